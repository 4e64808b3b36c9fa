"""Closed things, and parts that no tailor's line opens: cut along and across their own axes until each part can lie flat.

What keeps cloth from lying flat is the curvature that it encloses: the area that its normals cover on the unit sphere (Gauss). A part
of that curvature G, of area A and length L is strained by about G A / (12 L^2) when it is laid flat: the curvature over its width
squared. So a narrow gore of a ball lies flat where a cap of the same area does not. Every cut is the one after which the least is
left, over the area.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.seams.anatomy import HOLE
from warpflat.seams.cloth import Cloth, PieceMesh
from warpflat.seams.fields import Operators
from warpflat.seams.tailor import tidied
from warpflat.surface.connectivity import border_loops, components, euler_characteristic

__all__ = ["SOLID", "is_open", "is_panel", "part_solids", "wide_borders"]

Ids = NDArray[np.int64]

#: Seams of closed things are called by this word and a number.
SOLID = "seam"

# A part lies flat, or nearly, below this strain by estimate; a ball falls into eight gores by it.
_FLAT = 0.022
# Normals are smoothed over this share of a part's size: wrinkles and facets are no shape.
_SMOOTH = 0.04
# A cut pays for itself: a seam as long as the part is wide counts as this strain.
_SEAM = 0.005
# Parts that are alike are drawn once: a cut of a round part that leaves others, larger by this share, counts as this strain more.
_ALIKE, _UNLIKE = 0.03, 0.005
# Axes along which a part is as long as along another within this share are none of its own: those of space serve.
_ROUND = 0.05
# Where cloth faces an axis by more than this (cosine) it is a base.
_BASE = 0.6
# The border of a panel squared is at least this share of a disk's; a cap's is shorter.
_PANEL = 0.8
# Parts at most.
_MOST = 16
# A part smaller than this share of the whole is not cut further, and no cut leaves a smaller one.
_LEAST = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class _Way:
    """A way of cutting a part: a field, positive on one side; `round` if the part is round about an axis, and can fall into equal ones."""

    field: FloatArray
    name: str
    round: bool


def is_open(mesh: PieceMesh) -> bool:
    """Return whether a piece is a disk, or a tube that one cut opens."""
    loops = len(border_loops(mesh.faces.astype(np.int32)))
    return loops in (1, 2) and euler_characteristic(mesh.faces.astype(np.int32)) == 2 - loops


def wide_borders(cloth: Cloth) -> list[float]:
    """Return the lengths of the borders of a cloth that are no holes [m]."""
    rings = [cloth.vertices[np.append(loop, loop[0])] for loop in cloth.borders()]
    length = [float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum()) for ring in rings]
    return [one for one in length if one > HOLE * np.sqrt(float(cloth.face_areas.sum()))]


def is_panel(cloth: Cloth) -> bool:
    """Return whether a cloth is one panel: with one border that is about as long as that of a flat disk of its area, or longer."""
    wide = wide_borders(cloth)
    return len(wide) == 1 and wide[0] ** 2 >= _PANEL * 4.0 * np.pi * float(cloth.face_areas.sum())


def part_solids(cloth: Cloth, *, shape: bool, most: int | None = None) -> tuple[Cloth, list[str]]:
    """Return the cloth with its pieces cut until each is a disk or a tube, and notes.

    Args:
        cloth: with the seams that it has.
        shape: whether pieces are cut for their shape, too, until each can lie flat.
        most: pieces at most; 16 if not given.
    """
    total = float(cloth.face_areas.sum())
    most = _MOST if most is None else most
    done, known = set[tuple[int, float]](), dict[int, float]()
    for number in range(4 * most):
        meshes = list(cloth.pieces())
        waiting = []
        for mesh in meshes:
            area = float(cloth.face_areas[mesh.face_of].sum())
            key = len(mesh.face_of), round(area, 9)
            topology = not is_open(mesh)
            if key in done or (not topology and (not shape or len(meshes) >= most)):
                continue
            value = _strain(cloth, mesh.face_of, known)
            if topology or (value > _FLAT and area > _LEAST * total):
                waiting.append((topology, value * area, key, mesh))
        if not waiting:
            break
        _, _, key, mesh = max(waiting, key=lambda one: one[:2])
        cut = _best_cut(cloth, mesh, f"{SOLID} {number + 1}", total, known)
        if cut is None:
            done.add(key)
        else:
            cloth = cut
    left = sum(not is_open(mesh) for mesh in cloth.pieces())
    notes = [f"{left} of its pieces have a handle or several holes that no cut has opened"] if left else []
    return cloth, notes


def _strain(cloth: Cloth, faces: Ids, known: dict[int, float]) -> float:
    """Return about how much some faces are strained when they are laid flat; `known` remembers it by the hash of their corners."""
    corners = hash(cloth.vertices[cloth.faces[faces]].tobytes())
    if corners in known:
        return known[corners]
    area = float(cloth.face_areas[faces].sum())
    normals, _ = _smoothed_normals(cloth, faces)
    a, b, c = normals.transpose(1, 0, 2)
    # The solid angle of a triangle of unit vectors, for small ones the triangle's own area.
    curvature = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    length = _reach(cloth, faces)
    for loop in border_loops(cloth.faces[faces].astype(np.int32), cloth.vertices)[1:2]:
        # A tube is as long, laid flat, as it is around.
        ring = cloth.vertices[np.append(loop, loop[0])]
        length = max(length, float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum()))
    known[corners] = curvature * area / (12.0 * max(length, 1e-300) ** 2)
    return known[corners]


def _reach(cloth: Cloth, faces: Ids) -> float:
    """Return the way along the cloth between two places that are about as far from each other as any [m]."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    used, place = np.unique(cloth.faces[faces], return_inverse=True)
    local, points = place.reshape(-1, 3), cloth.vertices[used]
    a, b = local.ravel(), np.roll(local, -1, axis=1).ravel()
    step = np.linalg.norm(points[a] - points[b], axis=1)
    graph = coo_array((step, (a, b)), shape=(len(used), len(used))).tocsr()
    graph = graph.maximum(graph.T)
    far = dijkstra(graph, indices=0)
    far = dijkstra(graph, indices=int(np.where(np.isfinite(far), far, -1.0).argmax()))
    return float(far[np.isfinite(far)].max())


def _smoothed_normals(cloth: Cloth, faces: Ids) -> tuple[FloatArray, FloatArray]:
    """Return the smoothed normals at the corners of some faces (#F by 3 by 3), and their means (#F by 3)."""
    used, place = np.unique(cloth.faces[faces], return_inverse=True)
    local = place.reshape(-1, 3)
    operators = Operators(vertices=cloth.vertices[used], faces=local.astype(np.int64))
    size = float(np.sqrt(max(float(cloth.face_areas[faces].sum()), 1e-300)))
    smooth = operators.smooth(operators.vertex_normals, _SMOOTH * size)
    corners = (smooth / np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-300))[local]
    return corners, corners.mean(axis=1)


def _ways(cloth: Cloth, mesh: PieceMesh) -> Iterator[_Way]:
    """Yield ways of cutting a part: across each of its axes through the middle, and where it begins to face each way along them."""
    middles, areas = cloth.vertices[cloth.faces[mesh.face_of]].mean(axis=1), cloth.face_areas[mesh.face_of]
    share = areas / areas.sum()
    centre = share @ middles
    values, vectors = np.linalg.eigh(((middles - centre) * share[:, None]).T @ (middles - centre))
    axes = vectors.T
    same = values[1:] <= (1.0 + _ROUND) * values[:-1]
    if same.all():
        axes = np.eye(3)
    elif same.any():
        # Round about one of its axes: the axis of space that is the farthest from that one, and the one at right angles to both.
        own = axes[2 if same[0] else 0]
        other = np.eye(3)[np.abs(own).argmin()]
        other = other - (other @ own) * own
        other /= np.linalg.norm(other)
        round_ones = [other, np.cross(own, other)]
        axes = np.array([*round_ones, own] if same[0] else [own, *round_ones])
    # Axes that nearly are those of space are taken as these: a garment is drawn upright.
    axes = np.array(
        [
            np.sign(axis[np.abs(axis).argmax()]) * np.eye(3)[np.abs(axis).argmax()]
            if np.abs(axis).max() > 0.97
            else axis
            for axis in axes
        ]
    )
    for k in (1, 2, 0):
        yield _Way(field=(cloth.vertices - centre) @ axes[k], name="across", round=bool(same.any()))
    _, normals = _smoothed_normals(cloth, mesh.face_of)
    operators_faces = cloth.faces[mesh.face_of]
    for axis in axes:
        for sign in (1.0, -1.0):
            facing = np.zeros(len(cloth.vertices))
            weight = np.zeros(len(cloth.vertices))
            np.add.at(facing, operators_faces.ravel(), np.repeat(areas * (normals @ axis) * sign, 3))
            np.add.at(weight, operators_faces.ravel(), np.repeat(areas, 3))
            yield _Way(field=facing / np.maximum(weight, 1e-300) - _BASE, name="base", round=bool(same.any()))


def _best_cut(
    cloth: Cloth,
    mesh: PieceMesh,
    name: str,
    total: float,
    known: dict[int, float],
) -> Cloth | None:
    """Return the cloth with the cut of a part after which the least is left to do; None if no cut parts it well."""
    own = np.zeros(len(cloth.faces), dtype=bool)
    own[mesh.face_of] = True
    area = float(cloth.face_areas[own].sum())
    best: tuple[float, Cloth] | None = None
    for way in _ways(cloth, mesh):
        marked = replace(
            cloth,
            values={**cloth.values, "way": way.field},
            labels={**cloth.labels, "own": own.astype(np.int64)},
        )
        marked = tidied(marked, "way", own, keep=0.05)
        made, positive = marked.split("way", own)
        within = made.labels["own"] > 0
        edges = made.line_between(positive, within)
        if len(edges) == 0:
            continue
        made = replace(
            made,
            values={key: value for key, value in made.values.items() if key != "way"},
            labels={key: label for key, label in made.labels.items() if key != "own"},
        ).with_seam(name, edges)
        cost = _SEAM * made.seam_length(name) / np.sqrt(area)
        part = components(made.faces.astype(np.int32), barrier=made.seam_edges().astype(np.int32))
        areas = list[float]()
        for number in np.unique(part[within]):
            faces = np.flatnonzero(part == number)
            areas.append(float(made.face_areas[faces].sum()))
            if areas[-1] < 0.3 * _LEAST * total:
                cost = np.inf
                break
            cost += _strain(made, faces, known) * areas[-1] / area + _topology(made.faces[faces])
        cost += _UNLIKE * way.round * (max(areas) > (1.0 + _ALIKE) * min(areas))
        if np.isfinite(cost) and (best is None or cost < best[0]):
            best = cost, made
    return None if best is None else best[1]


def _topology(faces: Ids) -> float:
    """Return what it costs that a part is no disk: a tube needs one cut, anything else more."""
    loops = len(border_loops(faces.astype(np.int32)))
    if loops == 0:
        return 1.0
    holes = 2 - euler_characteristic(faces.astype(np.int32)) - 1
    return 0.01 * min(holes, 1) + 0.2 * max(holes - 1, 0)
