"""Symmetric pieces as halves on the fold of the cloth, for printing: half the paper, and both sides cut alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, arc_lengths, optional_step, without_side
from warpflat.pattern.drafting.curves import Curve, split_bezier
from warpflat.pattern.drafting.draft import draft_half
from warpflat.pattern.drafting.drafted import DraftedEdge, DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.piece_parts import Edge, Hole
from warpflat.pattern.drafting.pieces import Piece, Seam

__all__ = ["halved", "is_symmetric"]


#: A piece's cut line may stray from its mirror image by this much [m]; lines inside, which are only drawn, by more.
SYMMETRIC, INNER = 5e-4, 2e-3
#: Narrower pieces [m] stay whole: half of them saves no paper.
NARROW = 0.10
#: What lies closer to the axis than this [m] lies on it.
ON_AXIS = 1e-6


def halved(garment: DraftedGarment) -> DraftedGarment:
    """Return the garment with every wide piece that is its own mirror image, in all sizes, as a half on the fold.

    A piece whose half cannot be drawn stays whole: a slit along its middle may cross the fold.
    """
    halves: dict[str, list[DraftedPiece]] = {}
    for name in garment.piece_names:
        sizes = garment.all_sizes(name)
        if all(float(np.ptp(p.cut_line[:, 0])) >= NARROW and is_symmetric(p) for p in sizes):
            side = _kept_side(sizes[0], garment.garment.seams)
            with optional_step(f"{name} is printed whole, not as a half on the fold", is_needed=False):
                halves[name] = [_half(p, garment, side) for p in sizes]
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
    if any(name.startswith("pleat fold") for name in piece.internal_lines):
        # Knife pleats all turn one way.
        return False
    axis = _axis(piece)

    def strays(line: FloatArray, others: FloatArray) -> float:
        return float(shapely.hausdorff_distance(shapely.LineString(line), shapely.LineString(others)))

    mirror = np.array([-1.0, 1.0])
    ring = shapely.LinearRing(piece.cut_line)
    image = piece.cut_line * mirror + [2 * axis, 0]
    if float(shapely.distance(ring, shapely.points(image)).max()) > SYMMETRIC:
        return False
    tips = np.array([dart.tip for dart in piece.darts]).reshape(-1, 2)
    images = tips * mirror + [2 * axis, 0]
    if any(np.linalg.norm(tips - tip, axis=1).min() > INNER for tip in images):
        return False
    if (np.abs(tips[:, 0] - axis) <= INNER).any():
        # One leg of a dart in the middle would be lost on the fold.
        return False
    # A strip is sewn to pieces that are not its mirror images: its notches must be so themselves.
    notched = np.array([base for notch in piece.notches for base in notch.base]).reshape(-1, 2)
    if piece.piece.role in ("strip", "waistband", "cuff", "collar", "hood") and any(
        np.linalg.norm(notched - base, axis=1).min() > INNER for base in notched * mirror + [2 * axis, 0]
    ):
        return False
    marks = np.array([hole.at for hole in piece.drill_holes]).reshape(-1, 2)
    if any(np.linalg.norm(marks - mark, axis=1).min() > INNER for mark in marks * mirror + [2 * axis, 0]):
        return False
    return all(
        min(strays(line * mirror + [2 * axis, 0], other) for other in lines) <= INNER
        for lines in (list(piece.internal_lines.values()), list(piece.fisheyes.values()))
        for line in lines
    ) and not any(np.ptp(np.sign(line[:, 0] - axis)) for line in piece.fisheyes.values())


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
    return float(np.sign(line[:, 0].min() - axis + ON_AXIS) + np.sign(line[:, 0].max() - axis - ON_AXIS)) / 2


def _half(piece: DraftedPiece, garment: DraftedGarment, side: float) -> DraftedPiece:
    """Return the half of a symmetric piece on one side, with the fold along x = 0 and its lower end in the origin."""
    import shapely

    axis = _axis(piece)
    edges = []
    for whole in piece.edges:
        clipped = [_clipped(control, axis, side) for control in whole.curve.bezier]
        has_part = np.array([part is not None for part in clipped])
        if has_part.any():
            bezier = np.stack([part for part in clipped if part is not None])
            edges.append(_with_curve(whole, Curve(bezier=bezier, straight=whole.curve.straight[has_part])))
    # The first edge after the gap where the other half was.
    first = next(
        k
        for k in range(len(edges))
        if float(np.linalg.norm(edges[k - 1].curve.bezier[-1, 3] - edges[k].curve.bezier[0, 0])) > 10 * ON_AXIS
    )
    edges = [*edges[first:], *edges[:first]]
    start, end = edges[-1].curve.bezier[-1, 3], edges[0].curve.bezier[0, 0]
    low = start if start[1] < end[1] else end
    shift = -low
    edges = [_with_curve(edge, Curve(bezier=edge.curve.bezier + shift, straight=edge.curve.straight)) for edge in edges]
    names = {edge.name: without_side(edge.name) for edge in edges}
    if len(set(names.values())) < len(names):
        names = {name: name for name in names}
    edges = [replace(edge, edge=replace(edge.edge, name=names[edge.name])) for edge in edges]
    # The edge along the axis is named as the line of the piece that lies there.
    start, end = edges[-1].line[-1], edges[0].line[0]
    taken = {edge.name for edge in edges}
    candidates = [
        name for name, line in piece.internal_lines.items() if np.abs(line[:, 0] - _axis(piece)).max() < INNER
    ]
    name = next((name for name in candidates if name not in taken), "fold")
    thirds = np.stack([start + k / 3 * (end - start) for k in range(4)])
    curve = Curve(bezier=thirds[None], straight=np.array([True]))
    edge = Edge(name=name, points=np.stack([start, end]), kind="fold")
    edges.append(
        DraftedEdge(
            edge=edge,
            curve=curve,
            line=np.stack([start, end]),
            width=0.0,
            places=np.array([0.0, float(np.linalg.norm(end - start))]),
            fit_error=0.0,
            tolerance=0.0,
        )
    )
    darts = [
        replace(dart.dart, name=without_side(dart.dart.name), left=names[dart.dart.left], right=names[dart.dart.right])
        for dart in piece.darts
        if dart.dart.left in names
    ]
    holes = [
        Hole(name=without_side(name), points=line + shift, kind="dart")
        for name, line in piece.fisheyes.items()
        if side * (line[0, 0] - axis) > 0.0
    ]
    # The parts of lines on one side of the axis, without those that lie on it.
    far = 10.0
    box = shapely.box(min(axis, axis + side * far), -far, max(axis, axis + side * far), far)
    kept: dict[str, FloatArray] = {}
    for name, line in piece.internal_lines.items():
        inside = shapely.intersection(shapely.LineString(line), box)
        parts = [part for part in shapely.get_parts(inside) if part.geom_type == "LineString"]
        for part in parts:
            points = np.asarray(part.coords)
            if len(points) > 1 and np.abs(points[:, 0] - axis).max() > INNER and without_side(name) not in kept:
                kept[without_side(name)] = points + shift
    half = Piece(
        name=piece.name,
        size=piece.size,
        fabric=piece.piece.fabric,
        quantity=piece.piece.quantity,
        edges=[edge.edge for edge in edges],
        darts=darts,
        holes=holes,
        internal_lines=kept,
        marks={
            hole.name: hole.at + shift
            for hole in piece.drill_holes
            if hole.name in piece.piece.marks and side * (hole.at[0] - axis) > -ON_AXIS
        },
        role=piece.piece.role,
        also=piece.piece.also,
        paired=piece.piece.paired,
        title=piece.piece.title,
        units=piece.piece.units,
    )
    # The notches of seams on one side of the axis, each on its edge of the half. A seam across the axis (a waist) whose
    # notches all lie on the other side gets their mirror images.
    lines = [(e.name, e.line - shift) for e in edges[:-1]]
    axis, dart_names = _axis(piece), {dart.dart.name for dart in piece.darts}
    on_side = [
        n for n in piece.notches if n.seam not in dart_names and n.edge in names and side * (n.at[0] - axis) > -ON_AXIS
    ]
    across = {
        seam.name for seam in garment.garment.seams for s in seam.stretches if s.piece == piece.name and s.edge in names
    }
    across -= {notch.seam for notch in on_side}
    flip, moved_by = np.array([-1.0, 1.0]), np.array([2 * axis, 0.0])
    for notch in piece.notches:
        if notch.seam in across:
            bases = tuple(base * flip + moved_by for base in notch.base)
            on_side.append(replace(notch, at=notch.at * flip + moved_by, base=bases, direction=notch.direction * flip))
    drawn = [shapely.LineString(line) for _, line in lines]
    nearest = [lines[int(np.argmin(shapely.distance(drawn, shapely.Point(notch.at))))][0] for notch in on_side]
    notches = []
    for notch, name in zip(on_side, nearest, strict=True):
        placed = replace(notch, edge=name, at=notch.at + shift, base=tuple(base + shift for base in notch.base))
        if abs(placed.at[0]) <= SYMMETRIC and len(placed.base) == 1:
            # Its slit runs along the fold, x = 0.
            upright = np.array([0.0, 1.0])
            placed = replace(
                placed, at=placed.at * upright, base=(placed.base[0] * upright,),
                direction=np.sign(placed.direction[1]) * upright,
            )  # fmt: skip
        # Of a double notch on the fold one slit is the other's mirror image.
        placed = replace(placed, base=tuple(base for base in placed.base if side * base[0] >= -SYMMETRIC))
        notches.append(placed)
    return replace(draft_half(half, garment.name, tuple(edges), tuple(notches), piece.notes), enlarged=piece.enlarged)


def _clipped(control: FloatArray, axis: float, side: float) -> FloatArray | None:
    """Return the part of a cubic (4 by 2) on one side of a line x = axis that it crosses once at most."""
    away = side * (control[:, 0] - axis)
    if abs(away[0]) <= ON_AXIS and abs(away[3]) <= ON_AXIS:
        # It bows to one side, as the edge of a gore from tip to tip.
        return control if away[1] + away[2] > ON_AXIS else None
    if away[0] <= ON_AXIS and away[3] <= ON_AXIS:
        return None
    if away[0] >= -ON_AXIS and away[3] >= -ON_AXIS:
        return control
    a, b, c, d = away
    roots = np.roots([d - 3 * c + 3 * b - a, 3 * c - 6 * b + 3 * a, 3 * b - 3 * a, a])
    t = min((float(r.real) for r in roots if abs(r.imag) < 1e-9 and -1e-9 <= r.real <= 1 + 1e-9), default=0.5)
    before, after = split_bezier(control, t)
    before[-1, 0] = after[0, 0] = axis
    return before if away[0] > 0 else after


def _with_curve(edge: DraftedEdge, curve: Curve) -> DraftedEdge:
    """Return an edge along another curve, of the same name, kind and width."""
    line = curve.sample()
    shortened = Edge(name=edge.name, points=line, kind=edge.kind, allowance=edge.width)
    return replace(edge, edge=shortened, curve=curve, line=line, places=arc_lengths(line))
