"""Pieces of meshes are sewn, each to itself and to the others: at cuts, at seams that are named, where borders meet in space."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from warpflat.core import BoolArray, InputError, IntArray, arc_lengths, find_unused_name, unit
from warpflat.flat import Flattening, Layer, RelaxOptions, Surface, border_loops, join_labels, lies_within
from warpflat.garment.construction.border_seams import ONE_CURVE, surface_seams
from warpflat.garment.construction.closed_cuts import seams_of_cuts
from warpflat.garment.construction.constraints import Constraint, KeptGirth
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.fullness import FullEdge, give_fullness
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.meet import SAME_PLACE
from warpflat.garment.construction.mirror import even_sides, image_laid, mirror_images
from warpflat.garment.construction.sewing import sew
from warpflat.garment.construction.sewn import Sewn, Stitching
from warpflat.garment.construction.straight_band import cut_straight, find_band
from warpflat.pattern import find_corners

__all__ = ["Bands", "meeting_borders", "name_seams", "sew_pieces", "unsewn_borders", "unsewn_notes"]

#: Which bands are cut straight.
Bands = Literal["auto", "straight", "as worn"]

# A layer that keeps this near [m] to another one is its lining. Borders of a piece that is sewn to no other are reported where another
# piece is as near, too; the cosine of the way there and the border is less than the second.
_NEARLY, _AHEAD = 5e-3, 0.7
# Of one border only places further apart along it than this [m] can be beside each other; shorter stretches than the second are corners.
_APART, _SHORTEST = 1e-2, 3e-3
# So many stretches that are not sewn are told one by one.
_MOST_TOLD = 20
# Distance [m] of places along borders that are compared, and how many there are at most.
_SAMPLES, _MOST_SAMPLES = 5e-4, 200_000
# Layouts of mirrored pieces that differ by less than this [m] are two roundings of one.
_ALIKE = 5e-3
# A band that its mesh says is straight is so many times as long as wide, and this share of one side is sewn, and not of the other.
_SLENDER, _SEWN = 15.0, 0.8


def sew_pieces(
    pieces: Sequence[Flattening],
    constraints: Sequence[Constraint] = (),
    *,
    seams: Sequence[SeamTable] = (),
    options: RelaxOptions | None = None,
    name: str | None = None,
    eased: bool = False,
    bands: Bands = "as worn",
    shorter: float = 0.0,
    relaxed: bool = True,
) -> Garment:
    """Relax pieces of meshes again, all together, so that seams and darts match and constraints hold.

    Sewn are the two sides of every cut, the seams that are named, and borders that meet in space, of two pieces or of one that was
    cut open in its file.

    Args:
        pieces: flattened one by one, of one fabric and of different names, perhaps cut.
        constraints: on lines of pieces.
        seams: between lines along the border of the first piece.
        options: of the relaxation.
        name: of the garment; that of the first piece if not given.
        eased: whether the two sides of a seam where borders meet are as long as each other as a whole, what one has more here eased in
            there; otherwise they are alike edge by edge. Darts and seams that close a piece to a tube are.
        bands: long strips of even width that are cut straight, and stretched as they are sewn: "straight" all, "auto" those that are closed
            to a ring, at least fifteen times as long as wide, and sewn along one side; "as worn" none. One that a constraint holds is none.
        shorter: the share by which these are cut shorter than their shorter side is worn.
        relaxed: whether they are relaxed together; if not, each keeps its layout, and the seams only say what meets what.

    Returns:
        The garment; its `sewn` is None where there is nothing to be sewn or held, or nothing was relaxed.

    Raises:
        InputError: a constraint or a seam names a line that its piece does not have, or asks what the line cannot be.
        StepError: the pieces cannot be relaxed together.
    """
    flat = {piece.surface.name: piece for piece in pieces}
    first = next(iter(flat))
    found = surface_seams(flat[first].network.surface, seams)
    # More cloth along the sides that are meant to be longer.
    longer = [
        (seam, pair.vertices[seam.longer_line]) for seam, pair in zip(seams, found, strict=True) if seam.factor > 1.0
    ]
    if longer and flat[first].cuts:
        raise InputError(
            f"seam {longer[0][0].name!r}: fullness and gathers need a piece that is not cut; leave out the cuts or the fullness"
        )
    if longer:
        full = [FullEdge(vertices=row, factor=seam.factor, gathered=seam.gathered) for seam, row in longer]
        rows = [row for pair in found for row in pair.vertices]
        flat[first] = give_fullness(flat[first], full, rows, options=options)
    pairs = [
        Stitching(
            name=title, pieces=(name, name), vertices=(seam.left, seam.right),
            sides=(f"{name}.{title}.left", f"{name}.{title}.right"),
        )
        for name, piece in flat.items()
        for title, _, seam in seams_of_cuts(piece)
    ]  # fmt: skip
    pairs += found
    borders = {name: piece.network.surface for name, piece in flat.items()}
    for pair in meeting_borders(borders, without=_sewn_edges(pairs)):
        if len(flat) > 1:
            if eased and pair.pieces[0] != pair.pieces[1]:
                for part in _between_corners(pair, flat):
                    title = find_unused_name(pair.name, {other.name for other in pairs})
                    pairs.append(replace(part, name=title, sides=pair.pieces, eased=True))
            else:
                pairs.append(replace(pair, sides=pair.pieces))
            continue
        # What was cut open before, here or in the file, is sewn like any cut, and called by the line along which that was.
        sides, opening = {frozenset(side[:2].tolist()) for side in pair.vertices}, None
        for line, row in flat[first].network.surface.lines.items():
            side = re.fullmatch(r"(.+)\.(left|right)(\.\d+)?'*", line)
            if side is not None and not sides.isdisjoint(map(frozenset, pairwise(row.tolist()))):
                opening = side[1]
                break
        title = find_unused_name(opening or pair.name, {other.name for other in pairs})
        along = f"{first}.{opening or title}"
        pairs.append(replace(pair, name=title, sides=(f"{along}.left", f"{along}.right")))
    straight = (
        {} if bands == "as worn" else _straight_bands(flat, pairs, constraints, closed=bands == "auto", shorter=shorter)
    )
    flat |= straight
    rest = [pair for pair in pairs if straight.keys().isdisjoint(pair.pieces)]
    sewn: Sewn | None = None
    if relaxed and (rest or constraints):
        sewn = _sew_evenly(
            {name: piece for name, piece in flat.items() if name not in straight}, rest, constraints, options
        )
        flat |= sewn.pieces
        sewn = replace(sewn, pieces=flat)
    # What is sewn to a straight band keeps its length; the band is stretched to it.
    pairs = [pair if straight.keys().isdisjoint(pair.pieces) else pair.as_laid(flat) for pair in pairs]
    return Garment(name=name or first, pieces=flat, stitching=pairs, border_seams=seams, sewn=sewn)


def _sewn_edges(pairs: Sequence[Stitching]) -> set[tuple[str, int, int]]:
    """Return the edges that are sewn, by piece and vertices, the lower first."""
    return {
        (name, min(edge), max(edge))
        for pair in pairs
        for name, row in zip(pair.pieces, pair.vertices, strict=True)
        for edge in pairwise(row.tolist())
    }


def _between_corners(pair: Stitching, flat: Mapping[str, Flattening]) -> list[Stitching]:
    """Return a seam parted where both of its sides have a corner: there its pattern is parted, too, and each part has two sides as long."""
    first, second = pair.vertices
    corners = set(range(1, len(first) - 1))
    for name, row in zip(pair.pieces, pair.vertices, strict=True):
        loop = border_loops(flat[name].network.surface.faces)[0]
        own = loop[sorted(find_corners(flat[name].positions[loop]))]
        corners &= set(np.flatnonzero(np.isin(row, own)).tolist())
    ends = pairwise([0, *sorted(corners), len(first) - 1])
    return [replace(pair, vertices=(first[a : b + 1], second[a : b + 1])) for a, b in ends]


def _sew_evenly(
    flat: dict[str, Flattening],
    pairs: Sequence[Stitching],
    constraints: Sequence[Constraint],
    options: RelaxOptions | None,
) -> Sewn:
    """Sew pieces as :func:`warpflat.sew`, those that are mirror images from the same layout and to the same one."""
    # One pattern serves for both pieces of a pair only where both are the same: they are sewn from the same layout.
    images = mirror_images({name: piece.network.surface for name, piece in flat.items()}) if len(flat) > 1 else {}
    if any(piece.grain_angle for piece in flat.values()):
        images = {}
    for name, (mate, partners) in images.items():
        if list(flat).index(mate) < list(flat).index(name):
            own = flat[name].positions
            laid = image_laid(own, flat[mate].positions, partners)
            if np.abs(laid - own).max() < _ALIKE:
                flat[name] = replace(flat[name], positions=laid)
    sewn = sew(flat, pairs, constraints=constraints, options=options)
    even = even_sides({name: sewn.pieces[name].positions for name in flat}, images)
    return replace(sewn, pieces={name: replace(sewn.pieces[name], positions=even[name]) for name in flat})


def _straight_bands(
    flat: Mapping[str, Flattening],
    pairs: Sequence[Stitching],
    constraints: Sequence[Constraint],
    *,
    closed: bool,
    shorter: float,
) -> dict[str, Flattening]:
    """Return the bands, cut straight, by name.

    Args:
        flat: all pieces, relaxed.
        pairs: what is sewn.
        constraints: pieces that one holds are left as they are.
        closed: only those whose mesh says so: a slender ring that is sewn along one of its sides.
        shorter: as :func:`sew_pieces` takes it.
    """
    held = {each.piece for each in constraints if not isinstance(each, KeptGirth)}
    found = {}
    for name, piece in flat.items():
        band = None if name in held else find_band(piece)
        if band is None:
            continue
        # What is sewn to itself (at its ends), and to other pieces.
        own, others = (
            [
                v
                for pair in pairs
                for k in (0, 1)
                if pair.pieces[k] == name and (len(set(pair.pieces)) == 1) == alone
                for v in pair.vertices[k]
            ]
            for alone in (True, False)
        )
        ends = np.concatenate([side[[0, -1]] for side in band.sides])
        ring = bool(np.isin(ends, own).all())
        sewn = [float(np.isin(side[1:-1], others).mean()) if len(side) > 2 else 0.0 for side in band.sides]
        if closed and not (ring and band.slenderness > _SLENDER and max(sewn) > _SEWN and min(sewn) < 1.0 - _SEWN):
            continue
        made = cut_straight(piece, band, shorter=shorter)
        if made is not None:
            found[name] = made
    return found


def name_seams(surfaces: Sequence[Surface]) -> list[Surface]:
    """Return the surfaces with a line along each stretch of border that meets another piece, by that piece's name: "to front".

    A stretch that has a line keeps that one. Lines along the border name a pattern's edges, and part it where they end.
    """
    named = {surface.name: dict(surface.lines) for surface in surfaces}
    for pair in meeting_borders({surface.name: surface for surface in surfaces}):
        if pair.pieces[0] != pair.pieces[1]:
            for name, other, row in zip(pair.pieces, pair.pieces[::-1], pair.vertices, strict=True):
                ends = {frozenset(row[:2].tolist()), frozenset(row[-2:].tolist())}
                known = (map(frozenset, pairwise(line.tolist())) for line in named[name].values())
                if not any(ends <= set(line) for line in known):
                    named[name][find_unused_name(f"to {other}", named[name])] = row
    return [replace(surface, lines=named[surface.name]) for surface in surfaces]


def meeting_borders(
    surfaces: Mapping[str, Surface], *, without: Collection[tuple[str, int, int]] = ()
) -> list[Stitching]:
    """Return the stretches of border that lie at one place in space, edge by edge: seams between pieces, and darts.

    Three borders that meet along one edge are no seam there.

    Args:
        surfaces: by name.
        without: edges that are left out, by piece and vertices, the lower first.
    """
    edges = _BorderEdges(surfaces, without)
    pairs: list[Stitching] = []
    taken: set[str] = set()
    for first, second in edges.stretches():
        pieces = edges.names[first[0]], edges.names[second[0]]
        vertices = edges.chains(first, second)
        if pieces[0] != pieces[1]:
            plain = f"{pieces[0]} to {pieces[1]}"
        else:
            plain = f"{'dart' if (vertices[0] == vertices[1]).any() else 'seam'} of {pieces[0]}"
        name = find_unused_name(plain.replace("_", " "), taken)
        taken.add(name)
        pairs.append(Stitching(name=name, pieces=pieces, vertices=vertices))
    return pairs


def unsewn_notes(garment: Garment) -> list[str]:
    """Return a note on each stretch of border of meshes that runs along another and is not sewn, and on how many more there are."""
    joined = {name for pair in garment.stitching if pair.pieces[0] != pair.pieces[1] for name in pair.pieces}
    found = unsewn_borders(
        {name: piece.network.surface for name, piece in garment.pieces.items()},
        without=_sewn_edges(garment.stitching),
        alone=garment.pieces.keys() - joined,
    )
    left = len(found) - _MOST_TOLD
    more = [f"{left} more stretches of border run along others and are not sewn"] if left > 0 else []
    alone = len(garment.pieces) > 1 and not garment.stitching
    none = ["no borders meet in space, vertex by vertex: the pieces are not sewn to each other"] if alone else []
    return [*found[:_MOST_TOLD], *more, *none]


def unsewn_borders(
    surfaces: Mapping[str, Surface], *, without: Collection[tuple[str, int, int]] = (), alone: Collection[str] = ()
) -> list[str]:
    """Describe the stretches of border that run along another one and are not sewn to it, the longest first.

    Args:
        surfaces: by name.
        without: edges that are sewn in another way, by piece and vertices, the lower first.
        alone: pieces that are sewn to no other: stretches that run somewhat farther from another piece are described, too.
    """
    from scipy.spatial import cKDTree

    edges = _BorderEdges(surfaces, without)
    free = np.flatnonzero(edges.are_free())
    if len(free) == 0:
        return []
    start, edge = edges.ends[free, 0], edges.ends[free, 1] - edges.ends[free, 0]
    length = np.linalg.norm(edge, axis=1)
    spacing = max(_SAMPLES, float(length.sum()) / _MOST_SAMPLES)
    count = np.maximum(np.ceil(length / spacing), 1).astype(np.int64)
    of = np.repeat(np.arange(len(free)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    points = start[of] + share[:, None] * edge[of]
    loop, piece = edges.loop[free][of], edges.piece[free][of]
    arc, around = edges.arc[free][of] + share * length[of], edges.around[free][of]
    here, there = (
        cKDTree(points).query_pairs((_NEARLY if alone else ONE_CURVE) + 0.5 * spacing, output_type="ndarray").T
    )
    apart = np.abs(arc[here] - arc[there])
    other = (loop[here] != loop[there]) | (np.minimum(apart, around[here] - apart) > _APART)
    # Both borders see each other: the first tells it.
    other &= (piece[here] != piece[there]) | (here < there)
    here, there = here[other], there[other]
    turned = piece[here] > piece[there]
    here, there = np.where(turned, there, here), np.where(turned, here, there)
    to, along = points[here] - start[of[there]], edge[of[there]]
    foot = np.clip((to * along).sum(axis=1) / np.maximum(length[of[there]] ** 2, np.finfo(float).tiny), 0.0, 1.0)
    gap = np.linalg.norm(to - foot[:, None] * along, axis=1)
    order = np.lexsort((gap, here))
    by_itself = np.array([name in alone for name in edges.names])[free][of]
    # The other border lies to the side of one that runs along it, and ahead of one that ends there.
    way = unit(edge[of[here]])
    beside = np.abs(((to - foot[:, None] * along) * way).sum(axis=1)) < _AHEAD * gap
    nearly = (by_itself[here] | by_itself[there]) & (piece[here] != piece[there]) & beside
    order = order[gap[order] <= np.where(nearly, _NEARLY, ONE_CURVE)[order]]
    if len(order) == 0:
        return []
    order = order[np.append(True, np.diff(here[order]) > 0)]
    here, there, gap = here[order], there[order], gap[order]
    ends = (np.diff(here) > 1) | (np.diff(loop[here]) != 0) | (np.diff(loop[there]) != 0)
    notes = list[tuple[float, str]]()
    for run in np.split(np.arange(len(here)), np.flatnonzero(ends) + 1):
        long = float((length[of[here[run]]] / count[of[here[run]]]).sum())
        if long >= _SHORTEST:
            names = edges.names[free[of[here[run[0]]]]], edges.names[free[of[there[run[0]]]]]
            whose = (
                f"borders of {names[0]} and {names[1]}"
                if names[0] != names[1]
                else f"two stretches of the border of {names[0]}"
            )
            # At its ends a border goes on past the other.
            farthest = float(np.quantile(gap[run], 0.9))
            why = (
                "only two borders that agree vertex by vertex are, and no lining to its outer layer all around"
                if farthest <= ONE_CURVE
                else f"surface.meet_mm (--meet) {np.ceil(1e3 * farthest + 0.5):.0f} makes them meet"
            )
            place = ", ".join(f"{100 * x:.0f}" for x in points[here[run[len(run) // 2]]] + 0.0)
            words = (
                f"{whose} run {1e3 * float(np.median(gap[run])):.2f} mm apart for {1e3 * long:.0f} mm about ({place}) cm and are not "
                f"sewn: {why}"
            )
            notes.append((long, words))
    return [words for _, words in sorted(notes, key=lambda entry: -entry[0])]


class _BorderEdges:
    """The border edges of several surfaces, along their loops, each with the one that lies at its place."""

    def __init__(self, surfaces: Mapping[str, Surface], without: Collection[tuple[str, int, int]]) -> None:
        from scipy.spatial import cKDTree

        loops = [(name, loop) for name, surface in surfaces.items() for loop in border_loops(surface.faces)]
        sizes = np.array([len(loop) for _, loop in loops])
        first = np.repeat(np.cumsum(sizes) - sizes, sizes)
        place, count = np.arange(len(first)) - first, np.repeat(sizes, sizes)
        tail, following = np.concatenate([loop for _, loop in loops]), first + (place + 1) % count
        arcs = [arc_lengths(surfaces[name].vertices[loop], closed=True) for name, loop in loops]
        tails = np.concatenate([surfaces[name].vertices[loop] for name, loop in loops])
        self.names = [name for name, loop in loops for _ in range(len(loop))]
        self.tail, self.head = tail.tolist(), tail[following].tolist()
        self.next, self.before = following.tolist(), (first + (place - 1) % count).tolist()
        #: #E by 2 by 3 [m]; #E, piece and loop; #E, the arc length along the loop before the edge, and of the whole loop [m].
        self.ends = np.stack([tails, tails[following]], axis=1)
        self.piece = np.repeat([list(surfaces).index(name) for name, _ in loops], sizes)
        self.loop = np.repeat(np.arange(len(loops)), sizes)
        self.arc, self.around = np.concatenate([arc[:-1] for arc in arcs]), np.repeat([arc[-1] for arc in arcs], sizes)
        pairs = cKDTree(tails).query_pairs(SAME_PLACE, output_type="ndarray")
        places = join_labels(len(tail), *pairs.T).tolist()
        self._ends = [(places[edge], places[self.next[edge]]) for edge in range(len(tail))]
        here: dict[tuple[int, ...], list[int]] = {}
        for edge, ends in enumerate(self._ends):
            own = sorted((self.tail[edge], self.head[edge]))
            if ends[0] != ends[1] and (self.names[edge], own[0], own[1]) not in without:
                here.setdefault(tuple(sorted(ends)), []).append(edge)
        self._partner = {a: b for both in here.values() if len(both) == 2 for a, b in (both, both[::-1])}
        self._without = without
        # No lining is sewn to its outer layer along its whole outline: both would be a bag.
        others: dict[str, set[str]] = {}
        for edge, name in enumerate(self.names):
            others.setdefault(name, set()).add(self.names[self._partner[edge]] if edge in self._partner else "")
        for name, met in others.items():
            other = next(iter(met))
            if len(met) > 1 or other in ("", name):
                continue
            inner, outer = (Layer(surfaces[key].vertices, surfaces[key].faces) for key in (name, other))
            if lies_within(inner, outer, _NEARLY):
                self._partner = {
                    a: b for a, b in self._partner.items() if {self.names[a], self.names[b]} != {name, other}
                }

    def are_free(self) -> BoolArray:
        """Return #E, which edges are sewn to none."""
        return np.array(
            [
                edge not in self._partner and (name, min(ends), max(ends)) not in self._without
                for edge, (name, *ends) in enumerate(zip(self.names, self.tail, self.head, strict=True))
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
            yield first, [self._partner[one] for one in first]

    def chains(self, first: Sequence[int], second: Sequence[int]) -> tuple[IntArray, IntArray]:
        """Return the vertices along two rows of edges that meet, in the same order in space; the first runs as its border does."""
        starts, ends = (
            (self.tail, self.head) if self._ends[first[0]] == self._ends[second[0]] else (self.head, self.tail)
        )
        one = [*(self.tail[edge] for edge in first), self.head[first[-1]]]
        other = [*(starts[edge] for edge in second), ends[second[-1]]]
        return np.array(one, dtype=np.int32), np.array(other, dtype=np.int32)
