"""Coarser meshes: what they keep, how layouts go up from them, and that nothing is glued."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import Delaunay
from surface_meshes import quads_between

from warpflat.flat.solver.collapse import Coarsening, _prolongation, coarsen, iterate_coarsenings
from warpflat.flat.surface.connectivity import border_loops, components, euler_characteristic, non_manifold_vertices
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.half_edges import half_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.untangle import signed_cell_areas

FloatArray = NDArray[np.float64]


def sheet(columns: int, rows: int, *, triangles: bool = False) -> Surface:
    """A flat rectangle of 10 mm cells."""
    x, y = np.meshgrid(0.01 * np.arange(columns), 0.01 * np.arange(rows))
    faces = quads_between(x.shape)
    if triangles:
        none = np.full((len(faces), 1), -1)
        faces = np.concatenate([np.hstack([faces[:, k], none]) for k in ([0, 1, 2], [0, 2, 3])])
    return make_surface(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces)


def numbered_grid(rows: int, columns: int, turn: int = 0, *, mirrored: bool = False) -> Surface:
    """A grid of 10 mm numbered row by row, all its faces begun at the same of their corners, wound one way or the other."""
    i = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    faces = quads_between(i)
    faces = np.roll(faces[:, ::-1] if mirrored else faces, turn, axis=1)
    y, x = np.divmod(np.arange(rows * columns), columns)
    vertices = np.column_stack([0.01 * x, 0.01 * y, 0.001 * x * y])
    return Surface(vertices=vertices, faces=faces, input_vertices=vertices, input_index=i.ravel())


def flat(surface: Surface) -> FloatArray:
    return surface.vertices[:, :2]


def made(surface: Surface) -> Coarsening:
    step = coarsen(surface)
    assert step is not None
    return step


@pytest.mark.parametrize("seed", range(3))
def test_triangles_lose_three_quarters_and_stay_a_mesh(seed: int):
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(size=(900, 2)), [[0, 0], [1, 0], [1, 1], [0, 1]]])
    faces = Delaunay(points).simplices
    surface = make_surface(np.column_stack([points, 0.1 * np.sin(5 * points[:, 0])]), faces)
    step = made(surface)
    count = len(surface.vertices)
    assert 0.15 * count < len(step.kept) < 0.4 * count
    assert half_edges(step.surface.faces).count.max() <= 2
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
    cut = cut_along(whole.faces, [column], vertex_count=len(whole.vertices))
    surface = make_surface(whole.vertices[cut.vertex_origin], cut.faces)
    layout = surface.vertices[:, :2]
    left = layout[:, 0] < whole.vertices[column[0], 0] - 1e-9
    twins = {}
    for vertex, origin in enumerate(cut.vertex_origin):
        twins.setdefault(int(origin), []).append(vertex)
    sides = [pair for pair in twins.values() if len(pair) == 2]
    assert len(sides) == 14
    for _ in range(3):
        step = made(surface)
        coarse = step.surface
        assert len(border_loops(coarse.faces)) == 1
        assert half_edges(coarse.faces).count.max() <= 2
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


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.3]))
@example(868, 0.0)  # with a sliver beside a face that is almost one, along its border
@settings(max_examples=25, deadline=None)
def test_any_mesh_becomes_a_mesh_without_mirrored_triangles(seed: int, relief: float):
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(rng.integers(40, 300), 2))
    surface = make_surface(np.column_stack([points, relief * rng.normal(size=len(points))]), Delaunay(points).simplices)
    layout = surface.vertices[:, :2]
    step = coarsen(surface)
    if step is None:
        return
    assert half_edges(step.surface.faces).count.max() <= 2
    if not relief:
        assert (signed_cell_areas(step.surface.faces[:, :3], layout[step.kept]) > 0).all()
    assert np.isfinite(step.prolongation.data).all()
    np.testing.assert_allclose(step.prolongation.sum(axis=1), 1.0, atol=1e-12)


def jittered(side: int, *, hole: bool = False, seed: int = 0) -> Surface:
    """A dome of irregular triangles over the unit square, with even borders; with a square hole in the middle."""
    rng = np.random.default_rng(seed)
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    inner = (np.minimum(x, y) > 0) & (np.maximum(x, y) < 1)
    points = np.column_stack([x, y]) + np.where(inner[:, None], rng.uniform(-0.3, 0.3, (len(x), 2)) / side, 0.0)
    faces = Delaunay(points).simplices
    corners = points[faces]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # Delaunay leaves needles along straight borders.
    kept = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 0.05 / side**2
    if hole:
        kept &= (np.abs(corners.mean(axis=1) - 0.5) > 0.15).any(axis=1)
    height = np.sqrt(1.0 - ((points - 0.5) ** 2).sum(axis=1))
    return make_surface(np.column_stack([points, height]), faces[kept])


def qualities(surface: Surface) -> FloatArray:
    """Of its triangles: 1 where equilateral, 0 where they are flat."""
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return 4 * np.sqrt(3) * area / sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))


def normals(surface: Surface) -> FloatArray:
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def test_each_level_has_about_a_quarter_of_the_vertices_and_good_triangles():
    surface = jittered(71)
    while len(surface.vertices) > 250:
        step = coarsen(surface)
        assert step is not None
        assert 0.18 * len(surface.vertices) < len(step.kept) < 0.28 * len(surface.vertices)
        surface = step.surface
        assert qualities(surface).min() > 0.25
        assert np.median(qualities(surface)) > 0.78


def test_corners_and_holes_stay():
    surface = jittered(51, hole=True)
    corners = {tuple(place) for place in np.array([[0, 0], [0, 1], [1, 0], [1, 1]], dtype=float)}
    steps = list(iterate_coarsenings(surface))
    assert len(steps) >= 2
    for step in steps:
        assert len(border_loops(step.surface.faces)) == 2
        assert corners <= {tuple(place) for place in flat(step.surface)}


def test_levels_of_a_surface_are_made_once_the_finest_first():
    surface = jittered(51)
    steps = list(iterate_coarsenings(surface))
    assert all(one is other for one, other in zip(steps, iterate_coarsenings(surface), strict=True))
    assert list(iterate_coarsenings(steps[-1].surface)) == []
    assert len(steps[-1].surface.vertices) <= 250
    for finer, step in zip([surface, *(step.surface for step in steps)], steps, strict=False):
        assert len(finer.vertices) > 250
        np.testing.assert_array_equal(step.surface.vertices, finer.vertices[step.kept])
        again = coarsen(finer)
        assert again is not None
        np.testing.assert_array_equal(again.surface.faces, step.surface.faces)
        assert (again.prolongation != step.prolongation).nnz == 0


@pytest.mark.parametrize(("rows", "columns"), [(33, 21), (30, 21), (24, 26)])
@pytest.mark.parametrize("turn", [0, 1, 3])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_grid_keeps_every_second_row_and_column_and_the_last(rows: int, columns: int, turn: int, mirrored: bool):
    surface = numbered_grid(rows, columns, turn, mirrored=mirrored)
    step = next(iterate_coarsenings(surface))
    coarse = step.surface
    assert len(coarse.vertices) == (rows // 2 + 1) * (columns // 2 + 1)
    assert len(coarse.faces) == (rows // 2) * (columns // 2)
    np.testing.assert_array_equal(coarse.vertices, surface.vertices[step.kept])
    # Its places are bilinear in row and column, and so is the interpolation.
    np.testing.assert_allclose(step.prolongation @ coarse.vertices, surface.vertices, atol=1e-12)
    np.testing.assert_array_equal(step.into[step.kept], np.arange(len(step.kept)))
    assert np.abs(coarse.vertices[step.into] - surface.vertices)[:, :2].max() < 0.011
    finer = surface.faces[step.face_of]
    assert (finer[:, :, None] == step.kept[coarse.faces][:, None, :]).any(axis=(1, 2)).all()
    side = np.sign(signed_cell_areas(surface.faces[:, :3], flat(surface)))
    assert (np.sign(signed_cell_areas(coarse.faces[:, :3], flat(coarse))) == side[0]).all()


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_without_a_layout_faces_lie_like_those_of_the_body(triangles: bool):
    """A tube that is almost closed: seen from any side some of it is turned."""
    x, y = np.meshgrid(np.linspace(0.0, 0.9 * 2 * np.pi, 81), np.linspace(0.0, 4.0, 41))
    flat_faces = sheet(81, 41, triangles=triangles).faces[:-1]  # without its last face it is no grid
    surface = make_surface(np.stack([np.cos(x), np.sin(x), y], axis=-1).reshape(-1, 3), flat_faces)
    for step in iterate_coarsenings(surface):
        outward = step.surface.vertices[step.surface.faces[:, :3]].mean(axis=1) * [1.0, 1.0, 0.0]
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        assert (np.einsum("ij,ij->i", normals(step.surface), outward) > 0.5).all()
        assert components(step.surface.faces).max() == 0
        assert len(border_loops(step.surface.faces)) == 1


@pytest.mark.parametrize("around", [3, 4, 5])
def test_a_thin_tube_stays_one(around: int):
    """Neighbours across it may have a third one in common, on its far side."""
    angle, height = np.meshgrid(2 * np.pi * np.arange(around) / around, np.arange(41.0))
    vertices = np.stack([np.cos(angle), np.sin(angle), 0.8 * height], axis=-1).reshape(-1, 3)
    i = np.arange(len(vertices)).reshape(angle.shape)
    j = np.roll(i, -1, axis=1)
    lower, upper = [i[:-1], j[:-1], j[1:]], [i[:-1], j[1:], i[1:]]
    surface = make_surface(vertices, np.vstack([np.stack(half, axis=-1).reshape(-1, 3) for half in (lower, upper)]))
    step = coarsen(surface)
    coarse = surface if step is None else step.surface
    assert half_edges(coarse.faces).count.max() <= 2
    assert not len(non_manifold_vertices(coarse.faces))
    assert len(border_loops(coarse.faces)) == 2
    assert euler_characteristic(coarse.faces) == 0


def test_a_vertex_with_very_many_neighbours_is_no_obstacle():
    around, rings = 60, 12
    angle = np.tile(np.linspace(0, 2 * np.pi, around, endpoint=False), rings)
    radius = np.repeat(np.arange(1, rings + 1), around)
    points = np.vstack([[0.0, 0.0], np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])])
    k = np.arange(around)
    fan = np.column_stack([np.zeros(around, dtype=int), 1 + k, 1 + (k + 1) % around])
    bands = []
    for r in range(rings - 1):
        a, b = 1 + r * around + k, 1 + r * around + (k + 1) % around
        bands += [np.column_stack([a, a + around, b + around]), np.column_stack([a, b + around, b])]
    surface = make_surface(np.column_stack([points, 0 * points[:, 0]]), np.vstack([fan, *bands]))
    step = made(surface)
    assert len(step.kept) < 0.5 * len(points)
    assert half_edges(step.surface.faces).count.max() <= 2
    areas = signed_cell_areas(step.surface.faces[:, :3], flat(step.surface))
    assert (areas > 0).all()
    # Nothing overlaps, nothing is missing inside the border.
    assert areas.sum() == pytest.approx(np.pi * rings**2, rel=0.05)


def test_any_number_of_threads_makes_the_same(monkeypatch: pytest.MonkeyPatch):
    surface = jittered(61)
    results = []
    for threads in ("1", "3"):
        monkeypatch.setenv("WARPFLAT_THREADS", threads)
        results.append(made(surface))
    one, three = results
    np.testing.assert_array_equal(one.surface.faces, three.surface.faces)
    np.testing.assert_array_equal(one.face_of, three.face_of)
    assert (one.prolongation != three.prolongation).nnz == 0


@pytest.mark.parametrize("entries", [1, 8])
def test_what_is_gone_is_in_the_end_made_of_what_is_kept(entries: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("warpflat.flat.solver.collapse._ENTRIES", entries)
    random = np.random.default_rng(3)
    gone = random.permutation(np.repeat(np.arange(4, dtype=np.int32), 10))
    expected = np.zeros((40, 10))
    expected[gone == 0] = np.eye(10)
    parent, weight = np.zeros((40, 3), dtype=np.int32), np.zeros((40, 3))
    for number in (3, 2, 1):
        staying = np.flatnonzero((gone == 0) | (gone > number))
        for vertex in np.flatnonzero(gone == number):
            parent[vertex], weight[vertex] = random.choice(staying, 3, replace=False), random.dirichlet(np.ones(3))
            expected[vertex] = weight[vertex] @ expected[parent[vertex]]
    given = [
        wp.array(values, dtype=dtype, device="cpu")
        for values, dtype in ((gone, int), (parent, wp.vec3i), (weight, wp.vec3d))
    ]
    np.testing.assert_allclose(_prolongation(*given, passes=3).toarray(), expected, atol=1e-12)


def test_sheets_that_touch_in_one_vertex_have_no_coarser_level():
    left = sheet(9, 9, triangles=True)
    count = len(left.vertices)
    number = np.append(count - 1, np.arange(count, 2 * count - 1))  # its first vertex is the other one's last
    faces = np.where(left.faces >= 0, number[left.faces], -1)
    vertices = np.vstack([left.vertices, left.vertices[1:] + left.vertices[-1]])
    touching = Surface(
        vertices=vertices,
        faces=np.vstack([left.faces, faces]).astype(np.int32),
    )
    assert coarsen(touching) is None


def test_what_cannot_be_made_coarser_says_so():
    triangle = make_surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert coarsen(triangle) is None
