"""Pieces of one garment whose borders meet in space are sewn to each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.core.text import find_unused_name
from warpflat.flattening.result import Flattening
from warpflat.garment.seam_length import SeamLengths
from warpflat.garment.sewing import sew
from warpflat.garment.sewn import SeamPair, Sewn
from warpflat.solver.options import RelaxOptions
from warpflat.surface.border_seams import SAME_PLACE
from warpflat.surface.connectivity import border_loops, join_labels
from warpflat.surface.mesh import Surface
from warpflat.surface.repair.layers import Layer, lies_within

__all__ = ["SewnPieces", "meeting_borders", "name_seams", "sew_pieces", "unsewn_borders"]

#: Borders that run along each other within this distance [m] are meant to be sewn, or told.
BESIDE = 1e-3
# Of one border only places further apart along it than this [m] can be beside each other; shorter stretches than the second are corners.
_APART, _SHORTEST = 1e-2, 3e-3
# Distance [m] of places along borders that are compared, and how many there are at most.
_SAMPLES, _MOST_SAMPLES = 5e-4, 200_000
# A layer that keeps within this distance [m] of another one is its lining.
_LINING = 5e-3


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

    A stretch that has a line keeps that one. Lines along the border name a pattern's edges, and part it where they end.
    """
    named = {surface.name: dict(surface.lines) for surface in surfaces}
    for pair in meeting_borders({surface.name: surface for surface in surfaces}):
        if pair.pieces[0] != pair.pieces[1]:
            for own, other, row in zip(pair.pieces, pair.pieces[::-1], pair.vertices, strict=True):
                ends = {frozenset(row[:2].tolist()), frozenset(row[-2:].tolist())}
                known = (map(frozenset, pairwise(line.tolist())) for line in named[own].values())
                if not any(ends <= set(line) for line in known):
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


def unsewn_borders(surfaces: Mapping[str, Surface], *, without: Collection[tuple[int, int]] = ()) -> list[str]:
    """Describe the stretches of border that run along another one and are not sewn to it, the longest first.

    Args:
        surfaces: by name.
        without: edges that are sewn in another way, by their vertices, the lower first.
    """
    from scipy.spatial import cKDTree

    edges = _BorderEdges(surfaces, without)
    free = np.flatnonzero(edges.are_free())
    if len(free) == 0:
        return []
    start, way = edges.ends[free, 0], edges.ends[free, 1] - edges.ends[free, 0]
    length = np.linalg.norm(way, axis=1)
    spacing = max(_SAMPLES, float(length.sum()) / _MOST_SAMPLES)
    count = np.maximum(np.ceil(length / spacing), 1).astype(np.int64)
    of = np.repeat(np.arange(len(free)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    points = start[of] + share[:, None] * way[of]
    loop, piece = edges.loop[free][of], edges.piece[free][of]
    arc, around = edges.arc[free][of] + share * length[of], edges.around[free][of]
    here, there = cKDTree(points).query_pairs(BESIDE + 0.5 * spacing, output_type="ndarray").T
    apart = np.abs(arc[here] - arc[there])
    other = (loop[here] != loop[there]) | (np.minimum(apart, around[here] - apart) > _APART)
    # Both borders see each other: the first tells it.
    other &= (piece[here] != piece[there]) | (here < there)
    here, there = here[other], there[other]
    turned = piece[here] > piece[there]
    here, there = np.where(turned, there, here), np.where(turned, here, there)
    to, along = points[here] - start[of[there]], way[of[there]]
    foot = np.clip((to * along).sum(axis=1) / np.maximum(length[of[there]] ** 2, np.finfo(float).tiny), 0.0, 1.0)
    gap = np.linalg.norm(to - foot[:, None] * along, axis=1)
    order = np.lexsort((gap, here))
    order = order[gap[order] <= BESIDE]
    if len(order) == 0:
        return []
    order = order[np.append(True, np.diff(here[order]) > 0)]
    here, there, gap = here[order], there[order], gap[order]
    ends = (np.diff(here) > 1) | (np.diff(loop[here]) != 0) | (np.diff(loop[there]) != 0)
    told = list[tuple[float, str]]()
    for run in np.split(np.arange(len(here)), np.flatnonzero(ends) + 1):
        long = float((length[of[here[run]]] / count[of[here[run]]]).sum())
        if long >= _SHORTEST:
            names = edges.names[free[of[here[run[0]]]]], edges.names[free[of[there[run[0]]]]]
            whose = (
                f"borders of {names[0]} and {names[1]}"
                if names[0] != names[1]
                else f"two stretches of the border of {names[0]}"
            )
            place = ", ".join(f"{100 * x:.0f}" for x in points[here[run[len(run) // 2]]] + 0.0)
            words = (
                f"{whose} run {1e3 * float(np.median(gap[run])):.2f} mm apart for {1e3 * long:.0f} mm about ({place}) cm and are not "
                "sewn: only borders that agree vertex by vertex are, and no lining to its outer layer all around"
            )
            told.append((long, words))
    return [words for _, words in sorted(told, key=lambda entry: -entry[0])]


class _BorderEdges:
    """The border edges of several surfaces, along their loops, each with the one that lies at its place."""

    def __init__(self, surfaces: Mapping[str, Surface], without: Collection[tuple[int, int]]) -> None:
        from scipy.spatial import cKDTree

        self.names, self.tail, self.head = list[str](), list[int](), list[int]()
        self.next, self.before = list[int](), list[int]()
        points, piece, loops, arcs, around = [], list[int](), list[int](), list[FloatArray](), list[float]()
        for name, surface in surfaces.items():
            for loop in border_loops(surface.faces):
                first, count = len(self.tail), len(loop)
                self.names += [name] * count
                self.tail += loop.tolist()
                self.head += np.roll(loop, -1).tolist()
                self.next += [first + (k + 1) % count for k in range(count)]
                self.before += [first + (k - 1) % count for k in range(count)]
                points.append(surface.vertices[loop])
                arc = arc_lengths(surface.vertices[np.append(loop, loop[0])])
                arcs.append(arc[:-1])
                piece += [len(set(self.names)) - 1] * count
                loops += [len(points)] * count
                around += [float(arc[-1])] * count
        tails = np.concatenate(points)
        #: #E by 2 by 3 [m]; #E, piece and loop; #E, the arc length along the loop before the edge, and of the whole loop [m].
        self.ends = np.stack([tails, tails[self.next]], axis=1)
        self.piece, self.loop = np.array(piece), np.array(loops)
        self.arc, self.around = np.concatenate(arcs), np.array(around)
        pairs = cKDTree(tails).query_pairs(SAME_PLACE, output_type="ndarray")
        place = join_labels(len(self.tail), *pairs.T).tolist()
        self._ends = [(place[edge], place[self.next[edge]]) for edge in range(len(self.tail))]
        here: dict[tuple[int, ...], list[int]] = {}
        for edge, ends in enumerate(self._ends):
            own = sorted((self.tail[edge], self.head[edge]))
            if ends[0] != ends[1] and (own[0], own[1]) not in without:
                here.setdefault(tuple(sorted(ends)), []).append(edge)
        self._partner = {a: b for both in here.values() if len(both) == 2 for a, b in (both, both[::-1])}
        self._without = without
        self._leave_layers_apart(surfaces)

    def _leave_layers_apart(self, surfaces: Mapping[str, Surface]) -> None:
        """Sew no lining to its outer layer along its whole outline: both would be a bag."""
        others: dict[str, set[str]] = {}
        for edge, name in enumerate(self.names):
            others.setdefault(name, set()).add(self.names[self._partner[edge]] if edge in self._partner else "")
        for name, met in others.items():
            other = next(iter(met))
            if len(met) > 1 or other in ("", name):
                continue
            inner, outer = (Layer(surfaces[key].vertices, surfaces[key].faces) for key in (name, other))
            if lies_within(inner, outer, _LINING):
                self._partner = {
                    a: b for a, b in self._partner.items() if {self.names[a], self.names[b]} != {name, other}
                }

    def are_free(self) -> BoolArray:
        """Return #E, which edges are sewn to none."""
        return np.array(
            [
                edge not in self._partner and (min(ends), max(ends)) not in self._without
                for edge, ends in enumerate(zip(self.tail, self.head, strict=True))
            ]
        )

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
