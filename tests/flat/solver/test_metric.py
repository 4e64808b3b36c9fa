"""The metric: its matrix against finite differences, and soft cloth on triangles, which comes to rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from devices import DEVICE
from numpy.typing import NDArray

from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.flattening.develop import develop
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.grain import GrainAlignment
from warpflat.flat.solver.metric import stiffness_matrix
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation, relax_by_steps
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape

FloatArray = NDArray[np.float64]

SOFT = Fabric(name="soft", stiffness_warp=1000.0, stiffness_weft=700.0, shear_stiffness=20.0, areal_density=0.15)


def triangles(name: str, count: int) -> Surface:
    return make_shape(name, resolution=count, triangles=True)


def network_of(surface: Surface, positions: FloatArray, fabric: Fabric = SOFT) -> SpringNetwork:
    return SpringNetwork.build(surface, fabric, positions, device=DEVICE)


def developed(surface: Surface, fabric: Fabric) -> tuple[SpringNetwork, FloatArray]:
    start = develop(surface, surface.lines["centre"]).positions
    return network_of(surface, start, fabric), start


def differences(forces: Any, positions: FloatArray, step: float = 1e-7) -> FloatArray:
    """Minus the derivative of forces by places, 2 #V by 2 #V."""
    columns = []
    for at in range(positions.size):
        moved = [positions.copy(), positions.copy()]
        moved[0].flat[at] += step
        moved[1].flat[at] -= step
        columns.append((forces(moved[1]) - forces(moved[0])).ravel() / (2.0 * step))
    return np.array(columns).T


def test_the_matrix_is_the_stiffness_of_stretched_springs():
    network, start = developed(make_shape("dome", resolution=6), SOFT)
    rng = np.random.default_rng(1)
    positions = 1.6 * start + rng.normal(scale=1e-3, size=start.shape)
    s = network.spring_arrays
    assert (np.linalg.norm(positions[s.ends[:, 1]] - positions[s.ends[:, 0]], axis=1) > s.rest_length).all()

    def forces(at: FloatArray) -> FloatArray:
        return Relaxation(network, RelaxOptions(), start=at).forces()

    found = stiffness_matrix(network, positions).toarray()
    np.testing.assert_allclose(found, differences(forces, positions), atol=1e-4 * np.abs(found).max())


def test_the_matrix_holds_worn_threads_along_and_across():
    surface = make_surface([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.03, 0.08, 0.0]], [[0, 1, 2]])
    flat = surface.vertices[:, :2]
    network = replace(network_of(surface, flat), model="springs", held_stiffness=None)
    # Pressed along both threads, and sheared.
    positions = flat @ np.array([[0.8, 0.05], [0.0, 0.7]])
    rest = (flat[1:] - flat[0]).T

    def worn(at: FloatArray, thread: FloatArray) -> FloatArray:
        return np.asarray(rest @ np.linalg.solve((at[1:] - at[0]).T, thread))

    area = 0.5 * np.linalg.det((positions[1:] - positions[0]).T)
    expected = np.zeros((6, 6))
    onsets = map(float, network.guard.onset)
    for thread, stiffness, onset in zip(np.eye(2)[::-1], (1000.0, 700.0), onsets, strict=True):
        by_place = -differences(lambda at, e=thread: worn(at, e), positions)
        here = worn(positions, thread)
        stretch = float(np.linalg.norm(here))
        assert stretch > 1.0 + onset
        along, across = here / stretch, np.array([-here[1], here[0]]) / stretch
        pull = stretch - 1.0 - onset
        expected += area * stiffness * np.outer(along @ by_place, along @ by_place)
        expected += area * stiffness * pull / stretch * np.outer(across @ by_place, across @ by_place)
    s = network.spring_arrays
    for (i, j), k, length in zip(s.ends, s.stiffness, s.rest_length, strict=True):
        d = positions[j] - positions[i]
        assert np.linalg.norm(d) < length
        row = np.zeros(6)
        row[2 * i : 2 * i + 2], row[2 * j : 2 * j + 2] = -d / np.linalg.norm(d), d / np.linalg.norm(d)
        expected += k * np.outer(row, row)
    found = stiffness_matrix(network, positions).toarray()
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("kind", ["triangles", "quads"])
def test_the_matrix_is_the_stiffness_of_cells_at_rest(kind: str):
    """At rest nothing is negative, whichever way the grain runs."""
    surface = make_shape("dome", resolution=6, triangles=kind == "triangles")
    random, fabric = np.random.default_rng(4), replace(SOFT, poisson_ratio=0.2)
    flat = surface.vertices[:, :2] + random.normal(scale=3e-3, size=(36, 2))
    surface = make_surface(np.column_stack([flat, np.zeros(36)]), surface.faces)
    network = SpringNetwork.build(surface, fabric, flat, grain_angle=25.0, model="membrane", device=DEVICE)

    def forces(at: FloatArray) -> FloatArray:
        return Relaxation(network, RelaxOptions(), start=at).forces()

    found = stiffness_matrix(network, flat).toarray()
    np.testing.assert_allclose(found, differences(forces, flat), atol=1e-5 * np.abs(found).max())
    strained = flat @ [[1.02, 0.04], [0.0, 0.93]]
    values = np.linalg.eigvalsh(stiffness_matrix(network, strained).toarray())
    assert values.min() > -1e-9 * values.max()


@pytest.mark.parametrize(("name", "fabric"), [("bodice", "satin"), ("bodice", "denim"), ("dome", "cotton")])
def test_soft_cloth_between_triangles_comes_to_rest(name: str, fabric: str):
    flat = flatten(triangles(name, 25), fabric=fabric, datum="centre", device=DEVICE)
    assert flat.converged
    assert flat.flipped_faces == 0
    # Ten thousands of the paper's steps would take next to nothing more away.
    state = Relaxation(flat.network, RelaxOptions(max_steps=3000), start=flat.positions, alignments=held(flat))
    before = state.energies().potential
    relax_by_steps(state)
    after = state.energies().potential
    assert after > (1.0 - 1e-3) * before


def held(flat: Flattening) -> list[GrainAlignment]:
    line = flat.network.surface.lines["centre"]
    return [GrainAlignment(lower=int(line[0]), upper=int(line[-1]))]
