"""Bent quads laid flat: along which diagonal they are creased, and what they unfold into."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from surface_meshes import quads_between

from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.model.springs import springs_of
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.triangles import unfold_quad_diagonals
from warpflat.flat.surface.unfold import lay_cells, quad_creases

FloatArray = NDArray[np.float64]


def tilted_tube(angle: float, *, skew: float = 0.0) -> tuple[FloatArray, FloatArray, NDArray[np.int32]]:
    """A grid of rectangles in the plane, turned and rolled up about x = const; points in the plane, on the tube, faces."""
    x, y = np.meshgrid(0.01 * np.arange(12.0), 0.012 * np.arange(12.0))
    flat = np.stack([x + skew * y, y], axis=-1).reshape(-1, 2)
    c, s = np.cos(angle), np.sin(angle)
    turned = flat @ np.array([[c, s], [-s, c]])
    r = 0.05
    body = np.column_stack([r * np.sin(turned[:, 0] / r), turned[:, 1], r * np.cos(turned[:, 0] / r)])
    faces = quads_between((12, 12))
    return flat, body, faces.astype(np.int32)


def distances(
    body: FloatArray, faces: NDArray[np.int32], crease: NDArray[np.int8]
) -> dict[tuple[int, int], FloatArray]:
    """Of quads, the distances between their corners as their cells, laid flat, have them; each from both of its cells, 2 by #Q."""
    laid = lay_cells(body, faces, crease, np.arange(0, 4 * len(faces), 4, dtype=np.int32)).reshape(-1, 4, 3)
    length = np.stack([laid[..., 0], np.hypot(laid[..., 1], laid[..., 2])], axis=-1)
    opposite = np.hypot(laid[..., 1] - laid[..., 0], laid[..., 2])
    between: dict[tuple[int, int], list[FloatArray]] = {}
    for k in range(4):
        before, after = (k - 1) % 4, (k + 1) % 4
        for (a, b), here in (
            ((before, k), length[:, k, 0]),
            ((k, after), opposite[:, k]),
            ((before, after), length[:, k, 1]),
        ):
            between.setdefault((min(a, b), max(a, b)), []).append(here)
    return {ends: np.stack(lengths) for ends, lengths in between.items()}


@pytest.mark.parametrize("turned_over", [False, True])
def test_on_a_tube_the_ruling_is_the_crease(turned_over: bool):
    ruling = np.arctan2(0.01, 0.012)
    flat, body, faces = tilted_tube(-ruling if turned_over else ruling)
    crease = quad_creases(body, faces)
    assert len(crease) == len(faces)
    along = (0, 2) if crease[0] == 0 else (1, 3)
    d = body[faces[0][along[1]]] - body[faces[0][along[0]]]
    assert abs(d[1]) == pytest.approx(np.linalg.norm(d), rel=1e-9)
    assert (crease == crease[0]).all()
    # Sides across the tube are chords; with those, every quad unfolds into the same one, and no more is missing than chords do.
    for (a, b), laid in distances(body, faces, crease).items():
        np.testing.assert_allclose(laid, laid[0, 0], rtol=1e-12)
        in_plane = np.linalg.norm(flat[faces[:, a]] - flat[faces[:, b]], axis=1)
        np.testing.assert_allclose(laid[0], in_plane, rtol=1e-2)


def test_creased_quads_keep_their_sides_and_cells_and_springs_agree():
    _, body, faces = tilted_tube(0.6, skew=0.3)
    surface = make_surface(body, faces)
    crease, corner = quad_creases(surface.vertices, surface.faces), surface.faces
    assert (crease >= 0).all()
    both = distances(surface.vertices, surface.faces, crease)
    # Each side and each diagonal is in two cells, and of one length there.
    for one, other in both.values():
        np.testing.assert_allclose(one, other, rtol=1e-12)
    laid = {ends: lengths[0] for ends, lengths in both.items()}
    for a, b in ((0, 1), (1, 2), (2, 3), (0, 3)):
        space = np.linalg.norm(surface.vertices[corner[:, a]] - surface.vertices[corner[:, b]], axis=1)
        np.testing.assert_allclose(laid[a, b], space, rtol=1e-12)
    springs = springs_of(surface, find_fabric("woven"), surface.vertices[:, :2])
    diagonals = springs.rest_length[springs.edge_count :].reshape(2, -1)
    for k in (0, 1):
        np.testing.assert_allclose(diagonals[k], laid[k, k + 2], rtol=1e-12)
    # The four cells of a quad at half weight are the quad: by Bretschneider's formula, of its sides and diagonals.
    cells = make_cells(surface)
    assert (np.linalg.det(cells.edges) > 0.0).all()
    across = laid[0, 1] ** 2 - laid[1, 2] ** 2 + laid[2, 3] ** 2 - laid[0, 3] ** 2
    whole = 0.25 * np.sqrt(4.0 * laid[0, 2] ** 2 * laid[1, 3] ** 2 - across**2)
    np.testing.assert_allclose(np.bincount(cells.face, cells.area), whole, rtol=1e-12)


def test_a_lone_quad_is_creased_along_its_longer_diagonal_and_unfolds_into_what_it_was():
    for angle in (0.3, 1.0, 1.5, -1.0):
        for roll in range(4):
            vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
            middle, out = np.array([0.5, 0.5, 0]), np.array([-0.5, 0.5, 0])
            # Fold corner 3 up about the diagonal 0-2.
            vertices[3] = middle + out * np.cos(angle) + np.linalg.norm(out) * np.array([0, 0, np.sin(angle)])
            faces = np.roll([[0, 1, 2, 3]], roll, axis=1).astype(np.int32)
            crease = quad_creases(vertices, faces)
            assert crease.tolist() == [roll % 2]
            laid = {ends: lengths[0] for ends, lengths in distances(vertices, faces, crease).items()}
            sides = [laid[a, b] for a, b in ((0, 1), (1, 2), (2, 3), (0, 3))]
            np.testing.assert_allclose(sides, 1.0, rtol=1e-12)
            np.testing.assert_allclose([laid[0, 2], laid[1, 3]], np.sqrt(2), rtol=1e-12)
            lengths, _ = unfold_quad_diagonals(vertices, faces, crease=crease)
            np.testing.assert_allclose(lengths, np.sqrt(2), rtol=1e-12)


def test_flat_twisted_and_reflex_quads_have_no_crease():
    tube = make_shape("cylinder", resolution=9)
    assert (quad_creases(tube.vertices, tube.faces) < 0).all()
    saddle = make_shape("saddle", resolution=17)
    middle = (np.abs(saddle.vertices[saddle.faces].mean(axis=1)[:, :2]) < 0.05).all(axis=1)
    crease = quad_creases(saddle.vertices, saddle.faces)
    assert middle.sum() > 4
    assert (crease[middle] < 0).all()
    # Of a sphere every direction is as curved, however long the diagonals of a quad are.
    dome = make_shape("hemisphere", resolution=17)
    assert (quad_creases(dome.vertices, dome.faces) < 0).mean() > 0.9
    reflex = np.array([[0, 0, 0], [1, 0, 0], [0.2, 0.2, 0.05], [0, 1, 0]], dtype=float)
    assert quad_creases(reflex, np.array([[0, 1, 2, 3]], dtype=np.int32)).tolist() == [-1]
    assert quad_creases(reflex, np.array([[0, 1, 2, -1]], dtype=np.int32)).tolist() == [-1]


def test_a_cut_changes_no_crease():
    """Its two sides lie at the same place in space."""
    _, body, faces = tilted_tube(0.5)
    before = quad_creases(body, faces)
    assert (before >= 0).all()
    cut = faces.copy()
    right = np.arange(len(faces)) % 11 >= 5
    line = 5 + 12 * np.arange(12)
    cut[right] = np.where(np.isin(faces[right], line), 144 + faces[right] // 12, faces[right])
    after = quad_creases(np.concatenate([body, body[line]]), cut)
    np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize("column", [2, 6, 10])
def test_a_cut_changes_no_crease_where_the_body_curves_both_ways(column: int):
    """There one side of the cut alone would tell another normal than both."""
    body = make_shape("bodice", resolution=13)
    line = np.arange(169, dtype=np.int32).reshape(13, 13)[:8, column]
    cut = cut_along(body.faces, [np.ascontiguousarray(line)], vertex_count=169)
    before = quad_creases(body.vertices, body.faces)
    assert (before >= 0).any()
    np.testing.assert_array_equal(quad_creases(body.vertices[cut.vertex_origin], cut.faces), before)
