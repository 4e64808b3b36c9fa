"""Contact: the barrier's derivatives, where it acts, closed cracks opened, and a minimum found from two starts."""

from __future__ import annotations

import numpy as np
import pytest
from devices import DEVICE
from surface_meshes import quads_between

from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.harmonic_layout import harmonic_layout
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.contact import Barrier, open_cracks, relax_with_contact
from warpflat.flat.solver.energy import Energy
from warpflat.flat.solver.grain import GrainAlignment
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.injective import certify, is_injective
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface

NO_CUTS = np.empty(0, dtype=np.int32)


def grid(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(columns) / columns, np.arange(rows) / rows, indexing="xy")
    faces = quads_between((rows, columns))
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces


def arc(turns: float, *, rise: float = 0.1) -> Surface:
    """A band of radii 0.1 and 0.2 m that runs around an axis and rises along it."""
    angle, radius = np.meshgrid(2 * np.pi * turns * np.linspace(0, 1, 41), np.linspace(0.2, 0.1, 7), indexing="ij")
    faces = quads_between(angle.shape, turned=True)
    height = rise * angle / (2 * np.pi)
    place = np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=-1)
    return make_surface(place.reshape(-1, 3), faces, name="arc")


def flat_arc(turns: float) -> np.ndarray:
    angle, radius = np.meshgrid(2 * np.pi * turns * np.linspace(0, 1, 41), np.linspace(0.2, 0.1, 7), indexing="ij")
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)


def test_forces_of_the_barrier_are_the_gradient_of_its_energy():
    # The ends come within 3 mm of each other, and the corners of one lie beside edges of the other.
    layout = flat_arc(1.0 - 0.003 / (2 * np.pi * 0.15))
    layout += np.random.default_rng(1).normal(scale=2e-4, size=layout.shape)
    barrier = Barrier(arc(0.99), 0.008, 1000.0)
    here = barrier(layout)
    assert len(here.slope) > 5
    force = np.zeros_like(layout)
    np.add.at(force, here.vertices.ravel(), (here.slope[:, None, None] * here.jacobian).reshape(-1, 2))
    for vertex in np.unique(here.vertices):
        for axis in range(2):
            there = [layout.copy(), layout.copy()]
            for sign, moved in zip((-1, 1), there, strict=True):
                moved[vertex, axis] += sign * 1e-7
            slope = (barrier(there[1]).energy - barrier(there[0]).energy) / 2e-7
            assert slope == pytest.approx(force[vertex, axis], rel=1e-4, abs=1e-5 * np.abs(force).max())


def test_the_barrier_is_zero_beyond_the_gap_and_infinite_where_borders_cross():
    barrier = Barrier(arc(0.99), 0.001, 1000.0)
    assert barrier(flat_arc(0.9)).energy == 0.0
    assert barrier(flat_arc(1.05)).energy == np.inf


def test_neighbours_along_the_border_do_not_press_each_other():
    # A gap as wide as the band: without its limit along the border the band's two sides would push.
    assert Barrier(arc(0.5), 0.1, 1000.0)(flat_arc(0.5)).energy == 0.0


def test_a_closed_crack_is_opened_and_hardly_moved():
    whole = make_surface(*grid(9, 9))
    middle = np.flatnonzero(whole.vertices[:, 0] == np.median(whole.vertices[:, 0]))
    path = middle[np.argsort(whole.vertices[middle, 1])][:-2]
    made = cut_along(whole.faces, [path], vertex_count=len(whole.vertices))
    surface = make_surface(whole.vertices[made.vertex_origin], made.faces)
    layout = surface.vertices[:, :2].copy()
    assert len(layout) == len(whole.vertices) + len(path) - 1
    assert not is_injective(surface, layout)
    opened = open_cracks(surface, layout)
    assert is_injective(surface, opened)
    size = np.ptp(layout, axis=0).max()
    assert 0 < np.abs(opened - layout).max() < 0.01 * size


@pytest.mark.parametrize("model", ["springs", "membrane"])
def test_two_starts_come_to_minima_of_nearly_one_energy(model: str):
    """Which end lies before the other is decided by the way there, and by rounding: minima of this arc are 2.4 % apart at most."""
    surface = arc(1.1)
    middle = np.arange(3, len(surface.vertices), 7)
    network = SpringNetwork.build(
        surface, find_fabric("isotropic"), flat_arc(0.9), grain_angle=0.0, device=DEVICE, model=model
    )
    grain = GrainAlignment(lower=int(middle[0]), upper=int(middle[-1]), vertices=slice(0, len(surface.vertices)))
    energies = []
    for start in (flat_arc(0.7), harmonic_layout(surface)):
        state = Relaxation(network, RelaxOptions(), start=start, alignments=[grain])
        outcome = relax_with_contact(state, 5e-4)
        assert outcome is not None
        assert outcome.converged
        assert certify(surface, state.positions(), NO_CUTS)
        energies.append(outcome.energies.potential)
    assert energies[0] == pytest.approx(energies[1], rel=0.03)


def test_the_residual_is_the_largest_force_over_the_mean_force_of_a_spring():
    surface, start = arc(0.5), flat_arc(0.45)
    network = SpringNetwork.build(surface, find_fabric("isotropic"), start, grain_angle=0.0, device=DEVICE)
    state = Relaxation(network, RelaxOptions(), start=start, alignments=[])
    outcome = relax_with_contact(state, 5e-4)
    assert outcome is not None
    # Its sides are far apart.
    force, springs = Energy(state).at(state.positions()).gradient, network.spring_arrays
    length = np.linalg.norm(np.diff(state.positions()[springs.ends], axis=1)[:, 0], axis=1)
    mean = np.mean(springs.stiffness * np.abs(length - springs.rest_length))
    assert outcome.residual == pytest.approx(np.linalg.norm(force, axis=1).max() / mean, rel=1e-6)


def test_a_start_that_lies_over_itself_is_refused():
    surface = arc(1.1)
    network = SpringNetwork.build(surface, find_fabric("isotropic"), flat_arc(0.9), grain_angle=0.0, device=DEVICE)
    grain = GrainAlignment(lower=3, upper=283, vertices=slice(0, len(surface.vertices)))
    state = Relaxation(network, RelaxOptions(), start=flat_arc(1.1), alignments=[grain])
    assert relax_with_contact(state, 5e-4) is None
