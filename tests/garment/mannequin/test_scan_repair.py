"""Holes of a scan are closed by patches that carry on its curvature; noise is smoothed away, and only noise."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from warpflat.garment.mannequin.scan_repair import close_holes, smooth_noise, turned_outward


def ball() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m] and triangles of a ball of 0.1 m radius."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


def is_closed(triangles: np.ndarray) -> bool:
    """Return whether every edge has two faces that turn against each other."""
    ways = np.stack([triangles, np.roll(triangles, -1, axis=1)], -1).reshape(-1, 2)
    there, back = ({tuple(w) for w in ways[:, order].tolist()} for order in ([0, 1], [1, 0]))
    return len(there) == len(ways) and there == back


def test_patches_lie_on_the_ball_that_they_were_cut_from() -> None:
    points, triangles = ball()
    middles = points[triangles].mean(axis=1)
    # Two holes, one of them as wide as half the radius on every side of its middle.
    away = [np.linalg.norm(middles - np.array(place), axis=1) for place in ([0.1, 0, 0], [0, -0.06, 0.08])]
    torn = triangles[(away[0] > 0.05) & (away[1] > 0.02)]
    assert not is_closed(torn)
    # A second, whole ball makes the mesh as tall as a body, against which a hole's border is short.
    far = points + np.array([0.0, 1.4, 0.0])
    whole, closed, holes = close_holes(np.concatenate([points, far]), np.concatenate([torn, triangles + len(points)]))
    assert len(holes) == 2
    assert is_closed(closed)
    new = whole[2 * len(points) :]
    assert len(new) > 30
    # A flat patch across the wide hole would lie 13 mm inside.
    assert np.abs(np.linalg.norm(new, axis=1) - 0.1).max() < 0.0012


def test_the_open_end_of_a_limb_stays_open() -> None:
    tube = trimesh.creation.cylinder(radius=0.04, height=0.3, sections=32).subdivide().subdivide()
    points, triangles = np.asarray(tube.vertices, float), np.asarray(tube.faces, np.int64)
    open_ends = triangles[np.abs(points[triangles].mean(axis=1)[:, 2]) < 0.149]
    _, same, holes = close_holes(points, open_ends)
    assert holes == []
    assert len(same) == len(open_ends)


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


def test_a_hole_of_many_edges_is_closed() -> None:
    """Its patch has hundreds of vertices."""
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=0.1)
    points, triangles = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    torn = triangles[np.linalg.norm(points[triangles].mean(axis=1) - [0.1, 0.0, 0.0], axis=1) > 0.019]
    closed, faces, holes = close_holes(points, torn)
    assert len(holes) == 1
    assert len(closed) - len(points) > 200
    assert is_closed(faces)
    assert np.abs(np.linalg.norm(closed[len(points) :], axis=1) - 0.1).max() < 0.002


def test_a_hole_whose_rim_crosses_itself_is_closed() -> None:
    """Of a damaged scan: one place inside its rim, as seen from the front, has triangles outside alone."""
    rim = 0.003 * np.array([
        [-3.7, 1.9], [-0.7, 1.9], [0.4, 1.3], [1.3, 0.6], [1.8, 0.0], [2.0, -0.5], [2.1, -1.0], [2.0, -1.3], [1.8, -1.6], [1.3, -1.0],
        [1.3, -0.9], [-7.2, -1.5], [1.1, -0.3], [0.9, 0.0], [0.2, 0.5], [-0.8, 1.1], [-5.1, 1.3], [1.3, -0.6],
    ])  # fmt: skip
    count = len(rim)
    a, b = np.arange(count), np.roll(np.arange(count), -1)
    turn = np.pi * (1.0 - 2.0 * a / count)
    around = 0.3 * np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.concatenate([np.pad(np.concatenate([rim, around]), ((0, 0), (0, 1))), ball()[0] + [0, 1.4, 0]])
    ring = np.concatenate([np.stack([a, b, b + count], 1), np.stack([a, b + count, a + count], 1)])
    closed, faces, holes = close_holes(points, np.concatenate([ring, ball()[1] + 2 * count]))
    assert holes
    assert np.isfinite(closed).all()
    assert np.isin(np.arange(len(points), len(closed)), faces).all()
