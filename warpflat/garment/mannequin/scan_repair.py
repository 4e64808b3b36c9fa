"""A scan's mesh repaired: parts turned outward, holes closed by patches that carry on the skin's curvature, noise smoothed."""

from __future__ import annotations

import contextlib

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core import FloatArray, InputError, unit
from warpflat.flat import area_vectors, components, face_normals, half_edges, mesh_edges, orient, vertex_normals
from warpflat.garment.mannequin.slicer import plane_axes

__all__ = ["close_holes", "smooth_noise", "turned_outward"]

# Skin around a hole faces one way; around the open end of a limb it faces all ways. Borders up to so long, as a share of the
# scan's greatest extent, are holes if the mean unit normal beside them is so long. The second is a face that is torn all over.
_HOLES = ((0.30, 0.15), (0.80, 0.25))
# Least cotangent weight of an edge, which keeps the fairing stable where triangles are obtuse.
_LEAST_WEIGHT = 0.05
# A scan is noisy if its vertices waver off the skin by more than this share of their distance: smooth meshes of bodies by
# 0.03, those with 2 mm of noise on each coordinate by 0.18.
_WAVERS = 0.08
# A part tells which way it is wound if it has this share of the surface, and this volume for the 3/2 power of its area; a ball has 0.094.
_PART, _BULKY = 0.01, 0.004
# Taubin's shares of a step towards the neighbours' mean and of the step back, and how many of both.
_SHRINK, _GROW, _STEPS = 0.50, -0.53, 10


def turned_outward(points: FloatArray, triangles: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return triangles that all face outward, and how many of them did not.

    A part hangs together over edges of two triangles. Its own signed volume tells how it is wound; parts that are flat or small follow the
    most. One inside the others is the inner side of a wall, and stays.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.
    """
    faces = np.pad(triangles, ((0, 0), (0, 1)), constant_values=-1)
    # Torn scans may be one-sided somewhere: then each face is taken as it is wound.
    with contextlib.suppress(InputError):
        faces = orient(faces)[0].astype(np.int64)
    edges = half_edges(faces)
    part = components(edges, barrier=edges.edges[edges.count > 2])
    corners, vectors = points[faces[:, :3]], area_vectors(points, faces[:, :3])
    area = np.linalg.norm(vectors, axis=1)
    areas = np.maximum(np.bincount(part, area), 1e-300)
    middle = np.stack([np.bincount(part, area * along) for along in corners.mean(axis=1).T], axis=1) / areas[:, None]
    volume = np.bincount(part, np.einsum("ta,ta->t", vectors, corners[:, 0] - middle[part]) / 3.0)
    inward = volume < 0.0
    told = (areas > _PART * areas.sum()) & (np.abs(volume) > _BULKY * areas**1.5)
    for one in np.flatnonzero(told & inward & (areas < areas.max())):
        around = corners[part != one] - corners[part == one][0].mean(axis=0)
        inward[one] = abs(_winding_number(around)) < 0.5
    inward[~told] = areas[told & inward].sum() > 0.5 * areas[told].sum()
    turned = np.where(inward[part][:, None], faces[:, 2::-1], faces[:, :3]).astype(np.int64)
    # A triangle that is turned has its corners in the other order.
    first = np.argmax(turned == triangles[:, :1], axis=1)
    after = turned[np.arange(len(turned)), (first + 1) % 3]
    return turned, int((after != triangles[:, 1]).sum())


def _winding_number(corners: FloatArray) -> float:
    """Return how often triangles (#T by 3 by 3) go around the origin (Van Oosterom and Strackee 1983)."""
    a, b, c = corners.transpose(1, 0, 2)
    la, lb, lc = np.linalg.norm(corners, axis=2).T
    dots = [np.einsum("ta,ta->t", *pair) for pair in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.arctan2(np.einsum("ta,ta->t", a, np.cross(b, c)), below).sum() / (2.0 * np.pi))


def close_holes(
    points: FloatArray, triangles: NDArray[np.int64]
) -> tuple[FloatArray, NDArray[np.int64], list[tuple[float, FloatArray]]]:
    """Close the holes of a welded mesh; the open ends of limbs and long borders stay.

    A hole is triangulated in its plane. Its inner vertices minimise the bending of patch and rim together.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.

    Returns:
        Vertices, the new ones last; triangles, the new ones last; each closed hole's border length and middle.

    Source: Liepa, "Filling holes in meshes", 2003 (fairing by the second-order umbrella operator).
    """
    normal = face_normals(points, triangles)
    span = float(np.ptp(points, axis=0).max())
    holes: list[tuple[float, FloatArray]] = []
    new_points, new_triangles, size = [points], [triangles], len(points)
    for loop, faces in _border_loops(triangles):
        rim = points[loop]
        length = float(np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1).sum())
        facing = normal[faces].mean(axis=0)
        one_way = float(np.linalg.norm(facing))
        is_hole = any(length <= longest * span and one_way >= least for longest, least in _HOLES)
        if not 3 <= len(loop) <= 1000 or not is_hole:
            continue
        patch = _patch(rim, unit(facing))
        if patch is None:
            continue
        inner, filled = patch
        names = np.concatenate([loop, size + np.arange(len(inner))])
        if len(inner):
            around = triangles[np.isin(triangles, loop).any(axis=1)]
            inner = _fair(points, around, loop, inner, filled)
        holes.append((length, rim.mean(axis=0)))
        new_points.append(inner)
        new_triangles.append(names[filled])
        size += len(inner)
    return np.concatenate(new_points), np.concatenate(new_triangles), holes


def _border_loops(triangles: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return each closed border: its vertices, against the turn of the faces beside it, and those faces."""
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = int(triangles.max()) + 1
    keys = np.minimum(tails, heads) * size + np.maximum(tails, heads)
    _, inverse, count = np.unique(keys, return_inverse=True, return_counts=True)
    single = np.flatnonzero(count[np.ravel(inverse)] == 1)
    # Against the face's turn, as the patch beyond the edge runs.
    leaving: dict[int, list[tuple[int, int]]] = {}
    for edge in single:
        leaving.setdefault(int(heads[edge]), []).append((int(tails[edge]), int(edge) // 3))
    loops = []
    while leaving:
        start = next(iter(leaving))
        path, faces, place = [start], [], {start: 0}
        while path[-1] in leaving:
            ways = leaving[path[-1]]
            vertex, face = ways.pop()
            if not ways:
                del leaving[path[-1]]
            faces.append(face)
            if vertex in place:
                # A loop is closed; where holes touch at a vertex, the rest of the walk goes on.
                first = place[vertex]
                loops.append((np.array(path[first:]), np.array(faces[first:])))
                for gone in path[first + 1 :]:
                    del place[gone]
                del path[first + 1 :], faces[first:]
            else:
                place[vertex] = len(path)
                path.append(vertex)
        leaving.pop(path[-1], None)
    return loops


def _patch(rim: FloatArray, facing: FloatArray) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Return inner vertices (#I by 3, in the rim's mean plane) and triangles (of rim, then inner vertices) of a flat patch.

    None where the rim's shadow along `facing` crosses itself.
    """
    import shapely
    from scipy.spatial import Delaunay, QhullError, cKDTree

    middle, axes = rim.mean(axis=0), plane_axes(facing)
    flat = (rim - middle) @ axes.T
    if len(rim) == 3:
        return np.empty((0, 3)), np.array([[0, 1, 2]])
    sides = np.linalg.norm(flat - np.roll(flat, 1, axis=0), axis=1)
    step = float(np.median(sides))
    low, high = flat.min(axis=0), flat.max(axis=0)
    if step <= 0.0 or np.prod((high - low) / step) > 2e4:
        return None
    x, y = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], 0.87 * step))
    x[1::2] += 0.5 * step
    grid = np.column_stack([x.ravel(), y.ravel()])
    within = shapely.Polygon(flat)
    grid = grid[shapely.contains_xy(within, grid)]
    # On the rim's edges, too, or a long edge would lie close to a vertex of the grid.
    halves = np.concatenate([flat, 0.5 * (flat + np.roll(flat, 1, axis=0))])
    grid = grid[cKDTree(halves).query(grid)[0] > 0.55 * step]
    try:
        cells = Delaunay(np.concatenate([flat, grid])).simplices
    except (QhullError, ValueError):
        return None
    every = np.concatenate([flat, grid])
    cells = cells[shapely.contains_xy(within, every[cells].mean(axis=1))]
    a, b, c = (every[cells[:, k]] for k in range(3))
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    cells = np.where(turn[:, None] < 0.0, cells[:, ::-1], cells)[np.abs(turn) > 1e-12 * step * step]
    if not len(cells):
        return None
    # A place whose triangles all lie outside, as where the rim crosses itself, belongs to no patch.
    is_rim = np.arange(len(every)) < len(flat)
    kept = is_rim | (np.bincount(cells.ravel(), minlength=len(every)) > 0)
    return middle + grid[kept[len(flat) :]] @ axes, (np.cumsum(kept) - 1)[cells].astype(np.int64)


def _fair(
    points: FloatArray, around: NDArray[np.int64], loop: NDArray[np.int64], inner: FloatArray, filled: NDArray[np.int64]
) -> FloatArray:
    """Return the inner vertices that minimise the squared curvature of the patch and of its rim.

    Args:
        points: #P by 3, the mesh.
        around: its triangles at the rim.
        loop: #R, the rim's vertices.
        inner: #I by 3, a first guess.
        filled: the patch's triangles, of the rim's vertices and then the inner ones.
    """
    from scipy.sparse.linalg import splu

    outer = np.setdiff1d(around, loop)
    place = np.empty(len(points), dtype=np.int64)
    place[loop] = np.arange(len(loop))
    place[outer] = len(loop) + len(inner) + np.arange(len(outer))
    faces = np.concatenate([filled, place[around]])
    where = np.concatenate([points[loop], inner, points[outer]])
    rows = len(loop) + len(inner)
    free = np.arange(len(loop), rows)
    known = np.setdiff1d(np.arange(len(where)), free)
    for _ in range(3):
        bending = _laplacian(where, faces)[:rows]
        of_free = bending[:, free]
        where[free] = splu((of_free.T @ of_free).tocsc()).solve(-(of_free.T @ (bending[:, known] @ where[known])))
    return where[free]


def _laplacian(where: FloatArray, faces: NDArray[np.int64]) -> csr_array:
    """Return the mean-curvature operator of a mesh, each row over the square root of its vertex's area."""
    from scipy.sparse import coo_array, diags_array

    size = len(where)
    i, j, tip = np.concatenate([np.roll(faces, -k, axis=1) for k in range(3)]).T
    a, b = where[i] - where[tip], where[j] - where[tip]
    twice = np.linalg.norm(np.cross(a, b), axis=1)
    cotangent = np.clip((a * b).sum(axis=1) / np.maximum(twice, 1e-300), _LEAST_WEIGHT, 1.0 / _LEAST_WEIGHT)
    half = coo_array((cotangent, (i, j)), shape=(size, size)).tocsr()
    weights = half + half.T
    area = np.bincount(tip, twice / 6.0, size)
    return (diags_array(np.maximum(area, 1e-300) ** -0.5) @ (diags_array(weights.sum(axis=1)) - weights)).tocsr()


def smooth_noise(points: FloatArray, triangles: NDArray[np.int64]) -> tuple[FloatArray, float]:
    """Return vertices without noise, which neither shrink nor lose their shape, and how far they wavered.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.

    Returns:
        Vertices; the median distance along the normal by which noise moved them, 0 if they were left as they are.

    Source: Taubin, "A signal processing approach to fair surface design", 1995.
    """
    from scipy.sparse import coo_array

    ends = mesh_edges(triangles)
    both = np.concatenate([ends, ends[:, ::-1]])
    size = len(points)
    degree = np.bincount(both[:, 0], minlength=size).astype(float)
    beside = np.linalg.norm(points[both[:, 0]] - points[both[:, 1]], axis=1)
    distance = np.bincount(both[:, 0], beside, minlength=size) / degree
    mean = coo_array((1.0 / degree[both[:, 0]], (both[:, 0], both[:, 1])), shape=(size, size)).tocsr()
    # A curved skin stands off its neighbours' mean, too, but evenly: what differs from the neighbours is noise.
    off = ((points - mean @ points) * vertex_normals(points, triangles)).sum(axis=1)
    wavers = np.abs(off - mean @ off)
    if np.median(wavers / distance) < _WAVERS:
        return points, 0.0
    even = _even(points, mean)
    # Twicing: what was smoothed away is smoothed and added back, which returns most of what was shape.
    return even + _even(points - even, mean), float(np.median(wavers))


def _even(values: FloatArray, mean: csr_array) -> FloatArray:
    """Return values smoothed by Taubin's steps, `mean` the matrix of the neighbours' mean."""
    for _ in range(_STEPS):
        for share in (_SHRINK, _GROW):
            values = values + share * (mean @ values - values)
    return values
