"""Seams measured and notched: equal marks at equal lengths on both sides of every seam."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from warpflat.core import FloatArray, arc_lengths, points_at_lengths, unit
from warpflat.pattern.drafting.allowance import CutOutline
from warpflat.pattern.drafting.drafted import DraftedPiece, Notch, SeamReport
from warpflat.pattern.drafting.pieces import Piece, Place, Seam, SeamSide
from warpflat.pattern.drafting.seam_difference import (
    LOCAL_TOLERANCE,
    eased_length,
    lengths_along_side,
    worst_difference,
)
from warpflat.pattern.drafting.sides import Wedge

__all__ = [
    "SeamLine",
    "copied_together",
    "cut_darts",
    "dart_notches",
    "even_notches",
    "opposite_length",
    "seam_notches",
    "seam_reports",
]


#: Notches are cut this deep [m], and never deeper than this share of the allowance.
DEPTH, MOST_OF_ALLOWANCE = 0.005, 0.6
#: Depth [m] on an edge without allowance.
RAW_DEPTH = 0.003
#: Seams shorter than this [m] get no notch of their own; longer ones get one per `SPACING` [m].
SHORTEST, SPACING = 0.080, 0.200
#: The two slits of a double notch stand this far [m] apart.
DOUBLE_SPACING = 0.008
#: Least distance [m] of a notch from a joint of edges, in which it would be lost.
CLEAR = 0.012
#: Where a side cannot be notched, the notch is tried at these shares of its distance from the seam's start.
SHARES_FROM_START = (1.0, 0.5, 0.25)


def seam_reports(seams: Sequence[Seam], pieces: Mapping[str, DraftedPiece], size: str) -> list[SeamReport]:
    """Measure both sides of every seam along the fitted sewing lines, and how far its notches miss each other."""
    reports, groups = [], copied_together(seams)
    for seam in seams:
        lines = [SeamLine(side, pieces) for side in seam.sides]
        first, second = (line.length for line in lines)
        # Edges that come from no mesh have no common vertices, nor need copies of equal pieces.
        worst = None
        if all(edge.mesh_vertices is not None for line in lines for edge in line.edges) and (
            len(lines[0].places) == len(lines[1].places)
        ):
            laid = (lines[0].laid, lines[1].laid) if seam.as_laid else None
            worst = worst_difference(lines[0].places, lines[1].places, seam.ease, seam.eased, laid=laid)
        # A notch meets a notch or a joint of the other side; of equal edges one is drawn, and its notches are those of all.
        marked = [line.marked(groups[seam.name]) for line in lines]
        joints = [np.concatenate([row, line.joints]) for row, line in zip(marked, lines, strict=True)]
        gaps = [
            float(np.abs(joints[1 - side] - opposite_length(seam, lines, side, at)).min())
            for side in (0, 1)
            for at in marked[side]
        ]
        reports.append(
            SeamReport(
                name=seam.name,
                size=size,
                sides=(" + ".join(map(str, seam.sides[0])), " + ".join(map(str, seam.sides[1]))),
                length_mm=(first * 1000, second * 1000),
                ease=seam.ease,
                difference_mm=(second - first * (1 + seam.ease)) * 1000,
                local_mm=None if worst is None else 1000 * worst,
                notches_mm=1000 * max(gaps) if gaps else None,
            )
        )
    return reports


def seam_notches(seams: Sequence[Seam], pieces: Mapping[str, DraftedPiece]) -> dict[str, list[Notch]]:
    """Return the notches of seams by piece.

    Both sides of a seam get a notch at the same fraction of the seam's length, which is the same length wherever the
    sides are equal; ease is spread evenly, or between two notches. Fractions are not symmetric about the middle, so that a side sewn on the
    wrong way round shows. Where one side has a joint (a shoulder seam at a sleeve's cap, a dart in a side seam) the
    other side gets a single notch for it. Notches on a back are double, unless it is sewn to a front.

    A piece that is cut more than once is drawn once: each of its notches is one of all its copies, and what these are sewn to gets
    notches for them too.

    Where one side's allowance is not cut (deep in a dart, where it meets that of the other leg), the place is moved
    towards the seam's start, on both sides.
    """
    lines = [[SeamLine(side, pieces) for side in seam.sides] for seam in seams]
    # Where each edge is sewn: number and side of the seam, place in that side.
    sewn: dict[Place, list[tuple[int, int, int]]] = {}
    for number, seam in enumerate(seams):
        for at, row in enumerate(seam.sides):
            for place, side in enumerate(row):
                sewn.setdefault(side.place, []).append((number, at, place))
    groups = copied_together(seams)
    #: By group of seams and edge the lengths along it at which it has a notch.
    placed: dict[tuple[frozenset[str], str, str], list[float]] = {}
    notches: dict[str, list[Notch]] = {}

    def place_all(number: int, side: int, length: float, double: bool, clear: float) -> bool:
        """Place a notch and all that meet it; none, and return False, if one cannot be cut or lies within `clear` of a joint."""
        waiting, seen = [(number, side, length)], list[tuple[int, int, float]]()
        found: dict[tuple[frozenset[str], str, str], list[float]] = {}
        made: list[tuple[str, Notch]] = []
        while waiting:
            number, side, length = waiting.pop()
            seam, line = seams[number], lines[number][side]
            apart = float(np.abs(line.joints - length).min())
            if apart <= LOCAL_TOLERANCE or any(
                (n, k) == (number, side) and abs(x - length) <= LOCAL_TOLERANCE for n, k, x in seen
            ):
                continue
            seen.append((number, side, length))
            part = line.index(length)
            here, local = line.side[part], length - float(line.joints[part])
            along = line.edges[part].length - local if here.reversed else local
            key = groups[seam.name], here.piece, here.edge
            copies = list[tuple[int, int, float, SeamSide]]()
            for other, at, place in sewn[here.piece, here.edge]:
                copy, beside = seams[other].sides[at][place], lines[other][at]
                local = beside.edges[place].length - along if copy.reversed else along
                if groups[seams[other].name] == key[0]:
                    copies.append((other, at, float(beside.joints[place]) + local, copy))
            if not any(abs(known - along) <= LOCAL_TOLERANCE for known in (*placed.get(key, ()), *found.get(key, ()))):
                # It is called by the seam of the edge that is drawn.
                other, at, there, _ = next((copy for copy in copies if copy[3].is_drawn), copies[0])
                notch = lines[other][at].notch(seams[other].name, there, double)
                if notch is None or apart <= clear or not line.fits_at(length):
                    return False
                made.append((here.piece, notch))
                found.setdefault(key, []).append(along)
            waiting.append((number, 1 - side, opposite_length(seam, lines[number], side, length)))
            waiting += [copy[:3] for copy in copies if copy[3].cloth != here.cloth]
        for key, rows in found.items():
            placed.setdefault(key, []).extend(rows)
        for piece, notch in made:
            notches.setdefault(piece, []).append(notch)
        return True

    for number, seam in enumerate(seams):
        first, second = lines[number]
        # The fractions of the seam's length at which it is notched.
        if seam.notches is not None:
            fractions = list(seam.notches)
        else:
            joints = np.concatenate([first.joints / first.length, second.joints / second.length])
            fractions = [f for f in even_notches(first.length) if np.abs(joints - f).min() * first.length > CLEAR]
        for fraction in fractions:
            for share in SHARES_FROM_START:
                start = share * fraction * first.length
                both = (first, start), (second, opposite_length(seam, lines[number], 0, start))
                worn_at = [line.pieces[line.index(length)].piece.worn_at for line, length in both]
                double = "back" in worn_at and "front" not in worn_at if seam.double is None else seam.double
                if place_all(number, 0, start, double, 0.0 if seam.notches is not None else CLEAR):
                    break
        for own, other in ((0, 1), (1, 0)):
            if lines[number][other].is_marked:
                for joint in lines[number][own].joints[1:-1]:
                    place_all(number, other, opposite_length(seam, lines[number], own, float(joint)), False, CLEAR)
    return notches


def even_notches(length: float) -> list[float]:
    """Return the shares of a seam of this length [m] at which it is notched where nobody says."""
    count = max(1, round(length / SPACING))
    return [(number + 0.42) / count for number in range(count)] if length >= SHORTEST else []


def opposite_length(seam: Seam, lines: Sequence[SeamLine], side: int, length: float) -> float:
    """Return the length [m] along the other side of a seam opposite to a length along one side."""
    shares = np.linspace(0.0, 1.0, 1001)
    reached = eased_length(shares, 1.0, seam.ease, seam.eased) / (1.0 + seam.ease)
    table = (shares, reached) if side == 0 else (reached, shares)
    return float(np.interp(length / lines[side].length, *table)) * lines[1 - side].length


def copied_together(seams: Sequence[Seam]) -> dict[str, frozenset[str]]:
    """Return by seam all that are sewn along copies of its edges, each of which is drawn once; the seam is among them."""
    groups = {seam.name: frozenset((seam.name,)) for seam in seams}
    at: dict[Place, dict[tuple[bool, int], str]] = {}
    for seam in seams:
        for side in seam.stretches:
            at.setdefault(side.place, {}).setdefault((side.mirrored, side.copy), seam.name)
    for copies in at.values():
        joined = frozenset[str]().union(*(groups[name] for name in copies.values()))
        groups |= dict.fromkeys(joined, joined)
    return groups


def cut_darts(pieces: Mapping[str, DraftedPiece]) -> list[Seam]:
    """Return the darts that are cut away as seams that close them, both legs from the border to the tip."""
    return [
        seam
        for piece in pieces.values()
        for dart, seam in zip(piece.darts, piece.piece.dart_seams, strict=True)
        if dart.fold is None and piece.edge(dart.dart.left).width > 0
    ]


def dart_notches(piece: Piece, wedges: Mapping[str, Wedge], cut: CutOutline) -> tuple[Notch, ...]:
    """Return a single notch at the end of each leg of every folded dart, in the direction in which the leg runs on."""
    notches = []
    for dart in piece.darts:
        wedge = wedges.get(dart.name)
        if wedge is None:
            continue
        mouths = ((dart.left, wedge.left[0]), (dart.right, wedge.right[-1]))
        for (name, mouth), outwards in zip(mouths, cut.prolonged[dart.name], strict=True):
            inwards = -outwards
            base = _point_on_cut_line(mouth, inwards, 0.05, cut.points)
            if base is None:
                continue
            depth = _depth(float(np.linalg.norm(base - mouth)))
            notches.append(
                Notch(seam=dart.name, edge=name, length=0.0, at=mouth, base=(base,), direction=inwards, depth=depth)
            )
    return tuple(notches)


def _depth(width: float) -> float:
    """Return the depth of a notch in an allowance of a width [m]."""
    return min(DEPTH, MOST_OF_ALLOWANCE * width) if width > 1e-4 else RAW_DEPTH


def _point_on_cut_line(at: FloatArray, inwards: FloatArray, width: float, cut_line: FloatArray) -> FloatArray | None:
    """Return the point of the cut line straight out from a point of the sewing line.

    None if there is none within twice the width [m].
    """
    import shapely

    ring = shapely.LinearRing(cut_line)
    ray = shapely.LineString([at + 1e-5 * inwards, at - (2 * width + 0.005) * inwards])
    hits = shapely.get_coordinates(ray.intersection(ring))
    if len(hits) == 0:
        return None
    return np.asarray(hits[np.linalg.norm(hits - at, axis=1).argmin()])


class SeamLine:
    """One side of a seam as one long line, in the seam's direction."""

    def __init__(self, side: Sequence[SeamSide], pieces: Mapping[str, DraftedPiece]) -> None:
        self.side = side
        self.pieces = [pieces[s.piece] for s in side]
        self.edges = [piece.edge(s.edge) for piece, s in zip(self.pieces, side, strict=True)]
        self.lines = [edge.line[::-1] if s.reversed else edge.line for edge, s in zip(self.edges, side, strict=True)]
        self.joints = np.concatenate([[0.0], np.cumsum([edge.length for edge in self.edges])])

    @property
    def length(self) -> float:
        """Length of the side [m]."""
        return float(self.joints[-1])

    @property
    def places(self) -> FloatArray:
        """Length [m] along the side of each point of its edges as they came in, joints once."""
        return self._joined(edge.places for edge in self.edges)

    @property
    def laid(self) -> FloatArray:
        """Length [m] along the side of each point of its edges in the layout, joints once."""
        return self._joined(arc_lengths(edge.edge.points) for edge in self.edges)

    def _joined(self, lengths: Iterable[FloatArray]) -> FloatArray:
        return lengths_along_side(zip(lengths, (side.reversed for side in self.side), strict=True))

    def index(self, length: float) -> int:
        """Return the edge at a length [m]."""
        return int(np.clip(np.searchsorted(self.joints, length, side="right") - 1, 0, len(self.lines) - 1))

    @property
    def is_marked(self) -> bool:
        """Whether places along it are marked for joints of the other side.

        Not along panels, all of which would have the mark of one, nor along pleats, which are not laid yet.
        """
        return not any(piece.piece.pleats for piece in self.pieces) and not any(side.copy for side in self.side)

    def fits_at(self, length: float) -> bool:
        """Return whether a length [m] means the same when pleats are laid: it does where one of them ends."""
        part = self.index(length)
        count = self.pieces[part].piece.pleats
        stretch = self.edges[part].length / max(count, 1)
        local = length - float(self.joints[part])
        return count == 0 or abs(local - stretch * round(local / stretch)) <= LOCAL_TOLERANCE

    def marked(self, seams: Collection[str]) -> FloatArray:
        """Return the lengths [m] along the side at which its edges have notches of some seams, those of turned copies included."""
        import shapely

        found = {
            float(start + shapely.LineString(points).project(shapely.Point(notch.at)))
            for piece, edge, points, start in zip(self.pieces, self.edges, self.lines, self.joints, strict=False)
            for notch in piece.notches
            if notch.edge == edge.name and notch.seam in seams
        }
        return np.array(sorted(found))

    def notch(self, seam: str, length: float, double: bool) -> Notch | None:
        """Return a notch at a length [m]; the two slits of a double one lie on either side of it.

        None where the cut line does not run along the edge, since the allowance there meets another one.
        """
        index = self.index(length)
        piece, edge = self.pieces[index], self.edges[index]
        local = length - self.joints[index]
        at, direction = self.frame(index, local)
        offsets = (-DOUBLE_SPACING / 2, DOUBLE_SPACING / 2) if double else (0.0,)
        found = [
            _point_on_cut_line(*self.frame(index, local + offset), edge.width, piece.cut_line) for offset in offsets
        ]
        base = tuple(point for point in found if point is not None)
        if len(base) < len(offsets):
            return None
        depth = _depth(edge.width)
        return Notch(seam=seam, edge=edge.name, length=length, at=at, base=base, direction=direction, depth=depth)

    def frame(self, index: int, length: float) -> tuple[FloatArray, FloatArray]:
        """Return the point on the sewing line at a length [m], and the unit normal into the piece."""
        length = float(np.clip(length, 0.0, self.edges[index].length))
        # The direction is taken over a few millimetres: single short chords jitter.
        near, at, far = points_at_lengths(self.lines[index], [length - 2e-3, length, length + 2e-3])
        tangent = unit(far - near)
        inwards = np.array([-tangent[1], tangent[0]])
        return at, -inwards if self.side[index].reversed else inwards
