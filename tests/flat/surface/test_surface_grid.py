"""Rows and columns of rectangular grids of quads; none for concave corners, holes and cracks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from surface_meshes import quads_between

from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.grid import rows_and_columns
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape

BoolArray = NDArray[np.bool_]


def piece(solid: BoolArray, *, seed: int = 0, crack: list[tuple[int, int]] | None = None) -> Surface:
    """Flat quads of 10 mm where `solid` (#rows by #columns) is true, vertices and faces numbered at random and each face begun at any
    of its corners; cut along a way of (row, column) places."""
    rng = np.random.default_rng(seed)
    rows, columns = solid.shape
    i = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1)[solid]
    y, x = np.divmod(np.arange(i.size), columns + 1)
    vertices = np.column_stack([0.01 * x, 0.01 * y, 0.0 * x])
    if crack is not None:
        made = cut_along(faces, [[int(i[at]) for at in crack]], vertex_count=len(vertices))
        faces, vertices = made.faces, vertices[made.vertex_origin]
    faces = np.stack([np.roll(face, turn) for face, turn in zip(faces, rng.integers(4, size=len(faces)), strict=True)])
    used = rng.permutation(np.unique(faces))
    number = np.empty(len(vertices), dtype=np.int32)
    number[used] = np.arange(len(used))
    return make_surface(vertices[used], number[faces[rng.permutation(len(faces))]])


def ell() -> BoolArray:
    solid = np.ones((20, 24), dtype=bool)
    solid[12:, 15:] = False
    return solid


def with_hole() -> BoolArray:
    solid = np.ones((20, 22), dtype=bool)
    solid[6:12, 8:14] = False
    return solid


CRACK = [(row, 8) for row in range(13)]
PIECES = {
    "rectangle": piece(np.ones((9, 16), dtype=bool)),
    "L": piece(ell()),
    "hole": piece(with_hole()),
    "crack": piece(np.ones((20, 24), dtype=bool), crack=CRACK),
    "slit": piece(np.ones((20, 24), dtype=bool), crack=[(10, column) for column in range(6, 17)]),
    "crooked crack": piece(ell(), crack=[*((row, 4) for row in range(7)), *((6, column) for column in range(5, 11))]),
}


@pytest.mark.parametrize("name", PIECES)
def test_rows_and_columns_are_found_however_the_mesh_is_numbered(name: str) -> None:
    surface = PIECES[name]
    found = rows_and_columns(surface)
    assert (found is not None) == (name == "rectangle")
    if found is None:
        return
    assert sorted(found.shape) == [10, 17]
    assert sorted(found.ravel().tolist()) == list(range(170))
    # Up to a turn of the whole by quarters.
    row, column = np.indices(found.shape).reshape(2, -1)
    places = np.column_stack([column, row, np.ones(len(row))])
    turn, left, _, _ = np.linalg.lstsq(places, 100.0 * surface.vertices[found.ravel(), :2], rcond=None)
    assert np.abs(left).max() < 1e-20
    assert np.linalg.det(turn[:2]) == pytest.approx(1.0)
    assert sorted(np.abs(turn[:2]).round(9).ravel().tolist()) == [0.0, 0.0, 1.0, 1.0]


def ring() -> Surface:
    around, across = 24, 4
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    radius = np.linspace(1.0, 2.0, across)[:, None]
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.0 * radius * turn], axis=-1).reshape(-1, 3)
    i = np.arange(around * across).reshape(across, around)
    right = np.roll(i, -1, axis=1)
    return make_surface(points, np.stack([i[:-1], i[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4))


def corner_of_a_box() -> Surface:
    """Three sheets of quads that meet in one inner vertex."""
    side = 4
    a, b = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    i = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    quads = quads_between(i)
    flat = [np.stack(place, axis=-1).reshape(-1, 3) for place in ((a, b, 0 * a), (0 * a, a, b), (b, 0 * a, a))]
    points, index = np.unique(np.concatenate(flat), axis=0, return_inverse=True)
    faces = np.concatenate([quads + k * i.size for k in range(3)])
    return make_surface(points, index.reshape(-1)[faces])


@pytest.mark.parametrize("surface", [ring(), corner_of_a_box(), make_shape("dome", resolution=9, triangles=True)])
def test_what_is_no_grid(surface: Surface) -> None:
    assert rows_and_columns(surface) is None
