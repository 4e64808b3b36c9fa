"""All borders of a garment as curves: as close to the mesh as each is clean, and both sides of a seam as long as before."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import arc_lengths, turning_angles
from warpflat.pattern.curves import TOLERANCE, Curve, chords, fit_curve
from warpflat.pattern.pieces import SAME_POINT, Piece, Seam, SeamSide
from warpflat.pattern.seam_difference import LOCAL_TOLERANCE, SEAM_TOLERANCE, worst_difference

__all__ = ["TOLERANCES", "EdgeKey", "fit_edges", "is_wavy", "smooth_line"]

#: Names of a piece and of its edge.
EdgeKey = tuple[str, str]
Sides = tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]]

#: How far [m] curves may lie from a border: the first is for clean meshes, the others are tried on ragged ones.
TOLERANCES = (TOLERANCE, 3e-4, 1e-3, 2e-3)
#: A clean border has no more than so many curves, and one more for so much of its length [m].
CURVES, CURVE = 4, 0.012
#: A clean border turns back and forth, in waves shorter than about `WAVE` [m], by no more than this [rad], and this for each metre.
#: The borders of garments that follow the mesh stay below 2 rad/m; a cut across the mesh, whose triangles jut out in turns, reaches
#: 7 and more.
SWING, SWING_PER_METRE = 0.3, 3.5
WAVE = 0.04
#: Inside a piece, waves of so many edges are smoothed away, the short ones first, until a line is clean.
WAVES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
#: Smoothed sides of a ragged seam agree in length within this [m], if a tolerance can be found for it.
EQUAL = 1e-4
#: Curves keep near their points where the sides of their seams then differ by no more than this share of what they may.
SAFE = 0.8


def fit_edges(
    pieces: Sequence[Piece], lines: Mapping[EdgeKey, FloatArray], seams: Sequence[Seam], tolerance: float | None
) -> dict[EdgeKey, tuple[Curve, float]]:
    """A curve for every edge, and how far [m] it was allowed to keep from the points.

    Each keeps within the tolerance of its points, and as near to the length of its chords as that allows. Where the sides
    of a seam would then differ too much, as on coarse meshes, both keep the length of their chords all along, and run as
    far from their points as that takes (see :func:`fit_curve`).
    Where a border is so ragged that its curve would be all wiggles, a wider tolerance smooths them away, and their
    length with them; the other side of the seam or dart gets the same tolerance, and both the lengths of the shorter.
    Where curves would cross, as on coarse meshes in narrow places, the chords stay.

    Args:
        pieces: of one size.
        lines: #P by 2 [m], the points of every edge, in its piece's direction.
        seams: between them; the legs of the pieces' darts are taken as seams too.
        tolerance: [m] for all edges; None takes the least of `TOLERANCES` that makes a clean curve of each.
    """
    fitted = {}
    for piece in pieces:
        for edge in piece.edges:
            line = lines[piece.name, edge.name]
            fitted[piece.name, edge.name] = _clean(line[[0, -1]] if edge.kind == "fold" else line, tolerance)
    if tolerance is None:
        for first, second, against, ease in _pairs(pieces, seams):
            wide = max(fitted[first][1], fitted[second][1])
            if wide > TOLERANCE and len(lines[first]) == len(lines[second]):
                fitted[first], fitted[second] = _together(lines[first], lines[second], against, ease)
    _keep_near(pieces, lines, seams, fitted, tolerance)
    for piece in pieces:
        _uncross(piece, lines, fitted)
    return fitted


def smooth_line(line: FloatArray) -> FloatArray:
    """A line inside a piece without the teeth in which it runs along the mesh, within an edge of it; its ends stay.

    One that is clean stays as it is. Unlike a border it may lose the length of its teeth: nothing is sewn along it.

    Args:
        line: #P by 2 [m].
    """
    import shapely
    from scipy.interpolate import make_smoothing_spline

    arc = arc_lengths(line)
    edge = float(np.median(np.diff(arc)))
    if len(line) < 5 or np.diff(arc).min() < SAME_POINT or not is_wavy(chords(line)):
        return line
    weights = np.ones(len(line))
    weights[[0, -1]] = 1e6
    smooth, places = line, np.linspace(0.0, arc[-1], 2 * len(line))
    for wave in WAVES:
        stiffness = (wave * edge / (2 * np.pi)) ** 4 * len(line) / arc[-1]
        tried = make_smoothing_spline(arc, line, w=weights, lam=stiffness)(places)
        tried[[0, -1]] = line[[0, -1]]
        if shapely.distance(shapely.LineString(tried), shapely.points(line)).max() > edge:
            break
        smooth = tried
        if not is_wavy(chords(smooth)):
            break
    return smooth


def _clean(line: FloatArray, tolerance: float | None) -> tuple[Curve, float]:
    if tolerance is not None:
        return fit_curve(line, tolerance), tolerance
    for tried in TOLERANCES:
        curve = fit_curve(line, tried)
        if not _ragged(curve):
            break
    return curve, tried


def _ragged(curve: Curve) -> bool:
    return len(curve.bezier) > CURVES + curve.length / CURVE or is_wavy(curve)


def is_wavy(curve: Curve) -> bool:
    """Whether a curve turns back and forth as no clean border does; longer bends, one way and the other, are its shape."""
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


def _keep_near(
    pieces: Sequence[Piece],
    lines: Mapping[EdgeKey, FloatArray],
    seams: Sequence[Seam],
    fitted: dict[EdgeKey, tuple[Curve, float]],
    tolerance: float | None,
) -> None:
    """Bring the curves of clean edges within the tolerance of their points, where their seams allow it."""
    room = TOLERANCE if tolerance is None else tolerance
    near = {
        (piece.name, edge.name): (fit_curve(lines[piece.name, edge.name], room, near=True), room)
        for piece in pieces
        for edge in piece.edges
        if edge.kind != "fold" and fitted[piece.name, edge.name][1] <= room
    }
    tried = {**fitted, **near}
    left = list(_sewn(pieces, seams))
    # An edge of a pair is sewn at two seams: what one of them takes back concerns the other.
    while odd := [seam for seam in left if _apart(*_both(seam, lines, tried)) > SAFE]:
        for sides, ease in odd:
            near_apart, apart = (_apart(*_both((sides, ease), lines, curves)) for curves in (tried, fitted))
            # On a coarse mesh neither may be as near as it should be.
            if apart <= max(near_apart, 1.0):
                tried |= {key: fitted[key] for row in sides for key in ((side.piece, side.edge) for side in row)}
        left = [seam for seam in left if seam not in odd]
    fitted |= tried


def _both(
    seam: tuple[Sides, float], lines: Mapping[EdgeKey, FloatArray], curves: Mapping[EdgeKey, tuple[Curve, float]]
) -> tuple[FloatArray, FloatArray, float]:
    """The lengths along both sides of a seam at their points, and the second's ease."""
    (first, second), ease = seam
    return _places(first, lines, curves), _places(second, lines, curves), ease


def _sewn(pieces: Sequence[Piece], seams: Sequence[Seam]) -> Iterator[tuple[Sides, float]]:
    """Both sides of every seam and dart, in one direction, and the second's ease."""
    for seam in seams:
        yield seam.sides, seam.ease
    for piece in pieces:
        for dart in piece.darts:
            left, right = SeamSide(piece=piece.name, edge=dart.left), SeamSide(piece=piece.name, edge=dart.right)
            yield ((left,), (SeamSide(piece=right.piece, edge=right.edge, reversed=True),)), 0.0


def _places(
    side: Sequence[SeamSide], lines: Mapping[EdgeKey, FloatArray], curves: Mapping[EdgeKey, tuple[Curve, float]]
) -> FloatArray:
    """The length [m] along one side of a seam at each of its points, joints once."""
    rows = [np.zeros(1)]
    for part in side:
        key = part.piece, part.edge
        reached = _reached(curves[key][0], lines[key])
        rows.append(rows[-1][-1] + (reached[-1] - reached[::-1] if part.reversed else reached)[1:])
    return np.concatenate(rows)


def _apart(first: FloatArray, second: FloatArray, ease: float) -> float:
    """How much the sides of a seam differ, over what they may."""
    near = worst_difference(first, second, ease)
    whole = abs(second[-1] - first[-1] * (1 + ease)) / SEAM_TOLERANCE
    return float(whole if near is None else max(whole, near / LOCAL_TOLERANCE))


def _pairs(pieces: Sequence[Piece], seams: Sequence[Seam]) -> Iterator[tuple[EdgeKey, EdgeKey, bool, float]]:
    """Edges that are sewn to one other edge, whether these run against each other, and the second's ease."""

    def key(side: SeamSide) -> EdgeKey:
        return side.piece, side.edge

    for seam in seams:
        (first, *more), (second, *others) = seam.sides
        if not more and not others and key(first) != key(second):
            yield key(first), key(second), first.reversed != second.reversed, seam.ease
    for piece in pieces:
        for dart in piece.darts:
            yield (piece.name, dart.left), (piece.name, dart.right), True, 0.0


def _together(
    first: FloatArray, second: FloatArray, against: bool, ease: float
) -> tuple[tuple[Curve, float], tuple[Curve, float]]:
    """Both sides of a ragged seam, smoothed, with the lengths up to each point of the one that is shorter then."""
    sides = [first, second[::-1] if against else second]
    longer = np.array([1.0, 1.0 + ease])
    # A short zigzag may have no smooth line of the right length: better a wiggle than a seam that does not match.
    found, used = [fit_curve(side) for side in sides], TOLERANCES[-1]
    for tolerance in TOLERANCES[1:]:
        reached = [
            _reached(fit_curve(side, tolerance), side) / share for side, share in zip(sides, longer, strict=True)
        ]
        lengths = min(reached, key=lambda places: float(places[-1]))
        curves = [
            fit_curve(side, tolerance, lengths=lengths * share) for side, share in zip(sides, longer, strict=True)
        ]
        apart = abs(curves[1].length - curves[0].length * longer[1])
        if apart <= SAFE * LOCAL_TOLERANCE:
            found, used = curves, tolerance
        if apart <= EQUAL and not any(map(_ragged, curves)):
            break
    return (found[0], used), (found[1].reversed() if against else found[1], used)


def _reached(curve: Curve, points: FloatArray) -> FloatArray:
    """#P, the length [m] along the curve at each of the points."""
    import shapely

    line = shapely.LineString(curve.sample())
    places = np.maximum.accumulate(shapely.line_locate_point(line, shapely.points(points)))
    places[[0, -1]] = 0.0, line.length
    return np.asarray(places)


def _uncross(piece: Piece, lines: Mapping[EdgeKey, FloatArray], fitted: dict[EdgeKey, tuple[Curve, float]]) -> None:
    import shapely

    keys = [(piece.name, edge.name) for edge in piece.edges]
    drawn = {key: shapely.LineString(fitted[key][0].sample()) for key in keys}
    if shapely.Polygon(np.concatenate([line.coords[:-1] for line in drawn.values()])).is_valid:
        return
    for key in keys:
        if not drawn[key].is_simple or any(drawn[key].crosses(drawn[other]) for other in keys if other != key):
            fitted[key] = chords(lines[key]), fitted[key][1]
