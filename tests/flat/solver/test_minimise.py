"""L-BFGS over one factor: the minimum of the other schemes, no face mirrored, the chord upright, slivers, the same bits again."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from devices import DEVICE

from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.energy import Energy
from warpflat.flat.solver.grain import GrainAlignment
from warpflat.flat.solver.metric import LaplacianFactor, Metric
from warpflat.flat.solver.minimise import Cloth, relax
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation, relax_by_steps
from warpflat.flat.surface.laplacian import laplacian_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape


def pinched() -> Surface:
    """A bodice, two columns of whose vertices nearly coincide: needles fifty times as long as wide."""
    shape = make_shape("bodice", resolution=17, triangles=True)
    place = shape.vertices.reshape(17, 17, 3).copy()
    place[:, 5] += 0.95 * (place[:, 6] - place[:, 5])
    return make_surface(place.reshape(-1, 3), shape.faces, lines=dict(shape.lines), name="pinched")


def state_of(surface: Surface, fabric: str) -> Relaxation:
    """As it is relaxed by `flatten`, at its start."""
    piece = flatten(surface, fabric=fabric, datum="centre", device=DEVICE)
    line = piece.datum
    grain = GrainAlignment(lower=int(line[0]), upper=int(line[-1]), vertices=slice(0, piece.network.vertex_count))
    return Relaxation(piece.network, RelaxOptions(), start=piece.development.positions, alignments=[grain])


@pytest.mark.parametrize("fabric", ["isotropic", "denim"])
def test_it_reaches_the_minimum_of_plain_steps_on_needles(fabric: str):
    quick, plain = (state_of(pinched(), fabric) for _ in range(2))
    seen: list[int] = []
    outcome = relax(quick, each_step=lambda state: seen.append(state.steps))
    assert outcome.converged
    assert outcome.first_steps is not None
    assert seen == list(range(1, outcome.first_steps.steps + outcome.steps + 1))
    assert (quick.network.cell_arrays.least_shares(quick.positions()) > 0.0).all()
    (grain,) = quick.alignments
    chord = quick.positions()[[grain.lower, grain.upper]]
    assert abs(chord[1, 0] - chord[0, 0]) < 1e-12
    steps = relax_by_steps(plain)
    assert outcome.energies.potential <= 1.001 * steps.energies.potential
    again = state_of(pinched(), fabric)
    relax(again)
    np.testing.assert_array_equal(again.positions(), quick.positions())


def test_the_laplacian_of_a_linear_field_is_zero_inside_and_its_energy_is_the_area():
    shape = make_shape("dome", resolution=9, triangles=True)
    flat = make_surface(np.column_stack([shape.vertices[:, :2], 0 * shape.vertices[:, 0]]), shape.faces, name="flat")
    laplacian = laplacian_of(flat)
    slope = laplacian.matrix @ flat.vertices[:, 0]
    inside = np.ones((9, 9), dtype=bool)
    inside[[0, -1]] = inside[:, [0, -1]] = False
    assert np.abs(slope[inside.ravel()]).max() < 1e-12
    assert flat.vertices[:, 0] @ slope == pytest.approx(0.25)
    turned = flat.vertices[:, :2] @ [[0.6, 0.8], [-0.8, 0.6]]
    np.testing.assert_allclose(laplacian.as_rigid_step(turned), turned, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "cheap", "expected"), [("membrane", 81, [15, 30, 60]), ("membrane", 80, []), ("springs", 81, [])]
)
def test_the_cloths_own_stiffness_becomes_the_metric_of_cells_again_and_again(model, cheap, expected, monkeypatch):
    monkeypatch.setattr("warpflat.flat.solver.minimise.CHEAP", cheap)
    surface = make_shape("dome", resolution=9)
    network = SpringNetwork.build(
        surface, find_fabric("isotropic"), surface.vertices[:, :2], device=DEVICE, model=model
    )
    grain = GrainAlignment(lower=4, upper=76)
    state = Relaxation(network, RelaxOptions(), start=surface.vertices[:, :2], alignments=[grain])
    cloth = Cloth(Energy(state), Metric(LaplacianFactor(network), [grain]))
    positions, renewed = state.positions(), []
    for iteration in range(100):
        point = SimpleNamespace(energy=100.0 - iteration, positions=positions)
        cloth.factor_stiffness(
            SimpleNamespace(iterations=iteration, point=point, renew=lambda forget, at=iteration: renewed.append(at))
        )
    assert renewed == expected


def test_contacts_and_the_chord_enter_the_metric_exactly():
    surface = make_shape("dome", resolution=7, triangles=True)
    network = SpringNetwork.build(surface, find_fabric("isotropic"), surface.vertices[:, :2], device=DEVICE)
    metric = Metric(LaplacianFactor(network), [GrainAlignment(lower=3, upper=45)])
    random = np.random.default_rng(0)
    vertices, jacobian = np.array([[0, 8, 9], [6, 12, 13]]), random.normal(scale=30.0, size=(2, 3, 2))
    force = random.normal(size=(49, 2))
    # Neither contacts nor forces push a piece as a whole.
    jacobian -= jacobian.mean(axis=1, keepdims=True)
    force -= force.mean(axis=0)
    step = metric.solver(vertices, jacobian)(force)
    assert abs(step[45, 0] - step[3, 0]) < 1e-12
    left = force - 1000.0 * (laplacian_of(surface).matrix @ step)
    for corners, row in zip(vertices, jacobian, strict=True):
        left[corners] -= row * np.vdot(row, step[corners])
    # What is left is the force that holds the chord.
    assert left[45, 0] == pytest.approx(-left[3, 0], rel=1e-2)
    left[[3, 45], 0] = 0.0
    assert np.abs(left).max() < 1e-3
