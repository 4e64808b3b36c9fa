"""Facings of free edges: pieces that repeat an edge and a strip along it, joined as the pieces themselves are.

The facing of a button stand may be grown on: then it is the mirror image of that strip beyond the stand's edge, on which the
cloth is folded.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, find_unused_name, points_at_lengths, without_side
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

__all__ = ["INNER", "STAND", "STAND_END", "Stand", "centre_notch", "is_beside", "with_facings", "with_stand_facings"]

#: What the outer edge and the lower end of a button stand are called, after its line, and the inner edge of a facing.
STAND, STAND_END, INNER = "button stand", "stand end", "inner edge"
# The inner edge of a facing is rounded where its edges meet [m].
_ROUND = 0.030


@dataclass(frozen=True, kw_only=True)
class Stand:
    """The outer edge of a button stand, to be faced.

    Attributes:
        piece, edge: names.
        grown_on: whether the facing is folded, not sewn.
        width: of the facing [m].
    """

    piece: str
    edge: str
    grown_on: bool
    width: float


#: By piece and edge, the piece and edge that the facing has for it, and whether that runs the other way.
_Parts = dict[tuple[str, str], tuple[str, str, bool]]


def with_facings(
    pattern: Pattern,
    places: Sequence[tuple[str, str]],
    width: float,
    *,
    gaps: Collection[str] = (),
    stands: Sequence[Stand] = (),
) -> Pattern:
    """Return a pattern with a facing along each of some free edges, joined as the pieces themselves are.

    A button stand beside one of the edges is faced by the same piece, and so is a keyhole.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        width: [m].
        gaps: names of seams that an opening leaves open at their upper end; the facing's ends are turned in there.
        stands: of the pattern.

    Raises:
        InputError: a dart ends in an edge, or the facing would not lie within the piece.
    """
    parts: _Parts = {}
    pieces = {size: list(row) for size, row in pattern.pieces.items()}
    seams, called = list(pattern.seams), {seam.name for seam in pattern.seams}
    taken = {piece.name for piece in pattern.pieces[pattern.sample]}
    for name, edge in places:
        title = find_unused_name(f"{name}_{edge}_facing".replace(" ", "_"), taken)
        taken.add(title)
        stand = next((each for each in stands if is_beside(pattern, each, (name, edge))), None)
        grown_on = stand is not None and stand.grown_on
        sample = pattern.piece(name, pattern.sample)
        for row in pieces.values():
            at = next(k for k, piece in enumerate(row) if piece.name == name)
            strip = facing_edges(
                row[at], _chain(row[at], edge, stand), width, around=row[at].internal_lines.get("keyhole")
            )
            if stand is not None and grown_on:
                row[at] = _folded_over(row[at], stand.edge, strip)
            else:
                row.append(_facing_piece(row[at], strip, title))
        words = find_unused_name(title.replace("_", " "), called)
        called.add(words)
        for each in (edge, *_ends(sample, _chain(sample, edge, stand))):
            parts[name, each] = (name, f"facing {each}", True) if grown_on else (title, each, False)
        side = SeamSide(piece=name, edge=edge)
        seams.append(Seam(name=words, sides=((side,), (_part(side, parts),)), notches=centre_notch(sample)))
        if stand is not None and not grown_on:
            side = SeamSide(piece=name, edge=stand.edge)
            words = find_unused_name(f"{name} {stand.edge} facing".replace("_", " "), called)
            seams.append(Seam(name=words, sides=((side,), (replace(side, piece=title),))))
            called.add(words)
    # Facings are sewn to each other where their pieces are.
    for seam in pattern.seams:
        both = [row[0] for row in seam.sides]
        # Of halves on the fold one seam is listed for both sides, and just one of them has the opening.
        centre = both[0].piece == both[1].piece
        if seam.name in gaps and (
            centre or not any(pattern.piece(side.piece, pattern.sample).on_fold for side in both)
        ):
            continue
        if all(len(row) == 1 for row in seam.sides) and all((side.piece, side.edge) in parts for side in both):
            first, second = (_part(side, parts) for side in both)
            words = find_unused_name(f"{seam.name} of {places[0][1]} facing", called)
            seams.append(Seam(name=words, sides=((first,), (second,))))
            called.add(words)
    return replace(pattern, pieces=pieces, seams=seams)


def with_stand_facings(pattern: Pattern, stands: Sequence[Stand]) -> Pattern:
    """Return a pattern with a straight facing along each button stand, which ends raw at its upper and lower end."""
    pieces = {size: list(row) for size, row in pattern.pieces.items()}
    seams, called = list(pattern.seams), {seam.name for seam in pattern.seams}
    for stand in stands:
        # "front_left_centre" and "centre front button stand" make "front_left_centre_facing".
        known = stand.piece.split("_")
        known += [word for word in stand.edge.removesuffix(f" {STAND}").split(" ") if word not in known]
        title = "_".join([*known, "facing"])
        for row in pieces.values():
            at = next(k for k, piece in enumerate(row) if piece.name == stand.piece)
            strip = facing_edges(row[at], (stand.edge,), stand.width)
            if stand.grown_on:
                row[at] = _folded_over(row[at], stand.edge, strip, sewn=False)
            else:
                row.append(_facing_piece(row[at], strip, title))
        if not stand.grown_on:
            side = SeamSide(piece=stand.piece, edge=stand.edge)
            words = find_unused_name(title.replace("_", " "), called)
            called.add(words)
            seams.append(Seam(name=words, sides=((side,), (replace(side, piece=title),))))
    return replace(pattern, pieces=pieces, seams=seams)


def centre_notch(piece: Piece) -> tuple[float, ...] | None:
    """Return the notch in the middle of an edge that crosses the centre line; None where the piece has one side only.

    Such pieces may be printed half, each on its own: just a notch on the fold is then the same on all of them.
    """
    whole = without_side(piece.name) == piece.name.replace("_", " ") and not piece.on_fold
    return (0.5,) if whole else None


def is_beside(pattern: Pattern, stand: Stand, place: tuple[str, str]) -> bool:
    """Return whether a button stand lies beside an edge of its piece, at one of its ends."""
    return stand.piece == place[0] and stand.edge in _ends(pattern.piece(stand.piece, pattern.sample), (place[1],))


def _chain(piece: Piece, edge: str, stand: Stand | None) -> tuple[str, ...]:
    """Return an edge and the stand beside it in the order of the outline."""
    if stand is None:
        return (edge,)
    return (stand.edge, edge) if _ends(piece, (edge,))[0] == stand.edge else (edge, stand.edge)


def _ends(piece: Piece, chain: Sequence[str]) -> tuple[str, str]:
    """Return the names of the edges before and after some that follow each other."""
    names = [edge.name for edge in piece.edges]
    return names[names.index(chain[0]) - 1], names[(names.index(chain[-1]) + 1) % len(names)]


def _part(side: SeamSide, parts: _Parts) -> SeamSide:
    """Return the side of a seam on the facing for one on its piece."""
    piece, edge, flipped = parts[side.piece, side.edge]
    return replace(side, piece=piece, edge=edge, reversed=side.reversed != flipped)


def facing_edges(piece: Piece, chain: Sequence[str], width: float, *, around: FloatArray | None = None) -> list[Edge]:
    """Return the outline of a facing: its edges, as much of both neighbours as it is wide, and the line at that distance.

    Args:
        piece: that is faced.
        chain: names of edges that follow each other.
        width: [m].
        around: #P by 2 [m], a line inside that the facing reaches around by half of its width.

    Returns:
        The edges of the chain, the part of the edge after it, the inner edge, the part of the edge before it.

    Raises:
        InputError: a dart ends in the chain, or a neighbour is shorter than the facing is wide.
    """
    import shapely

    where = f"{piece.name}.{chain[0]}"
    edges, (before, after) = [piece.edge(name) for name in chain], (piece.edge(name) for name in _ends(piece, chain))
    if "dart" in (before.kind, after.kind):
        raise InputError(f"a dart ends in {where}: give it a band or a binding instead of a facing")
    # Where a stand ends above the hem, its facing ends straight across.
    beside = [
        _prolonged(each, width, forward=each is after) if each.name.endswith(STAND_END) else each
        for each in (before, after)
    ]
    if min(each.length for each in beside) <= width:
        raise InputError(f"the edges beside {where} are shorter than the facing is wide")
    last = _start(beside[1].points, width, edges[-1])
    first = _start(beside[0].points[::-1], width, edges[0])[::-1]
    line = np.concatenate([edge.points[int(k > 0) :] for k, edge in enumerate(edges)])
    rounding = _ROUND if len(edges) > 1 else 0.0
    offset = shapely.LineString(line).offset_curve(width + rounding)
    inner = np.asarray((offset.offset_curve(-rounding) if rounding else offset).coords)[::-1]
    body = shapely.Polygon(piece.outline)
    # Near the corners the line leads to where the neighbours end.
    near = np.minimum(*(np.linalg.norm(inner - end, axis=1) for end in (last[-1], first[0])))
    inner = inner[(near > 0.25 * width) & shapely.contains(body, shapely.points(inner))]
    inner = np.vstack([last[-1:], inner, first[:1]])
    if around is not None:
        # The inner edge of a facing that is made larger around a line.
        outline = np.concatenate([line[:-1], last[:-1], inner[:-1], first[:-1]])
        tongue = shapely.LineString(around).buffer(0.6 * width)
        # Rounded where the tongue leaves the strip.
        whole = shapely.union_all([shapely.Polygon(outline), tongue]).buffer(_ROUND).buffer(-_ROUND)
        ring = np.asarray(shapely.orient_polygons(whole).exterior.coords)[:-1]
        start, end = (int(np.linalg.norm(ring - point, axis=1).argmin()) for point in (inner[0], inner[-1]))
        count = (end - start) % len(ring)
        inner = np.vstack([inner[:1], np.roll(ring, -start, axis=0)[1:count], inner[-1:]])
    return [
        *(replace(edge, vertices=None) for edge in edges),
        replace(after, points=last, vertices=None),
        Edge(name=INNER, points=inner, kind="cut"),
        replace(before, points=first, vertices=None),
    ]


def _prolonged(edge: Edge, width: float, *, forward: bool) -> Edge:
    """Return the lower end of a button stand, longer at its inner end than a facing is wide [m]."""
    outer, inner = (edge.points[0], edge.points[-1]) if forward else (edge.points[-1], edge.points[0])
    far = outer + (inner - outer) / np.linalg.norm(inner - outer) * (width + 1e-3)
    return replace(edge, points=np.array([outer, far] if forward else [far, outer]))


def _start(points: FloatArray, length: float, beside: Edge) -> FloatArray:
    """Return the first part of a line: of a given length [m], or up to that distance from a button stand."""
    at = arc_lengths(points)
    if beside.name.endswith(STAND):
        start, end = beside.points[0], beside.points[-1]
        along = (end - start) / np.linalg.norm(end - start)
        away = np.maximum.accumulate(np.abs((points - start) @ [-along[1], along[0]]))
        if away[-1] <= length:
            raise InputError(f"the edges beside {beside.name} are shorter than the facing is wide")
        length = float(np.interp(length, away, at))
    return np.vstack([points[at < length - 1e-6], points_at_lengths(points, np.array([length]))])


def _facing_piece(piece: Piece, edges: Sequence[Edge], title: str) -> Piece:
    """Return a facing as a piece of its own."""
    try:
        # A grain line of the piece's direction in the middle of a facing's outline.
        grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
        along = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
        inner = next(edge for edge in edges if edge.name == INNER)
        middle = np.concatenate([edges[0].points, inner.points]).mean(axis=0)
        return Piece(
            name=title, size=piece.size, fabric=piece.fabric, quantity=piece.quantity, edges=edges, paired=piece.paired,
            grain=middle + np.outer([-0.02, 0.02], along),
            role="facing", internal_lines={key: line for key, line in piece.internal_lines.items() if key.startswith("keyhole")},
        )  # fmt: skip
    except InputError:
        raise InputError(f"no facing can be drawn along {piece.name}.{edges[0].name}: make it narrower") from None


def _folded_over(piece: Piece, fold: str, edges: Sequence[Edge], *, sewn: bool = True) -> Piece:
    """Return a piece with its facing grown on: the mirror image beyond an edge, which becomes a fold line inside."""
    at = [edge.name for edge in edges].index(fold)
    line = edges[at].points[[0, -1]]
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    turn = 2.0 * np.outer(along, along) - np.eye(2)
    mirrored = []
    for edge in [*edges[:at][::-1], *edges[at + 1 :][::-1]]:
        name = f"facing {edge.name}"
        kind = edge.kind if sewn or edge.kind != "seam" else "cut"
        points = (edge.points[::-1] - line[0]) @ turn.T + line[0]
        mirrored.append(replace(edge, name=name, kind=kind, points=points, allowance=edge.width, vertices=None))
    # Corners are shared bit for bit.
    mirrored[0].points[0], mirrored[-1].points[-1] = line[0], line[1]
    for one, other in pairwise(mirrored):
        other.points[0] = one.points[-1]
    outline: list[Edge] = []
    for edge in piece.edges:
        outline += mirrored if edge.name == fold else [edge]
    name = find_unused_name("fold line", piece.internal_lines)
    return replace(piece, edges=outline, internal_lines={**piece.internal_lines, name: line})
