"""Small garments by formula: the skin of rounded cylinders, cut open at neck, wrists and hems."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.seams.cloth import Cloth

# An opening reaches so far around its point [m]; the first, a hem, further.
_REACH = 0.1

Distance = Callable[[FloatArray], FloatArray]
Plane = tuple[Sequence[float], Sequence[float]]

# The six tetrahedra of a cube, along its diagonal.
_TETRAHEDRA = [[0, 1 << p[0], (1 << p[0]) | (1 << p[1]), 7] for p in permutations(range(3))]


def rod(start: Sequence[float], end: Sequence[float], radius: float, deep: float = 1.0) -> Distance:
    """Return the distance from a rounded rod; `deep` flattens it along z."""
    a, b = np.array(start), np.array(end)

    def distance(points: FloatArray) -> FloatArray:
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        off = points - a - share[:, None] * (b - a)
        off[:, 2] /= deep
        return np.asarray(np.linalg.norm(off, axis=1) - radius)

    return distance


def joined(parts: Sequence[Distance], round_by: float = 0.04) -> Distance:
    """Return the distance from several parts, their joints rounded."""

    def distance(points: FloatArray) -> FloatArray:
        every = np.stack([part(points) for part in parts])
        return np.asarray(-round_by * np.log(np.exp(-every / round_by).sum(axis=0)))

    return distance


def _gradient(distance: Distance, points: FloatArray) -> FloatArray:
    return np.stack([(distance(points + 1e-5 * e) - distance(points - 1e-5 * e)) / 2e-5 for e in np.eye(3)], axis=1)


def skin(
    distance: Distance, low: Sequence[float], high: Sequence[float], step: float, openings: Sequence[Plane] = ()
) -> Surface:
    """Return the zero surface of a distance by marching tetrahedra, evened out, without what lies beyond the planes (point, normal)."""
    axes = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
    shape = tuple(len(axis) for axis in axes)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    value = distance(grid)
    value[np.abs(value) < 1e-9] = 1e-9
    index = np.arange(len(grid)).reshape(shape)
    corners = np.stack(
        [
            index[i : shape[0] - 1 + i, j : shape[1] - 1 + j, k : shape[2] - 1 + k].ravel()
            for k in (0, 1)
            for j in (0, 1)
            for i in (0, 1)
        ],
        axis=1,
    )
    corners = corners[(value[corners] < 0).any(axis=1) & (value[corners] > 0).any(axis=1)]
    known: dict[tuple[int, int], int] = {}
    points: list[FloatArray] = []
    faces = []

    def crossing(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in known:
            # Kept off the corners, so that no needles arise.
            t = np.clip(value[a] / (value[a] - value[b]), 0.3, 0.7)
            known[key] = len(points)
            points.append((1 - t) * grid[a] + t * grid[b])
        return known[key]

    for tetrahedron in np.concatenate([corners[:, row] for row in _TETRAHEDRA]).tolist():
        inside = [v for v in tetrahedron if value[v] < 0]
        outside = [v for v in tetrahedron if value[v] > 0]
        if len(inside) in (1, 3):
            one, three = (inside[0], outside) if len(inside) == 1 else (outside[0], inside)
            faces.append([crossing(one, v) for v in three])
        elif len(inside) == 2:
            quad = [
                crossing(a, b)
                for a, b in (
                    (inside[0], outside[0]),
                    (inside[0], outside[1]),
                    (inside[1], outside[1]),
                    (inside[1], outside[0]),
                )
            ]
            faces += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    cloth = Cloth(vertices=np.array(points), faces=np.array(faces))
    inwards = (
        np.einsum("ij,ij->i", cloth.face_normals, _gradient(distance, cloth.vertices[cloth.faces].mean(axis=1))) < 0
    )
    cloth = Cloth(vertices=cloth.vertices, faces=np.where(inwards[:, None], cloth.faces[:, ::-1], cloth.faces))
    for _ in range(8):
        # Triangles become even: vertices move to their neighbours' middle, and back onto the surface.
        a, b = cloth.faces.ravel(), np.roll(cloth.faces, -1, axis=1).ravel()
        total = np.zeros_like(cloth.vertices)
        count = np.zeros(len(total))
        np.add.at(total, a, cloth.vertices[b])
        np.add.at(count, a, 1.0)
        moved = 0.4 * cloth.vertices + 0.6 * total / count[:, None]
        for _ in range(2):
            gradient = _gradient(distance, moved)
            moved = moved - distance(moved)[:, None] * gradient / np.maximum((gradient**2).sum(axis=1), 0.1)[:, None]
        cloth = Cloth(vertices=moved, faces=cloth.faces)
    for number, (point, normal) in enumerate(openings):
        wide = number == 0
        cloth = Cloth(
            vertices=cloth.vertices, faces=cloth.faces, values={"plane": (cloth.vertices - point) @ np.array(normal)}
        )
        near = np.linalg.norm(cloth.vertices[cloth.faces].mean(axis=1) - point, axis=1) < _REACH * (
            2.0 if wide else 1.0
        )
        cloth, beyond, _ = cloth.split("plane", near)
        near = np.linalg.norm(cloth.vertices[cloth.faces].mean(axis=1) - point, axis=1) < _REACH * (
            2.0 if wide else 1.0
        )
        cloth = Cloth(vertices=cloth.vertices, faces=cloth.faces[~(beyond & near)])
    used, place = np.unique(cloth.faces, return_inverse=True)
    return make_surface(cloth.vertices[used], place.reshape(-1, 3), component="largest", closed=True, name="garment")


def shirt(arm: float = 0.0, sleeve: float = 0.5, step: float = 0.03) -> Surface:
    """Return a shirt; `arm` is how far its arms hang [rad], `sleeve` their length from the middle [m]."""
    way = np.array([np.cos(arm), -np.sin(arm), 0.0])
    root = np.array([0.12 + 0.12 * max(np.sin(arm), 0.0), 0.5, 0.0])
    parts = [rod([0, -0.05, 0], [0, 0.45, 0], 0.17, 0.65), rod([0, 0.45, 0], [0, 0.75, -0.02], 0.06)]
    openings: list[Plane] = [([0, 0, 0], [0, -1, 0]), ([0, 0.66, 0.0], [0, 0.94, 0.34])]
    for side in (1.0, -1.0):
        mirror = np.array([side, 1.0, 1.0])
        parts.append(rod(root * mirror, (root + (sleeve - 0.05) * way) * mirror, 0.06))
        openings.append(((root + (sleeve - 0.12) * way) * mirror, way * mirror))
    reach = root[0] + sleeve * way[0]
    return skin(joined(parts, 0.02), [-reach - 0.2, -0.2, -0.3], [reach + 0.2, 1.0, 0.3], step, openings)


def trousers(step: float = 0.035) -> Surface:
    """Return trousers."""
    parts = [rod([0, 0.05, 0], [0, 0.25, 0], 0.15, 0.75)]
    parts += [rod([0.09 * side, 0, 0], [0.16 * side, -0.65, 0], 0.075) for side in (1.0, -1.0)]
    openings: list[Plane] = [([0, 0.2, 0], [0, 1, 0])]
    openings += [([0.15 * side, -0.6, 0], [0, -1, 0]) for side in (1.0, -1.0)]
    return skin(joined(parts, 0.03), [-0.35, -0.7, -0.25], [0.35, 0.3, 0.25], step, openings)


def skirt(rows: int = 16, around: int = 40) -> Surface:
    """Return a skirt: an elliptic cone, narrower at the waist."""
    turn = np.arange(around) * 2 * np.pi / around
    height = np.linspace(0.0, 0.6, rows)
    vertices = np.array([[(0.28 - 0.2 * y) * np.sin(t), y, (0.2 - 0.13 * y) * np.cos(t)] for y in height for t in turn])
    faces = [
        [around * r + k, around * r + (k + 1) % around, around * (r + 1) + (k + 1) % around, around * (r + 1) + k]
        for r in range(rows - 1)
        for k in range(around)
    ]
    return make_surface(vertices, faces, name="skirt")


def jumpsuit(step: float = 0.04) -> Surface:
    """Return a suit in one: trunk, arms that hang a little, legs."""
    way, root = np.array([np.cos(0.6), -np.sin(0.6), 0.0]), np.array([0.16, 0.52, 0.0])
    parts = [rod([0, 0.05, 0], [0, 0.45, 0], 0.17, 0.65), rod([0, 0.45, 0], [0, 0.75, -0.02], 0.06)]
    parts += [rod([0.09 * side, 0, 0], [0.16 * side, -0.75, 0], 0.075) for side in (1.0, -1.0)]
    openings: list[Plane] = [([0, 0.66, 0.0], [0, 0.94, 0.34])]
    for side in (1.0, -1.0):
        mirror = np.array([side, 1.0, 1.0])
        parts.append(rod(root * mirror, (root + 0.45 * way) * mirror, 0.06))
        openings.append(((root + 0.4 * way) * mirror, way * mirror))
        openings.append(([0.15 * side, -0.7, 0], [0, -1, 0]))
    return skin(joined(parts, 0.02), [-0.75, -0.9, -0.3], [0.75, 0.9, 0.3], step, openings)
