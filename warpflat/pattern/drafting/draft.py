"""A garment ready for the cutting table: clean curves, cut lines, notches, drill holes, grain and labels.

Everything that the files show is worked out here once; the writers of DXF, SVG, PDF and JSON only draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, polyline_length
from warpflat.pattern.drafting.allowance import cut_hole, cut_outline
from warpflat.pattern.drafting.curves import TOLERANCE, Curve
from warpflat.pattern.drafting.drafted import (
    DraftedCutout,
    DraftedEdge,
    DraftedGarment,
    DraftedPiece,
    DrillHole,
    Notch,
    SeamReport,
)
from warpflat.pattern.drafting.drafted_darts import dart_notes, draft_dart, fisheye_legs, fold_darts, smooth_fisheye
from warpflat.pattern.drafting.fitting import (
    ALIKE,
    TOLERANCES,
    as_in_layout,
    equal_sides,
    fit_edges,
    is_wavy,
    lengths_along,
    smooth_line,
    uncrossed,
)
from warpflat.pattern.drafting.label import Label
from warpflat.pattern.drafting.measures import length_words
from warpflat.pattern.drafting.names import dart_words
from warpflat.pattern.drafting.notches import cut_darts, dart_notches, seam_notches, seam_reports
from warpflat.pattern.drafting.pieces import Pattern, Piece, Place, Seam
from warpflat.pattern.drafting.placement import default_grain, place_label
from warpflat.pattern.drafting.polygons import mapped, upright
from warpflat.pattern.drafting.seam_difference import SEAM_TOLERANCE
from warpflat.pattern.drafting.sides import Side, Wedge
from warpflat.pattern.drafting.truing import CornerReport, true_corners
from warpflat.pattern.drafting.words import printed_in
from warpflat.pattern.files.output import optional_step

__all__ = ["draft_garment", "draft_half", "nest_label", "relabelled"]


#: A grain line may lie beyond the sewing line by this much [m], as along a fold.
GRAIN_ON_BORDER = 1e-4
#: A grain line lies this far [m] from a line along it; how far it is moved aside for that, in order of preference.
GRAIN_CLEAR, GRAIN_ASIDE = 0.003, (0.0, 0.008, -0.008, 0.014, -0.014)
#: An edge that runs along the grain within this [rad] can carry the grading's fixed point.
ALONG_GRAIN = np.radians(1.0)


def draft_garment(
    garment: Pattern,
    *,
    tolerance: float | None = None,
    sizes: Sequence[str] | None = None,
    true: bool = True,
) -> DraftedGarment:
    """Draft every piece of a garment and match the notches of its seams.

    Args:
        garment: flat pieces and seams.
        tolerance: how far [m] a fitted curve may lie from the points of an edge, but where its corners are trued; None
            takes 0.1 mm, and more where a border is so ragged that its curve would be all wiggles.
        sizes: only these; None drafts all.
        true: whether edges are made to run on smoothly across seams (see :func:`warpflat.pattern.drafting.truing.true_corners`).

    Raises:
        InputError: an unknown size, or no piece can be drawn; one of several that cannot is left out, with its seams and a note.
    """
    import shapely

    with printed_in(garment.words):
        chosen = garment.sizes if sizes is None else tuple(sizes)
        for size in chosen:
            garment.check_size(size)
        drafted: dict[str, tuple[DraftedPiece, ...]] = {}
        reports: list[SeamReport] = []
        corners: list[CornerReport] = []
        for size in chosen:
            edges, trued = _fitted_edges(garment.pieces[size], garment.seams, tolerance, true=true)
            corners += trued
            pieces = dict[str, DraftedPiece]()
            for piece in garment.pieces[size]:
                step = optional_step(f"{piece.name} was left out of the pattern")
                with step if len(garment.pieces[size]) > 1 else nullcontext():
                    try:
                        pieces[piece.name] = _draft(piece, garment.name, edges[piece.name], tolerance)
                    except shapely.errors.GEOSException as error:
                        words = str(error).partition(". ")[0]
                        raise InputError(
                            f"its lines lie over each other as they are drawn: {words}; cut it apart"
                        ) from error
            failed = {piece.name for piece in garment.pieces[size]} - pieces.keys()
            if failed:
                return draft_garment(garment.without(failed), tolerance=tolerance, sizes=sizes, true=true)
            seams = [seam.of_size(size) for seam in garment.seams]
            notches = seam_notches([*seams, *cut_darts(pieces)], pieces)
            drafted[size] = tuple(
                replace(piece, notches=piece.notches + tuple(notches.get(name, ()))) for name, piece in pieces.items()
            )
            reports += seam_reports(seams, {piece.name: piece for piece in drafted[size]}, size)
        return DraftedGarment(pattern=garment, pieces=drafted, seams=tuple(reports), corners=tuple(corners))


def draft_half(
    piece: Piece,
    garment: str,
    edges: tuple[DraftedEdge, ...],
    notches: tuple[Notch, ...],
    notes: tuple[str, ...],
) -> DraftedPiece:
    """Draft the half of a drafted piece: its lines, its notches in seams and its notes are kept as they are.

    The half's frame is its own: the lower end of its fold is the origin, its grain runs upwards.
    """
    half = _draft(piece, garment, edges, 0.0)
    return replace(half, notches=half.notches + notches, notes=notes)


def relabelled(piece: DraftedPiece, garment: str, joints: Sequence[FloatArray]) -> DraftedPiece:
    """Return a piece with its label where no joint of two sheets (2 by 2 [m] each) crosses it."""
    return replace(piece, label=place_label(piece, garment, joints))


def _draft(piece: Piece, garment: str, edges: tuple[DraftedEdge, ...], tolerance: float | None) -> DraftedPiece:
    """Draft one piece whose edges are fitted: cut line, darts, holes, lines, label and notes."""
    import shapely

    frame = _frame(piece)
    edges, wedges = fold_darts(piece, edges)
    by_name = {edge.name: edge for edge in edges}
    # The outline in order; a wedge stands for both legs of a folded dart.
    folded = {dart.left: wedges[dart.name] for dart in piece.darts if dart.name in wedges}
    right_legs = {dart.right for dart in piece.darts if dart.name in wedges}
    sides: list[Side | Wedge] = []
    for edge in edges:
        if edge.name in folded:
            sides.append(folded[edge.name])
        elif edge.name not in right_legs:
            sides.append(Side(name=edge.name, points=edge.line, width=edge.width, kind=edge.kind))
    cut = cut_outline(sides)
    legs = [(by_name[dart.left], by_name[dart.right]) for dart in piece.darts]
    darts = tuple(
        draft_dart(dart, left.line, right.line, wedges.get(dart.name), cut.points)
        for dart, (left, right) in zip(piece.darts, legs, strict=True)
    )
    holes = {hole.name: mapped(hole.points, frame) for hole in piece.holes}
    fisheyes = {hole.name: smooth_fisheye(holes[hole.name], tolerance) for hole in piece.holes if hole.kind == "dart"}
    cutouts = {}
    for hole in (hole for hole in piece.holes if hole.kind == "cutout"):
        # A hole that is too small for an allowance is cut on its sewing line.
        points = holes[hole.name]
        line = cut_hole(points, hole.width)
        cutouts[hole.name] = DraftedCutout(
            sew_line=points, cut_line=points if line is None else line, width=0.0 if line is None else hole.width
        )
    lines = {name: mapped(line, frame) for name, line in piece.internal_lines.items()}
    internal = {name: smooth_line(line) if tolerance is None else line for name, line in lines.items()}
    sew_line = np.concatenate([edge.line[:-1] for edge in edges])
    grain = None if piece.grain is None else mapped(piece.grain, frame)
    # The middle of a curved piece, such as a facing, lies outside it.
    if grain is None or not shapely.Polygon(sew_line).buffer(GRAIN_ON_BORDER).covers(shapely.LineString(grain)):
        grain = default_grain(sew_line, list(holes.values()))
    grain = _beside_lines(grain, list(internal.values()), sew_line)
    # Pleats are not marked through the cloth.
    drilled = [DrillHole(name=dart.dart.name, at=dart.tip) for dart in darts if dart.dart.pleat is None]
    drilled += [
        DrillHole(name=name, at=end) for name, line in fisheyes.items() for end in fisheye_legs(line)[0][[0, -1]]
    ]
    uneven = []
    for name, line in fisheyes.items():
        first, second = map(polyline_length, fisheye_legs(line))
        if abs(first - second) > SEAM_TOLERANCE:
            uneven.append(f"{dart_words(name)}: its sides differ by {length_words(abs(first - second), piece.units)}")
    # What even the widest tolerance leaves wavy.
    wavy = [e.name for e in edges if tolerance is None and e.tolerance > TOLERANCE and is_wavy(e.curve)]
    ragged = [
        f"the border stays ragged at {', '.join(wavy)}: no smooth line of the right length keeps within "
        f"{length_words(TOLERANCES[-1], piece.units)} of it; a cut along the rows of the mesh, or a finer mesh, may help"
    ]
    drafted = DraftedPiece(
        piece=piece,
        frame=frame,
        edges=edges,
        cut_line=cut.points,
        darts=darts,
        drill_holes=(
            *drilled,
            *(DrillHole(name=name, at=mapped(at[None], frame)[0]) for name, at in piece.marks.items()),
        ),
        notches=dart_notches(piece, wedges, cut),
        internal_lines=internal,
        cutouts=cutouts,
        fisheyes=fisheyes,
        grain=grain,
        label=Label(at=np.zeros(2), lines=()),
        notes=(
            *cut.notes,
            *(ragged if wavy else ()),
            *(note for dart, both in zip(darts, legs, strict=True) for note in dart_notes(dart, *both, piece.units)),
            *[
                f"{hole.name} is too small for an allowance of {length_words(hole.width, piece.units)}: it is cut on its sewing line"
                for hole in piece.holes
                if hole.name in cutouts and cutouts[hole.name].width < hole.width
            ],
            *uneven,
        ),
    )
    return relabelled(drafted, garment, ())


def _beside_lines(grain: FloatArray, lines: Sequence[FloatArray], sew_line: FloatArray) -> FloatArray:
    """Return the grain line (2 by 2 [m]) moved aside, where it would lie on a line that runs along it, such as a fold."""
    import shapely

    room = shapely.Polygon(sew_line).buffer(GRAIN_ON_BORDER)
    drawn = shapely.MultiLineString([line for line in lines if len(line) > 1])
    for aside in GRAIN_ASIDE:
        moved = grain + np.array([aside, 0.0])
        line = shapely.LineString(moved)
        if room.covers(line) and line.buffer(GRAIN_CLEAR).intersection(drawn).length < 0.5 * line.length:
            return moved
    return grain


def _frame(piece: Piece) -> FloatArray:
    """Return the map (2 by 3) that turns the grain upwards and brings the fixed point of grading into the origin.

    The fixed point is the lower end of the fold, else of the longest straight edge along the grain (a centre back),
    else the middle of the lower border.
    """
    turn = np.eye(2) if piece.grain is None else upright(piece.grain[1] - piece.grain[0])
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
        # Of edges that are equally long the first, whatever the rounding.
        if edge.kind == "fold" or length > longest + ALIKE:
            anchor, longest = ends[np.argmin(ends[:, 1])], length
            if edge.kind == "fold":
                break
    return np.column_stack([turn, -anchor])


def _fitted_edges(
    pieces: Sequence[Piece], seams: Sequence[Seam], tolerance: float | None, *, true: bool
) -> tuple[dict[str, tuple[DraftedEdge, ...]], list[CornerReport]]:
    """Return the edges of all pieces as curves with trued corners, by piece, and a report on each."""
    import shapely

    lines: dict[Place, FloatArray] = {}
    for piece in pieces:
        frame = _frame(piece)
        lines |= {(piece.name, edge.name): mapped(edge.points, frame) for edge in piece.edges}
    fitted = fit_edges(pieces, lines, seams, tolerance)
    curves = equal_sides(pieces, seams, {key: curve for key, (curve, _) in fitted.items()})
    corners = list[CornerReport]()
    trued: Mapping[Place, Curve] = curves
    if true:
        # Turned ends change lengths a little, too.
        trued, corners = true_corners(pieces, seams, curves)
        trued = equal_sides(pieces, seams, trued)
    trued = uncrossed(pieces, lines, as_in_layout(lines, seams, trued))
    edges = {}
    for piece in pieces:
        drafted = list[DraftedEdge]()
        for edge in piece.edges:
            key = (piece.name, edge.name)
            line, marks = trued[key].sample(), shapely.points(lines[key])
            # The fit is that before truing.
            untrued = shapely.LineString(line if trued[key] is curves[key] else curves[key].sample())
            drafted.append(
                DraftedEdge(
                    edge=edge,
                    curve=trued[key],
                    line=line,
                    width=edge.width,
                    places=lengths_along(trued[key], lines[key]),
                    fit_error=float(shapely.distance(untrued, marks).max()),
                    tolerance=fitted[key][1],
                    mesh_vertices=edge.vertices,
                )
            )
        edges[piece.name] = tuple(drafted)
    return edges, corners


def nest_label(pieces: Sequence[DraftedPiece]) -> Label:
    """Return the label of sizes that lie upon each other: the middle one's, moved beside all if it has a leader."""
    middle = pieces[len(pieces) // 2]
    if middle.label.leader is None:
        return middle.label
    right = max(float(piece.cut_line[:, 0].max()) for piece in pieces)
    away = np.array([right - float(middle.cut_line[:, 0].max()), 0.0])
    start, end = middle.label.leader
    return replace(middle.label, at=middle.label.at + away, leader=np.stack([start + away, end]))
