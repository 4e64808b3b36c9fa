"""All borders of a garment as curves: close to the mesh, and both sides of a seam as long as before."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, arc_lengths, polyline_length, segment_lengths, turning_angles
from warpflat.pattern.drafting.curves import TOLERANCE, Curve, chords, farthest, fit_curve
from warpflat.pattern.drafting.fairing import fair_lines
from warpflat.pattern.drafting.piece_parts import SAME_POINT
from warpflat.pattern.drafting.pieces import Piece, Place, Seam
from warpflat.pattern.drafting.seam_difference import (
    LOCAL_TOLERANCE,
    SEAM_TOLERANCE,
    lengths_along_side,
    worst_difference,
)

if TYPE_CHECKING:
    from shapely import LineString

__all__ = [
    "TOLERANCES",
    "as_in_layout",
    "drawn_length",
    "equal_sides",
    "fit_edges",
    "is_wavy",
    "lengths_along",
    "smooth_line",
    "uncrossed",
]

#: How far [m] curves may lie from a border: the first is for clean meshes, the others are tried on ragged ones.
TOLERANCES = (TOLERANCE, 3e-4, 1e-3, 2e-3)
#: A clean border has at most this many curves, and one more for each of these lengths [m].
CURVES, CURVE = 4, 0.012
#: In waves shorter than about `WAVE` [m] a clean border turns back and forth by at most this [rad], and this for each
#: metre. The borders of garments that follow the mesh stay below 2 rad/m; a cut across the mesh, whose triangles jut
#: out in turns, reaches 7 and more.
SWING, SWING_PER_METRE = 0.3, 3.5
WAVE = 0.04
#: Inside a piece, waves of these numbers of mesh edges are smoothed away, the short ones first, until a line is clean.
WAVES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
#: Curves keep near their points where the sides of their seams then differ by at most this share of what is allowed.
SAFE = 0.8
# Sides that differ by more than allowed in the layout are drawn with at most so many times that.
_NO_WORSE = 1.1
#: What is drawn for the length of an edge, by its role.
STRIPS = ("strip", "waistband", "cuff")
#: Sides of a seam that differ by less [m] stay as they are.
ALIKE = 5e-6
#: A curve moves by no more than this [m] to be as long as what it is sewn to: a tenth of what a turned corner may move.
SHIFT = 3e-4
#: So many bumps move it, whose squared slopes are to be small; those of a seam's first side count this many times, and those of a curve
#: that is straight in parts again this many times.
BUMPS, OF_FIRST, IN_PARTS = (1, 2, 4, 8), 10.0, 100.0


def fit_edges(
    pieces: Sequence[Piece], lines: Mapping[Place, FloatArray], seams: Sequence[Seam], tolerance: float | None
) -> dict[Place, tuple[Curve, float]]:
    """Fit a curve to every edge, and return it with how far [m] it was allowed to keep from the points.

    Each curve keeps within the tolerance of its points, and as near to the length of its chords as that allows. Where
    the sides of a seam would then differ too much, as on coarse meshes, both keep the length of their chords all along,
    and run as far from their points as that takes (see :func:`fit_curve`). Where a border is so ragged that its curve
    would be all wiggles, a wider tolerance smooths them away, and their length with them. The other side of the seam or
    dart gets the same tolerance, and both get the lengths of the shorter one. Where curves would cross, as on coarse
    meshes in narrow places, the chords stay.

    Args:
        pieces: of one size.
        lines: #P by 2 [m], the points of every edge, in its piece's direction.
        seams: between them; the legs of the pieces' darts are sewn too.
        tolerance: [m] for all edges; None takes the least of `TOLERANCES` that makes a clean curve of each.
    """
    fitted, sewn = {}, [*seams, *(dart for piece in pieces for dart in piece.dart_seams)]
    for piece in pieces:
        for edge in piece.edges:
            line = lines[piece.name, edge.name]
            line = line[[0, -1]] if edge.kind == "fold" else line
            as_it_is = chords(line), TOLERANCE if tolerance is None else tolerance
            fitted[piece.name, edge.name] = as_it_is if edge.as_drawn else _clean_curve(line, tolerance)
    if tolerance is None:
        # Edges that are sewn to one other edge, whether they run against each other, and the second's ease.
        pairs = list[tuple[Place, Place, bool, float]]()
        for seam in sewn:
            (one, *more), (other, *others) = seam.sides
            ends = one.place, other.place
            if not more and not others and ends[0] != ends[1]:
                pairs.append((*ends, one.reversed != other.reversed, seam.ease))
                continue
            for key in {side.place for side in seam.stretches}:
                # Of several edges each keeps its own length as it is smoothed: so do both sides.
                width, arc = fitted[key][1], arc_lengths(lines[key])
                if width > TOLERANCE and abs(fitted[key][0].length - arc[-1]) > TOLERANCE:
                    fitted[key] = fit_curve(lines[key], width, lengths=arc), width
        for first, second, against, ease in pairs:
            wide = max(fitted[first][1], fitted[second][1])
            if wide > TOLERANCE and len(lines[first]) == len(lines[second]):
                # Both sides of a ragged seam are smoothed, and get the lengths of the one that is then shorter.
                sides = [lines[first], lines[second][::-1] if against else lines[second]]
                longer = np.array([1.0, 1.0 + ease])
                # A short zigzag may have no smooth line of the right length: a wiggle is better than a seam that does not match.
                found, used = [fit_curve(side) for side in sides], TOLERANCES[-1]
                for width in TOLERANCES[1:]:
                    reached = [
                        lengths_along(fit_curve(side, width), side) / share
                        for side, share in zip(sides, longer, strict=True)
                    ]
                    lengths = min(reached, key=lambda places: float(places[-1]))
                    curves = [
                        fit_curve(side, width, lengths=lengths * share)
                        for side, share in zip(sides, longer, strict=True)
                    ]
                    difference = abs(curves[1].length - curves[0].length * longer[1])
                    if difference <= SAFE * LOCAL_TOLERANCE:
                        found, used = curves, width
                    if difference <= TOLERANCE and not any(map(_ragged, curves)):
                        break
                fitted[first], fitted[second] = (found[0], used), (found[1].reversed() if against else found[1], used)
    # The curves of clean edges are brought within the tolerance of their points, where their seams allow it.
    within = TOLERANCE if tolerance is None else tolerance
    keys = [(piece.name, edge.name) for piece in pieces for edge in piece.edges if edge.kind != "fold"]
    far = [key for key in keys if fitted[key][1] <= within and farthest(fitted[key][0].sample(), lines[key]) > within]
    tried = fitted | {key: (fit_curve(lines[key], within, near=True), within) for key in far}
    unchecked = list(sewn)
    # The edges of a mirror pair are sewn at two seams: a curve that one of them rejects changes the other.
    while unequal := [seam for seam in unchecked if max(_differences(seam, lines, tried)) > SAFE]:
        for seam in unequal:
            near, before = (max(_differences(seam, lines, curves)) for curves in (tried, fitted))
            # On a coarse mesh neither may be as close as it should be.
            if before <= max(near, 1.0):
                tried |= {side.place: fitted[side.place] for side in seam.stretches}
        unchecked = [seam for seam in unchecked if seam not in unequal]
    fitted |= tried
    clean = uncrossed(pieces, lines, {key: curve for key, (curve, _) in fitted.items()})
    return {key: (clean[key], width) for key, (_, width) in fitted.items()}


def uncrossed(
    pieces: Sequence[Piece], lines: Mapping[Place, FloatArray], curves: Mapping[Place, Curve]
) -> dict[Place, Curve]:
    """Return the curves with chords for those that cross themselves or each other, or all fall into one line.

    Where chords beside curves cross, too, all edges of the piece get theirs, as its layout has them.

    Args:
        pieces: of one size.
        lines: #P by 2 [m], the points of every edge, in its piece's direction.
        curves: of all edges.
    """
    import shapely

    found = dict(curves)
    for piece in pieces:
        keys = [(piece.name, edge.name) for edge in piece.edges]

        drawn = {key: shapely.LineString(found[key].sample()) for key in keys}
        if _encloses(list(drawn.values())):
            continue
        for key in keys:
            if (
                sum(len(line.coords) - 1 for line in drawn.values()) < 3
                or not drawn[key].is_simple
                or any(drawn[key].crosses(drawn[other]) for other in keys if other != key)
            ):
                found[key] = chords(lines[key])
        if not _encloses([shapely.LineString(found[key].sample()) for key in keys]):
            found |= {key: chords(lines[key]) for key in keys}
    return found


def _encloses(outline: Sequence[LineString]) -> bool:
    """Return whether lines that follow each other enclose an area, without crossing."""
    import shapely

    ring = np.concatenate([line.coords[:-1] for line in outline])
    return len(ring) > 2 and bool(shapely.Polygon(ring).is_valid)


def equal_sides(pieces: Sequence[Piece], seams: Sequence[Seam], curves: Mapping[Place, Curve]) -> dict[Place, Curve]:
    """Return the curves with the sides of each seam as long as they should be, to some micrometres.

    Curves that keep near their points, and turned corners, leave a seam's sides some tenths of a millimetre apart. The curves of
    both sides take up the difference, above all those of the second side, and those that bend most: each moves by smooth bumps in
    directions of their own, the least squares of whose slopes give the wanted length, so that no choice hangs on rounding. Ends stay,
    with their directions. What would have to move farther than `SHIFT` stays as it is. A straight strip, such as a band or a cuff, is
    stretched.
    """
    found, roles = dict(curves), {piece.name: piece.role for piece in pieces}
    # A second step takes what the first one, on curves of few joints, has missed.
    for seam in (seam for seam in seams for _ in range(2)):
        first, second = ([found[side.piece, side.edge] for side in row] for row in seam.sides)
        one, other = (sum(polyline_length(curve.sample()) for curve in curves) for curves in (first, second))
        more = one * (1.0 + seam.ease) - other
        if abs(more) < ALIKE:
            continue
        strip = next(
            ((row[0], grow) for row, grow in zip(seam.sides, (-more / (1.0 + seam.ease), more), strict=True)
             if len(row) == 1 and roles[row[0].piece] in STRIPS and found[row[0].piece, row[0].edge].straight.all()),
            None,
        )  # fmt: skip
        if strip is not None:
            side, grow = strip
            ends = found[side.piece, side.edge].nodes[[0, -1]]
            length = float(np.linalg.norm(ends[1] - ends[0]))
            along = (ends[1] - ends[0]) / length
            if abs(grow) <= 2.0 * SHIFT:
                stretch = np.eye(2) + grow / length * np.outer(along, along)
                for key in [key for key in found if key[0] == side.piece]:
                    found[key] = found[key].transformed(np.column_stack([stretch, np.zeros(2)]))
            continue
        more -= np.copysign(ALIKE, more)
        # How the difference grows with each bump, over its cost.
        ways, total = dict[Place, dict[int, FloatArray]](), 0.0
        for row, of_side in zip(seam.sides, (-(1.0 + seam.ease), 1.0), strict=True):
            for key in (side.place for side in row):
                line = found[key].sample()
                if found[key].straight.all() or len(line) < 3:
                    continue
                # The length grows by the bumps' work on the turning tangent.
                tangents = np.diff(line, axis=0) / segment_lengths(line)[:, None]
                at, turns = arc_lengths(line)[1:-1] / polyline_length(line), -of_side * np.diff(tangents, axis=0)
                cost = (1.0 if row is seam.sides[1] else OF_FIRST) * (IN_PARTS if found[key].straight.any() else 1.0)
                ways[key] = {}
                for count in BUMPS:
                    bend = np.zeros((count, 2))
                    np.add.at(
                        bend,
                        np.minimum(count * at, count - 1).astype(int),
                        np.sin(np.pi * count * at)[:, None] ** 2 * turns,
                    )
                    ways[key][count] = bend / (cost * count**2)
                    # Both copies of an edge that is sewn twice move.
                    total += float((bend * ways[key][count]).sum())
        places = np.linspace(0.0, 1.0, 65)
        moves = [abs(more) * np.linalg.norm(_bumps(way, places)[0], axis=1).max() for way in ways.values()]
        if not ways or max(moves) > SHIFT * total:
            continue
        for key, way in ways.items():
            bezier = found[key].bezier.copy()
            lengths = [
                polyline_length(Curve(bezier=each[None], straight=np.zeros(1, dtype=bool)).sample()) for each in bezier
            ]
            joints = np.concatenate([[0.0], np.cumsum(lengths)]) / sum(lengths)
            bump, slope = (more / total * each for each in _bumps(way, joints))
            slope /= sum(lengths)
            handles = np.linalg.norm(bezier[:, [1, 2]] - bezier[:, [0, 3]], axis=2)
            # Tangents at a joint turn alike on both of its sides.
            bezier[:, 0] += bump[:-1]
            bezier[:, 1] += bump[:-1] + handles[:, :1] * slope[:-1]
            bezier[:, 2] += bump[1:] - handles[:, 1:] * slope[1:]
            bezier[:, 3] += bump[1:]
            # The ends are corners, shared bit for bit.
            bezier[0, 0], bezier[-1, 3] = found[key].bezier[0, 0], found[key].bezier[-1, 3]
            straight = found[key].straight & (np.abs(bump[:-1]).max(axis=1) + np.abs(bump[1:]).max(axis=1) == 0.0)
            found[key] = replace(found[key], bezier=bezier, straight=straight)
    return found


def _bumps(ways: Mapping[int, FloatArray], at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the moves (#P by 2 [m]) of a curve at shares of its length, and their derivatives by the share.

    Args:
        ways: by how many bumps, how far [m] each of them moves the curve in its middle, #bumps by 2.
        at: #P.
    """
    move, slope = np.zeros((len(at), 2)), np.zeros((len(at), 2))
    for count, way in ways.items():
        each = way[np.minimum(count * at, count - 1).astype(int)]
        move += np.sin(np.pi * count * at)[:, None] ** 2 * each
        slope += count * np.pi * np.sin(2.0 * np.pi * count * at)[:, None] * each
    return move, slope


def as_in_layout(
    lines: Mapping[Place, FloatArray], seams: Sequence[Seam], curves: Mapping[Place, Curve]
) -> dict[Place, Curve]:
    """Return the curves with chords along both sides of each seam that would differ as drawn, and by more than in the layout.

    No smooth line near a ragged border may be as long as that; its chords are.

    Args:
        lines: #P by 2 [m], the points of every edge, in its piece's direction.
        seams: between them.
        curves: of all edges.
    """
    found = {key: (curve, 0.0) for key, curve in curves.items()}
    flat = {key: (chords(line), 0.0) for key, line in lines.items()}
    unchecked = list(seams)

    def strays(seam: Seam) -> bool:
        laid = _along_sides(seam, lines, flat) if seam.as_laid else None
        now, least = (_differences(seam, lines, each, laid) for each in (found, flat))
        return any(one > max(1.0, _NO_WORSE * other) for one, other in zip(now, least, strict=True))

    # Chords on one side of a seam may change an edge of another one.
    while straying := [seam for seam in unchecked if strays(seam)]:
        for seam in straying:
            found |= {side.place: flat[side.place] for side in seam.stretches}
        unchecked = [seam for seam in unchecked if seam not in straying]
    return {key: curve for key, (curve, _) in found.items()}


def drawn_length(line: FloatArray) -> float:
    """Return the length of an edge as it is drawn where no seam has a say: along its fitted curve [m].

    A curve is longer than the chords of a mesh that it is drawn through. What is drafted for an edge is as long as its curve.

    Args:
        line: #P by 2 [m].
    """
    return _drawn_length(np.ascontiguousarray(line, dtype=np.float64).tobytes())


@functools.lru_cache(maxsize=512)
def _drawn_length(data: bytes) -> float:
    import shapely

    line = np.frombuffer(data).reshape(-1, 2)
    curve, within = _clean_curve(line, None)
    if within == TOLERANCE and farthest(curve.sample(), line) > within:
        curve = fit_curve(line, within, near=True)
    drawn = curve.sample()
    # A curve that crosses itself is drawn as its chords.
    return polyline_length(drawn if shapely.LineString(drawn).is_simple else line)


def _clean_curve(line: FloatArray, tolerance: float | None) -> tuple[Curve, float]:
    """Return a curve of the tolerance; if that is None, of the least of `TOLERANCES` that makes it clean, or the largest; and which."""
    if tolerance is not None:
        return fit_curve(line, tolerance), tolerance
    for tried in TOLERANCES:
        curve = fit_curve(line, tried)
        if not _ragged(curve):
            break
    return curve, tried


def smooth_line(line: FloatArray) -> FloatArray:
    """Remove the teeth of a line that runs along a mesh inside a piece, within one mesh edge of it; its ends stay.

    A clean line stays as it is. Unlike a border the line may lose the length of its teeth: nothing is sewn along it.

    Args:
        line: #P by 2 [m].
    """
    steps = segment_lengths(line)
    edge = float(np.median(steps))
    if len(line) < 5 or steps.min() < SAME_POINT or not is_wavy(chords(line)):
        return line
    smooth, ends = line, np.isin(np.arange(len(line)), [0, len(line) - 1])
    for tried in fair_lines(line, (wave * edge for wave in WAVES), met=ends):
        if tried.shift > edge:
            break
        smooth = tried.points
        smooth[ends] = line[ends]
        if not is_wavy(chords(smooth)):
            break
    return smooth


def _ragged(curve: Curve) -> bool:
    """Return whether a curve has too many segments or waves for a clean border."""
    return len(curve.bezier) > CURVES + curve.length / CURVE or is_wavy(curve)


def is_wavy(curve: Curve) -> bool:
    """Return whether a curve turns back and forth as no clean border does; longer bends belong to its shape."""
    line = curve.sample()
    arc = arc_lengths(line)
    count = max(2, int(np.ceil(arc[-1] / (WAVE / 40))))
    places = (np.arange(count) + 0.5) * arc[-1] / count
    direction = np.concatenate([[0.0], np.cumsum(turning_angles(line))])[np.searchsorted(arc[1:-1], places)]
    width = int(np.ceil(WAVE * count / arc[-1]))
    # Averaged over a wave's length, what turns back within it is gone.
    mean = np.convolve(np.pad(direction, width, mode="edge"), np.full(width, 1.0 / width), mode="valid")
    swing = float(np.abs(np.diff(direction)).sum() - np.abs(np.diff(mean)).sum())
    return swing > SWING + SWING_PER_METRE * float(arc[-1])


def _along_sides(
    seam: Seam, lines: Mapping[Place, FloatArray], curves: Mapping[Place, tuple[Curve, float]]
) -> tuple[FloatArray, FloatArray]:
    """Return the lengths along both sides of a seam at their points [m], joints once."""
    first, second = (
        lengths_along_side((lengths_along(curves[part.place][0], lines[part.place]), part.reversed) for part in side)
        for side in seam.sides
    )
    return first, second


def _differences(
    seam: Seam,
    lines: Mapping[Place, FloatArray],
    curves: Mapping[Place, tuple[Curve, float]],
    laid: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[float, float]:
    """Return by how much the sides of a seam differ as a whole, and over a short stretch, each over what is allowed."""
    first, second = _along_sides(seam, lines, curves)
    near = worst_difference(first, second, seam.ease, seam.eased, laid=laid)
    whole = abs(second[-1] - first[-1] * (1 + seam.ease)) / SEAM_TOLERANCE
    return float(whole), 0.0 if near is None else near / LOCAL_TOLERANCE


def lengths_along(curve: Curve, points: FloatArray) -> FloatArray:
    """Return the length [m] along the curve at each of the points (#P)."""
    import shapely

    line = shapely.LineString(curve.sample())
    # Places rise along the line: where a border nearly touches itself, the nearest place may be on its other part.
    places = np.maximum.accumulate(shapely.line_locate_point(line, shapely.points(points)))
    places[[0, -1]] = 0.0, line.length
    return np.asarray(places)
