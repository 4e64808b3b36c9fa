"""What of a pattern is draped, in one layer, and where its buttons and ties close it.

Facings, bindings, second layers of collars, what of a folded strip lies behind its fold, and bags of pockets lie within the garment. In
the drape nothing keeps layers apart, so that what lies within would hang out. It is left out, and named.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from shapely import Point, Polygon, contains_xy
from shapely.ops import nearest_points

from warpflat.core import FloatArray, nearest_on_polyline, segment_lengths, unit
from warpflat.pattern import MIRRORED, Edge, Piece, Seam, SeamSide, hole_edges, turn_over

__all__ = ["Button", "closures", "in_one_layer", "right_side_out", "turned_down"]

#: Where a button or a tie closes a garment: piece and point [m] of both layers.
Button = tuple[tuple[str, FloatArray], tuple[str, FloatArray]]

_FOLD, _BUTTON, _HOLE, _TIE, _CENTRE = "fold line", "button", "buttonhole", "tie", "centre"
_WITHIN = ("facing", "interfacing")
# What strays less far from a line lies on it; a button lies this near to a buttonhole of its own piece if both halves are marked alike [m].
_ON_LINE, _ON_HOLE = 1e-6, 0.006
# A button is farther than this from the edge [m], and the middle of a tie lies so far within the corner at which it is sewn on.
_ON_OUTLINE, _IN_CORNER = 0.001, 0.01
# Ends of a cut-off corner are as far apart as those of the opening that it fills, but for so much [m].
_ALIKE = 0.001


def in_one_layer(
    pieces: Mapping[str, Piece], seams: Iterable[Seam], lifted: Collection[str]
) -> tuple[dict[str, Piece], list[Seam], list[str]]:
    """Leave out what lies within a garment.

    Args:
        pieces: whole ones.
        seams: between them.
        lifted: pieces that have a designed surface; where there is none, second layers of collars have a place of their own.

    Returns:
        The pieces and seams that are draped, and notes.
    """
    seams = list(seams)
    out = {name for name, piece in pieces.items() if piece.role in _WITHIN}
    # A binding is a strip that is turned around the edge to which it is sewn: its other edge is folded over as it is cut.
    out |= {
        name
        for name, piece in pieces.items()
        if piece.role == "strip" and any(edge.kind == "cut" and edge.allowance == 0.0 for edge in piece.edges)
    }
    # The bag of a pocket that takes part in a seam beside the shell lies behind a cut-off corner of it, and stays.
    beside = {side.piece for seam in seams for chain in seam.sides if len(chain) > 1 for side in chain}
    out |= {name for name, piece in pieces.items() if piece.role == "pocket" and name not in beside}
    # The second layer of a collar, sewn to the first one alone, has no place of its own.
    pairs = [{side.piece for side in seam.stretches} for seam in seams]
    layers = {name for name in pieces if name.endswith(MIRRORED) and name.removesuffix(MIRRORED) not in lifted}
    layers = layers - out if lifted else set()
    while held_by := {
        name
        for name in layers
        if not set[str]().union(*(pair for pair in pairs if name in pair)) <= layers | {name.removesuffix(MIRRORED)}
    }:
        layers -= held_by
    out |= layers
    pieces, openings = _cut_off_corners(pieces, seams, out)
    seams = [*(seam for seam, pair in zip(seams, pairs, strict=True) if not pair & out), *openings]
    kept, folded = {name: piece for name, piece in pieces.items() if name not in out}, set[str]()
    for name, piece in kept.items():
        sewn = {side.edge for seam in seams for side in seam.stretches if side.piece == name}
        for line in [line for title, line in piece.internal_lines.items() if title.startswith(_FOLD)]:
            kept[name] = cut = _cut_at(kept[name], line, sewn)
            folded |= {name} if cut is not piece else set()
    there = {(name, edge.name) for name, piece in kept.items() for edge in piece.edges}
    there |= {(name, edge.name) for name, piece in kept.items() for hole in piece.holes for edge in hole_edges(hole)}
    seams = [seam for seam in seams if all(side.place in there for side in seam.stretches)]
    # What hung by what is left out alone is sewn to nothing now.
    lost = set(kept) - {side.piece for seam in seams for side in seam.stretches}
    kept = {name: piece for name, piece in kept.items() if name not in lost}
    titles = sorted({name.removesuffix(MIRRORED) for name in out | folded | lost})
    return kept, seams, [f"worn in one layer: {', '.join(titles)}"] if titles else []


def _cut_off_corners(
    pieces: Mapping[str, Piece], seams: Sequence[Seam], out: Collection[str]
) -> tuple[dict[str, Piece], list[Seam]]:
    """Return the pieces with those behind cut-off corners as the corners alone, and the seams that close the pockets' openings.

    What fills a corner takes part in the shell's seams beside it, and goes on as half of a bag; the other half, which is left out, joins it
    to the opening.
    """
    cut, closed = dict(pieces), list[Seam]()
    beside = {side.place for seam in seams for chain in seam.sides if len(chain) > 1 for side in chain}
    # Both sides of a seam, either first.
    pairs = [
        (seam.name, one[0], other[0])
        for seam in seams
        for one, other in (seam.sides, seam.sides[::-1])
        if len(one) == len(other) == 1
    ]
    for name in [name for name, piece in pieces.items() if piece.role == "pocket" and name not in out]:
        edges = list(pieces[name].edges)
        first = next((k for k, edge in enumerate(edges) if (name, edge.name) not in beside), 0)
        edges = [edge for edge in edges[first:] + edges[:first] if (name, edge.name) in beside]
        bags = {other.piece for _, own, other in pairs if own.piece == name} & set(out)
        found = [(title, shell) for title, bag, shell in pairs if bag.piece in bags and shell.piece not in (name, *out)]
        ends = [points for edge in edges for points in (edge.points[0], edge.points[-1])]
        if len(found) != 1 or any(
            np.linalg.norm(a - b) > _ON_LINE for a, b in zip(ends[1:-1:2], ends[2::2], strict=True)
        ):
            continue
        ((title, shell),) = found
        opening = pieces[shell.piece].edge(shell.edge).points[::-1]
        across, along = ((row[-1] - row[0]) @ [1.0, 1j] for row in (np.array([ends[-1], ends[0]]), opening))
        if not abs(abs(across) - abs(along)) < _ALIKE < abs(across):
            continue
        # Turned so that its ends are those of the corner.
        turned = (opening - opening[0]) @ [1.0, 1j] * across / along
        rim = ends[-1] + np.column_stack([turned.real, turned.imag])
        rim[-1] = ends[0]
        if Polygon(np.concatenate([*(edge.points for edge in edges), rim])).is_valid:
            corner = [*edges, Edge(name=shell.edge, points=rim)]
            cut[name] = replace(pieces[name], edges=corner, internal_lines={}, marks={}, holes=[], darts=[])
            closed.append(
                Seam(name=title, sides=((shell,), (replace(shell, piece=name, reversed=not shell.reversed),)))
            )
    return cut, closed


def _cut_at(piece: Piece, line: FloatArray, sewn: Collection[str]) -> Piece:
    """Return the part of a piece on that side of a straight line on which more of its outline is sewn."""
    along = unit(line[-1] - line[0])
    across = np.array([-along[1], along[0]])

    def off(points: FloatArray) -> FloatArray:
        return np.asarray((points - line[0]) @ across)

    if np.abs(off(line)).max() > _ON_LINE:
        return piece
    parts = [edge.points for edge in piece.edges if edge.name in sewn]
    more = sum(float(segment_lengths(part) @ np.sign(off(0.5 * (part[1:] + part[:-1])))) for part in parts)
    side = 1.0 if more > -_ON_LINE else -1.0
    edges = list[Edge]()
    for edge in piece.edges:
        height = side * off(edge.points)
        height[np.abs(height) < _ON_LINE] = 0.0
        k = np.flatnonzero(height[:-1] * height[1:] < 0.0)
        share = height[k] / (height[k] - height[k + 1])
        met = edge.points[k] + share[:, None] * (edge.points[k + 1] - edge.points[k])
        points = np.insert(edge.points, k + 1, met, axis=0)[np.insert(height, k + 1, 0.0) >= 0.0]
        if len(points) > 1 and height.max() > 0.0:
            edges.append(edge if height.min() >= 0.0 else replace(edge, points=points, vertices=None))
    # The fold closes the one gap that is left.
    ends = [np.array([one.points[-1], other.points[0]]) for one, other in pairwise([*edges, *edges[:1]])]
    gaps = [k for k, (end, begin) in enumerate(ends) if np.linalg.norm(end - begin) > _ON_LINE]
    if len(gaps) != 1:
        return piece
    edges.insert(gaps[0] + 1, Edge(name=_FOLD, points=ends[gaps[0]], kind="cut"))
    heights = {name: side * off(line) for name, line in piece.internal_lines.items()}
    inside = {
        name: piece.internal_lines[name]
        for name, height in heights.items()
        if height.min() > -_ON_LINE and height.max() > _ON_LINE
    }
    names = {edge.name for edge in edges}
    return replace(
        piece, edges=edges, internal_lines=inside,
        holes=[hole for hole in piece.holes if (side * off(hole.points) > 0.0).all()],
        darts=[dart for dart in piece.darts if {dart.left, dart.right} <= names],
        marks={name: mark for name, mark in piece.marks.items() if side * off(mark[None])[0] > -_ON_LINE},
    )  # fmt: skip


def right_side_out(
    pieces: Mapping[str, Piece], seams: Sequence[Seam], lifted: Collection[str]
) -> tuple[dict[str, Piece], list[Seam], frozenset[str]]:
    """Turn drafted pieces over whose outlines run along their seams as those of the pieces do to which they are sewn.

    A strip is its own mirror image, and may be named either way; sewn cloth has one right side.

    Args:
        pieces: in one layer.
        seams: between them.
        lifted: pieces that have a designed surface, which is right side out.

    Returns:
        The pieces, their seams, and the names of those that were turned.
    """
    turned = {name: False for name in pieces if name in lifted or name.removesuffix(MIRRORED) in lifted}
    links = [(a, b) for seam in seams for a in seam.sides[0] for b in seam.sides[1] if a.piece != b.piece]
    found = bool(turned)
    while found:
        found = False
        for a, b in (each for link in links for each in (link, link[::-1])):
            if a.piece in turned and b.piece not in turned:
                turned[b.piece], found = turned[a.piece] ^ (a.reversed == b.reversed), True
    over = frozenset(name for name, is_turned in turned.items() if is_turned)

    def sides(chain: Sequence[SeamSide]) -> tuple[SeamSide, ...]:
        return tuple(replace(side, reversed=side.reversed ^ (side.piece in over)) for side in chain)

    return (
        {name: turn_over(piece) if name in over else piece for name, piece in pieces.items()},
        [replace(seam, sides=(sides(seam.sides[0]), sides(seam.sides[1]))) for seam in seams],
        over,
    )


def turned_down(pieces: Mapping[str, Piece]) -> set[str]:
    """Return the collars that fall: all but their stands, and those that are stands alone."""
    return {name for name, piece in pieces.items() if piece.role == "collar" and "stand" not in name}


def closures(pieces: Mapping[str, Piece]) -> list[Button]:
    """Return where buttons and ties close whole pieces of a garment.

    A waistband, a cuff or a collar's stand has its button at one end and its buttonhole at the other. Both halves of a front are
    marked alike, with buttons in their buttonholes; one lies over the other, and the buttons of the same number meet.
    """
    found, fronts = list[Button](), dict[tuple[str, ...], list[str]]()
    for name, piece in pieces.items():
        marks = {title: point for title, point in piece.marks.items() if title.split()[:1] == [_BUTTON]}
        holes = [
            line
            for title, line in piece.internal_lines.items()
            if title.split()[:1] == [_HOLE] and title.split()[1:2] != ["end"]
        ]
        if marks and all(
            any(np.linalg.norm(nearest_on_polyline(mark, hole) - mark) < _ON_HOLE for hole in holes)
            for mark in marks.values()
        ):
            fronts.setdefault(tuple(sorted(marks)), []).append(name)
        elif len(marks) == len(holes):
            found += [
                ((name, mark), (name, hole.mean(axis=0))) for mark, hole in zip(marks.values(), holes, strict=True)
            ]
    for titles, alike in fronts.items():
        twins = [(name, name + MIRRORED) for name in alike if name + MIRRORED in alike]
        left = [name for name in alike if not any(name in pair for pair in twins)]
        found += [
            ((one, pieces[one].marks[title]), (other, pieces[other].marks[title]))
            for one, other in ([*twins, (left[0], left[1])] if len(left) == 2 else twins)
            for title in titles
        ]
    # The ties of a wrap hold the edge of each half where it lies on the other one, across the centre line.
    for name, piece in pieces.items():
        halves = [piece, pieces.get(name + MIRRORED, piece)]
        at = list[tuple[FloatArray, FloatArray]]()
        for half in halves:
            lines = [line for title, line in half.internal_lines.items() if title.split()[:1] == [_CENTRE]]
            inside = Polygon(half.outline).buffer(-_IN_CORNER)
            if _TIE in half.marks and len(lines) == 1 and not inside.is_empty:
                end = np.concatenate(nearest_points(inside, Point(half.marks[_TIE]))[0].coords)
                at.append((end, 2.0 * nearest_on_polyline(end, lines[0]) - end))
        if halves[1] is not piece and len(at) == 2:
            names = [half.name for half in halves]
            found += [((names[k], at[k][0]), (names[1 - k], at[1 - k][1])) for k in (0, 1)]
    # What others mark beyond an outline, or on it, closes nothing.
    inside = {name: Polygon(piece.outline).buffer(-_ON_OUTLINE) for name, piece in pieces.items() if piece.marks}
    return [layers for layers in found if all(contains_xy(inside[name], *point) for name, point in layers)]
