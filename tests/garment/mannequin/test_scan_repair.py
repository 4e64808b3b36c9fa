"""Holes of a scan are found; noise is smoothed away, and only noise; parts are turned outward."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from warpflat.garment.mannequin.scan_repair import find_holes, smooth_noise, turned_outward


def ball() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m] and triangles of a ball of 0.1 m radius."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


def test_holes_are_found_with_their_lengths_and_middles() -> None:
    points, triangles = ball()
    middles, places = points[triangles].mean(axis=1), np.array([[0.1, 0, 0], [0, -0.06, 0.08]])
    away = np.linalg.norm(middles[:, None] - places, axis=2)
    torn = triangles[(away[:, 0] > 0.05) & (away[:, 1] > 0.02)]
    # A second, whole ball makes the mesh as tall as a body, against which a hole's border is short.
    far = points + np.array([0.0, 1.4, 0.0])
    holes = find_holes(np.concatenate([points, far]), np.concatenate([torn, triangles + len(points)]))
    (wide, middle), (small, _) = sorted(holes, key=lambda hole: -hole[0])
    # Their rims run to and fro along edges of the mesh.
    assert 1.0 < wide / (2.0 * np.pi * 0.048) < 1.5
    assert 1.0 < small / (2.0 * np.pi * 0.02) < 1.5
    np.testing.assert_allclose(middle, [0.0875, 0.0, 0.0], atol=0.003)


def test_the_open_end_of_a_limb_is_no_hole() -> None:
    tube = trimesh.creation.cylinder(radius=0.04, height=0.3, sections=32).subdivide().subdivide()
    points, triangles = np.asarray(tube.vertices, float), np.asarray(tube.faces, np.int64)
    open_ends = triangles[np.abs(points[triangles].mean(axis=1)[:, 2]) < 0.149]
    assert find_holes(points, open_ends) == []


def test_noise_is_smoothed_and_a_smooth_mesh_left_alone() -> None:
    points, triangles = ball()
    same, none = smooth_noise(points, triangles)
    assert none == 0.0
    assert same is points
    noisy = points + np.random.default_rng(3).normal(0.0, 0.002, points.shape)
    smoothed, wavered = smooth_noise(noisy, triangles)
    assert 0.0005 < wavered < 0.004
    off = np.linalg.norm(smoothed, axis=1) - 0.1
    # It neither shrinks the ball nor keeps half the noise.
    assert abs(off.mean()) < 0.0003
    assert off.std() < 0.5 * (np.linalg.norm(noisy, axis=1) - 0.1).std()


def _volume(points: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = points[triangles].transpose(1, 0, 2)
    return float(np.einsum("ta,ta->", np.cross(a, b), c) / 6.0)


def test_each_part_is_turned_by_its_own_volume() -> None:
    points, triangles = ball()
    two, inward = np.concatenate([points, points + np.array([0.3, 0.0, 0.0])]), triangles[:, ::-1]
    for first, second, count in ((triangles, inward, 1), (inward, inward, 2), (triangles, triangles, 0)):
        faces, turned = turned_outward(two, np.concatenate([first, second + len(points)]))
        assert turned == count * len(triangles)
        assert _volume(two, faces[: len(triangles)]) > 0.0
        assert _volume(two, faces[len(triangles) :]) > 0.0
    # A part of a mesh that hangs together, and one with an open end.
    patch = points[triangles].mean(axis=1)[:, 0] > 0.04
    faces, turned = turned_outward(points, np.where(patch[:, None], inward, triangles))
    assert turned == patch.sum()
    assert _volume(points, faces) == pytest.approx(_volume(points, triangles))
    assert turned_outward(points, inward[~patch])[1] == (~patch).sum()


def test_the_inner_side_of_a_wall_stays() -> None:
    points, triangles = ball()
    wall = np.concatenate([triangles, triangles[:, ::-1] + len(points)])
    faces, turned = turned_outward(np.concatenate([points, 0.9 * points]), wall)
    assert turned == 0
    assert (faces == wall).all()
