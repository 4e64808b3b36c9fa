"""Layers of cloth: the triangles before and behind a vertex, and the force that keeps it beside them."""

from __future__ import annotations

import numpy as np
import warp as wp
from devices import DEVICE
from warpflat.kernels.drape_layers import find_layers, press_layers


def test_the_nearest_triangles_are_found_before_and_behind_a_vertex():
    # A vertex between three level triangles that belong to others, of which two lie behind it, and one of its own next to it.
    level = np.array([[-1.0, -1.0], [2.0, -1.0], [-1.0, 2.0]])
    heights = (0.01, -0.02, -0.03, 0.001)
    points = np.array([[0.0, 0.0, 0.0], *([x, y, z] for z in heights for x, y in level)])
    mesh = wp.Mesh(
        points=wp.array(points, dtype=wp.vec3, device=DEVICE),
        indices=wp.array(np.arange(1, len(points)), dtype=wp.int32, device=DEVICE),
    )
    near = [[0, 10], *([k] for k in range(1, len(points)))]
    offset = np.cumsum([0, *map(len, near)])
    given = [wp.array(rows, dtype=wp.int32, device=DEVICE) for rows in (offset, np.concatenate(near))]
    outwards = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    places = [wp.array(rows, dtype=wp.vec3d, device=DEVICE) for rows in (points, outwards)]
    face, share = wp.zeros(2 * len(points), wp.int32, DEVICE), wp.zeros(2 * len(points), wp.vec3d, DEVICE)
    wp.launch(
        find_layers, len(points), inputs=[mesh.id, *given, *places, 0.05, 0], outputs=[face, share], device=DEVICE
    )
    assert face.numpy()[:2].tolist() == [0, 1]
    np.testing.assert_allclose(share.numpy()[:2] @ level, 0.0, atol=1e-6)
    # Its corners lie beside all other triangles' edges, not over the triangles.
    wp.launch(find_layers, 1, inputs=[mesh.id, *given, *places, 0.005, 0], outputs=[face, share], device=DEVICE)
    assert face.numpy()[:2].tolist() == [-1, -1]


def test_forces_between_layers_are_the_gradient_of_their_energy():
    points = np.array([[0.1, 0.2, 0.001], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    corner, share = np.repeat(np.arange(4), 6).reshape(-1, 3), np.zeros((8, 3))
    normal, skin = np.zeros((8, 3)), np.full(4, 50.0)
    corner[0], share[0], normal[0] = [1, 2, 3], [0.7, 0.1, 0.2], [0.0, 0.6, 0.8]

    def press(at: np.ndarray) -> tuple[np.ndarray, float]:
        force, energy = wp.zeros(3 + 32, wp.vec3d, DEVICE), wp.zeros(1 + 8, wp.float64, DEVICE)
        arrays = [
            wp.array(rows, dtype=kind, device=DEVICE)
            for rows, kind in (
                (at, wp.vec3d),
                (corner, wp.vec3i),
                (share, wp.vec3d),
                (normal, wp.vec3d),
                (skin, wp.float64),
            )
        ]
        wp.launch(press_layers, 8, inputs=[*arrays, 0.002, 1, 0], outputs=[force, energy], device=DEVICE)
        total = np.zeros((4, 3))
        np.add.at(total, np.column_stack([np.repeat(np.arange(4), 2), corner]).ravel(), force.numpy()[3:])
        return total, float(energy.numpy().sum())

    found, energy = press(points)
    assert energy > 0.0
    np.testing.assert_allclose(found.sum(axis=0), 0.0, atol=1e-12)
    step = 1e-6
    for i in range(4):
        for c in range(3):
            ends = [points.copy(), points.copy()]
            ends[0][i, c] += step
            ends[1][i, c] -= step
            slope = (press(ends[0])[1] - press(ends[1])[1]) / (2.0 * step)
            np.testing.assert_allclose(found[i, c], -slope, atol=1e-8)
    # Beyond the distance that layers keep there is none.
    points[0, 2] = 0.01
    assert press(points)[1] == 0.0
