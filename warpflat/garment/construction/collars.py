"""Collars and hoods, drafted for the neckline that they are sewn to: its length, and the shape of the pieces around it.

A collar that is turned down is as long along its outer edge as the line on which that comes to lie on the sewn pieces.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, find_unused_name, points_at_lengths, polyline_length
from warpflat.garment.construction.button_stand import buttonhole
from warpflat.garment.construction.free_edges import (
    OFF_END,
    Break,
    FreeChain,
    chain_length,
    free_chains,
    joined_line,
    marks_of,
    split_edge,
)
from warpflat.garment.construction.strips import Strip, strip_edges, swept
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide, drawn_length

__all__ = ["COLLARS", "Collar", "with_collar", "with_hood"]

#: By style the width in the middle of the back [m]: of a stand, of a stand below a fall, of a collar in one with its stand, of a flat one.
COLLARS = {"stand": 0.035, "shirt": 0.030, "convertible": 0.075, "flat": 0.065, "turtleneck": 0.060}
# A flat collar is drafted with the shoulders lapped by this angle [rad], about a centimetre at their ends: it rolls a little.
_LAPPED = 0.10
# Share of a convertible collar that stands up.
_STANDS = 0.4
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


@dataclass(frozen=True, kw_only=True)
class Collar:
    """What a collar or hood is like.

    Attributes:
        style: one of `COLLARS`; "" for a hood.
        width: in the middle of the back [m]; of a shirt's collar that of its stand.
        rise: by how much a stand's front ends lie higher than its middle [m], so that it leans to the neck.
        fall: width of a shirt collar's fall in the middle of the back [m].
        point: length of the front edge of a fall, or of a collar with points [m].
        strip: width of the strip over the crown of a hood of three pieces [m]; 0 for one of two.
    """

    style: str
    width: float
    rise: float = 0.015
    fall: float = 0.045
    point: float = 0.065
    strip: float = 0.0


def with_collar(
    pattern: Pattern,
    places: Sequence[tuple[str, str]],
    collar: Collar,
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
    closed = any(chain.closed for chain, _ in free_chains(pattern, places, gaps, breaks))
    if closed and collar.style != "flat":
        raise InputError(
            f'a {collar.style} collar needs an opening in front, as [[openings]] kind = "buttons", seam = "centre front"; a neck '
            'that is closed can have style = "flat", or "turtleneck" in a knit'
        )
    if collar.style in ("flat", "convertible"):
        # It ends at the centre front: a button stand lies beyond it.
        pattern, parted, places = _parted_at(pattern, places, "centre front")
        breaks = [*breaks, *parted]
    chains = [chain for chain, _ in free_chains(pattern, places, gaps, breaks)]
    lengths = [chain_length(pattern, chain) for chain in chains]
    chains = [chain for chain, length in zip(chains, lengths, strict=True) if length > 0.5 * max(lengths)]
    if len(chains) == 2 and collar.style == "flat":
        return _with_flat_halves(pattern, (chains[0], chains[1]), collar)
    if len(chains) != 1:
        raise InputError(f"a {collar.style} collar opens in front, and this neckline has {len(chains)} parts of a kind")
    chain = chains[0]
    if collar.style in ("shirt", "convertible") and not _ends_in_front(pattern, chain):
        raise InputError(
            f'a {collar.style} collar opens in front, and this neckline behind; take style = "stand" or "flat"'
        )
    if collar.style == "flat":
        edges = {size: _flat_edges(pattern, chain, size, collar.width) for size in pattern.pieces}
        pattern, name = _add(pattern, "collar", edges, quantity=2)
    elif collar.style == "convertible":
        edges = {}
        for size in pattern.pieces:
            length, high = chain_length(pattern, chain, size), collar.width
            back, grown = _rests_on(pattern, chain, size, (1.0 - 2.0 * _STANDS) * high)
            turn = 0.5 * length * max(0.0, grown - back) / (back * high)
            shape = Strip(
                length=length, height=high, turn=-turn, even=True, tip=collar.point + _STANDS * high, lean=_LEAN
            )
            edges[size] = strip_edges(*swept(shape), allowance=_all_around(_allowance(pattern, chain, size)))
        pattern, name = _add(pattern, "collar", edges, quantity=2)
    else:
        return _with_stand(pattern, chain, collar)
    return _sewn_on(pattern, chain, name, layers=("right end", "upper", "left end"))


def _with_stand(pattern: Pattern, chain: FreeChain, collar: Collar) -> Pattern:
    """Return a pattern with a stand along the whole neckline, and with the fall that is sewn into its upper edge, if it has one."""
    stands, falls = dict[str, list[Edge]](), dict[str, list[Edge]]()
    lines, marks = dict[str, dict[str, FloatArray]](), dict[str, dict[str, FloatArray]]()
    for size in pattern.pieces:
        length, high = chain_length(pattern, chain, size), collar.width
        allowance = _allowance(pattern, chain, size)
        centres = marks_of(pattern, chain, size, "centre front")
        beyond = min((at for at in (*centres, *(length - c for c in centres)) if at < 0.25 * length), default=0.0)
        lower, upper = swept(Strip(length=length, height=high, turn=6.0 * collar.rise / length))
        # The fall ends at the centre front, the stand at the end of the button stand.
        count = len(upper) - 1
        ends = [_between(upper, share * count) for share in (beyond / length, 1.0 - beyond / length)]
        rounded = min(_ROUND * high, 0.9 * beyond) if beyond > 0.005 else 0.0
        right, top, left = strip_edges(lower, upper, rounded=rounded)[1:]
        places = [_along(top.points, end) for end in reversed(ends)]
        parts = [
            _part(top.points, 0.0, places[0]),
            _part(top.points, *places),
            _part(top.points, places[1], top.length),
        ]
        outline = {
            "lower": lower,
            "right end": np.vstack([right.points, parts[0][1:]]) if beyond else right.points,
            "upper": parts[1],
            "left end": np.vstack([parts[2][:-1], left.points]) if beyond else left.points,
        }
        stands[size] = [Edge(name=name, points=points, allowance=allowance) for name, points in outline.items()]
        if beyond > 0.01:
            # The button lies on the centre front, and so does the buttonhole at the other end.
            low = [_between(lower, share * (len(lower) - 1)) for share in (beyond / length, 1.0 - beyond / length)]
            middles = [0.5 * (one + other) for one, other in zip(low, ends, strict=True)]
            across = (ends[0] - low[0]) / np.linalg.norm(ends[0] - low[0])
            marks[size] = {"button": middles[1]}
            lines[size] = buttonhole(middles[0], np.array([across[1], -across[0]]))
        if collar.style == "shirt":
            covers = collar.fall - high
            if covers < _COVERS:
                raise InputError(
                    f"the fall of a shirt collar hides the seam of its stand: fall_mm = {1e3 * collar.fall:g} must be at least "
                    f"{1e3 * _COVERS:g} more than width_mm = {1e3 * high:g}"
                )
            sewn = drawn_length(parts[1])
            back, grown = _rests_on(pattern, chain, size, covers)
            # The upper edge of the stand is shorter than the neckline there.
            middle = slice(*(round(count * (0.5 + sign * 0.5 * back / length)) for sign in (-1.0, 1.0)))
            own = back * polyline_length(upper[middle]) / polyline_length(lower[middle])
            turn = 0.5 * sewn * max(0.0, grown - own) / (own * collar.fall)
            shape = Strip(length=sewn, height=collar.fall, turn=-turn, even=True, tip=collar.point, lean=_LEAN)
            falls[size] = strip_edges(*swept(shape), allowance=_all_around(allowance))
    pattern, stand = _add(pattern, "collar_stand", stands, quantity=2, lines=lines, marks=marks)
    layers: tuple[tuple[str, ...], ...] = (
        (("right end",), ("left end",)) if falls else (("right end", "upper", "left end"),)
    )
    if falls:
        pattern, fall = _add(pattern, "collar", falls, quantity=2)
        pattern = _with_layers(pattern, fall, ("right end", "upper", "left end"))
        sides = ((SeamSide(piece=fall, edge="lower"),), (SeamSide(piece=stand, edge="upper", reversed=True),))
        pattern = _with_seam(pattern, "collar to its stand", sides, notches=(0.5,))
    for row in layers[:-1]:
        pattern = _with_layers(pattern, stand, row)
    return _sewn_on(pattern, chain, stand, layers=layers[-1])


def _with_flat_halves(pattern: Pattern, chains: tuple[FreeChain, FreeChain], collar: Collar) -> Pattern:
    """Return a pattern with a flat collar in two halves, which meet in front and leave the back open."""
    first, second = chains
    edges = {size: _flat_edges(pattern, first, size, collar.width) for size in pattern.pieces}
    pattern, name = _add(pattern, "collar", edges, quantity=4, paired=True)
    pattern = _sewn_on(pattern, first, name, layers=("right end", "upper", "left end"))
    other = (SeamSide(piece=name, edge="lower", reversed=True, mirrored=True),)
    return _with_seam(pattern, "collar of the other half", (other, second.sides))


def with_hood(
    pattern: Pattern,
    places: Sequence[tuple[str, str]],
    collar: Collar,
    heads: Mapping[str, float],
    *,
    gaps: Collection[str] = (),
) -> Pattern:
    """Return a pattern with a hood: two halves, or two sides and a strip over the crown, from the centre front around the neck.

    Args:
        pattern: with all its openings.
        places: pieces and edges of the neckline.
        collar: with the width of the strip.
        heads: girth of the head by size [m].
        gaps: names of seams that an opening leaves open there.

    Raises:
        InputError: the neckline opens behind, or is too narrow for the hood.
    """
    pattern, breaks, places = _parted_at(pattern, places, "centre front")
    chains = [chain for chain, _ in free_chains(pattern, places, gaps, breaks)]
    lengths = [chain_length(pattern, chain) for chain in chains]
    chains = [chain for chain, length in zip(chains, lengths, strict=True) if length > 0.5 * max(lengths)]
    if len(chains) != 1 or chains[0].closed or not _ends_in_front(pattern, chains[0]):
        raise InputError("a hood begins and ends at the centre front, and this neckline does not")
    chain, strip = chains[0], collar.strip
    halves, crowns = dict[str, list[Edge]](), dict[str, list[Edge]]()
    for size in pattern.pieces:
        neck = 0.5 * (chain_length(pattern, chain, size) - strip)
        lower = swept(Strip(length=2.0 * neck, height=0.1, turn=_HOOD_TURN))[0]
        lower = lower[len(lower) // 2 :] - lower[len(lower) // 2]
        front, rise = lower[-1].tolist()
        high, wide = rise + _HOOD_HIGH * heads[size] - 0.5 * strip, _HOOD_WIDE * heads[size] - 0.5 * strip
        if wide < 0.5 * front:
            raise InputError(f"a hood for a head of {1e3 * heads[size]:.0f} mm does not reach around this neckline")
        top, behind = np.array([front, high]), np.array([front - wide, 0.55 * high])
        crown = np.vstack(
            [
                _bezier(top, (front - 0.55 * wide, high), (front - wide, 0.85 * high), behind),
                _bezier(behind, (front - wide, 0.30 * high), (0.0, 0.12 * high), lower[0])[1:],
            ]
        )
        allowance = _allowance(pattern, chain, size)
        halves[size] = [
            Edge(name="neck", points=lower, allowance=allowance),
            Edge(name="front edge", points=np.array([lower[-1], top]), kind="hem", allowance=_HOOD_HEM),
            Edge(name="crown", points=crown, allowance=allowance),
        ]
        if strip:
            length = drawn_length(crown)
            corners = np.array([[0.0, 0.0], [strip, 0.0], [strip, length], [0.0, length]])
            names = ("neck", "right side", "front edge", "left side")
            crowns[size] = [
                Edge(
                    name=name, points=corners[[k, (k + 1) % 4]], kind="hem" if name == "front edge" else "seam",
                    allowance=_HOOD_HEM if name == "front edge" else allowance,
                )
                for k, name in enumerate(names)
            ]  # fmt: skip
    pattern, hood = _add(pattern, "hood", halves, quantity=2, paired=True, role="hood")
    one, other = SeamSide(piece=hood, edge="neck"), SeamSide(piece=hood, edge="neck", reversed=True, mirrored=True)
    around: tuple[SeamSide, ...] = (other, one)
    if strip:
        pattern, middle = _add(pattern, "hood_strip", crowns, quantity=1, role="hood")
        around = (other, SeamSide(piece=middle, edge="neck"), one)
        for mirrored, edge in ((False, "right side"), (True, "left side")):
            # The crown runs down to the neck, as the strip's left side does.
            sides = (
                (SeamSide(piece=hood, edge="crown", mirrored=mirrored, reversed=True),),
                (SeamSide(piece=middle, edge=edge, reversed=edge == "left side"),),
            )
            pattern = _with_seam(pattern, f"hood {edge}", sides)
    else:
        crown_side = SeamSide(piece=hood, edge="crown")
        pattern = _with_seam(pattern, "hood crown", ((crown_side,), (replace(crown_side, mirrored=True),)))
    return _with_seam(pattern, "hood", (around, chain.sides))


def _parted_at(
    pattern: Pattern, places: Sequence[tuple[str, str]], line: str
) -> tuple[Pattern, list[Break], list[tuple[str, str]]]:
    """Return a pattern whose edges are parted where a line meets them, the ends of chains there, and the edges that there are now."""
    breaks, now = list[Break](), list(places)
    for name, edge in places:
        side = FreeChain(sides=(SeamSide(piece=name, edge=edge),), closed=False)
        at = {size: marks_of(pattern, side, size, line) for size in pattern.pieces}
        lengths = {size: pattern.piece(name, size).edge(edge).length for size in pattern.pieces}
        if any(len(row) != 1 or not OFF_END < row[0] < lengths[size] - OFF_END for size, row in at.items()):
            continue
        known = {each.name for each in pattern.piece(name, pattern.sample).edges}
        pattern, broken = split_edge(pattern, (name, edge), {size: row[0] for size, row in at.items()})
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

    line = joined_line(pattern, chain, size)
    ends = np.cumsum([pattern.piece(side.piece, size).edge(side.edge).length for side in chain.sides])
    joints = [
        float(end)
        for end, one, other in zip(ends, chain.sides, chain.sides[1:], strict=False)
        if one.piece != other.piece
    ]
    reach = (joints[0], joints[-1]) if len(joints) > 1 else (0.25 * float(ends[-1]), 0.75 * float(ends[-1]))
    back = _part(line, *reach)
    offset = shapely.LineString(back).offset_curve(below) if below > 0.0 else shapely.LineString(back)
    return polyline_length(back), float(offset.length)


def _flat_edges(pattern: Pattern, chain: FreeChain, size: str, width: float) -> list[Edge]:
    """Return the edges of a collar that lies flat around a neckline, with round corners."""
    import shapely

    line, length = joined_line(pattern, chain, size, lapped=_LAPPED), chain_length(pattern, chain, size)
    line = line * (length / drawn_length(line))
    outer = np.asarray(shapely.LineString(line).offset_curve(width).simplify(2e-5).coords)
    return strip_edges(line, outer, rounded=_ROUND * width, allowance=_all_around(_allowance(pattern, chain, size)))


def _all_around(allowance: float) -> dict[str, float]:
    return dict.fromkeys(("lower", "right end", "upper", "left end"), allowance)


def _allowance(pattern: Pattern, chain: FreeChain, size: str) -> float:
    return pattern.piece(chain.sides[0].piece, size).edge(chain.sides[0].edge).width


def _add(
    pattern: Pattern,
    name: str,
    edges: Mapping[str, Sequence[Edge]],
    *,
    quantity: int,
    paired: bool = False,
    role: str = "collar",
    lines: Mapping[str, Mapping[str, FloatArray]] | None = None,
    marks: Mapping[str, Mapping[str, FloatArray]] | None = None,
) -> tuple[Pattern, str]:
    """Return a pattern with one more piece, and what it is called; its grain runs upwards through the middle."""
    name = find_unused_name(name, {piece.name for piece in pattern.pieces[pattern.sample]})
    pieces = {}
    for size, row in pattern.pieces.items():
        outline = np.concatenate([edge.points for edge in edges[size]])
        low, high = outline.min(axis=0), outline.max(axis=0)
        x = 0.5 * (low[0] + high[0])
        try:
            piece = Piece(
                name=name, size=size, fabric=row[0].fabric, quantity=quantity, edges=edges[size], paired=paired, role=role,
                internal_lines=(lines or {}).get(size, {}), marks=(marks or {}).get(size, {}),
                grain=np.array([[x, 0.7 * low[1] + 0.3 * high[1]], [x, 0.3 * low[1] + 0.7 * high[1]]]),
            )  # fmt: skip
        except InputError:
            words = name.replace("_", " ")
            raise InputError(f"no {words} of these measures can be drawn along this neckline") from None
        pieces[size] = (*row, piece)
    return replace(pattern, pieces=pieces), name


def _sewn_on(pattern: Pattern, chain: FreeChain, name: str, *, layers: Sequence[str]) -> Pattern:
    """Return a pattern with both layers of a collar sewn to each other and its lower edge to the neckline."""
    pattern = _with_layers(pattern, name, layers)
    sides = ((SeamSide(piece=name, edge="lower"),), chain.sides)
    return _with_seam(pattern, name.replace("_", " "), sides)


def _with_layers(pattern: Pattern, name: str, edges: Sequence[str]) -> Pattern:
    """Return a pattern with edges of a piece sewn to those of its second copy."""
    side = tuple(SeamSide(piece=name, edge=edge) for edge in edges)
    other = tuple(replace(each, mirrored=True) for each in side)
    what = "edge" if len(edges) > 1 else edges[0]
    return _with_seam(pattern, f"{name.replace('_', ' ')} {what}", (side, other))


def _with_seam(
    pattern: Pattern,
    name: str,
    sides: tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]],
    notches: tuple[float, ...] | None = None,
) -> Pattern:
    name = find_unused_name(name, {seam.name for seam in pattern.seams})
    return replace(pattern, seams=[*pattern.seams, Seam(name=name, sides=sides, notches=notches)])


def _between(points: FloatArray, at: float) -> FloatArray:
    """Return the point of a line at a number of points along it that need not be whole."""
    return np.array([np.interp(at, np.arange(len(points)), column) for column in points.T])


def _along(points: FloatArray, place: FloatArray) -> float:
    """Return where along a line the nearest point to a place lies [m]."""
    import shapely

    return float(shapely.LineString(points).project(shapely.Point(place)))


def _part(points: FloatArray, begin: float, end: float) -> FloatArray:
    """Return the part of a line between two lengths along it [m]."""
    at = arc_lengths(points)
    ends = points_at_lengths(points, [begin, end])
    return np.vstack([ends[:1], points[(at > begin + 1e-7) & (at < end - 1e-7)], ends[1:]])


def _bezier(start: FloatArray, one: Sequence[float], other: Sequence[float], end: FloatArray) -> FloatArray:
    """Return points along a cubic Bezier curve (#P by 2 [m])."""
    at = np.linspace(0.0, 1.0, 25)[:, None]
    rest = 1.0 - at
    return np.asarray(rest**3 * start + 3 * rest**2 * at * one + 3 * rest * at**2 * other + at**3 * end)
