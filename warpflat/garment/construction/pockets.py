"""Pockets: patches and welts with their places marked, bags in a seam, and hip pockets cut into the corner of a piece."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    arc_lengths,
    find_unused_name,
    nearest,
    other_side,
    part_between,
    points_at_lengths,
    polyline_length,
)
from warpflat.garment.construction.mark_openings import lines_inside, with_notches
from warpflat.garment.construction.strips import Strip, strip_edges, swept
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

__all__ = ["Pocket", "add_pockets"]

# Hem of a patch pocket, and how much lower its middle lies than its lower corners [m].
_HEM, _POINT = 0.030, 0.015
# A bag runs past both ends of its opening [m].
_PAST = 0.020
# An opening ends this far above the lower end of its seam [m].
_CLEAR = 0.030
# The bag of a welt is wider than its opening by this on either side, and the welt itself [m].
_BESIDE, _WELT_ENDS = 0.015, 0.010
# The bag of a hip pocket reaches this far beyond its opening, inwards and downwards [m].
_INWARDS, _DEEPER = 0.050, 0.110


@dataclass(frozen=True, kw_only=True)
class Pocket:
    """A pocket.

    Attributes:
        kind: "patch", sewn onto a piece; "welt", an opening across a piece, with a welt; "inseam", bags in a seam; "hip", an opening
            from the upper edge of the front to its seam.
        where: the piece of a patch or welt, the seam of bags.
        width, height: of a patch; length of the opening and depth of the bag of a welt; depth of a bag in a seam and length of its
            opening; how far from the seam and below the upper edge a hip pocket's opening ends [m].
        line: a line across the piece on which the upper edge of a patch or welt lies.
        below: how far a patch or welt lies below its line, an opening below the upper end of its seam [m].
        from_centre: distance of the inner side from the centre line [m]; on a leg, which has none, it lies in the middle.
        welt: height of a welt [m].
        most_share: of its line on the piece that a patch or welt is wide at most; its other lengths become smaller with its width.
    """

    kind: str
    where: str
    width: float
    height: float
    line: str = ""
    below: float = 0.0
    from_centre: float = 0.07
    welt: float = 0.015
    most_share: float = math.inf


def add_pockets(pattern: Pattern, pockets: Sequence[Pocket]) -> Pattern:
    """Return a pattern with pockets: their pieces, their places on pieces, their notches in seams.

    Raises:
        InputError: there is no such piece, line or seam, or a pocket does not lie on its piece.
    """
    for number, pocket in enumerate(pockets):
        try:
            if pocket.kind in ("patch", "welt"):
                pattern = _with_placed(pattern, pocket)
            else:
                pattern = (_with_hip_pocket if pocket.kind == "hip" else _with_bags)(pattern, pocket)
        except InputError as error:
            raise InputError(f"pockets[{number}]: {error}") from None
    return pattern


def _with_placed(pattern: Pattern, pocket: Pocket) -> Pattern:
    """Return a pattern with a patch or welt pocket and its place, on both sides of a piece that has both."""
    import shapely

    asked, pieces = pocket, {}
    for size, row in pattern.pieces.items():
        like = pattern.piece(asked.where, size)
        known = {**{edge.name: edge.points for edge in like.edges}, **like.internal_lines}
        if asked.line not in known:
            raise InputError(f"piece {like.name!r} has no line {asked.line!r}; {nearest(asked.line, known)}")
        smaller = min(1.0, asked.most_share * polyline_length(known[asked.line]) / asked.width)
        pocket = replace(
            asked,
            **{key: smaller * getattr(asked, key) for key in ("width", "height", "below", "from_centre")},
        )
        half, high = 0.5 * pocket.width, pocket.height if pocket.kind == "patch" else pocket.welt
        # Of a patch on the right of the centre line, from its upper right corner leftwards.
        shape = [(half, 0.0), (-half, 0.0), (-half, -high), (0.0, -high - _POINT), (half, -high)]
        shape = shape if pocket.kind == "patch" else [*shape[:3], shape[4]]
        made = list[Piece]()
        count = 0
        for piece in row:
            if piece.name != pocket.where:
                made.append(piece)
                continue
            grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
            up = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
            across = np.array([up[1], -up[0]])
            level = known[pocket.line]
            order = np.argsort(level @ across)
            lines, marks = dict(piece.internal_lines), dict(piece.marks)
            body = shapely.Polygon(piece.outline)
            middle_of_level = float((level @ up).mean()) - pocket.below - 0.5 * high
            for middle in _middles(piece, pocket, across, middle_of_level):
                top = float(np.interp(middle, (level @ across)[order], (level @ up)[order])) - pocket.below
                place = np.array([(middle + x) * across + (top + y) * up for x, y in shape])
                if not body.contains(shapely.Polygon(place)):
                    continue
                count += 1
                # Side by side, so that its corners stay sharp; the upper edge of a patch is left open.
                sides = [*place[1:], place[0]] if pocket.kind == "patch" else [*place, place[0]]
                for ends in pairwise(sides):
                    lines[find_unused_name("pocket", lines)] = np.array(ends)
                for corner in place[:2]:
                    marks[find_unused_name("pocket corner", marks)] = corner
            if not count:
                raise InputError(
                    f"a pocket {1e3 * pocket.width:.0f} by {1e3 * high:.0f} mm does not lie on {piece.name!r} there"
                )
            made.append(replace(piece, internal_lines=lines, marks=marks))
            count *= piece.quantity * (2 if piece.on_fold else 1)
        # The piece of a patch, or welt and bags.
        if pocket.kind == "patch":
            names = ["upper", "left side", "lower left", "lower right", "right side"]
            patch = np.array(shape)
            outlines = {
                "pocket": [
                    Edge(
                        name=name, points=patch[[k, (k + 1) % 5]], kind="hem" if k == 0 else "cut",
                        allowance=_HEM if k == 0 else 0.010,
                    )
                    for k, name in enumerate(names)
                ]
            }  # fmt: skip
        else:
            outlines = {}
            for what, long, tall in (
                ("pocket_welt", pocket.width + 2 * _WELT_ENDS, 2 * pocket.welt),
                ("pocket_bag", pocket.width + 2 * _BESIDE, pocket.height),
            ):
                names = ["lower", "right end", "upper", "left end"]
                outlines[what] = strip_edges(
                    *swept(Strip(length=long, height=tall)),
                    kinds=dict.fromkeys(names, "cut"),
                    allowance=dict.fromkeys(names, 0.010),
                )
        for what, edges in outlines.items():
            title = find_unused_name(f"{pocket.where}_{what}", {piece.name for piece in pattern.pieces[pattern.sample]})
            fold = np.array([[0.0, pocket.welt], [pocket.width + 2 * _WELT_ENDS, pocket.welt]])
            made.append(
                Piece(
                    name=title, size=like.size, fabric=like.fabric, quantity=count * (2 if what == "pocket_bag" else 1),
                    edges=edges, role="pocket", paired=False,
                    internal_lines={"fold line": fold} if what == "pocket_welt" else {},
                )
            )  # fmt: skip
        pieces[size] = made
    return replace(pattern, pieces=pieces)


def _middles(piece: Piece, pocket: Pocket, across: FloatArray, level: float) -> list[float]:
    """Return where across a piece the middles of its pockets lie [m]: beside its centre line, or in the middle of a leg.

    Args:
        piece: with the pocket.
        pocket: how far it lies from the centre line.
        across: direction of the weft.
        level: along the warp, at which the middle of a leg is taken [m].
    """
    import shapely

    known = {**{edge.name: edge.points for edge in piece.edges}, **piece.internal_lines}
    centre = next((points for name, points in known.items() if name.startswith("centre")), None)
    if centre is not None:
        at, away = float((centre @ across).mean()), pocket.from_centre + 0.5 * pocket.width
        return [at + away, at - away]
    if not any(name.startswith("crotch") for name in known):
        raise InputError(f"piece {piece.name!r} has no centre line to place a pocket from")
    up = np.array([-across[1], across[0]])
    row = shapely.LineString([level * up - 5.0 * across, level * up + 5.0 * across])
    spots = shapely.get_coordinates(row.intersection(shapely.Polygon(piece.outline))) @ across
    return [float(spots.min() + spots.max()) / 2] if len(spots) else []


def _with_hip_pocket(pattern: Pattern, pocket: Pocket) -> Pattern:
    """Return a pattern whose fronts are cut off from their upper edge to a side seam, with what lies behind the opening.

    The corner that is cut off belongs to a piece of its own, which is sewn in its place at the upper edge and in the seam. A bag of
    the same outline, without the corner, is sewn to the opening.
    """
    names = {pocket.where, other_side(pocket.where)}
    opened = [seam for seam in pattern.seams if seam.name in names]
    if not opened:
        raise InputError(f"no seam {pocket.where!r}; {nearest(pocket.where, [seam.name for seam in pattern.seams])}")
    # Of pieces that are cut in pairs both seams have one edge.
    fronts = dict[tuple[str, str], SeamSide]()
    for seam in opened:
        found = [row[0] for row in seam.sides if len(row) == 1 and "front" in row[0].piece.split("_")]
        if not found:
            raise InputError(f"a hip pocket lies in a front, and {seam.name!r} joins none")
        fronts.setdefault((found[0].piece, found[0].edge), found[0])
    for front in fronts.values():
        pattern = _cut_hip_pocket(pattern, pocket, front)
    return pattern


def _cut_hip_pocket(pattern: Pattern, pocket: Pocket, front: SeamSide) -> Pattern:
    """Return a pattern with a hip pocket in one piece, whose edge lies in the seam."""
    import shapely

    sample, taken = pattern.piece(front.piece, pattern.sample), {piece.name for piece in pattern.pieces[pattern.sample]}
    behind = find_unused_name(f"{front.piece}_pocket_facing", taken)
    bag = find_unused_name(f"{front.piece}_pocket_bag", taken)
    opening = find_unused_name("pocket opening", {edge.name for edge in sample.edges})
    order = [edge.name for edge in sample.edges]
    at = order.index(front.edge)
    # The upper edge comes before the side's where that runs downwards.
    first = bool(np.array_equal(_downwards(sample, front)[0][0], sample.edge(front.edge).points[0]))
    upper = order[at - 1] if first else order[(at + 1) % len(order)]
    pieces = {}
    for size, row in pattern.pieces.items():
        piece = pattern.piece(front.piece, size)
        # Both edges from their corner.
        lines = {
            upper: piece.edge(upper).points[:: -1 if first else 1],
            front.edge: piece.edge(front.edge).points[:: 1 if first else -1],
        }
        cuts = {upper: pocket.width, front.edge: pocket.height}
        for name, cut in cuts.items():
            whole = float(arc_lengths(lines[name])[-1])
            if cut > whole - _CLEAR:
                raise InputError(
                    f"the pocket ends {1e3 * cut:.0f} mm along {name!r}, which is {1e3 * whole:.0f} mm long"
                )
        # The bag lies in a box below the corner, whose lower inner corner is cut off.
        grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
        up = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
        corner, across = lines[upper][0], np.array([up[1], -up[0]])
        across = across if (lines[upper][-1] - corner) @ across > 0 else -across
        inward, low, slope = pocket.width + _INWARDS, -pocket.height - _DEEPER, 0.35 * pocket.width + 0.02
        box = [(-0.3, 0.3), (inward, 0.3), (inward, low + slope), (inward - slope, low), (-0.3, low)]
        region = shapely.Polygon(piece.outline).intersection(
            shapely.Polygon([corner + x * across + y * up for x, y in box])
        )
        if region.geom_type != "Polygon" or not 0.0 < region.area < 0.8 * shapely.Polygon(piece.outline).area:
            raise InputError(f"the bag of a hip pocket finds no room on {piece.name!r}")
        # Where the region's outline leaves both edges.
        inside = {}
        for name, line in lines.items():
            both = shapely.LineString(line).intersection(region.buffer(1e-7))
            inside[name] = max(float(both.length), cuts[name] + 0.01)
            if inside[name] > float(arc_lengths(line)[-1]) - 1e-3:
                raise InputError(f"the bag of a hip pocket is deeper than {name!r} of {piece.name!r} is long")
        parts = {
            name: [part_between(line, *ends) for ends in pairwise([0.0, cuts[name], inside[name], np.inf])]
            for name, line in lines.items()
        }
        ring = np.asarray(region.exterior.coords)[:-1]
        ends = [parts[name][1][-1] for name in (upper, front.edge)]
        rim = _between_ends(ring, ends[0], ends[1], corner)
        straight = np.array([parts[upper][0][-1], parts[front.edge][0][-1]])
        own, side = piece.edge(upper), piece.edge(front.edge)
        under: dict[str, Any] = {"kind": "cut", "allowance": 0.010}
        # From the corner along the side, around and back along the upper edge, then turned into the outline's direction.
        facing_rows: list[tuple[str, FloatArray, dict[str, Any]]] = [
            (upper, parts[upper][0][::-1], {"kind": own.kind, "allowance": own.allowance}),
            (front.edge, parts[front.edge][0], {"kind": side.kind, "allowance": side.allowance}),
            (f"{front.edge} under", parts[front.edge][1], under),
            ("rim", rim[::-1], {"as_drawn": True}),
            (f"{upper} under", parts[upper][1][::-1], under),
        ]
        bag_rows: list[tuple[str, FloatArray, dict[str, Any]]] = [
            (opening, straight, {}),
            (f"{front.edge} under", parts[front.edge][1], under),
            ("rim", rim[::-1], {"as_drawn": True}),
            (f"{upper} under", parts[upper][1][::-1], under),
        ]
        panel_rows = {
            upper: np.vstack([parts[upper][1][:-1], parts[upper][2]])[::-1],
            front.edge: np.vstack([parts[front.edge][1][:-1], parts[front.edge][2]]),
        }
        new = []
        for edge in piece.edges:
            if edge.name in panel_rows:
                points = panel_rows[edge.name] if first else panel_rows[edge.name][::-1]
                kept = replace(edge, points=points, vertices=None)
                cut_edge = Edge(name=opening, points=straight if first else straight[::-1])
                if edge.name == front.edge:
                    new += [cut_edge, kept] if first else [kept, cut_edge]
                else:
                    new.append(kept)
            else:
                new.append(edge)
        left = shapely.Polygon(np.concatenate([edge.points[:-1] for edge in new])).buffer(1e-9)
        kept_lines = lines_inside(piece.internal_lines, np.concatenate([edge.points[:-1] for edge in new]))
        marks = {name: mark for name, mark in piece.marks.items() if left.contains(shapely.Point(mark))}
        cut_panel = replace(piece, edges=new, internal_lines=kept_lines, marks=marks)
        made = []
        for name, parts_of in ((behind, facing_rows), (bag, bag_rows)):
            edges = [
                Edge(name=n, points=p if first else p[::-1], **k) for n, p, k in (parts_of if first else parts_of[::-1])
            ]
            middle = np.asarray(region.centroid.coords)[0]
            count = piece.quantity * (2 if piece.on_fold else 1)
            made.append(
                Piece(
                    name=name, size=piece.size, fabric=piece.fabric, quantity=count, edges=edges, role="pocket",
                    grain=middle + np.outer([-0.05, 0.05], up),
                )
            )  # fmt: skip
        pieces[size] = [*(cut_panel if each.name == piece.name else each for each in row), *made]
    seams = []
    for seam in pattern.seams:
        rows = list[tuple[SeamSide, ...]]()
        for own_row in seam.sides:
            sides = list[SeamSide]()
            for each in own_row:
                if each.piece != front.piece or each.edge not in (upper, front.edge):
                    sides.append(each)
                    continue
                # The corner lies at the end of the upper edge where that comes first.
                corner_last = (first if each.edge == upper else not first) != each.reversed
                both = [each, replace(each, piece=behind)]
                sides += both if corner_last else both[::-1]
            rows.append(tuple(sides))
        seams.append(replace(seam, sides=(rows[0], rows[1])))
    taken = {seam.name for seam in seams}
    for words, panel, name, along in (
        ("pocket opening", front.piece, bag, opening),
        ("pocket bag", behind, bag, "rim"),
    ):
        title = find_unused_name(words, taken)
        taken.add(title)
        seams.append(
            Seam(
                name=title,
                sides=((SeamSide(piece=panel, edge=along),), (SeamSide(piece=name, edge=along, mirrored=True),)),
            )
        )
    return replace(pattern, pieces=pieces, seams=seams)


def _between_ends(ring: FloatArray, start: FloatArray, end: FloatArray, beside: FloatArray) -> FloatArray:
    """Return the part of a closed line (#P by 2 [m]) from one of its points to another that keeps away from a third."""
    import shapely

    closed = shapely.LineString(np.vstack([ring, ring[:1]]))
    whole, (a, b, c) = closed.length, (float(closed.project(shapely.Point(p))) for p in (start, end, beside))
    forward = (b - a) % whole
    line = np.vstack([ring, ring[:1]])
    if (c - a) % whole < forward:
        line, a, forward = line[::-1], whole - a, whole - forward
    part = part_between(np.vstack([line[:-1], line]), a, a + forward)
    part[[0, -1]] = start, end
    return part


def _with_bags(pattern: Pattern, pocket: Pocket) -> Pattern:
    """Return a pattern with the bags of a pocket in a seam, and on the other side's too, and notches where they open."""
    names = {pocket.where, other_side(pocket.where)}
    opened = [seam for seam in pattern.seams if seam.name in names]
    if not opened or any(len(row) > 1 for seam in opened for row in seam.sides):
        raise InputError(
            f"no seam {pocket.where!r} between two edges; {nearest(pocket.where, [seam.name for seam in pattern.seams])}"
        )
    # Of halves, and of pieces that are cut in pairs, one seam is listed for both sides.
    sewn = [pattern.piece(side.piece, pattern.sample) for row in opened[0].sides for side in row]
    both = 4 if len(opened) == 2 or any(piece.on_fold or piece.quantity % 2 == 0 for piece in sewn) else 2
    title = find_unused_name("pocket_bag", {piece.name for piece in pattern.pieces[pattern.sample]})
    seams = list(pattern.seams)
    for number, seam in enumerate(seams):
        if seam.name not in names:
            continue
        # Notches at both ends of the opening.
        side, by_size = seam.sides[0][0], {}
        for size in pattern.pieces:
            points, with_seam = _downwards(pattern.piece(side.piece, size), side)
            whole = float(arc_lengths(points)[-1])
            stretch = np.array([pocket.below, pocket.below + pocket.height])
            if stretch[1] > whole - _CLEAR:
                raise InputError(
                    f"the pocket ends {1e3 * stretch[1]:.0f} mm along {seam.name!r}, which is {1e3 * whole:.0f} mm long"
                )
            shares = stretch / whole if with_seam else 1.0 - stretch / whole
            by_size[size] = with_notches(seam.of_size(size), shares.tolist(), whole)
        seams[number] = replace(seam, notches=by_size[pattern.sample], size_notches=by_size)
    pieces = {}
    for size, row in pattern.pieces.items():
        side = opened[0].sides[0][0]
        piece = next(each for each in row if each.name == side.piece)
        # A bag: its straight edge along the seam, its rim deeper below the opening than above.
        points, _ = _downwards(piece, side)
        start = max(0.0, pocket.below - _PAST)
        edge = points_at_lengths(points, np.array([start, pocket.below + pocket.height + _PAST]))
        length = float(np.linalg.norm(edge[1] - edge[0]))
        deep = pocket.width
        # In the frame of the bag the seam runs upwards along x = 0, the cloth lies to its left.
        turn = np.linspace(0.0, np.pi / 2, 9)
        low = -0.35 * length
        radius = min(0.4 * deep, 0.4 * length)
        upper = np.array([-deep + radius, length - radius]) + radius * np.column_stack([-np.sin(turn), np.cos(turn)])
        lower = np.array([-deep + radius, low + radius]) + radius * np.column_stack([-np.cos(turn), -np.sin(turn)])
        around = np.vstack([[0.0, length], upper, lower, [-0.02, low], [0.0, 0.0]])
        past = pocket.below - start
        ends = {"pocket opening": length - past, "pocket opening end": length - past - pocket.height}
        pieces[size] = (
            *row,
            Piece(
                name=title,
                size=piece.size,
                fabric=piece.fabric,
                quantity=both,
                role="pocket",
                edges=[
                    Edge(name="opening", points=np.array([[0.0, 0.0], [0.0, length]]), kind="cut", allowance=0.010),
                    Edge(name="rim", points=around),
                ],
                internal_lines={name: np.array([[-0.012, y], [0.0, y]]) for name, y in ends.items()},
                grain=np.array([[-0.5 * deep, 0.1 * length], [-0.5 * deep, 0.7 * length]]),
            ),
        )
    rim = SeamSide(piece=title, edge="rim")
    words = find_unused_name("pocket bag", {seam.name for seam in seams})
    seams.append(Seam(name=words, sides=((rim,), (replace(rim, mirrored=True),))))
    return replace(pattern, pieces=pieces, seams=seams)


def _downwards(piece: Piece, side: SeamSide) -> tuple[FloatArray, bool]:
    """Return the points of an edge from its upper end, and whether the seam runs that way."""
    points = piece.edge(side.edge).points
    grain = np.array([0.0, 1.0]) if piece.grain is None else piece.grain[1] - piece.grain[0]
    down = bool((points[-1] - points[0]) @ grain < 0.0)
    return (points if down else points[::-1]), down != side.reversed
