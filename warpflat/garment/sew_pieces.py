"""Pieces of one garment whose borders meet in space are sewn to each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpflat.core.polyline import polyline_length
from warpflat.core.text import find_unused_name
from warpflat.flattening.result import Flattening
from warpflat.garment.seam_length import SeamLengths
from warpflat.garment.sewing import sew
from warpflat.garment.sewn import SeamPair, Sewn
from warpflat.solver.options import RelaxOptions
from warpflat.surface.border_seams import SAME_PLACE
from warpflat.surface.connectivity import border_loops, join_labels
from warpflat.surface.mesh import Surface

__all__ = ["SewnPieces", "meeting_borders", "name_seams", "sew_pieces"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SewnPieces:
    """Pieces relaxed together under the seams between them.

    Attributes:
        pieces: in their order.
        sewn: outcome of the relaxation.
        seams: measured.
    """

    pieces: tuple[Flattening, ...]
    sewn: Sewn
    seams: tuple[SeamLengths, ...]

    def metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` besides the pieces."""
        return {"seams": [seam.as_dict() for seam in self.seams], "constraints": [], "sewing": self.sewn.as_dict()}


def sew_pieces(pieces: Sequence[Flattening], *, options: RelaxOptions | None = None) -> SewnPieces | None:
    """Relax pieces again so that both sides of seams and darts are equally long; None where no borders meet.

    Args:
        pieces: flattened one by one, of one fabric and of different names.
        options: of the relaxation.
    """
    pairs = meeting_borders({piece.surface.name: piece.surface for piece in pieces})
    if not pairs:
        return None
    sewn = sew({piece.surface.name: piece for piece in pieces}, pairs, options=options)
    after = {name: sewn.pieces[name] for name in (piece.surface.name for piece in pieces)}
    measured = []
    for pair, result in zip(pairs, sewn.results, strict=False):
        first, second = (
            polyline_length(after[name].positions[row]) for name, row in zip(pair.pieces, pair.vertices, strict=True)
        )
        measured.append(
            SeamLengths(
                name=pair.name,
                sides=pair.pieces,
                length_3d=polyline_length(after[pair.pieces[0]].surface.vertices[pair.vertices[0]]),
                lengths=(first, second),
                cost=result.cost,
            )
        )
    return SewnPieces(pieces=tuple(after.values()), sewn=sewn, seams=tuple(measured))


def name_seams(surfaces: Sequence[Surface]) -> list[Surface]:
    """Return the surfaces with a line along each stretch of border that meets another piece, by that piece's name: "to front".

    Lines along the border name a pattern's edges, and part it where they end.
    """
    named = {surface.name: dict(surface.lines) for surface in surfaces}
    for pair in meeting_borders({surface.name: surface for surface in surfaces}):
        if pair.pieces[0] != pair.pieces[1]:
            for own, other, row in zip(pair.pieces, pair.pieces[::-1], pair.vertices, strict=True):
                named[own][find_unused_name(f"to {other}", named[own])] = row
    return [replace(surface, lines=named[surface.name]) for surface in surfaces]


def meeting_borders(surfaces: Mapping[str, Surface], *, without: Collection[tuple[int, int]] = ()) -> list[SeamPair]:
    """Return the stretches of border that lie at one place in space, edge by edge: seams between pieces, and darts.

    Three borders that meet along one edge are no seam there.

    Args:
        surfaces: by name.
        without: edges that are left out, by their vertices, the lower first.
    """
    edges = _BorderEdges(surfaces, without)
    pairs: list[SeamPair] = []
    taken: set[str] = set()
    for first, second in edges.stretches():
        pieces = edges.names[first[0]], edges.names[second[0]]
        vertices = edges.chain(first), edges.chain(second)
        if pieces[0] != pieces[1]:
            plain = f"{pieces[0]} to {pieces[1]}"
        else:
            plain = f"{'dart' if (vertices[0] == vertices[1]).any() else 'seam'} of {pieces[0]}"
        name = find_unused_name(plain, taken)
        taken.add(name)
        pairs.append(SeamPair(name=name, pieces=pieces, vertices=vertices))
    return pairs


class _BorderEdges:
    """The border edges of several surfaces, along their loops, each with the one that lies at its place."""

    def __init__(self, surfaces: Mapping[str, Surface], without: Collection[tuple[int, int]]) -> None:
        from scipy.spatial import cKDTree

        self.names, self.tail, self.head = list[str](), list[int](), list[int]()
        self.next, self.before = list[int](), list[int]()
        points = []
        for name, surface in surfaces.items():
            for loop in border_loops(surface.faces):
                first, count = len(self.tail), len(loop)
                self.names += [name] * count
                self.tail += loop.tolist()
                self.head += np.roll(loop, -1).tolist()
                self.next += [first + (k + 1) % count for k in range(count)]
                self.before += [first + (k - 1) % count for k in range(count)]
                points.append(surface.vertices[loop])
        pairs = cKDTree(np.concatenate(points)).query_pairs(SAME_PLACE, output_type="ndarray")
        place = join_labels(len(self.tail), *pairs.T).tolist()
        self._ends = [(place[edge], place[self.next[edge]]) for edge in range(len(self.tail))]
        here: dict[tuple[int, ...], list[int]] = {}
        for edge, ends in enumerate(self._ends):
            own = sorted((self.tail[edge], self.head[edge]))
            if ends[0] != ends[1] and (own[0], own[1]) not in without:
                here.setdefault(tuple(sorted(ends)), []).append(edge)
        self._partner = {a: b for both in here.values() if len(both) == 2 for a, b in (both, both[::-1])}

    def stretches(self) -> Iterator[tuple[list[int], list[int]]]:
        """Yield the edges of stretches that meet, in the same order in space."""
        used: set[int] = set()
        for edge in self._partner:
            if edge in used:
                continue
            first = [edge]
            used |= {edge, self._partner[edge]}
            for step, other in ((self.next, self.before), (self.before, self.next)):
                while True:
                    end = first[-1] if step is self.next else first[0]
                    following, partner = step[end], self._partner[end]
                    met = self._partner.get(following)
                    against = self._ends[end] != self._ends[partner]
                    if met is None or following in used or met != (other if against else step)[partner]:
                        break
                    used |= {following, met}
                    first = [*first, following] if step is self.next else [following, *first]
            if len(first) > 1:
                yield first, [self._partner[one] for one in first]

    def chain(self, edges: Sequence[int]) -> np.ndarray[Any, np.dtype[np.int32]]:
        """Return the vertices along edges that follow each other, with or against the border's direction."""
        if self.next[edges[0]] == edges[1]:
            return np.array([*(self.tail[edge] for edge in edges), self.head[edges[-1]]], dtype=np.int32)
        return np.array([*(self.head[edge] for edge in edges), self.tail[edges[-1]]], dtype=np.int32)
