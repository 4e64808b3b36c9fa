"""The openings of a sewn garment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import InputError, IntArray
from warpflat.flat import border_loops, orient
from warpflat.garment.draping.mesh_pieces import FlatMesh, Weld, welded_vertices

__all__ = ["Opening", "find_openings"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """A closed border of a sewn garment.

    Attributes:
        vertices: its vertices in their order, in the numbering of the sewn mesh.
        length: in the flat pieces [m].
        pieces: those that have an edge on it.
        turn: by how much it turns in the flat cloth [rad]: -2 pi around a hole, nothing at the end of a tube.
    """

    vertices: IntArray
    length: float
    pieces: frozenset[str]
    turn: float


def find_openings(
    meshes: Mapping[str, FlatMesh], welds: Sequence[Sequence[Weld]], buttons: Sequence[Weld] = ()
) -> list[Opening]:
    """Return the openings of pieces that are sewn together, the longest first; none where their seams make no surface.

    A border that runs along both fronts of a buttoned garment is two: one beyond the first button, one beyond the last.

    Args:
        meshes: the pieces.
        welds: for each seam the vertices that it joins.
        buttons: those of them that join points inside two pieces.
    """
    welded, begins = welded_vertices(meshes, welds)
    faces = np.concatenate([welded[mesh.triangles + begins[name]] for name, mesh in meshes.items()])
    try:
        loops = border_loops(orient(np.column_stack([faces, np.full(len(faces), -1, np.int32)]))[0])
    except InputError:
        return []
    lengths: dict[tuple[int, int], tuple[float, str]] = {}
    angle = np.zeros(len(welded))
    for name, mesh in meshes.items():
        for k in range(3):
            corner, *others = (mesh.points[mesh.triangles[:, (k + step) % 3]] @ [1.0, 1j] for step in range(3))
            np.add.at(
                angle,
                welded[mesh.triangles[:, k] + begins[name]],
                np.angle((others[1] - corner) / (others[0] - corner)),
            )
        edges = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
        along = np.linalg.norm(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]], axis=1).tolist()
        pairs = np.sort(welded[edges + begins[name]], axis=1).tolist()
        lengths |= {(a, b): (length, name) for (a, b), length in zip(pairs, along, strict=True)}
    found = []
    for loop in [part for whole in loops for part in _between_buttons(whole, meshes, welded, begins, buttons)]:
        sides = np.sort(np.column_stack([loop, np.roll(loop, -1)]), axis=1).tolist()
        on = [lengths[a, b] for a, b in sides if (a, b) in lengths]
        pieces = frozenset(name for _, name in on)
        turn = float((np.pi - angle[loop]).sum())
        found.append(Opening(vertices=loop, length=sum(length for length, _ in on), pieces=pieces, turn=turn))
    # Of two that are equally long, as armholes, the first is that of the first vertex, however their lengths are rounded.
    return sorted(found, key=lambda each: (-round(each.length, 6), int(each.vertices.min())))


def _between_buttons(
    loop: IntArray,
    meshes: Mapping[str, FlatMesh],
    welded: IntArray,
    begins: Mapping[str, int],
    buttons: Sequence[Weld],
) -> list[IntArray]:
    """Return the parts of a border that lie beyond the first and the last of the buttons that join it to itself."""
    parts, ends = [loop], list[tuple[int, ...]]()
    for layers in buttons:
        nearest = []
        for name, vertex in layers:
            own = welded[begins[name] : begins[name] + len(meshes[name].points)]
            far = np.linalg.norm(meshes[name].points - meshes[name].points[vertex], axis=1)
            nearest.append(int(own[np.where(np.isin(own, loop), far, np.inf).argmin()]))
        for k, part in enumerate(parts):
            if len({name for name, _ in layers}) == 2 and nearest[0] != nearest[1] and np.isin(nearest, part).all():
                first, last = sorted(int(np.flatnonzero(part == end)[0]) for end in nearest)
                parts[k : k + 1] = [part[first : last + 1], np.concatenate([part[last:], part[: first + 1]])]
                ends.append(tuple(nearest))
                break
    # What lies between two buttons is sewn to neither.
    return [part for part in parts if sum(bool(np.isin(pair, part).all()) for pair in ends) < 2]
