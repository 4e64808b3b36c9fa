"""Steps along the lines of a lattice, against NumPy's solution of each line."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from small_networks import CLOTH, DEVICE, Launched, vec2
from warpflat.kernels.line_solve import move_along_lines, solve_lines

from warpflat.core.launch import launch_each
from warpflat.model.network import SpringNetwork
from warpflat.surface.mesh import Surface
from warpflat.surface.repair.validate import make_surface
from warpflat.surface.shapes import make_shape

FloatArray = NDArray[np.float64]

STEP = 0.01


def grid() -> Surface:
    return make_shape("saddle", curvature=0.5, resolution=7)


def ell() -> Surface:
    """Quads with a concave corner."""
    x, y = (values.ravel() for values in np.meshgrid(0.01 * np.arange(6), 0.012 * np.arange(7)))
    number = np.arange(42).reshape(7, 6)
    faces = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    solid = np.ones((6, 5), dtype=bool)
    solid[3:, 2:] = False
    used, index = np.unique(faces[solid], return_inverse=True)
    return make_surface(np.column_stack([x, y, 0.1 * x * y])[used], index.reshape(-1, 4))


def lines(network: SpringNetwork) -> list[tuple[bool, list[int]]]:
    """Whether it is a row, and the vertices of each line."""
    arrays = network.line_arrays
    assert arrays is not None
    parts = np.split(arrays.vertex, arrays.offset[1:-1])
    return [(number < arrays.rows, part.tolist()) for number, part in enumerate(parts)]


def ways(network: SpringNetwork, at: Launched) -> tuple[FloatArray, FloatArray]:
    """#V by 2 each: along the rows, along the columns; NumPy's solution of each line's system."""
    x, force, acting = at["position"], at["force"], at["guarded"] != 0
    s = network.spring_arrays
    k_ij = {(int(i), int(j)): (k, rest) for (i, j), k, rest in zip(s.ends, s.stiffness, s.rest_length, strict=True)}
    k_ij |= {(j, i): values for (i, j), values in k_ij.items()}
    guard = np.zeros(len(x))
    for face, corners in enumerate(network.cell_arrays.faces):
        if at["face_acting"][face]:
            guard[corners] += at["face_stiffness"][4 * face : 4 * face + 4]
    result = np.zeros((2, *x.shape))
    for is_row, line in lines(network):
        if len(line) < 2:
            continue
        n, matrix = len(line), np.zeros((len(line), len(line)))
        along = np.array([x[line[min(e + 1, n - 1)]] - x[line[max(e - 1, 0)]] for e in range(n)])
        along /= np.linalg.norm(along, axis=1)[:, None]
        for e, i in enumerate(line):
            beside = [line[f] for f in (e - 1, e + 1) if 0 <= f < n]
            matrix[e, e] += network.mass.numpy()[i] / STEP**2
            matrix[e, e] += guard[i] / 32.0 if acting[i] else 0.0
            for (a, j), (k, rest) in k_ij.items():
                if a != i or j in beside:
                    continue
                d = x[j] - x[i]
                length = np.linalg.norm(d)
                cosine = d @ along[e] / length
                matrix[e, e] += k * (cosine**2 + max(1.0 - rest / length, 0.0) * (1.0 - cosine**2))
            if e + 1 < n:
                k = k_ij[i, line[e + 1]][0] * (2.0 if acting[i] and acting[line[e + 1]] else 1.0)
                matrix[e : e + 2, e : e + 2] += [[k, -k], [-k, k]]
        gone = np.linalg.solve(matrix, np.einsum("ij,ij->i", force[line], along))
        result[0 if is_row else 1, line] = gone[:, None] * along
    return result[0], result[1]


@pytest.mark.parametrize("squeezed", [1.03, 0.93])
@pytest.mark.parametrize("make", [grid, ell])
def test_lines_go_where_numpy_says(make, squeezed: float):
    surface = make()
    rng = np.random.default_rng(4)
    positions = surface.vertices[:, :2] * [1.03, squeezed] + rng.normal(scale=5e-5, size=(len(surface.vertices), 2))
    network = SpringNetwork.build(surface, CLOTH, positions, device=DEVICE)
    at = Launched(network, positions, time_step=STEP).evaluate_guard().gather_forces()
    assert (at["guarded"] != 0).any() == (squeezed < 1.0)
    moved = [vec2(np.full((len(positions), 2), np.nan)) for _ in range(2)]
    given = ["position", "force", "mass", "springs", "cells", "face_acting", "face_stiffness", "guarded", "lines"]
    inputs = [at.arrays[name] if name in at.arrays else getattr(network, name) for name in given]
    assert network.lines is not None
    launch_each(solve_lines, len(lines(network)), [*inputs, STEP], moved, device=DEVICE)
    for made, wished in zip(moved, ways(network, at), strict=True):
        np.testing.assert_allclose(made.numpy(), wished, rtol=1e-9, atol=1e-12)


def test_no_vertex_goes_beyond_its_reach_or_where_it_may_not():
    rng = np.random.default_rng(3)
    here, rows, columns = (rng.normal(size=(40, 2)) for _ in range(3))
    reach = rng.uniform(0.1, 3.0, 40)
    freedom = np.where(rng.random((40, 2)) < 0.3, [0.0, 1.0], 1.0)
    position = vec2(here)
    inputs = [vec2(rows), vec2(columns), wp.array(reach, dtype=wp.float64, device=DEVICE), vec2(freedom)]
    launch_each(move_along_lines, 40, inputs, [position], device=DEVICE)
    way = (rows + columns) * freedom
    length = np.linalg.norm(way, axis=1)
    assert 5 < np.count_nonzero(length > reach) < 35
    wished = here + way * np.minimum(1.0, reach / length)[:, None]
    np.testing.assert_allclose(position.numpy(), wished, rtol=1e-13)


def test_a_line_of_one_vertex_leads_nowhere():
    surface = grid()
    network = SpringNetwork.build(surface, CLOTH, 1.01 * surface.vertices[:, :2], device=DEVICE)
    at = Launched(network, 1.01 * surface.vertices[:, :2], time_step=STEP).evaluate_guard().gather_forces()
    count = network.vertex_count
    alone = network.lines
    assert alone is not None
    alone.offset = wp.array(np.arange(2 * count + 1), dtype=wp.int32, device=DEVICE)
    alone.vertex = wp.array(np.tile(np.arange(count), 2), dtype=wp.int32, device=DEVICE)
    alone.rows = count
    moved = [vec2(np.full((count, 2), np.nan)) for _ in range(2)]
    given = ["position", "force", "mass", "springs", "cells", "face_acting", "face_stiffness", "guarded", "lines"]
    inputs = [at.arrays[name] if name in at.arrays else getattr(network, name) for name in given]
    launch_each(solve_lines, 2 * count, [*inputs, STEP], moved, device=DEVICE)
    for made in moved:
        np.testing.assert_array_equal(made.numpy(), 0.0)
