"""Seams measured and notched: equal marks at equal lengths on both sides of every seam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import arc_lengths, points_at_lengths
from warpflat.pattern.allowance import CutOutline
from warpflat.pattern.drafted import DraftedPiece, Notch, SeamReport
from warpflat.pattern.pieces import Piece, Seam, SeamSide
from warpflat.pattern.seam_difference import eased_length, worst_difference
from warpflat.pattern.sides import Wedge

__all__ = ["SeamLine", "cut_darts", "dart_notches", "seam_notches", "seam_reports"]


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
    """Measure both sides of every seam along the fitted sewing lines."""
    reports = []
    for seam in seams:
        lines = [SeamLine(side, pieces) for side in seam.sides]
        first, second = (line.length for line in lines)
        # Edges that come from no mesh have no common vertices, nor need copies of equal pieces.
        worst = None
        if all(edge.edge.vertices is not None for line in lines for edge in line.edges) and (
            len(lines[0].places) == len(lines[1].places)
        ):
            laid = (lines[0].laid, lines[1].laid) if seam.as_laid else None
            worst = worst_difference(lines[0].places, lines[1].places, seam.ease, seam.eased, laid=laid)
        reports.append(
            SeamReport(
                name=seam.name,
                size=size,
                sides=(" + ".join(map(str, seam.sides[0])), " + ".join(map(str, seam.sides[1]))),
                length_mm=(first * 1000, second * 1000),
                ease=seam.ease,
                difference_mm=(second - first * (1 + seam.ease)) * 1000,
                local_mm=None if worst is None else 1000 * worst,
            )
        )
    return reports


def seam_notches(seams: Sequence[Seam], pieces: Mapping[str, DraftedPiece]) -> dict[str, list[Notch]]:
    """Return the notches of seams by piece.

    Both sides of a seam get a notch at the same fraction of the seam's length, which is the same length wherever the
    sides are equal; ease is spread evenly, or between two notches. Fractions are not symmetric about the middle, so that a side sewn on the
    wrong way round shows. Where one side has a joint (a shoulder seam at a sleeve's cap, a dart in a side seam) the
    other side gets a single notch for it. Notches on a back are double, unless it is sewn to a front.

    Where one side's allowance is not cut (deep in a dart, where it meets that of the other leg), the place is moved
    towards the seam's start, on both sides.
    """
    notches: dict[str, list[Notch]] = {}
    for seam in seams:
        first, second = (SeamLine(side, pieces) for side in seam.sides)
        # A piece that is sewn to its own mirror image has one edge for both sides.
        lines = (first,) if seam.sides[0] == seam.sides[1] else (first, second)
        # The fractions of the seam's length at which it is notched.
        if seam.notches is not None:
            fractions = list(seam.notches)
        elif first.length < SHORTEST:
            fractions = []
        else:
            count = max(1, round(first.length / SPACING))
            joints = np.concatenate([first.joints / first.length, second.joints / second.length])
            evenly = ((np.arange(count) + 0.42) / count).tolist()
            fractions = [f for f in evenly if np.abs(joints - f).min() * first.length > CLEAR]
        for fraction in fractions:
            for piece, notch in _notch_pair(seam, lines, fraction):
                notches.setdefault(piece, []).append(notch)
        for line, other in ((first, second), (second, first)):
            for joint in line.joints[1:-1] / line.length:
                # The joint's share of one side's length, and that of the place on the other side opposite to it.
                shares = np.linspace(0.0, 1.0, 1001)
                reached = eased_length(shares, 1.0, seam.ease, seam.eased) / (1.0 + seam.ease)
                table = (shares, reached) if line is first else (reached, shares)
                length = float(np.interp(float(joint), *table)) * other.length
                if not other.is_marked:
                    continue
                if np.abs(other.joints - length).min() > CLEAR and other.is_drawn(length):
                    single = other.notch(seam.name, length, double=False)
                    if single is not None:
                        notches.setdefault(other.piece_name(length), []).append(single)
    return notches


def _notch_pair(seam: Seam, lines: Sequence[SeamLine], fraction: float) -> list[tuple[str, Notch]]:
    """Return the notches of both sides at a fraction of the seam's length, by piece; none if they cannot be cut."""
    for share in SHARES_FROM_START:
        at = share * fraction
        opposite = seam.reach(at, 1.0) / (1.0 + seam.ease)
        places = [(line, part * line.length) for line, part in zip(lines, (at, opposite), strict=False)]
        names = [line.piece_name(length).lower() for line, length in places]
        back = any("back" in name for name in names) and not any("front" in name for name in names)
        double = back if seam.double is None else seam.double
        places = [(line, length) for line, length in places if line.is_drawn(length)]
        found = [(line.piece_name(length), line.notch(seam.name, length, double)) for line, length in places]
        matched = [(piece, notch) for piece, notch in found if notch is not None]
        if len(matched) == len(found):
            return matched
    return []


def cut_darts(pieces: Mapping[str, DraftedPiece]) -> list[Seam]:
    """Return the darts that are cut away as seams that close them, both legs from the border to the tip."""
    return [
        Seam(
            name=f"{name}.{dart.dart.name}",
            sides=(
                (SeamSide(piece=name, edge=dart.dart.left),),
                (SeamSide(piece=name, edge=dart.dart.right, reversed=True),),
            ),
            double=False,
        )
        for name, piece in pieces.items()
        for dart in piece.darts
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
            width = float(np.linalg.norm(base - mouth))
            depth = min(DEPTH, MOST_OF_ALLOWANCE * width) if width > 1e-4 else RAW_DEPTH
            notches.append(
                Notch(seam=dart.name, edge=name, length=0.0, at=mouth, base=(base,), direction=inwards, depth=depth)
            )
    return tuple(notches)


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
        self.arcs = [arc_lengths(line) for line in self.lines]
        self.joints = np.concatenate([[0.0], np.cumsum([arc[-1] for arc in self.arcs])])

    @property
    def length(self) -> float:
        """Length of the side [m]."""
        return float(self.joints[-1])

    @property
    def places(self) -> FloatArray:
        """Length [m] along the side of each point of its edges as they came in, joints once."""
        return self._joined([edge.places for edge in self.edges])

    @property
    def laid(self) -> FloatArray:
        """Length [m] along the side of each point of its edges in the layout, joints once."""
        return self._joined([arc_lengths(edge.edge.points) for edge in self.edges])

    def _joined(self, lengths: Sequence[FloatArray]) -> FloatArray:
        """Return lengths [m] along the edges, each in its piece's direction, as lengths along the side."""
        rows = [np.zeros(1)]
        for along, side in zip(lengths, self.side, strict=True):
            rows.append(rows[-1][-1] + (along[-1] - along[::-1] if side.reversed else along)[1:])
        return np.concatenate(rows)

    def index(self, length: float) -> int:
        """Return the edge at a length [m]."""
        return int(np.clip(np.searchsorted(self.joints, length, side="right") - 1, 0, len(self.lines) - 1))

    def piece_name(self, length: float) -> str:
        """Return the piece at a length [m]."""
        return self.side[self.index(length)].piece

    def is_drawn(self, length: float) -> bool:
        """Return whether the edge at a length [m] is that of the piece itself, not of another copy."""
        return self.side[self.index(length)].is_drawn

    @property
    def is_marked(self) -> bool:
        """Whether places along it can be marked for joints of the other side.

        Not along several copies of a piece, which all have the mark of one, nor along pleats, which are not laid yet.
        """
        copies = {(side.piece, side.edge) for side in self.side}
        pleats = any("pleat fold" in name for piece in self.pieces for name in piece.piece.internal_lines)
        return len(copies) == len(self.side) and not pleats

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
        depth = min(DEPTH, MOST_OF_ALLOWANCE * edge.width) if edge.width > 0 else RAW_DEPTH
        return Notch(seam=seam, edge=edge.name, length=length, at=at, base=base, direction=direction, depth=depth)

    def frame(self, index: int, length: float) -> tuple[FloatArray, FloatArray]:
        """Return the point on the sewing line at a length [m], and the unit normal into the piece."""
        line, arc = self.lines[index], self.arcs[index]
        length = float(np.clip(length, 0.0, arc[-1]))
        step = int(np.clip(np.searchsorted(arc, length) - 1, 0, len(line) - 2))
        span = float(arc[step + 1] - arc[step])
        at = line[step] + (line[step + 1] - line[step]) * ((length - arc[step]) / span if span > 0 else 0.0)
        # The direction is taken over a few millimetres: single short chords jitter.
        near, far = points_at_lengths(line, [length - 2e-3, length + 2e-3])
        tangent = (far - near) / max(float(np.linalg.norm(far - near)), 1e-12)
        inwards = np.array([-tangent[1], tangent[0]])
        return at, -inwards if self.side[index].reversed else inwards
