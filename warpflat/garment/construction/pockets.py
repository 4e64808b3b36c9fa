"""Pockets: patches and welts with their places marked, bags in a seam, and hip pockets cut into the corner of a piece."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    find_unused_name,
    nearest,
    other_side,
    part_between,
    points_at_lengths,
    polyline_length,
)
from warpflat.garment.construction.details import PocketTable
from warpflat.garment.construction.edges import (
    above_and_below,
    backwards,
    copies_sewn,
    downwards,
    drawn_on,
    free_piece_name,
    in_sizes,
    joined,
    lines_of,
    new_piece,
    polygon_edges,
    redrawn,
    runs_down,
    sewn,
    trimmed,
    up_and_across,
    with_edges,
)
from warpflat.garment.construction.mark_openings import with_notches
from warpflat.garment.construction.strips import NARROW, Strip, folded_strip
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

__all__ = ["add_pockets"]

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


def add_pockets(pattern: Pattern, pockets: Sequence[PocketTable]) -> Pattern:
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


def _with_placed(pattern: Pattern, pocket: PocketTable) -> Pattern:
    """Return a pattern with a patch or welt pocket and its place, on both sides of a piece that has both."""
    import shapely

    patch, welt, bag = (
        free_piece_name(pattern, f"{pocket.piece}_{what}") for what in ("pocket", "pocket_welt", "pocket_bag")
    )

    def placed(piece: Piece) -> tuple[Piece, ...]:
        # Smaller where its line is short.
        most = (pocket.most_share or math.inf) * polyline_length(_line_of(piece, pocket.line))
        smaller, keys = min(1.0, most / pocket.width), ("width_mm", "height_mm", "below_mm", "from_centre_mm")
        here = pocket.model_copy(update={key: smaller * getattr(pocket, key) for key in keys})
        up, across = up_and_across(piece)
        level, high = _line_of(piece, here.line), here.height if here.kind == "patch" else here.welt
        order = np.argsort(level @ across)
        places = []
        # It lies beside the centre line, or in the middle of a leg. Where a piece buttons, its centre line lies inside, and the edge of
        # that name is its stand's.
        known = {**piece.internal_lines, **lines_of(piece)}
        centre = next((points for name, points in known.items() if name.startswith("centre")), None)
        if centre is not None:
            at, away = float((centre @ across).mean()), here.from_centre + 0.5 * here.width
            middles = [at + away, at - away]
        else:
            if not any(name.startswith("crotch") for name in known):
                raise InputError(f"piece {piece.name!r} has no centre line to place a pocket from")
            height = float((level @ up).mean()) - here.below - 0.5 * high
            row = shapely.LineString([height * up - 5.0 * across, height * up + 5.0 * across])
            spots = shapely.get_coordinates(row.intersection(shapely.Polygon(piece.outline))) @ across
            middles = [float(spots.min() + spots.max()) / 2] if len(spots) else []
        for middle in middles:
            top = float(np.interp(middle, (level @ across)[order], (level @ up)[order])) - here.below
            place = (np.array([middle, top]) + _shape(here)) @ [across, up]
            if shapely.Polygon(piece.outline).contains(shapely.Polygon(place)):
                places.append(place)
        if not places:
            raise InputError(
                f"a pocket {1e3 * here.width:.0f} by {1e3 * high:.0f} mm does not lie on {piece.name!r} there"
            )
        count = len(places) * piece.quantity * (2 if piece.on_fold else 1)
        # Side by side, so that its corners stay sharp; the upper edge of a patch is left open.
        rows = [[*place[1:], place[0]] if pocket.kind == "patch" else [*place, place[0]] for place in places]
        sides = [("pocket", np.array(ends)) for row in rows for ends in pairwise(row)]
        marked = drawn_on(piece, sides, [("pocket corner", corner) for place in places for corner in place[:2]])
        if pocket.kind == "patch":
            names = ("upper", "left side", "lower left", "lower right", "right side")
            edges = polygon_edges(names, _shape(here), kind="cut", allowance=NARROW)
            edges = [replace(edges[0], kind="hem", allowance=_HEM), *edges[1:]]
            return marked, new_piece(patch, piece, edges, "pocket", quantity=count)
        long = here.width + 2 * _WELT_ENDS
        around = Strip(length=here.width + 2 * _BESIDE, height=here.height).edges(kinds="cut", allowance=NARROW)
        return (
            marked,
            folded_strip(welt, piece, long, here.welt, role="pocket", quantity=count),
            new_piece(bag, piece, around, "pocket", quantity=2 * count),
        )

    return redrawn(pattern, pocket.piece, placed)


def _line_of(piece: Piece, name: str) -> FloatArray:
    """Return a line inside a piece or an edge of it.

    Raises:
        InputError: it has none; gives the nearest.
    """
    known = lines_of(piece)
    if name not in known:
        raise InputError(f"piece {piece.name!r} has no line {name!r}; {nearest(name, known)}")
    return known[name]


def _shape(pocket: PocketTable) -> FloatArray:
    """Return the corners of a patch, or of the opening of a welt, from its upper right one leftwards; its upper edge lies along y = 0."""
    half, high = 0.5 * pocket.width, pocket.height if pocket.kind == "patch" else pocket.welt
    corners = np.array([(half, 0.0), (-half, 0.0), (-half, -high), (0.0, -high - _POINT), (half, -high)])
    return corners if pocket.kind == "patch" else corners[[0, 1, 2, 4]]


def _with_hip_pocket(pattern: Pattern, pocket: PocketTable) -> Pattern:
    """Return a pattern whose fronts are cut off from their upper edge to a side seam, with what lies behind the opening.

    The corner that is cut off belongs to a piece of its own, which is sewn in its place at the upper edge and in the seam. A bag of
    the same outline, without the corner, is sewn to the opening.
    """
    opened = _opened_seams(pattern, pocket)
    # Of pieces that are cut in pairs both seams have one edge.
    fronts = dict[tuple[str, str], SeamSide]()
    for seam in opened:
        _check_clear(seam, 0.0, pocket.height)
        found = [row[0] for row in seam.sides if len(row) == 1 and "front" in row[0].piece.split("_")]
        if not found:
            raise InputError(f"a hip pocket lies in a front, and {seam.name!r} joins none")
        fronts.setdefault((found[0].piece, found[0].edge), found[0])
    for front in fronts.values():
        pattern = _cut_hip_pocket(pattern, pocket, front)
    return pattern


def _cut_hip_pocket(pattern: Pattern, pocket: PocketTable, front: SeamSide) -> Pattern:
    """Return a pattern with a hip pocket in one piece, whose edge lies in the seam."""
    sample = pattern.piece(front.piece, pattern.sample)
    facing, bag = (free_piece_name(pattern, f"{front.piece}_pocket_{what}") for what in ("facing", "bag"))
    opening = find_unused_name("pocket opening", {edge.name for edge in sample.edges})
    # The upper edge comes before the side's where that runs downwards.
    first, upper = runs_down(sample, sample.edge(front.edge).points), above_and_below(sample, front.edge)[0]
    names = opening, facing, bag
    pattern = redrawn(
        pattern, front.piece, lambda piece: _hip_pocket(piece, pocket, upper, front.edge, names, first=first)
    )

    def both(side: SeamSide) -> list[SeamSide]:
        if side.piece != front.piece or side.edge not in (upper, front.edge):
            return [side]
        # The corner lies at the end of the upper edge where that comes first.
        corner_last = (first if side.edge == upper else not first) != side.reversed
        return [side, replace(side, piece=facing)][:: 1 if corner_last else -1]

    seams = []
    for seam in pattern.seams:
        one, other = (tuple(each for side in row for each in both(side)) for row in seam.sides)
        seams.append(replace(seam, sides=(one, other)))
    pattern = replace(pattern, seams=seams)
    for words, panel, edge in (("pocket opening", front.piece, opening), ("pocket bag", facing, "rim")):
        pattern = sewn(pattern, words, SeamSide(piece=panel, edge=edge), SeamSide(piece=bag, edge=edge, mirrored=True))
    return pattern


def _hip_pocket(
    piece: Piece, pocket: PocketTable, upper: str, side: str, names: tuple[str, str, str], *, first: bool
) -> tuple[Piece, Piece, Piece]:
    """Return a piece without its corner, what takes the corner's place, and the bag.

    Args:
        piece: with the pocket.
        pocket: how far along both edges it opens.
        upper, side: edges that meet in the corner.
        names: of the edge at the opening, of the pocket's facing and of its bag.
        first: whether the upper edge comes before the other one in the outline.

    Raises:
        InputError: the bag finds no room.
    """
    import shapely

    opening, facing, bag = names
    # Both edges from their corner.
    lines = {
        upper: piece.edge(upper).points[:: -1 if first else 1],
        side: piece.edge(side).points[:: 1 if first else -1],
    }
    cuts = {upper: pocket.width, side: pocket.height}
    for name, cut in cuts.items():
        _check_end(cut, name, piece.edge(name).length)
    # The bag lies in a box below the corner, whose lower inner corner is cut off.
    corner, (up, across) = lines[upper][0], up_and_across(piece)
    across = across if (lines[upper][-1] - corner) @ across > 0 else -across
    inward, low, slope = pocket.width + _INWARDS, -pocket.height - _DEEPER, 0.35 * pocket.width + 0.02
    box = np.array([(-0.3, 0.3), (inward, 0.3), (inward, low + slope), (inward - slope, low), (-0.3, low)])
    whole = shapely.Polygon(piece.outline)
    region = whole.intersection(shapely.Polygon(corner + box @ [across, up]))
    if region.geom_type != "Polygon" or not 0.0 < region.area < 0.8 * whole.area:
        raise InputError(f"the bag of a hip pocket finds no room on {piece.name!r}")
    # Each edge along the opening, along the bag, and beyond that.
    parts = {}
    for name, line in lines.items():
        inside = max(float(shapely.LineString(line).intersection(region.buffer(1e-7)).length), cuts[name] + 0.01)
        if inside > piece.edge(name).length - 1e-3:
            raise InputError(f"the bag of a hip pocket is deeper than {name!r} of {piece.name!r} is long")
        parts[name] = [part_between(line, *ends) for ends in pairwise([0.0, cuts[name], inside, np.inf])]
    rim = _between_ends(np.asarray(region.exterior.coords), parts[side][1][-1], parts[upper][1][-1], corner)
    straight = Edge(name=opening, points=np.array([parts[upper][0][-1], parts[side][0][-1]]))

    def part(name: str, *lines: FloatArray) -> Edge:
        return replace(piece.edge(name), points=joined(*lines)[:: -1 if name == upper else 1], vertices=None)

    def under(name: str) -> Edge:
        return replace(part(name, parts[name][1]), name=f"{name} under", kind="cut", allowance=NARROW)

    # From the corner along the side, around and back along the upper edge.
    around = [under(side), Edge(name="rim", points=rim, as_drawn=True), under(upper)]
    of_facing = [part(upper, parts[upper][0]), part(side, parts[side][0]), *around]
    of_bag = [straight, *around]
    # The opening stands before or behind the side's edge.
    left = {upper: [part(upper, *parts[upper][1:])], side: [straight, part(side, *parts[side][1:])]}
    if not first:
        of_facing, of_bag = backwards(of_facing), backwards(of_bag)
        left = {name: backwards(row) for name, row in left.items()}
    panel = with_edges(piece, left)
    like = {
        "paired": True, "grain": shapely.get_coordinates(region.centroid)[0] + np.outer([-0.05, 0.05], up),
        "quantity": piece.quantity * (2 if piece.on_fold else 1),
    }  # fmt: skip
    return (
        trimmed(panel, panel.edges),
        new_piece(facing, piece, of_facing, "pocket", **like),
        new_piece(bag, piece, of_bag, "pocket", **like),
    )


def _between_ends(ring: FloatArray, start: FloatArray, end: FloatArray, away: FloatArray) -> FloatArray:
    """Return the part of a closed line (#P by 2 [m], the first point repeated) from one of its points to another, away from a third."""
    import shapely

    places, whole = shapely.LineString(ring).project(shapely.points([start, end, away])), polyline_length(ring)
    forward, there = (places[1:] - places[0]) % whole
    if there < forward:
        return _between_ends(ring[::-1], start, end, away)
    part = part_between(joined(ring, ring), places[0], places[0] + forward)
    part[[0, -1]] = start, end
    return part


def _opened_seams(pattern: Pattern, pocket: PocketTable) -> list[Seam]:
    """Return the seam in which a pocket opens, and that of the other side of the body.

    Raises:
        InputError: there is none; gives the nearest.
    """
    opened = [seam for seam in pattern.seams if seam.name in (pocket.seam, other_side(pocket.seam))]
    if not opened:
        raise InputError(f"no seam {pocket.seam!r}; {nearest(pocket.seam, [seam.name for seam in pattern.seams])}")
    return opened


def _check_clear(seam: Seam, begin: float, end: float) -> None:
    """Check that a pocket's opening [m from the upper end of its seam], with what its bag runs past it, is clear of a zip or buttons there.

    Raises:
        InputError: it is not.
    """
    for other in seam.openings:
        stop = other.begin + other.length
        if other.kind in ("zip", "buttons") and begin - _PAST < stop and other.begin < end + _PAST:
            raise InputError(
                f"a pocket that opens from {1e3 * begin:.0f} to {1e3 * end:.0f} mm along {seam.name!r} meets the {other.kind} there, "
                f"from {1e3 * max(other.begin, 0.0):.0f} to {1e3 * stop:.0f} mm: move one of them"
            )


def _check_end(end: float, called: str, whole: float) -> None:
    """Check that an opening ends above the lower end of a seam or an edge.

    Raises:
        InputError: it does not.
    """
    if end > whole - _CLEAR:
        raise InputError(f"the pocket ends {1e3 * end:.0f} mm along {called!r}, which is {1e3 * whole:.0f} mm long")


def _with_bags(pattern: Pattern, pocket: PocketTable) -> Pattern:
    """Return a pattern with the bags of a pocket in a seam, and on the other side's too, and notches where they open."""
    opened = _opened_seams(pattern, pocket)
    if any(len(row) > 1 for seam in opened for row in seam.sides):
        raise InputError(f"the bag of a pocket lies in a seam between two edges, and {pocket.seam!r} joins more")
    # Of halves, and of pieces that are cut in pairs, one seam is listed for both sides.
    joined = [pattern.piece(side.piece, pattern.sample) for row in opened[0].sides for side in row]
    both = 4 if len(opened) == 2 or any(piece.on_fold or piece.quantity % 2 == 0 for piece in joined) else 2
    title = free_piece_name(pattern, "pocket_bag")
    ends = [pocket.below, pocket.below + pocket.height]
    for seam in opened:
        _check_clear(seam, *ends)
        first = seam.sides[0][0]
        for piece in in_sizes(pattern, first.piece):
            _check_end(ends[1], seam.name, piece.edge(first.edge).length)
        # Notches at both ends of the opening.
        pattern = with_notches(pattern, seam, dict.fromkeys(pattern.pieces, ends))
    side = opened[0].sides[0][0]

    def bag(piece: Piece) -> Piece:
        # Its straight edge lies along the seam, its rim reaches deeper below the opening than above.
        start = max(0.0, pocket.below - _PAST)
        ends = points_at_lengths(downwards(piece, side.edge)[0], [start, pocket.below + pocket.height + _PAST])
        length, deep = float(np.linalg.norm(ends[1] - ends[0])), pocket.width
        # In the frame of the bag the seam runs upwards along x = 0, the cloth lies to its left.
        turn = np.linspace(0.0, np.pi / 2, 9)
        round_end = np.column_stack([-np.sin(turn), np.cos(turn)])
        low, radius = -0.35 * length, min(0.4 * deep, 0.4 * length)
        upper = np.array([-deep + radius, length - radius]) + radius * round_end
        lower = np.array([-deep + radius, low + radius]) + radius * round_end[::-1] * [1.0, -1.0]
        around = np.vstack([[0.0, length], upper, lower, [-0.02, low], [0.0, 0.0]])
        past = pocket.below - start
        marked = {"pocket opening": length - past, "pocket opening end": length - past - pocket.height}
        edges = [
            Edge(name="opening", points=np.array([[0.0, 0.0], [0.0, length]]), kind="cut", allowance=NARROW),
            Edge(name="rim", points=around),
        ]
        return new_piece(
            title, piece, edges, "pocket", quantity=both, paired=True,
            internal_lines={name: np.array([[-0.012, y], [0.0, y]]) for name, y in marked.items()},
            grain=np.array([[-0.5 * deep, 0.1 * length], [-0.5 * deep, 0.7 * length]]),
        )  # fmt: skip

    return copies_sewn(redrawn(pattern, side.piece, bag), "pocket bag", title, "rim")
