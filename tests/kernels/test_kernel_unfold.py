"""Creases, diagonals and cells of a surface against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from surface_meshes import quads_between
from warpflat.kernels.unfold import measure_triangles

from warpflat.core.launch import launch_each
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.connectivity import coincident_vertices
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.triangles import corner_triangles, unfold_quad_diagonals
from warpflat.flat.surface.unfold import quad_creases

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


def half_split(surface: Surface, *, every: int = 3) -> Surface:
    """A surface of quads with every so manieth of them cut into two triangles, the faces in any order."""
    quads = surface.faces
    cut = np.arange(len(quads)) % every == 0
    none = np.full((int(cut.sum()), 1), -1)
    halves = [np.hstack([quads[cut][:, corners], none]) for corners in ([0, 1, 2], [0, 2, 3])]
    faces = np.concatenate([quads[~cut], *halves])
    return make_surface(surface.vertices, faces[np.random.default_rng(1).permutation(len(faces))])


def rolled(*, slit: bool = False) -> Surface:
    """A sheared grid of quads rolled up askew: each is creased. With a slit, from the border into the middle."""
    x, y = np.meshgrid(0.01 * np.arange(20.0), 0.012 * np.arange(20.0))
    flat = np.stack([x + 0.3 * y, y], axis=-1).reshape(-1, 2)
    along, across = flat @ [np.cos(0.6), np.sin(0.6)], flat @ [-np.sin(0.6), np.cos(0.6)]
    body = np.column_stack([0.05 * np.sin(along / 0.05), across, 0.05 * np.cos(along / 0.05)])
    index = np.arange(400).reshape(20, 20)
    faces = quads_between(index)
    if slit:
        line = index[:9, 8]
        right = np.arange(len(faces)) % 19 >= 8
        faces[right] = np.where(np.isin(faces[right], line), 400 + faces[right] // 20, faces[right])
        body = np.concatenate([body, body[line]])
    return make_surface(body, faces)


SURFACES = {
    "dome": lambda: make_shape("dome", resolution=17),
    "saddle": lambda: make_shape("saddle", resolution=17),
    "bodice": lambda: make_shape("bodice", resolution=33),
    "triangles": lambda: make_shape("bodice", resolution=17, triangles=True),
    "mixed": lambda: half_split(make_shape("bodice", resolution=33)),
    "rolled": rolled,
    "slit": lambda: rolled(slit=True),
    "rolled, mixed": lambda: half_split(rolled(), every=5),
}


def norm(a: FloatArray) -> FloatArray:
    return np.linalg.norm(a, axis=-1)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("...i,...i->...", a, b)


def creases(surface: Surface) -> NDArray[np.int8]:
    """What `quad_creases` says, in NumPy."""
    vertices, faces, is_quad = surface.vertices, surface.faces, surface.is_quad
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal[is_quad] = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])[is_quad]
    place = coincident_vertices(vertices, faces)
    at_vertex = np.zeros_like(vertices)
    for k in range(4):
        there = faces[:, k] >= 0
        np.add.at(at_vertex, place[faces[there, k]], normal[there])
    at_vertex = (at_vertex / np.maximum(norm(at_vertex), 1e-300)[:, None])[place]
    p, n, normal = p[is_quad], at_vertex[faces[is_quad]], normal[is_quad]
    diagonal = np.stack([p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]], axis=1)
    lengths, side = norm(diagonal), np.roll(p, -1, axis=1) - p
    bent = np.abs(dot(side[:, 0], normal)) > 1e-9 * norm(normal) * lengths.max(axis=1)
    bent &= (dot(np.cross(side, np.roll(side, -1, axis=1)), normal[:, None]) > 0.0).all(axis=1)
    turn = np.abs(dot(n[:, 2:] - n[:, :2], diagonal)) / lengths
    told = turn.max(axis=1, initial=0.0) > 1e-7
    measure = np.where(told[:, None], turn / lengths, lengths[:, ::-1])
    share = np.where(told, 0.5, 1.0 - 1e-6)
    of_quad = np.full(len(p), -1, dtype=np.int8)
    for k in (0, 1):
        of_quad[bent & (measure[:, k] < share * measure[:, 1 - k])] = k
    crease = np.full(len(faces), -1, dtype=np.int8)
    crease[is_quad] = of_quad
    return crease


def laid_flat(surface: Surface, crease: NDArray[np.int8]) -> tuple[FloatArray, IntArray]:
    """The creased quads unfolded about their creases, #K by 4 by 2, and the face of each."""
    face = np.flatnonzero(crease >= 0)
    turned = (np.arange(4)[None] + crease[face][:, None].astype(np.int64)) % 4
    corner = surface.vertices[np.take_along_axis(surface.faces[face], turned, axis=1)]
    hinge = corner[:, 2] - corner[:, 0]
    length = norm(hinge)
    flat = np.zeros((len(face), 4, 2))
    flat[:, 2, 0] = length
    for k, side in ((1, -1.0), (3, 1.0)):
        out = corner[:, k] - corner[:, 0]
        flat[:, k, 0] = dot(out, hinge) / length
        flat[:, k, 1] = side * norm(np.cross(hinge, out)) / length
    unrolled = np.empty_like(flat)
    np.put_along_axis(unrolled, turned[..., None], flat, axis=1)
    return unrolled, face


def across(a: FloatArray, b: FloatArray, p: FloatArray, q: FloatArray, normal: FloatArray) -> FloatArray:
    """Distance of a and b with both triangles on the hinge p-q laid into one plane."""
    hinge = q - p
    cross_a, cross_b = np.cross(p - a, hinge), np.cross(b - p, hinge)
    unfolded = np.hypot(dot(b - a, hinge), norm(cross_a) + norm(cross_b)) / norm(hinge)
    return np.where((dot(cross_a, normal) < 0) | (dot(cross_b, normal) < 0), norm(b - a), unfolded)


@pytest.mark.parametrize("name", SURFACES)
def test_creases_are_those_of_numpy(name: str):
    surface = SURFACES[name]()
    wished = creases(surface)
    if name in ("bodice", "mixed", "rolled", "slit", "rolled, mixed"):
        assert (wished >= 0).any()
    np.testing.assert_array_equal(quad_creases(surface.vertices, surface.faces), wished)


@pytest.mark.parametrize("name", SURFACES)
def test_diagonals_are_those_of_numpy_and_straight_along_creases(name: str):
    surface = SURFACES[name]()
    crease = creases(surface)
    p0, p1, p2, p3 = surface.vertices[surface.faces[surface.is_quad]].swapaxes(0, 1)
    normal = np.cross(p2 - p0, p3 - p1)
    over = np.stack([across(p0, p2, p1, p3, normal), across(p1, p3, p2, p0, normal)], axis=1)
    lengths, face = unfold_quad_diagonals(surface.vertices, surface.faces)
    np.testing.assert_array_equal(face, np.flatnonzero(surface.is_quad))
    np.testing.assert_allclose(lengths, over, rtol=1e-12)
    straight = np.stack([norm(p2 - p0), norm(p3 - p1)], axis=1)
    along = crease[surface.is_quad][:, None] == np.arange(2)
    lengths, _ = unfold_quad_diagonals(surface.vertices, surface.faces, crease=crease)
    np.testing.assert_allclose(lengths, np.where(along, straight, over), rtol=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_cells_are_those_of_numpy(name: str):
    surface = SURFACES[name]()
    corner, face, weight = corner_triangles(surface.faces)
    p = surface.vertices[corner]
    flat, creased = laid_flat(surface, creases(surface))
    around = np.isin(face, creased)
    p[around] = 0.0
    p[around, :, :2] = flat[:, [[3, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 0]]].reshape(-1, 3, 2)
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    twice = norm(np.cross(a, b))
    edges = np.zeros((len(corner), 2, 2))
    edges[:, 0, 0], edges[:, 0, 1], edges[:, 1, 1] = norm(a), dot(a, b) / norm(a), twice / norm(a)
    cells = make_cells(surface)
    for have, wished in ((cells.corner, corner), (cells.face, face), (cells.weight, weight)):
        np.testing.assert_array_equal(have, wished)
    np.testing.assert_allclose(cells.edges, edges, rtol=1e-12, atol=1e-12 * edges.max())
    np.testing.assert_allclose(cells.area, 0.5 * weight * twice, rtol=1e-12)
    at_vertices = np.bincount(corner.ravel(), np.repeat(cells.area / 3.0, 3), minlength=len(surface.vertices))
    np.testing.assert_allclose(cells.vertex_areas, at_vertices, rtol=1e-12)


def test_triangles_are_measured_at_each_corner():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(12, 3))
    triangles = np.array([rng.choice(12, 3, replace=False) for _ in range(30)], dtype=np.int32)
    triangles[4] = 3
    area, product = np.empty(30), np.empty((30, 3))
    launch_each(measure_triangles, 30, [points, triangles], [area, product])
    p, q, r = points[triangles].transpose(1, 0, 2)
    np.testing.assert_allclose(area, 0.5 * norm(np.cross(q - p, r - p)), rtol=1e-12)
    expected = np.column_stack([dot(q - p, r - p), dot(r - q, p - q), dot(p - r, q - r)])
    np.testing.assert_allclose(product, expected, rtol=1e-12, atol=1e-12)
