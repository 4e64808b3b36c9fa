"""The openings of a sewn garment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import InputError, IntArray
from warpflat.flat import border_loops, orient
from warpflat.garment.draping.mesh_pieces import Weld
from warpflat.garment.draping.sewn_cloth import SewnCloth

__all__ = ["Opening", "find_openings"]

# An opening that turns by nearly a full turn goes around a hole in the cloth, as of a pocket, unless it is so long [m].
_HOLE, _LONG = -1.9 * np.pi, 0.4


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

    @property
    def is_hole(self) -> bool:
        """Whether it is a hole in the cloth, through which nothing goes."""
        return self.turn <= _HOLE and self.length <= _LONG


def find_openings(cloth: SewnCloth, buttons: Sequence[Weld] = ()) -> list[Opening]:
    """Return the openings of pieces that are sewn together, the longest first; none where their seams make no surface.

    A border that runs along both fronts of a buttoned garment is two: one beyond the first button, one beyond the last.

    Args:
        cloth: of triangles.
        buttons: what joins points inside two pieces.
    """
    try:
        loops = border_loops(orient(cloth.faces)[0])
    except InputError:
        return []
    lengths, angle = cloth.edge_lengths(), np.zeros(len(cloth.designed))
    for k in range(3):
        corner, *others = (cloth.flat[cloth.flat_faces[:, (k + step) % 3]] @ [1.0, 1j] for step in range(3))
        np.add.at(angle, cloth.faces[:, k], np.angle((others[1] - corner) / (others[0] - corner)))
    found = []
    for loop in [part for whole in loops for part in _between_buttons(whole, cloth, buttons)]:
        length, turn = float(lengths[loop, np.roll(loop, -1)].sum()), float((np.pi - angle[loop]).sum())
        on = {name: np.isin(loop, cloth.welded[rows]) for name, rows in cloth.piece_vertices.items()}
        pieces = frozenset(name for name, ends in on.items() if (ends & np.roll(ends, -1)).any())
        found.append(Opening(vertices=loop, length=length, pieces=pieces, turn=turn))
    # Of two that are equally long, as armholes, the first is that of the first vertex, however their lengths are rounded.
    return sorted(found, key=lambda each: (-round(each.length, 6), int(each.vertices.min())))


def _between_buttons(loop: IntArray, cloth: SewnCloth, buttons: Sequence[Weld]) -> list[IntArray]:
    """Return the parts of a border that lie beyond the first and the last of the buttons that join it to itself."""
    parts, ends = [loop], list[tuple[int, ...]]()
    for layers in buttons:
        nearest = []
        for name, vertex in layers:
            own, flat = (rows[cloth.piece_vertices[name]] for rows in (cloth.welded, cloth.flat))
            far = np.linalg.norm(flat - flat[vertex], axis=1)
            nearest.append(int(own[np.where(np.isin(own, loop), far, np.inf).argmin()]))
        for k, part in enumerate(parts):
            if len({name for name, _ in layers}) == 2 and nearest[0] != nearest[1] and np.isin(nearest, part).all():
                first, last = sorted(int(np.flatnonzero(part == end)[0]) for end in nearest)
                parts[k : k + 1] = [part[first : last + 1], np.concatenate([part[last:], part[: first + 1]])]
                ends.append(tuple(nearest))
                break
    # What lies between two buttons is sewn to neither.
    return [part for part in parts if sum(bool(np.isin(pair, part).all()) for pair in ends) < 2]
