"""A garment ready for the cutting table: clean curves, cut lines, notches, drill holes, grain and labels.

Everything that the files show is worked out here once; the writers of DXF, SVG, PDF and JSON only draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.pattern.allowance import cut_hole, cut_outline
from warpflat.pattern.curves import TOLERANCE, Curve, arc_lengths, fit_curve
from warpflat.pattern.dart_allowance import WIDEST_DART
from warpflat.pattern.drafted import (
    DraftedCutout,
    DraftedDart,
    DraftedEdge,
    DraftedGarment,
    DraftedPiece,
    DrillHole,
    SeamReport,
)
from warpflat.pattern.fitting import TOLERANCES, fit_edges, is_wavy, smooth_line
from warpflat.pattern.label import Label, default_grain, place_label
from warpflat.pattern.notches import cut_darts, dart_notches, seam_notches, seam_reports
from warpflat.pattern.pieces import SAME_POINT, Dart, Edge, Garment, Hole, Piece, Seam
from warpflat.pattern.seam_difference import SEAM_TOLERANCE
from warpflat.pattern.sides import Side, Wedge
from warpflat.surface.cut.dart_legs import are_curved

__all__ = ["draft_garment", "draft_piece", "eye_legs", "nest_label"]


#: An edge that runs along the grain within this [rad] can carry the grading's fixed point.
ALONG_GRAIN = np.radians(1.0)
#: Allowance [m] of the legs of a dart that is cut away, where they name none, and what there is to be cut away between both.
LEG, BETWEEN = 0.010, 0.005
#: Points of the fold between curved legs.
MIDDLE = 33


def draft_garment(
    garment: Garment, *, tolerance: float | None = None, sizes: Sequence[str] | None = None
) -> DraftedGarment:
    """Draft every piece of a garment and match the notches of its seams.

    Args:
        garment: flat pieces and seams.
        tolerance: how far [m] a fitted curve may lie from the points of an edge; None takes 0.1 mm, and more where
            a border is so ragged that its curve would be all wiggles.
        sizes: only these; None drafts all.

    Raises:
        InputError: an unknown size, or a half piece that reaches across its fold.
    """
    chosen = garment.sizes if sizes is None else tuple(sizes)
    for size in chosen:
        garment.piece(garment.pieces[garment.sizes[0]][0].name, size)
    drafted: dict[str, tuple[DraftedPiece, ...]] = {}
    reports: list[SeamReport] = []
    for size in chosen:
        drawn = _fitted(garment.pieces[size], garment.seams, tolerance)
        pieces = {
            piece.name: _draft(piece, garment.name, drawn[piece.name], tolerance) for piece in garment.pieces[size]
        }
        notches = seam_notches([*garment.seams, *cut_darts(pieces)], pieces)
        drafted[size] = tuple(
            replace(piece, notches=piece.notches + tuple(notches.get(name, ()))) for name, piece in pieces.items()
        )
        reports += seam_reports(garment.seams, pieces, size)
    return DraftedGarment(garment=garment, pieces=drafted, seams=tuple(reports))


def draft_piece(piece: Piece, *, garment: str = "", tolerance: float | None = None) -> DraftedPiece:
    """Draft one piece on its own: every line but the notches that its seams would give it."""
    return _draft(piece, garment, _fitted([piece], (), tolerance)[piece.name], tolerance)


def _draft(piece: Piece, garment: str, edges: tuple[DraftedEdge, ...], tolerance: float | None) -> DraftedPiece:
    frame = _frame(piece)
    wedges, darts = _darts(piece, edges)
    edges = tuple(_widened(edge, piece, darts) for edge in edges)
    cut = cut_outline(_sides(piece, edges, wedges))
    notes = [*cut.notes]
    smoothed = [edge for edge in edges if tolerance is None and edge.tolerance > TOLERANCE]
    if wavy := [edge.name for edge in smoothed if is_wavy(edge.curve)]:
        notes.append(
            f"the border stays ragged at {', '.join(wavy)}: no smooth line of the right length keeps within "
            f"{TOLERANCES[-1] * 1000:.0f} mm of it; a cut along the rows of the mesh, or a finer mesh, may help"
        )
    for dart in piece.darts:
        left, right = (next(e for e in edges if e.name == leg) for leg in (dart.left, dart.right))
        if abs(left.length - right.length) > SEAM_TOLERANCE:
            notes.append(f"dart {dart.name}: its legs differ by {abs(left.length - right.length) * 1000:.1f} mm")
        if not darts[dart.name] and left.width > 0:
            notes.append(
                f"dart {dart.name} is cut away, not folded: {_why_cut(dart, left, right)}; sew its legs as a seam"
            )
        if darts[dart.name] and dart.cut:
            notes.append(
                f"dart {dart.name} is folded, not cut away: its mouth of {_mouth(left, right) * 1000:.0f} mm has no room for the "
                f"allowances of its legs, which bend by {_bend(left, right) * 1000:.0f} mm; pin leg on leg"
            )
    drafted_darts = tuple(_dart_lines(dart, wedges, edges, cut.points) for dart in piece.darts)
    holes = {hole.name: _moved(hole.points, frame) for hole in piece.holes}
    fisheyes = {hole.name: _fisheye(holes[hole.name], tolerance) for hole in piece.holes if hole.kind == "dart"}
    cutouts = {hole.name: _cutout(hole, holes[hole.name]) for hole in piece.holes if hole.kind == "cutout"}
    notes += [
        f"{hole.name} is too small for an allowance of {hole.width * 1000:g} mm: it is cut on its sewing line"
        for hole in piece.holes
        if hole.name in cutouts and cutouts[hole.name].width < hole.width
    ]
    for name, line in fisheyes.items():
        apart = abs(float(np.subtract(*(arc_lengths(leg)[-1] for leg in eye_legs(line)))))
        if apart > SEAM_TOLERANCE:
            notes.append(f"dart {name}: its sides differ by {apart * 1000:.1f} mm")
    drills = [DrillHole(name=dart.dart.name, at=dart.tip) for dart in drafted_darts]
    drills += [DrillHole(name=name, at=end) for name, line in fisheyes.items() for end in eye_legs(line)[0][[0, -1]]]
    internal = {name: _moved(line, frame) for name, line in piece.internal_lines.items()}
    internal = {name: smooth_line(line) if tolerance is None else line for name, line in internal.items()}
    sew_line = np.concatenate([edge.line[:-1] for edge in edges])
    grain = default_grain(sew_line, list(holes.values())) if piece.grain is None else _moved(piece.grain, frame)
    obstacles = [grain, *internal.values()]
    obstacles += [np.concatenate([_line(edges, d.left), _line(edges, d.right)]) for d in piece.darts]
    folds = [edge.line for edge in edges if edge.kind == "fold"]
    # Whether a dart's legs have an allowance is known only now.
    widened = replace(piece, edges=[replace(edge.edge, allowance=edge.width) for edge in edges])
    return DraftedPiece(
        piece=piece,
        frame=frame,
        edges=edges,
        cut_line=cut.points,
        darts=drafted_darts,
        drill_holes=tuple(drills),
        notches=dart_notches(piece, wedges, cut),
        internal_lines=internal,
        cutouts=cutouts,
        fisheyes=fisheyes,
        grain=grain,
        label=place_label(widened, garment, (sew_line, cut.points), list(holes.values()), obstacles, folds),
        notes=tuple(notes),
    )


def _frame(piece: Piece) -> FloatArray:
    """Turns the grain upwards and brings the fixed point of grading into the origin.

    The fixed point is the lower end of the fold, else of the longest straight edge along the grain (a centre back),
    else the middle of the lower border.
    """
    if piece.grain is None:
        turn = np.eye(2)
    else:
        x, y = (piece.grain[1] - piece.grain[0]) / np.linalg.norm(piece.grain[1] - piece.grain[0])
        turn = np.array([[y, -x], [x, y]])
    outline = piece.outline @ turn.T
    low, high = outline.min(axis=0), outline.max(axis=0)
    anchor = np.array([(low[0] + high[0]) / 2, low[1]])
    longest = 0.3 * (high[1] - low[1])
    for edge in sorted(piece.edges, key=lambda e: e.kind != "fold"):
        ends = edge.points[[0, -1]] @ turn.T
        span = ends[1] - ends[0]
        length = float(np.linalg.norm(span))
        if edge.kind != "fold" and (abs(span[0]) > ALONG_GRAIN * length or edge.length > length * 1.0001):
            continue
        if edge.kind == "fold" or length > longest:
            anchor, longest = ends[np.argmin(ends[:, 1])], length
            if edge.kind == "fold":
                break
    return np.column_stack([turn, -anchor])


def _moved(points: FloatArray, frame: FloatArray) -> FloatArray:
    return points @ frame[:, :2].T + frame[:, 2]


def _fitted(
    pieces: Sequence[Piece], seams: Sequence[Seam], tolerance: float | None
) -> dict[str, tuple[DraftedEdge, ...]]:
    """The edges of all pieces as curves, by piece."""
    lines: dict[tuple[str, str], FloatArray] = {}
    for piece in pieces:
        frame = _frame(piece)
        lines |= {(piece.name, edge.name): _moved(edge.points, frame) for edge in piece.edges}
    fitted = fit_edges(pieces, lines, seams, tolerance)
    return {
        piece.name: tuple(
            _drafted_edge(edge, *fitted[piece.name, edge.name], lines[piece.name, edge.name]) for edge in piece.edges
        )
        for piece in pieces
    }


def _drafted_edge(edge: Edge, curve: Curve, tolerance: float, points: FloatArray) -> DraftedEdge:
    import shapely

    line, marks = curve.sample(), shapely.points(points)
    drawn = shapely.LineString(line)
    # Not the nearest place anywhere: a border that nearly touches itself must not jump.
    places = np.maximum.accumulate(shapely.line_locate_point(drawn, marks))
    places[[0, -1]] = 0.0, drawn.length
    fit_error = float(shapely.distance(drawn, marks).max())
    return DraftedEdge(
        edge=edge, curve=curve, line=line, width=edge.width, places=places, fit_error=fit_error, tolerance=tolerance
    )


def _darts(piece: Piece, edges: tuple[DraftedEdge, ...]) -> tuple[dict[str, Wedge], dict[str, bool]]:
    """The darts that are folded, and by name whether each is."""
    wedges, folded = {}, {}
    for dart in piece.darts:
        left, right = _line(edges, dart.left), _line(edges, dart.right)
        wedge = Wedge(name=dart.name, left=left, right=right, fold_to=dart.fold_to or _fold_to(left, right))
        legs = [next(e for e in edges if e.name == name) for name in (dart.left, dart.right)]
        # Legs that are one line (a dart of no width) have nothing to fold.
        folded[dart.name] = SAME_POINT < wedge.opening <= WIDEST_DART and not (dart.cut and _has_room(*legs))
        if folded[dart.name]:
            wedges[dart.name] = wedge
    return wedges, folded


def _has_room(left: DraftedEdge, right: DraftedEdge) -> bool:
    """Whether a dart's mouth is so wide that there is something to cut away between its legs' allowances."""
    widths = _leg_width(left) + _leg_width(right)
    return widths == 0 or _mouth(left, right) >= widths + BETWEEN


def _leg_width(leg: DraftedEdge) -> float:
    return LEG if leg.edge.allowance is None else leg.edge.allowance


def _mouth(left: DraftedEdge, right: DraftedEdge) -> float:
    """How far [m] a dart opens at the border."""
    return float(np.linalg.norm(left.line[0] - right.line[-1]))


def _fold_to(left: FloatArray, right: FloatArray) -> str:
    tip = left[-1]
    away = (left[0] + right[-1]) / 2 - tip
    if abs(away[0]) > abs(away[1]):
        return "left" if left[0, 1] < right[-1, 1] else "right"
    return "left" if abs(left[0, 0]) < abs(right[-1, 0]) else "right"


def _widened(edge: DraftedEdge, piece: Piece, folded: Mapping[str, bool]) -> DraftedEdge:
    """The legs of a dart that is cut out are seams, with a seam's allowance if they name none."""
    if edge.kind != "dart":
        return edge
    dart = next(d for d in piece.darts if edge.name in (d.left, d.right))
    if folded[dart.name]:
        return replace(edge, width=0.0)
    return replace(edge, width=_leg_width(edge))


def _sides(piece: Piece, edges: tuple[DraftedEdge, ...], wedges: Mapping[str, Wedge]) -> list[Side | Wedge]:
    by_left = {dart.left: dart for dart in piece.darts if dart.name in wedges}
    by_right = {dart.right for dart in by_left.values()}
    sides: list[Side | Wedge] = []
    for edge in edges:
        if edge.name in by_left:
            sides.append(wedges[by_left[edge.name].name])
        elif edge.name not in by_right:
            sides.append(Side(name=edge.name, points=edge.line, width=edge.width, kind=edge.kind))
    return sides


def _dart_lines(
    dart: Dart, wedges: Mapping[str, Wedge], edges: tuple[DraftedEdge, ...], cut_line: FloatArray
) -> DraftedDart:
    import shapely

    left, right = _line(edges, dart.left), _line(edges, dart.right)
    wedge = wedges.get(dart.name)
    opening = float(np.linalg.norm(left[0] - right[-1]))
    if wedge is None:
        return DraftedDart(dart=dart, tip=left[-1], fold=None, fold_to="", opening=opening)
    reach = float(np.linalg.norm(cut_line - wedge.tip, axis=1).max()) + 0.01
    ray = shapely.LineString([wedge.tip, wedge.tip + reach * wedge.middle]).intersection(shapely.Polygon(cut_line))
    parts = [part for part in shapely.get_parts(ray) if part.length > 0]
    first = min(parts, key=lambda part: part.distance(shapely.Point(wedge.tip)))
    ends = np.asarray(first.coords)[[0, -1]]
    far = ends[np.argmax(np.linalg.norm(ends - wedge.tip, axis=1))]
    fold = np.stack([wedge.tip, far])
    if are_curved(left, right):
        fold = np.concatenate([_between(left[::-1], right), fold[1:]])
    return DraftedDart(dart=dart, tip=wedge.tip, fold=fold, fold_to=wedge.fold_to, opening=opening)


def _between(first: FloatArray, second: FloatArray) -> FloatArray:
    """The middle line of two lines with one start, by shares of their lengths."""
    shares = np.linspace(0.0, 1.0, MIDDLE)
    sides = [
        np.column_stack([np.interp(shares * arc[-1], arc, line[:, k]) for k in (0, 1)])
        for line, arc in ((line, arc_lengths(line)) for line in (first, second))
    ]
    return np.asarray((sides[0] + sides[1]) / 2)


def _line(edges: tuple[DraftedEdge, ...], name: str) -> FloatArray:
    return next(edge.line for edge in edges if edge.name == name)


def eye_legs(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The two sides (#P by 2 [m]) of a fish-eye dart's closed line, both from its lower tip to its upper one."""
    distance = np.linalg.norm(line[:, None] - line[None], axis=2)
    a, b = sorted(map(int, np.unravel_index(int(distance.argmax()), distance.shape)))
    first, second = line[a : b + 1], np.concatenate([line[b:], line[: a + 1]])
    if tuple(first[0, ::-1]) > tuple(first[-1, ::-1]):
        return second, first[::-1]
    return first, second[::-1]


def _cutout(hole: Hole, points: FloatArray) -> DraftedCutout:
    line = cut_hole(points, hole.width)
    if line is None:
        return DraftedCutout(sew_line=points, cut_line=points, width=0.0)
    return DraftedCutout(sew_line=points, cut_line=line, width=hole.width)


def nest_label(pieces: Sequence[DraftedPiece]) -> Label:
    """What is written on sizes that lie upon each other: the middle one's label, beside all if it stands beside it."""
    middle = pieces[len(pieces) // 2]
    if middle.label.leader is None:
        return middle.label
    right = max(float(piece.cut_line[:, 0].max()) for piece in pieces)
    away = np.array([right - float(middle.cut_line[:, 0].max()), 0.0])
    start, end = middle.label.leader
    return replace(middle.label, at=middle.label.at + away, leader=np.stack([start + away, end]))


def _fisheye(points: FloatArray, tolerance: float | None) -> FloatArray:
    """Its closed line with both sides as clean curves, the first point not repeated."""
    first, second = (fit_curve(leg, tolerance or TOLERANCE).sample() for leg in eye_legs(points))
    return np.concatenate([first[:-1], second[:0:-1]])


def _why_cut(dart: Dart, left: DraftedEdge, right: DraftedEdge) -> str:
    return f"its legs bend by {_bend(left, right) * 1000:.0f} mm" if dart.cut else "it opens too wide"


def _bend(left: DraftedEdge, right: DraftedEdge) -> float:
    """How far [m] the legs of a dart leave their chords."""
    import shapely

    return max(
        float(shapely.distance(shapely.LineString(e.line[[0, -1]]), shapely.points(e.line)).max())
        for e in (left, right)
    )
