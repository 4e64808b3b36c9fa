"""Coarser levels: what they keep, how layouts go up from them, and that nothing is glued."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from warpflat.coarsen import Coarser, coarser
from warpflat.shapes import make_shape
from warpflat.strain import signed_cell_areas
from warpflat.surface import Surface, make_surface
from warpflat.surface.cut import cut_along
from warpflat.surface.topology import border_loops, components, non_manifold_edges

FloatArray = NDArray[np.float64]


def sheet(columns: int, rows: int, *, triangles: bool = False) -> Surface:
    """A flat rectangle of 10 mm cells."""
    x, y = np.meshgrid(0.01 * np.arange(columns), 0.01 * np.arange(rows))
    i = np.arange(x.size).reshape(x.shape)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4)
    if triangles:
        none = np.full((len(faces), 1), -1)
        faces = np.concatenate([np.hstack([faces[:, k], none]) for k in ([0, 1, 2], [0, 2, 3])])
    return make_surface(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces)


def flat(surface: Surface) -> FloatArray:
    return surface.vertices[:, :2]


def made(surface: Surface, layout: FloatArray | None = None) -> Coarser:
    step = coarser(surface, flat(surface) if layout is None else layout)
    assert step is not None
    return step


@pytest.mark.parametrize(("columns", "rows"), [(9, 5), (17, 17), (8, 11), (33, 6)])
def test_a_grid_keeps_every_second_row_and_column(columns: int, rows: int):
    surface = sheet(columns, rows)
    shuffled = np.random.default_rng(0).permutation(len(surface.vertices))
    number = np.argsort(shuffled)
    mixed = make_surface(surface.vertices[shuffled], number[surface.faces])
    for piece in (surface, mixed):
        step = made(piece)
        assert step.surface.is_quad.all()
        assert len(step.kept) == (columns // 2 + 1) * (rows // 2 + 1)
        corners = {(0.0, 0.0), (0.01 * (columns - 1), 0.0), (0.0, 0.01 * (rows - 1))}
        assert corners <= {(x, y) for x, y in step.surface.vertices[:, :2].tolist()}
        np.testing.assert_allclose(step.prolongation @ flat(step.surface), flat(piece), atol=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_triangles_lose_three_quarters_and_stay_a_mesh(seed: int):
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(size=(900, 2)), [[0, 0], [1, 0], [1, 1], [0, 1]]])
    faces = Delaunay(points).simplices
    surface = make_surface(np.column_stack([points, 0.1 * np.sin(5 * points[:, 0])]), faces)
    step = made(surface)
    count = len(surface.vertices)
    assert 0.15 * count < len(step.kept) < 0.4 * count
    assert not len(non_manifold_edges(step.surface.faces))
    assert components(step.surface.faces).max() == 0
    assert len(border_loops(step.surface.faces)) == 1
    assert (signed_cell_areas(step.surface.faces[:, :3], flat(surface)[step.kept]) > 0).all()
    np.testing.assert_allclose(step.prolongation.sum(axis=1), 1.0, atol=1e-12)
    assert step.prolongation.data.min() >= 0.0
    # A kept vertex is where it was.
    np.testing.assert_allclose((step.prolongation @ step.surface.vertices)[step.kept], surface.vertices[step.kept])


def test_inside_a_flat_mesh_the_way_up_is_exact_for_linear_layouts():
    surface = sheet(21, 21, triangles=True)
    step = made(surface)
    inside = (flat(surface) > 1e-6).all(axis=1) & (flat(surface) < 0.2 - 1e-6).all(axis=1)
    layout = flat(surface) @ np.array([[1.1, 0.2], [-0.1, 0.9]])
    np.testing.assert_allclose((step.prolongation @ layout[step.kept])[inside], layout[inside], atol=1e-12)


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_the_sides_of_a_crack_stay_apart(triangles: bool):
    whole = make_shape("dome", resolution=25, triangles=triangles)
    column = np.arange(25 * 25, dtype=np.int32).reshape(25, 25)[:15, 8]
    cut = cut_along(whole.faces, column, vertex_count=len(whole.vertices))
    surface = make_surface(whole.vertices[cut.vertex_origin], cut.faces)
    layout = surface.vertices[:, :2]
    left = layout[:, 0] < whole.vertices[column[0], 0] - 1e-9
    twins = {}
    for vertex, origin in enumerate(cut.vertex_origin):
        twins.setdefault(int(origin), []).append(vertex)
    sides = [pair for pair in twins.values() if len(pair) == 2]
    assert len(sides) == 14
    for _ in range(3):
        step = made(surface, layout)
        coarse = step.surface
        assert len(border_loops(coarse.faces)) == 1
        assert not len(non_manifold_edges(coarse.faces))
        # Below the tip, no face has vertices on both sides; the twins of the crack belong to the side of their faces.
        side = np.where(left[step.kept], -1, 1)
        below = layout[step.kept, 1] < whole.vertices[column[-1], 1] - 0.05
        on_line = np.isclose(layout[step.kept, 0], whole.vertices[column[0], 0])
        for face in coarse.faces:
            corners = face[face >= 0]
            sure = corners[below[corners] & ~on_line[corners]]
            if below[corners].all():
                assert len(set(side[sure].tolist())) <= 1
        surface, layout, left = coarse, layout[step.kept], left[step.kept]


@given(st.integers(0, 10_000), st.floats(0.0, 0.3))
@settings(max_examples=25, deadline=None)
def test_any_mesh_becomes_a_mesh_without_mirrored_triangles(seed: int, relief: float):
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(rng.integers(40, 300), 2))
    surface = make_surface(np.column_stack([points, relief * rng.normal(size=len(points))]), Delaunay(points).simplices)
    layout = surface.vertices[:, :2]
    step = coarser(surface, layout)
    if step is None:
        return
    assert not len(non_manifold_edges(step.surface.faces))
    assert (signed_cell_areas(step.surface.faces[:, :3], layout[step.kept]) > 0).all()
    assert np.isfinite(step.prolongation.data).all()
    np.testing.assert_allclose(step.prolongation.sum(axis=1), 1.0, atol=1e-12)


def test_what_cannot_be_made_coarser_says_so():
    triangle = make_surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert coarser(triangle, flat(triangle)) is None
