"""From coarse to fine, on meshes that count as too large to factor: the same minimum, the V-cycle beside the factor."""

from __future__ import annotations

import re

import numpy as np
import pytest
from devices import DEVICE

from warpflat.flattening.flatten_piece import flatten
from warpflat.flattening.progress import relaxation_words
from warpflat.solver import collapse, metric
from warpflat.solver.metric import laplacian_solution
from warpflat.surface import laplacian
from warpflat.surface.laplacian import laplacian_solver
from warpflat.surface.shapes import make_shape


@pytest.fixture
def too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only meshes of at most 1,000 vertices are factored, and the coarsest has at most 400."""
    monkeypatch.setattr(laplacian, "_MOST_VERTICES", 1_000)
    monkeypatch.setattr(metric, "CHEAP", 400)
    monkeypatch.setattr("warpflat.solver.coarse.CHEAP", 400)


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
    right = laplacian.stiffness_matrix(surface) @ (exact := factor(one))
    missed = exact - cycle(right)
    missed -= missed.mean(axis=0)
    matrix = laplacian.stiffness_matrix(surface)
    assert (missed * (matrix @ missed)).sum() < 0.2**2 * (exact * (matrix @ exact)).sum()


@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_the_minimum_is_that_of_the_factor(triangles: bool, fabric: str, monkeypatch: pytest.MonkeyPatch):
    given = {"datum": "centre", "fabric": fabric, "device": DEVICE}
    expected = flatten(make_shape("bodice", resolution=57, triangles=triangles), **given)
    monkeypatch.setattr(laplacian, "_MOST_VERTICES", 1_000)
    monkeypatch.setattr(metric, "CHEAP", 1_000)
    monkeypatch.setattr("warpflat.solver.coarse.CHEAP", 1_000)
    found = flatten(make_shape("bodice", resolution=57, triangles=triangles), **given)
    assert found.converged
    assert found.flipped_faces == 0
    assert [stage.name for stage in found.stages] == ["develop", "coarse", "steps", "relax"]
    words = relaxation_words([[stage.as_dict() for stage in found.stages]])
    assert re.fullmatch(
        r"coarser meshes released [^,]+, \d+ steps released [^,]+, \d+ iterations released [^,]+", words
    )
    # The coarser mesh releases nearly all that there is to release.
    energies = [stage.model_energy_j for stage in found.stages]
    assert energies[0] - energies[1] > 0.9 * (energies[0] - energies[-1])
    assert found.stages[-1].model_energy_j == pytest.approx(expected.stages[-1].model_energy_j, rel=1e-3)
    chord = found.positions[found.datum[[0, -1]]]
    assert abs(chord[1, 0] - chord[0, 0]) < 1e-9
    again = flatten(make_shape("bodice", resolution=57, triangles=triangles), **given)
    np.testing.assert_array_equal(again.positions, found.positions)


def test_a_cut_opens_on_a_mesh_too_large_to_factor(too_large: None):
    from warpflat.cutting.cut_piece import cut
    from warpflat.cutting.cut_plan import CutPlan

    flat = flatten(make_shape("dome", resolution=45), datum="centre", device=DEVICE)
    path = np.arange(45 * 45, dtype=np.int32).reshape(45, 45)[:28, 13]
    opened = cut(flat, CutPlan(name="dart", paths=(path,)))
    assert opened.converged
    assert opened.flipped_faces == 0
    assert opened.stages[-1].model_energy_j < 0.95 * flat.stages[-1].model_energy_j
