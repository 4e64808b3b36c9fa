"""Symmetric pieces as halves on the fold of the cloth, for printing: half the paper, and both sides cut alike."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, arc_lengths, find_unused_name, without_side
from warpflat.pattern.drafting.curves import Curve, chords, farthest, split_bezier
from warpflat.pattern.drafting.draft import draft_half
from warpflat.pattern.drafting.drafted import DraftedEdge, DraftedGarment, DraftedPiece, Notch
from warpflat.pattern.drafting.piece_parts import SAME_POINT, Edge, Hole
from warpflat.pattern.drafting.pieces import Seam
from warpflat.pattern.drafting.seam_difference import SEAM_TOLERANCE
from warpflat.pattern.drafting.shrinkage import as_worn, resized
from warpflat.pattern.files.output import optional_step

__all__ = ["halved", "is_symmetric"]


#: A piece's cut line may stray from its mirror image by as much as its sides may differ where they are sewn [m]; lines inside, which are
#: only drawn, by more.
SYMMETRIC, INNER = SEAM_TOLERANCE, 2e-3
#: Narrower pieces [m] stay whole: half of them saves no paper.
NARROW = 0.10


def halved(garment: DraftedGarment) -> DraftedGarment:
    """Return the garment with every wide piece that is its own mirror image, in all sizes, as a half on the fold.

    A piece whose half cannot be drawn stays whole: a slit along its middle may cross the fold.
    """
    halves: dict[str, list[DraftedPiece]] = {}
    for name in garment.piece_names:
        sizes = garment.all_sizes(name)
        if all(float(np.ptp(p.cut_line[:, 0])) >= NARROW and is_symmetric(p) for p in sizes):
            side = _kept_side(sizes[0], garment.pattern.seams)
            with optional_step(f"{name} is printed whole, not as a half on the fold", is_needed=False):
                halves[name] = [resized(_half(as_worn(p), garment, side), np.array(p.enlarged)) for p in sizes]
    pieces = {
        size: tuple(halves[piece.name].pop(0) if piece.name in halves else piece for piece in row)
        for size, row in garment.pieces.items()
    }
    return replace(garment, pieces=pieces)


def is_symmetric(piece: DraftedPiece) -> bool:
    """Return whether a whole piece is its own mirror image about a line along its grain, darts and holes included."""
    import shapely

    if piece.piece.on_fold or len(piece.piece.edges) < 2 or piece.cutouts:
        return False
    if piece.piece.pleats:
        # Knife pleats all turn one way.
        return False
    axis = _axis(piece)

    def image(points: FloatArray) -> FloatArray:
        return points * [-1.0, 1.0] + [2 * axis, 0.0]

    def has_images(points: Sequence[FloatArray]) -> bool:
        """Return whether the mirror image of each point is one of them, too."""
        found = np.array(points).reshape(-1, 2)
        return not any(np.linalg.norm(found - at, axis=1).min() > INNER for at in image(found))

    def line_has_image(line: FloatArray, others: Iterable[FloatArray]) -> bool:
        strings = map(shapely.LineString, others)
        return bool(min(shapely.hausdorff_distance(shapely.LineString(image(line)), each) for each in strings) <= INNER)

    around, tips = np.concatenate([piece.cut_line, piece.cut_line[:1]]), [dart.tip for dart in piece.darts]
    if farthest(around, image(piece.cut_line)) > SYMMETRIC or not has_images(tips):
        return False
    if any(abs(tip[0] - axis) <= INNER for tip in tips):
        # One leg of a dart in the middle would be lost on the fold.
        return False
    # A strip is sewn to pieces that are not its mirror images: its notches must be so themselves.
    strip = piece.piece.role in ("strip", "waistband", "cuff", "collar", "hood")
    if strip and not has_images([base for notch in piece.notches for base in notch.base]):
        return False
    if not has_images([hole.at for hole in piece.drill_holes]):
        return False
    groups = [list(piece.internal_lines.values()), list(piece.fisheyes.values())]
    crosses = any(np.ptp(np.sign(line[:, 0] - axis)) for line in piece.fisheyes.values())
    return all(line_has_image(line, lines) for lines in groups for line in lines) and not crosses


def _axis(piece: DraftedPiece) -> float:
    """Return where the axis of a symmetric piece lies across its grain [m]."""
    return float(piece.cut_line[:, 0].min() + piece.cut_line[:, 0].max()) / 2


def _kept_side(piece: DraftedPiece, seams: Sequence[Seam]) -> float:
    """Return the side that is drawn, -1 or 1 along x: whose seams meet the drawn copies, else the left one's."""
    axis, votes = _axis(piece), 0.0
    for seam in seams:
        for chain, others in (seam.sides, seam.sides[::-1]):
            for side in chain:
                if side.piece == piece.name and any(other.mirrored for other in others):
                    votes -= 2 * _side_of(piece.edge(side.edge).line, axis)
    for edge in piece.edges:
        words = edge.name.split(" ")
        votes += _side_of(edge.line, axis) * (("left" in words) - ("right" in words)) / len(piece.edges)
    return 1.0 if votes >= 0 else -1.0


def _side_of(line: FloatArray, axis: float) -> float:
    """Return on which side of the axis a line lies, -1 or 1 along x; 0 if it crosses it."""
    return float(np.sign(line[:, 0].min() - axis + SAME_POINT) + np.sign(line[:, 0].max() - axis - SAME_POINT)) / 2


def _half(piece: DraftedPiece, garment: DraftedGarment, side: float) -> DraftedPiece:
    """Return the half of a symmetric piece on one side, with the fold along x = 0 and its lower end in the origin."""
    import shapely

    axis = _axis(piece)
    # What of the edges lies on one side of the axis, in order, the first after the gap where the other half was.
    edges = list[DraftedEdge]()
    for whole in piece.edges:
        clipped = [_clipped(control, axis, side) for control in whole.curve.bezier]
        has_part = np.array([part is not None for part in clipped])
        if has_part.any():
            bezier = np.stack([part for part in clipped if part is not None])
            edges.append(_with_curve(whole, Curve(bezier=bezier, straight=whole.curve.straight[has_part])))
    gaps = [float(np.linalg.norm(edges[k - 1].line[-1] - edges[k].line[0])) for k in range(len(edges))]
    first = next(k for k, gap in enumerate(gaps) if gap > 10 * SAME_POINT)
    edges = [*edges[first:], *edges[:first]]
    ends = edges[-1].line[-1], edges[0].line[0]
    shift = -min(ends, key=lambda end: float(end[1]))
    names = {edge.name: without_side(edge.name) for edge in edges}
    if len(set(names.values())) < len(names):
        names = {name: name for name in names}
    moved = [
        _with_curve(edge, replace(edge.curve, bezier=edge.curve.bezier + shift), names[edge.name]) for edge in edges
    ]
    # The edge along the axis is named as the line of the piece that lies there.
    along = [name for name, line in piece.internal_lines.items() if np.abs(line[:, 0] - axis).max() < INNER]
    name = next((name for name in along if name not in names.values()), "fold")
    fold = chords(np.stack(ends) + shift)
    points = fold.nodes
    drafted = DraftedEdge(
        edge=Edge(name=name, points=points, kind="fold"),
        curve=fold,
        line=points,
        width=0.0,
        places=arc_lengths(points),
        fit_error=0.0,
        tolerance=0.0,
    )
    # The parts of lines on one side of the axis, without those that lie on it.
    far = 10.0
    box = shapely.box(min(axis, axis + side * far), -far, max(axis, axis + side * far), far)
    lines: dict[str, FloatArray] = {}
    for name, line in piece.internal_lines.items():
        # Of a closed line the part around its first point comes in two.
        for part in shapely.get_parts(shapely.line_merge(shapely.intersection(shapely.LineString(line), box))):
            points = shapely.get_coordinates(part)
            if len(points) > 1 and np.abs(points[:, 0] - axis).max() > INNER:
                lines[find_unused_name(without_side(name), lines)] = points + shift
    half = replace(
        piece.piece,
        edges=[*(edge.edge for edge in moved), drafted.edge],
        darts=[
            replace(
                dart.dart, name=without_side(dart.dart.name), left=names[dart.dart.left], right=names[dart.dart.right]
            )
            for dart in piece.darts
            if dart.dart.left in names
        ],
        holes=[
            Hole(name=without_side(name), points=line + shift, kind="dart")
            for name, line in piece.fisheyes.items()
            if side * (line[0, 0] - axis) > 0.0
        ],
        internal_lines=lines,
        marks={
            hole.name: hole.at + shift
            for hole in piece.drill_holes
            if hole.name in piece.piece.marks and side * (hole.at[0] - axis) > -SAME_POINT
        },
        grain=None,
        at="",
        placement=None,
        levels={},
    )
    # Each notch moves with the half, on which it gets the nearest edge.
    notches = []
    for notch in _notches_beside(piece, garment.pattern.seams, names, axis, side):
        at, bases, slit = notch.at + shift, [base + shift for base in notch.base], notch.direction
        place = shapely.Point(at)
        nearest = min(moved, key=lambda edge: float(shapely.LineString(edge.line).distance(place)))
        if abs(at[0]) <= SYMMETRIC and len(bases) == 1:
            # Its slit runs along the fold, x = 0.
            upright = np.array([0.0, 1.0])
            at, bases, slit = at * upright, [bases[0] * upright], np.sign(slit[1]) * upright
        # Of a double notch on the fold one slit is the other's mirror image.
        bases = [base for base in bases if side * base[0] >= -SYMMETRIC]
        notches.append(replace(notch, edge=nearest.name, at=at, base=tuple(bases), direction=slit))
    return draft_half(half, garment.name, (*moved, drafted), tuple(notches), piece.notes)


def _notches_beside(
    piece: DraftedPiece, seams: Sequence[Seam], edges: Collection[str], axis: float, side: float
) -> list[Notch]:
    """Return the notches of seams on one side of the axis.

    A seam across the axis (a waist) whose notches all lie on the other side gets their mirror images.
    """
    darts = {dart.dart.name for dart in piece.darts}
    on_side = [
        notch
        for notch in piece.notches
        if notch.seam not in darts and notch.edge in edges and side * (notch.at[0] - axis) > -SAME_POINT
    ]
    across = {seam.name for seam in seams for s in seam.stretches if s.piece == piece.name and s.edge in edges}
    across -= {notch.seam for notch in on_side}
    flip, moved_by = np.array([-1.0, 1.0]), np.array([2 * axis, 0.0])
    for notch in piece.notches:
        if notch.seam in across:
            bases = tuple(base * flip + moved_by for base in notch.base)
            on_side.append(replace(notch, at=notch.at * flip + moved_by, base=bases, direction=notch.direction * flip))
    return on_side


def _clipped(control: FloatArray, axis: float, side: float) -> FloatArray | None:
    """Return the part of a cubic (4 by 2) on one side of a line x = axis that it crosses once at most."""
    away = side * (control[:, 0] - axis)
    if abs(away[0]) <= SAME_POINT and abs(away[3]) <= SAME_POINT:
        # It bows to one side, as the edge of a gore from tip to tip.
        return control if away[1] + away[2] > SAME_POINT else None
    if away[0] <= SAME_POINT and away[3] <= SAME_POINT:
        return None
    if away[0] >= -SAME_POINT and away[3] >= -SAME_POINT:
        return control
    a, b, c, d = away
    roots = np.roots([d - 3 * c + 3 * b - a, 3 * c - 6 * b + 3 * a, 3 * b - 3 * a, a])
    t = min((float(r.real) for r in roots if abs(r.imag) < 1e-9 and -1e-9 <= r.real <= 1 + 1e-9), default=0.5)
    before, after = split_bezier(control, t)
    before[-1, 0] = after[0, 0] = axis
    return before if away[0] > 0 else after


def _with_curve(edge: DraftedEdge, curve: Curve, name: str = "") -> DraftedEdge:
    """Return an edge along another curve, of the same kind and width, and of the same name if no other is given."""
    line = curve.sample()
    shortened = Edge(name=name or edge.name, points=line, kind=edge.kind, allowance=edge.width)
    return replace(edge, edge=shortened, curve=curve, line=line, places=arc_lengths(line), mesh_vertices=None)
