"""From coarse to fine, on meshes that count as too large to factor: the same minimum, the V-cycle beside the factor."""

from __future__ import annotations

import numpy as np
import pytest
from devices import DEVICE
from surface_meshes import quads_between

from warpflat.core.errors import InputError
from warpflat.flat.flattening import flatten_piece
from warpflat.flat.flattening.develop import develop
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.model.wear import Wear
from warpflat.flat.solver import collapse, metric
from warpflat.flat.solver.metric import laplacian_solution
from warpflat.flat.surface import laplacian
from warpflat.flat.surface.injective import is_injective
from warpflat.flat.surface.laplacian import laplacian_solver
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape


def ramp(along: int, across: int) -> Surface:
    """A flat ring of more than a turn on a ramp, of triangles."""
    s, t = np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, across), indexing="ij")
    radius, angle = 0.2 - 0.1 * t, 2.2 * np.pi * s
    quads = quads_between(s.shape, turned=True)
    places = np.stack([radius * np.cos(angle), 0.1 * s, radius * np.sin(angle)], axis=-1).reshape(-1, 3)
    return make_surface(places, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), name="ramp")


@pytest.fixture
def too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only meshes of at most 1,000 vertices are factored, and the coarsest has at most 400."""
    monkeypatch.setattr(laplacian, "MOST_FACTORED", 1_000)
    monkeypatch.setattr(metric, "CHEAP", 400)
    monkeypatch.setattr(flatten_piece, "_COARSE", 400)


@pytest.mark.usefixtures("too_large")
@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_the_v_cycle_is_symmetric_and_near_to_the_factor(triangles: bool):
    surface = make_shape("dome", resolution=45, triangles=triangles)
    assert len(list(collapse.iterate_coarsenings(surface, 400))) >= 1
    cycle, factor = laplacian_solution(surface), laplacian_solver(surface)
    random = np.random.default_rng(2)
    one, other = (random.normal(size=(45 * 45, 2)) for _ in range(2))
    one, other = one - one.mean(axis=0), other - other.mean(axis=0)
    np.testing.assert_allclose((one * cycle(other)).sum(), (other * cycle(one)).sum(), rtol=1e-4)
    # What is left of the error after a cycle, in the energy's norm.
    right = laplacian.cotangent_matrix(surface) @ (exact := factor(one))
    missed = exact - cycle(right)
    missed -= missed.mean(axis=0)
    matrix = laplacian.cotangent_matrix(surface)
    assert (missed * (matrix @ missed)).sum() < 0.2**2 * (exact * (matrix @ exact)).sum()


@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_the_minimum_is_that_of_the_factor(triangles: bool, fabric: str, monkeypatch: pytest.MonkeyPatch):
    given = {"datum": "centre", "fabric": fabric, "device": DEVICE}
    expected = flatten(make_shape("bodice", resolution=57, triangles=triangles), **given)
    monkeypatch.setattr(laplacian, "MOST_FACTORED", 1_000)
    monkeypatch.setattr(metric, "CHEAP", 1_000)
    monkeypatch.setattr(flatten_piece, "_COARSE", 1_000)
    found = flatten(make_shape("bodice", resolution=57, triangles=triangles), **given)
    assert found.converged
    assert found.flipped_faces == 0
    assert found.start == "the layout of a coarser mesh"
    assert [stage.name for stage in found.stages] == ["develop", "steps", "relax"]
    # The coarser mesh releases nearly all that there is to release from the development.
    developed = flatten(found.surface, **given, start=develop(found.surface, found.datum).positions)
    begin, end = developed.stages[0].model_energy_j, expected.stages[-1].model_energy_j
    assert begin - found.stages[0].model_energy_j > 0.9 * (begin - end)
    assert found.stages[-1].model_energy_j == pytest.approx(expected.stages[-1].model_energy_j, rel=1e-3)
    chord = found.positions[found.datum[[0, -1]]]
    assert abs(chord[1, 0] - chord[0, 0]) < 1e-9
    again = flatten(make_shape("bodice", resolution=57, triangles=triangles), **given)
    np.testing.assert_array_equal(again.positions, found.positions)


def test_a_cut_opens_on_a_mesh_too_large_to_factor(too_large: None):
    from warpflat.flat.cutting.cut_piece import cut
    from warpflat.flat.cutting.cut_plan import CutPlan

    flat = flatten(make_shape("dome", resolution=45), datum="centre", device=DEVICE)
    path = np.arange(45 * 45, dtype=np.int32).reshape(45, 45)[:28, 13]
    opened = cut(flat, CutPlan(name="dart", paths=(path,)))
    assert opened.converged
    assert opened.flipped_faces == 0
    assert opened.stages[-1].model_energy_j < 0.95 * flat.stages[-1].model_energy_j


def test_contact_on_the_coarser_mesh_is_carried_up(monkeypatch: pytest.MonkeyPatch):
    """The strip lies apart in the layout of the coarser mesh, from which contact on its own one starts."""
    strip = ramp(121, 11)
    fine = flatten(strip, device=DEVICE)
    monkeypatch.setattr(flatten_piece, "_COARSE", 450)
    carried = flatten(ramp(121, 11), device=DEVICE)
    for flat in (fine, carried):
        assert flat.stages[-1].name == "contact"
        assert flat.converged
        assert is_injective(strip, flat.positions)
    assert carried.start == "the layout of a coarser mesh"
    assert carried.stages[-1].model_energy_j == pytest.approx(fine.stages[-1].model_energy_j, rel=1e-3)
    assert is_injective(strip, carried.development.positions)


def test_a_piece_to_be_worn_tight_is_shrunk_once(monkeypatch: pytest.MonkeyPatch):
    given = {"datum": "centre", "fabric": "jersey", "wear": Wear(stretch_weft=0.2), "device": DEVICE}
    expected = flatten(make_shape("bodice", resolution=45, triangles=True), **given)
    monkeypatch.setattr(flatten_piece, "_COARSE", 1_000)
    found = flatten(make_shape("bodice", resolution=45, triangles=True), **given)
    assert found.start == "the layout of a coarser mesh"
    width = np.ptp(expected.positions, axis=0)[0]
    assert np.ptp(found.development.positions, axis=0)[0] == pytest.approx(width, rel=0.03)
    assert found.stages[-1].model_energy_j == pytest.approx(expected.stages[-1].model_energy_j, rel=2e-3)


def test_what_is_said_of_a_tube_names_its_own_vertices(monkeypatch: pytest.MonkeyPatch):
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 40, endpoint=False), np.linspace(0, 0.5, 31))
    n = np.arange(around.size).reshape(around.shape)
    quads = np.stack([n[:-1], np.roll(n, -1, 1)[:-1], np.roll(n, -1, 1)[1:], n[1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    places = np.stack([0.1 * np.cos(around), along, 0.1 * np.sin(around)], axis=-1).reshape(-1, 3)
    with pytest.raises(InputError) as expected:
        flatten(make_surface(places, triangles, name="tube"), device=DEVICE)
    monkeypatch.setattr(flatten_piece, "_COARSE", 400)
    with pytest.raises(InputError) as found:
        flatten(make_surface(places, triangles, name="tube"), device=DEVICE)
    assert str(found.value) == str(expected.value)
