"""Collars and hoods, drafted for the neckline that they are sewn to: its length, and the shape of the pieces around it.

A collar that is turned down is as long along its outer edge as the line on which that comes to lie on the sewn pieces.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import InputError, part_between, polyline_length
from warpflat.garment.construction.button_stand import buttonhole
from warpflat.garment.construction.details import FinishingTable
from warpflat.garment.construction.edges import (
    Place,
    added,
    bezier,
    copies_sewn,
    direction,
    free_piece_name,
    joined,
    lengths_of,
    new_piece,
    sewn,
)
from warpflat.garment.construction.free_edges import (
    Break,
    FreeChain,
    chain_allowance,
    chain_length,
    crossed_at,
    free_chains,
    joined_line,
    marks_of,
    split_edge,
)
from warpflat.garment.construction.strips import Strip, strip_edges, swept
from warpflat.pattern import Edge, Pattern, Piece, SeamSide, drawn_length

__all__ = ["STANDS", "with_collar", "with_hood"]

# A flat collar is drafted with the shoulders lapped by this angle [rad], about a centimetre at their ends: it rolls a little.
_LAPPED = 0.10
#: Share of a convertible collar that stands up.
STANDS = 0.4
# A fall reaches at least so far below the seam of its stand [m].
_COVERS = 0.004
# The upper corners of a stand are rounded by this share of its height, a flat collar's by this share of its width.
_ROUND = 0.6
# How much farther apart the points of a fall are than its sewn edge, on each side [m].
_LEAN = 0.010
# Length of a hood's front edge and its width as shares of the head's girth, and how far its neck rises towards the front [rad].
_HOOD_HIGH, _HOOD_WIDE, _HOOD_TURN = 0.62, 0.44, 0.25
# Hem of a hood's front edge, through which a cord may run [m].
_HOOD_HEM = 0.030
# The edges of a collar that are not sewn to the neckline.
_AROUND = ("right end", "upper", "left end")


def with_collar(
    pattern: Pattern,
    places: Sequence[Place],
    collar: FinishingTable,
    *,
    gaps: Collection[str] = (),
    breaks: Sequence[Break] = (),
) -> Pattern:
    """Return a pattern with a collar along its neckline: upper and under collar, or both layers of a stand.

    Args:
        pattern: with all its openings.
        places: pieces and edges of the neckline.
        collar: what it is like.
        gaps: names of seams that an opening leaves open there.
        breaks: ends of edges at which a placket opens it.

    Raises:
        InputError: the neckline is closed or opens behind, where the collar needs an opening in front, or the collar cannot be drawn.
    """
    import shapely

    closed = any(chain.closed for chain, _ in free_chains(pattern, places, gaps, breaks))
    if closed and collar.style != "flat":
        raise InputError(
            f'a {collar.style} collar needs an opening in front, as [[openings]] kind = "buttons", seam = "centre front"; a neck '
            'that is closed can have style = "flat", or "turtleneck" in a knit'
        )
    if collar.style in ("flat", "convertible"):
        # It ends at the centre front: a button stand lies beyond it.
        pattern, parted, places = _parted_at_front(pattern, places)
        breaks = [*breaks, *parted]
    chains = _long_chains(pattern, places, gaps, breaks)
    # Two halves of a flat one meet in front and leave the back open.
    halves = len(chains) == 2 and collar.style == "flat"
    if len(chains) != 1 and not halves:
        raise InputError(f"a {collar.style} collar opens in front, and this neckline has {len(chains)} parts of a kind")
    if collar.style in ("shirt", "convertible") and not _ends_in_front(pattern, chains[0]):
        raise InputError(
            f'a {collar.style} collar opens in front, and this neckline behind; take style = "stand" or "flat"'
        )
    if collar.style in ("stand", "shirt"):
        return _with_stand(pattern, chains[0], collar)
    name, chain = free_piece_name(pattern, "collar"), chains[0]

    def draw(like: Piece) -> Piece:
        length, allowance = chain_length(pattern, chain, like.size), chain_allowance(pattern, chain, like.size)
        if collar.style == "flat":
            # Around the neckline, with round corners.
            line = joined_line(pattern, chain, like.size, lapped=_LAPPED)
            line = line * (length / drawn_length(line))
            outer = np.asarray(shapely.LineString(line).offset_curve(collar.width).simplify(2e-5).coords)
            edges = strip_edges(line, outer, rounded=_ROUND * collar.width, allowance=allowance)
        else:
            back, grown = _rests_on(pattern, chain, like.size, (1.0 - 2.0 * STANDS) * collar.width)
            shape = _turned_down(length, collar.width, grown / back, collar.point + STANDS * collar.width)
            edges = shape.edges(allowance=allowance)
        return _piece(name, like, edges, quantity=4 if halves else 2, paired=halves)

    pattern = _sewn_on(added(pattern, draw), chain, name)
    if halves:
        other = SeamSide(piece=name, edge="lower", reversed=True, mirrored=True)
        pattern = sewn(pattern, "collar of the other half", other, chains[1].sides)
    return pattern


def _turned_down(length: float, high: float, longer: float, tip: float) -> Strip:
    """Return a collar of a length and a height [m] that is turned down: so many times as long outside as where it turns.

    Args:
        length, high: of its lower edge, and in the middle of the back [m].
        longer: length of the line on which its outer edge rests over that of where it turns.
        tip: length of its front edges [m].
    """
    turn = 0.5 * length * max(0.0, longer - 1.0) / high
    return Strip(length=length, height=high, turn=-turn, even=True, tip=tip, lean=_LEAN)


def _with_stand(pattern: Pattern, chain: FreeChain, collar: FinishingTable) -> Pattern:
    """Return a pattern with a stand along the whole neckline, and with the fall that is sewn into its upper edge, if it has one."""
    import shapely

    stand, fall = free_piece_name(pattern, "collar_stand"), free_piece_name(pattern, "collar")
    high, covers = collar.width, collar.fall - collar.width
    if collar.style == "shirt" and covers < _COVERS:
        raise InputError(
            f"the fall of a shirt collar hides the seam of its stand: fall_mm = {collar.fall_mm:g} must be at least "
            f"{1e3 * _COVERS:g} more than width_mm = {1e3 * high:g}"
        )

    def draw(like: Piece) -> list[Piece]:
        size = like.size
        length, allowance = chain_length(pattern, chain, size), chain_allowance(pattern, chain, size)
        centres = marks_of(pattern, chain, size, "centre front")
        beyond = min((at for at in (*centres, *(length - c for c in centres)) if at < 0.25 * length), default=0.0)
        lower, upper = swept(Strip(length=length, height=high, turn=6.0 * collar.rise / length))
        # The fall ends at the centre front, the stand at the end of the button stand.
        count = len(upper) - 1
        at = np.array([beyond / length, 1.0 - beyond / length]) * count
        low, ends = (
            np.column_stack([np.interp(at, np.arange(count + 1), row) for row in line.T]) for line in (lower, upper)
        )
        rounded = min(_ROUND * high, 0.9 * beyond) if beyond > 0.005 else 0.0
        right, top, left = (edge.points for edge in strip_edges(lower, upper, rounded=rounded)[1:])
        begin, end = shapely.LineString(top).project(shapely.points(ends[::-1])).tolist()
        edge = part_between(top, begin, end)
        if beyond:
            right = joined(right, part_between(top, 0.0, begin))
            left = joined(part_between(top, end, polyline_length(top)), left)
        outline = {"lower": lower, "right end": right, "upper": edge, "left end": left}
        edges = [Edge(name=name, points=points, allowance=allowance) for name, points in outline.items()]
        made = [_piece(stand, like, edges)]
        if beyond > 0.01:
            # The button lies on the centre front, and so does the buttonhole at the other end.
            middles, (x, y) = 0.5 * (low + ends), direction(np.array([low[0], ends[0]]))
            lines = buttonhole(middles[0], np.array([y, -x]))
            made[-1] = replace(made[-1], internal_lines=lines, marks={"button": middles[1]})
        if collar.style == "shirt":
            back, grown = _rests_on(pattern, chain, size, covers)
            # The upper edge of the stand is shorter than the neckline there.
            middle = slice(*(round(count * (0.5 + sign * 0.5 * back / length)) for sign in (-1.0, 1.0)))
            own = back * polyline_length(upper[middle]) / polyline_length(lower[middle])
            shape = _turned_down(drawn_length(edge), collar.fall, grown / own, collar.point)
            made.append(_piece(fall, like, shape.edges(allowance=allowance)))
        return made

    pattern = added(pattern, draw)
    if collar.style != "shirt":
        return _sewn_on(pattern, chain, stand)
    pattern = copies_sewn(pattern, f"{fall} edge", fall, *_AROUND)
    upper_side = SeamSide(piece=stand, edge="upper", reversed=True)
    pattern = sewn(pattern, "collar to its stand", SeamSide(piece=fall, edge="lower"), upper_side, notches=(0.5,))
    pattern = copies_sewn(pattern, f"{stand} right end", stand, "right end")
    return _sewn_on(pattern, chain, stand, ("left end",))


def with_hood(
    pattern: Pattern,
    places: Sequence[Place],
    wish: FinishingTable,
    heads: Mapping[str, float],
    *,
    gaps: Collection[str] = (),
) -> Pattern:
    """Return a pattern with a hood: two halves, or two sides and a strip over the crown, from the centre front around the neck.

    Args:
        pattern: with all its openings.
        places: pieces and edges of the neckline.
        wish: with the width of its strip.
        heads: girth of the head by size [m].
        gaps: names of seams that an opening leaves open there.

    Raises:
        InputError: the neckline opens behind, or is too narrow for the hood.
    """
    pattern, breaks, places = _parted_at_front(pattern, places)
    chains = _long_chains(pattern, places, gaps, breaks)
    if len(chains) != 1 or chains[0].closed or not _ends_in_front(pattern, chains[0]):
        raise InputError("a hood begins and ends at the centre front, and this neckline does not")
    chain, strip = chains[0], wish.strip
    hood, middle = free_piece_name(pattern, "hood"), free_piece_name(pattern, "hood_strip")

    def draw(like: Piece) -> list[Piece]:
        size = like.size
        neck = 0.5 * (chain_length(pattern, chain, size) - strip)
        lower = swept(Strip(length=2.0 * neck, height=0.1, turn=_HOOD_TURN))[0]
        lower = lower[len(lower) // 2 :] - lower[len(lower) // 2]
        front, rise = lower[-1].tolist()
        high, wide = rise + _HOOD_HIGH * heads[size] - 0.5 * strip, _HOOD_WIDE * heads[size] - 0.5 * strip
        if wide < 0.5 * front:
            raise InputError(f"a hood for a head of {1e3 * heads[size]:.0f} mm does not reach around this neckline")
        back = front - wide
        controls = np.array(
            [(front, high), (front - 0.55 * wide, high), (back, 0.85 * high), (back, 0.55 * high),
             (back, 0.30 * high), (0.0, 0.12 * high), lower[0]]
        )  # fmt: skip
        crown = joined(bezier(*controls[:4], count=25), bezier(*controls[3:], count=25))
        allowance = chain_allowance(pattern, chain, size)
        hem = Edge(name="front edge", points=np.array([lower[-1], controls[0]]), kind="hem", allowance=_HOOD_HEM)
        edges = [
            Edge(name="neck", points=lower, allowance=allowance),
            hem,
            Edge(name="crown", points=crown, allowance=allowance),
        ]
        made = [_piece(hood, like, edges, paired=True, role="hood")]
        if strip:
            names = {"lower": "neck", "right end": "right side", "upper": "front edge", "left end": "left side"}
            edges = [
                replace(hem, points=edge.points) if edge.name == "upper" else replace(edge, name=names[edge.name])
                for edge in Strip(length=strip, height=drawn_length(crown)).edges(allowance=allowance)
            ]
            made.append(_piece(middle, like, edges, quantity=1, role="hood"))
        return made

    pattern = added(pattern, draw)
    one, other = SeamSide(piece=hood, edge="neck"), SeamSide(piece=hood, edge="neck", reversed=True, mirrored=True)
    if not strip:
        return sewn(copies_sewn(pattern, "hood crown", hood, "crown"), "hood", (other, one), chain.sides)
    for mirrored, edge in ((False, "right side"), (True, "left side")):
        # The crown runs down to the neck, as the strip's left side does.
        crown_side = SeamSide(piece=hood, edge="crown", mirrored=mirrored, reversed=True)
        pattern = sewn(pattern, f"hood {edge}", crown_side, SeamSide(piece=middle, edge=edge, reversed=mirrored))
    return sewn(pattern, "hood", (other, SeamSide(piece=middle, edge="neck"), one), chain.sides)


def _long_chains(
    pattern: Pattern, places: Sequence[Place], gaps: Collection[str], breaks: Sequence[Break]
) -> list[FreeChain]:
    """Return the chains of a neckline that are more than half as long as the longest: not those beyond the centre front."""
    chains = [chain for chain, _ in free_chains(pattern, places, gaps, breaks)]
    lengths = [chain_length(pattern, chain) for chain in chains]
    return [chain for chain, length in zip(chains, lengths, strict=True) if length > 0.5 * max(lengths)]


def _parted_at_front(pattern: Pattern, places: Sequence[Place]) -> tuple[Pattern, list[Break], list[Place]]:
    """Return a pattern whose edges are parted at the centre front, the ends of chains there, and the edges that there are now."""
    breaks, now = list[Break](), list(places)
    for name, edge in places:
        at = crossed_at(pattern, (name, edge), "centre front")
        if at is None:
            continue
        known = {each.name for each in pattern.piece(name, pattern.sample).edges}
        pattern, broken = split_edge(pattern, (name, edge), at)
        breaks.append(broken)
        now += [(name, each.name) for each in pattern.piece(name, pattern.sample).edges if each.name not in known]
    return pattern, breaks, now


def _ends_in_front(pattern: Pattern, chain: FreeChain) -> bool:
    """Return whether the centre front lies in the first or the last quarter of a chain, or at its ends."""
    length = chain_length(pattern, chain)
    return any(min(at, length - at) < 0.25 * length for at in marks_of(pattern, chain, pattern.sample, "centre front"))


def _rests_on(pattern: Pattern, chain: FreeChain, size: str, below: float) -> tuple[float, float]:
    """Return the length of a neckline between the shoulders, behind, and that of the line at a distance below it on the pieces [m]."""
    import shapely

    ends = np.cumsum(lengths_of(pattern, chain.sides, size)).tolist()
    sides = zip(ends, chain.sides, chain.sides[1:], strict=False)
    joints = [end for end, one, other in sides if one.piece != other.piece]
    reach = (joints[0], joints[-1]) if len(joints) > 1 else (0.25 * ends[-1], 0.75 * ends[-1])
    back = part_between(joined_line(pattern, chain, size), *reach)
    offset = shapely.LineString(back).offset_curve(below) if below > 0.0 else shapely.LineString(back)
    return polyline_length(back), float(offset.length)


def _piece(
    name: str, like: Piece, edges: Sequence[Edge], *, quantity: int = 2, paired: bool = False, role: str = "collar"
) -> Piece:
    """Return a new piece; its grain runs upwards through the middle."""
    outline = np.concatenate([edge.points for edge in edges])
    (x, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    grain = np.array([[0.5 * (x + right), share * high + (1.0 - share) * low] for share in (0.3, 0.7)])
    try:
        return new_piece(name, like, edges, role, quantity=quantity, paired=paired, grain=grain)
    except InputError:
        raise InputError(f"no {name.replace('_', ' ')} of these measures can be drawn along this neckline") from None


def _sewn_on(pattern: Pattern, chain: FreeChain, name: str, layers: tuple[str, ...] = _AROUND) -> Pattern:
    """Return a pattern with both layers of a collar sewn to each other and its lower edge to the neckline."""
    pattern = copies_sewn(pattern, f"{name} {'edge' if len(layers) > 1 else layers[0]}", name, *layers)
    return sewn(pattern, name, SeamSide(piece=name, edge="lower"), chain.sides)
