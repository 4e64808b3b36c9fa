"""Tubes cut open: along their shortest line on an irregular mesh, along a line of one's own, and through several borders."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from devices import DEVICE

import warpflat
from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.tubes import tube_borders


def _cylinder(*, slant: float = 0.0, seed: int = 0) -> Surface:
    """A cylinder of radius 0.1 m, renumbered, its triangles irregular; one side is lower by `slant`."""
    rng = np.random.default_rng(seed)
    rows, around = 12, 36
    u = (np.arange(around) + rng.uniform(-0.3, 0.3, (rows, around))) / around
    v = np.arange(rows)[:, None] / (rows - 1) + np.where(
        (np.arange(rows) % (rows - 1) > 0)[:, None], rng.uniform(-0.02, 0.02, (rows, around)), 0.0
    )
    a = 2.0 * np.pi * u
    points = np.stack([0.1 * np.cos(a), v * (0.3 - slant * np.cos(a)), 0.1 * np.sin(a)], axis=-1).reshape(-1, 3)
    at = np.arange(rows * around).reshape(rows, around)
    right = np.roll(at, -1, axis=1)
    faces = np.concatenate(
        [
            np.stack([at[:-1], at[1:], right[1:]], -1).reshape(-1, 3),
            np.stack([at[:-1], right[1:], right[:-1]], -1).reshape(-1, 3),
        ]
    )
    order = rng.permutation(len(points))
    back = np.argsort(order)
    return warpflat.make_surface(points[order], back[faces], name="tube")


def test_the_shortest_line_is_straight_across_faces():
    tube = _cylinder(slant=0.1)
    opened = warpflat.open_tube(tube)
    assert len(border_loops(opened.faces)) == 1
    left, right = (opened.vertices[opened.lines[f"opening.{side}"]] for side in ("left", "right"))
    np.testing.assert_array_equal(left, right)
    length = np.linalg.norm(np.diff(left, axis=0), axis=1).sum()
    assert 0.2 <= length < 0.203
    pattern = warpflat.flatten(opened, fabric="isotropic", device=DEVICE)
    assert pattern.converged
    assert pattern.measures["length_error"] < 0.005
    assert not pattern.flipped_faces


def test_a_line_of_ones_own_opens_it_unless_it_ends_inside():
    tube = _cylinder()
    rims = border_loops(tube.faces)
    tube = warpflat.with_lines(tube, {"side": warpflat.line_between(tube, int(rims[0][0]), int(rims[1][0]))})
    opened = warpflat.open_tube(tube, "side")
    assert not tube_borders(opened)
    assert {"side.left", "side.right"} <= set(opened.lines)
    half = warpflat.with_lines(tube, {"half": tube.lines["side"][:4]})
    with pytest.raises(InputError, match=r"line 'half' does not cut piece 'tube' open; it must run from one border"):
        warpflat.open_tube(half, "half")
    with pytest.raises(InputError, match=r"has no line 'sied'.*side"):
        warpflat.open_tube(tube, "sied")
    with pytest.raises(InputError, match="'tube' is no tube"):
        warpflat.open_tube(opened)


def test_a_piece_with_three_borders_is_cut_twice():
    """Four cubes like a T, open at its three ends."""
    cubes = {(0, 0, 0), (0, 1, 0), (-1, 1, 0), (1, 1, 0)}
    ends = {((0, 0, 0), (0, -1, 0)), ((-1, 1, 0), (-1, 0, 0)), ((1, 1, 0), (1, 0, 0))}
    corners: list[np.ndarray] = []
    for cube, axis, sign in itertools.product(cubes, range(3), (1, -1)):
        step = tuple(sign * int(axis == k) for k in range(3))
        if tuple(np.add(cube, step)) not in cubes and (cube, step) not in ends:
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            around = [-u - v, u - v, u + v, v - u][::sign]
            corners.append(np.asarray(cube) + 0.5 * (np.asarray(step) + np.array(around)))
    faces = np.arange(4 * len(corners)).reshape(-1, 4)
    surface = warpflat.make_surface(0.1 * np.concatenate(corners), faces, name="tee")
    assert len(tube_borders(surface)) == 2
    opened = warpflat.open_tube(surface)
    assert len(border_loops(opened.faces)) == 1
    # Either side may be parted where the second opening begins.
    assert {name.partition(".")[0] for name in opened.lines} == {"opening", "opening 2"}
