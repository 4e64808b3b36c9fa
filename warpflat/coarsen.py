"""One coarser level of a piece: a quarter of its vertices, faces between them, and how layouts go between the two.

The vertices of the coarser level are vertices of the finer one. A rectangular grid of quads keeps every second row and column.
Any other mesh loses vertices by edges that collapse, an independent set of them at a time, until a quarter is left: a vertex vanishes
into the neighbour that leaves the best triangles, on the border only along the border. So corners, holes and cracks stay what they
are: two sides of a crack have different vertices, and nothing joins them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.sparse import csr_array, kron

from warpflat.kernels.coarsen import Ring, find_border, find_targets, place, select
from warpflat.surface.mesh import Surface
from warpflat.surface.topology import HalfEdges, half_edges, triangulate

__all__ = ["Coarser", "coarser"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Passes of collapses to one level, rounds in which a pass chooses its vertices, and the least share of vertices that a level
# must lose to be worth having.
_PASSES = 10
_ROUNDS = 3
_LEAST_GAIN = 0.3


@dataclass(frozen=True, kw_only=True)
class Coarser:
    """A coarser level.

    Attributes:
        surface: of the level; its vertices are the finer level's, without lines.
        kept: #C, the finer level's vertices that it has.
        prolongation: #V by #C, rows add up to 1.
        face_of: #G, for each of its faces one of the finer level's that lies in or beside it.
    """

    surface: Surface
    kept: IntArray
    prolongation: csr_array
    face_of: IntArray


def coarser(surface: Surface, layout: FloatArray) -> Coarser | None:
    """The next coarser level, or None where none is to be had.

    Args:
        surface: the finer one.
        layout: #V by 2, of it, without mirrored faces [m]; triangles that collapses leave are not mirrored in it either.
    """
    grid = _rows_and_columns(surface)
    return _every_second(surface, grid) if grid is not None else _collapsed(surface, layout)


def _part(surface: Surface, kept: IntArray, faces: NDArray[np.integer]) -> Surface:
    """The surface with these vertices and faces (numbered among the kept)."""
    vertices = surface.vertices[kept]
    return Surface(
        vertices=vertices,
        faces=faces.astype(np.int32),
        name=surface.name,
        input_vertices=vertices,
        input_index=np.arange(len(kept), dtype=np.int32),
    )


# --- rectangular grids


def _rows_and_columns(surface: Surface) -> IntArray | None:
    """#rows by #columns vertices of a rectangular grid of quads, else None."""
    faces, count = surface.faces, len(surface.vertices)
    if not surface.is_quad.all():
        return None
    columns = int(np.ptp(faces[0])) - 1
    if columns >= 2 and count % columns == 0:
        # Most grids are numbered row by row, which is seen at once.
        grid = np.arange(count, dtype=np.int32).reshape(-1, columns)
        blocks = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]], axis=-1).reshape(-1, 4)
        if blocks.shape == faces.shape and np.array_equal(np.sort(faces, axis=1), blocks):
            return grid
    he = half_edges(faces)
    twin = _twins(he)
    around = np.bincount(faces.ravel(), minlength=count)
    corners = np.flatnonzero(around == 1)
    if len(corners) != 4 or ((around != 1) & (around != 2) & (around != 4)).any():
        return None
    # The side from one corner to the next, and then row after row to its left: the edge across each quad from a row's.
    on_border = np.flatnonzero(twin < 0)
    after = np.full(count, -1, dtype=np.int64)
    after[he.tail[on_border]] = he.head[on_border]
    leaving = np.full(count, -1, dtype=np.int64)
    leaving[he.tail[on_border]] = on_border
    side = [int(corners[0])]
    while len(side) <= count:
        side.append(int(after[side[-1]]))
        if around[side[-1]] == 1:
            break
    columns = len(side)
    if columns < 2 or count % columns or (count // columns - 1) * (columns - 1) != len(faces):
        return None
    rows = [np.array(side)]
    edge = leaving[side[:-1]]
    for _ in range(count // columns - 1):
        opposite = he.next[he.next[edge]]
        row = np.append(he.head[opposite], he.tail[opposite[-1]])
        if (row[1:-1] != he.tail[opposite[:-1]]).any():
            return None
        rows.append(row)
        edge = twin[opposite]
        if (edge < 0).any() != (edge < 0).all():
            return None
    grid = np.stack(rows)
    if (edge >= 0).any() or len(np.unique(grid)) != count:
        return None
    return grid.astype(np.int32)


def _twins(he: HalfEdges) -> NDArray[np.int64]:
    """#H, the half-edge on the other side, -1 on the border."""
    order = np.argsort(he.edge, kind="stable")
    begin = np.cumsum(he.count) - he.count
    inner = begin[he.count == 2]
    twin = np.full(len(he.edge), -1, dtype=np.int64)
    twin[order[inner]], twin[order[inner + 1]] = order[inner + 1], order[inner]
    return twin


def _every_second(surface: Surface, grid: IntArray) -> Coarser | None:
    """Every second row and column, and the last ones; between them by halves, or by lengths where the count was even."""
    rows, columns = grid.shape
    if min(rows, columns) < 5:
        return None
    keep = [_second(rows), _second(columns)]
    kept = grid[np.ix_(*keep)]
    number = np.arange(kept.size).reshape(kept.shape)
    faces = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    weights = kron(_between(rows, keep[0]), _between(columns, keep[1]), format="csr")
    back = np.empty(grid.size, dtype=np.int64)
    back[grid.ravel()] = np.arange(grid.size)
    prolongation = csr_array(weights)[back]
    first = grid[keep[0][:-1]][:, keep[1][:-1]].ravel()
    return Coarser(
        surface=_part(surface, kept.ravel(), faces),
        kept=np.ascontiguousarray(kept.ravel()),
        prolongation=csr_array(prolongation),
        face_of=_some_face(surface, first),
    )


def _second(count: int) -> IntArray:
    keep = np.arange(0, count, 2)
    if keep[-1] != count - 1:
        # An even number of rows: the last cell is a single one.
        keep = np.append(keep, count - 1)
    return keep.astype(np.int32)


def _between(count: int, keep: IntArray) -> csr_array:
    """#count by #keep, linear interpolation by index."""
    place = np.searchsorted(keep, np.arange(count), side="right") - 1
    place = np.minimum(place, len(keep) - 2)
    share = (np.arange(count) - keep[place]) / (keep[place + 1] - keep[place])
    rows = np.repeat(np.arange(count), 2)
    matrix = csr_array(
        (np.column_stack([1.0 - share, share]).ravel(), (rows, np.column_stack([place, place + 1]).ravel())),
        shape=(count, len(keep)),
    )
    matrix.eliminate_zeros()
    return matrix


def _some_face(surface: Surface, vertices: IntArray) -> IntArray:
    """For each vertex a face that has it."""
    used = surface.faces >= 0
    face = np.zeros(len(surface.vertices), dtype=np.int32)
    face[surface.faces[used]] = np.repeat(np.arange(len(surface.faces), dtype=np.int32), used.sum(axis=1))
    return face[vertices]


# --- any other mesh


def _collapsed(surface: Surface, layout: FloatArray) -> Coarser | None:
    count = len(surface.vertices)
    triangles, face = triangulate(surface.faces)
    triangles = np.ascontiguousarray(triangles[:, :3], dtype=np.int32)
    live = np.arange(count)
    steps: list[csr_array] = []
    for _ in range(_PASSES):
        if len(live) <= 0.27 * count:
            break
        passed = _pass(surface.vertices[live], layout[live], triangles)
        if passed is None:
            break
        triangles, kept_faces, kept, weights = passed
        face, live = face[kept_faces], live[kept]
        steps.append(weights)
    if len(live) > (1.0 - _LEAST_GAIN) * count:
        return None
    prolongation = steps[0]
    for weights in steps[1:]:
        prolongation = prolongation @ weights
    return Coarser(
        surface=_part(surface, live.astype(np.int32), np.column_stack([triangles, np.full(len(triangles), -1)])),
        kept=live.astype(np.int32),
        prolongation=csr_array(prolongation),
        face_of=np.asarray(face, dtype=np.int32),
    )


def _pass(
    vertices: FloatArray, layout: FloatArray, triangles: IntArray
) -> tuple[IntArray, NDArray[np.int64], NDArray[np.int64], csr_array] | None:
    """One independent set of collapses: triangles left (new numbers), which they were, vertices left, and the weights."""
    count = len(vertices)
    ring = _ring_of(vertices, layout, triangles)
    target = wp.empty(count, dtype=wp.int32, device="cpu")
    wp.launch(find_targets, dim=count, inputs=[ring, 0], outputs=[target], device="cpu")
    state, other = wp.zeros(count, dtype=wp.int32, device="cpu"), wp.zeros(count, dtype=wp.int32, device="cpu")
    for _ in range(_ROUNDS):
        wp.launch(select, dim=count, inputs=[ring, target, state, 0], outputs=[other], device="cpu")
        state, other = other, state
    chosen = np.flatnonzero(state.numpy() == 1).astype(np.int32)
    if len(chosen) < 0.02 * count:
        return None
    parent = wp.empty(len(chosen), dtype=wp.vec3i, device="cpu")
    weight = wp.empty(len(chosen), dtype=wp.vec3d, device="cpu")
    wp.launch(
        place,
        dim=len(chosen),
        inputs=[ring, target, wp.array(chosen, dtype=wp.int32, device="cpu"), 0],
        outputs=[parent, weight],
        device="cpu",
    )
    into = np.arange(count)
    into[chosen] = target.numpy()[chosen]
    stays = np.ones(count, dtype=bool)
    stays[chosen] = False
    kept = np.flatnonzero(stays)
    number = np.full(count, -1, dtype=np.int64)
    number[kept] = np.arange(len(kept))
    corners = into[triangles]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    left = number[corners[whole]].astype(np.int32)
    if not _is_manifold(left, len(kept)):
        return None
    rows = np.concatenate([kept, np.repeat(chosen, 3)])
    columns = np.concatenate([np.arange(len(kept)), number[parent.numpy().ravel()]])
    values = np.concatenate([np.ones(len(kept)), weight.numpy().ravel()])
    weights = csr_array((values, (rows, columns)), shape=(count, len(kept)))
    return left, np.flatnonzero(whole), kept, weights


def _ring_of(vertices: FloatArray, layout: FloatArray, triangles: IntArray) -> Ring:
    count = len(vertices)
    ring = Ring()
    ring.vertices = wp.array(np.ascontiguousarray(vertices), dtype=wp.vec3d, device="cpu")
    ring.layout = wp.array(np.ascontiguousarray(layout), dtype=wp.vec2d, device="cpu")
    ring.corner = wp.array(triangles, dtype=wp.vec3i, device="cpu")
    offset = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(np.bincount(triangles.ravel(), minlength=count), out=offset[1:])
    ring.offset = wp.array(offset, dtype=wp.int32, device="cpu")
    slot = np.argsort(triangles.ravel(), kind="stable").astype(np.int32)
    ring.slot = wp.array(slot, dtype=wp.int32, device="cpu")
    before, after = wp.empty(count, dtype=wp.int32, device="cpu"), wp.empty(count, dtype=wp.int32, device="cpu")
    wp.launch(find_border, dim=count, inputs=[ring, 0], outputs=[before, after], device="cpu")
    ring.before, ring.after = before, after
    return ring


def _is_manifold(triangles: IntArray, count: int) -> bool:
    """Whether no edge is run through twice in one direction."""
    keys = np.sort((triangles.astype(np.int64) * count + np.roll(triangles, -1, axis=1)).ravel())
    return not (keys[1:] == keys[:-1]).any()
