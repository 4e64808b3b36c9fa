"""Strips: pieces drafted for the length of the edge that they are sewn to. Bands, cuffs, waistbands, ruffles and collars are strips."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpflat.core import FloatArray, InputError, part_between, polyline_length
from warpflat.garment.construction.edges import bezier, joined, new_piece
from warpflat.pattern import Edge, Piece, drawn_length

__all__ = ["NARROW", "Strip", "folded_strip", "panel_count", "strip_edges", "swept"]


#: Allowance of an edge that is turned in or overlocked, and of a narrow hem [m].
NARROW = 0.010

# A curved lower edge has so many points, an odd number: one lies in its middle.
_POINTS = 97
# The ends of a strip are drawn out to their tips over this share of half its length.
_TIP = 0.55
# More panels than these are a mistake in a length, not a ruffle.
_MOST_PANELS = 60


@dataclass(frozen=True, kw_only=True)
class Strip:
    """The shape of a strip, which is its own mirror image. Its lower edge is sewn.

    Attributes:
        length: of the lower edge [m].
        height: in the middle [m].
        turn: by how much both ends of the lower edge turn upwards [rad], which makes the upper edge shorter; downwards if negative.
        even: whether it turns evenly, as a circle does; else from nothing in the middle to most at the ends, as a collar is drafted.
        tip: height at the ends [m]; that of the middle if not given.
        lean: how far the upper corners lie outside of the ends [m].
    """

    length: float
    height: float
    turn: float = 0.0
    even: bool = False
    tip: float | None = None
    lean: float = 0.0

    def edges(self, **how: Any) -> list[Edge]:
        """Return its edges, as :func:`strip_edges` does."""
        return strip_edges(*swept(self), **how)


def panel_count(width_of: Callable[[int], float], cloth_width: float) -> int:
    """Return the least number of equal panels of which none is wider than the cloth.

    Args:
        width_of: width [m] across the cloth of one of so many panels, with its allowances.
        cloth_width: usable width of the cloth [m].

    Raises:
        InputError: no number of panels makes them narrow enough.
    """
    for count in range(1, _MOST_PANELS + 1):
        if width_of(count) <= cloth_width:
            return count
    raise InputError(f"it would need more than {_MOST_PANELS} panels on a cloth of {cloth_width:g} m; give wider cloth")


def swept(shape: Strip) -> tuple[FloatArray, FloatArray]:
    """Return the lower and the upper edge of a strip, from left to right (#P by 2 [m]).

    The direction of the lower edge is `turn * (s / half)**power` at the distance s from the middle. The upper edge lies at the height
    of the strip along its normals. Between the tips it is therefore shorter by the angle that it turns through times the height.
    """
    if shape.turn == 0.0 and shape.tip is None and shape.lean == 0.0:
        ends = np.array([[0.0, 0.0], [shape.length, 0.0]])
        return ends, ends + np.array([0.0, shape.height])
    share = np.linspace(-1.0, 1.0, _POINTS)
    middles = 0.5 * (share[1:] + share[:-1])
    power = 1.0 if shape.even else 2.0
    angle = np.sign(middles) * shape.turn * np.abs(middles) ** power
    lower = np.vstack([[0.0, 0.0], np.cumsum(np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)])
    # Another scale is drawn a little differently.
    for _ in range(3):
        lower *= shape.length / drawn_length(lower)
    angle = np.sign(share) * shape.turn * np.abs(share) ** power
    along, normal = np.column_stack([np.cos(angle), np.sin(angle)]), np.column_stack([-np.sin(angle), np.cos(angle)])
    near = np.clip((np.abs(share) - 1.0 + _TIP) / _TIP, 0.0, 1.0) ** 2
    high = shape.height + near * ((shape.height if shape.tip is None else shape.tip) - shape.height)
    upper = lower + high[:, None] * normal + (np.sign(share) * near * shape.lean)[:, None] * along
    return lower, upper


def strip_edges(
    lower: FloatArray,
    upper: FloatArray,
    *,
    overlap: float = 0.0,
    rounded: float = 0.0,
    kinds: Mapping[str, str] | str = "seam",
    allowance: Mapping[str, float] | float | None = None,
) -> list[Edge]:
    """Return the edges of a strip: "lower", "overlap" where it has one, "right end", "upper" and "left end".

    Args:
        lower, upper: #P by 2 [m], from left to right.
        overlap: how far a straight strip runs on beyond its right end [m].
        rounded: radius of the upper corners [m].
        kinds: of all edges, or by name, "seam" if not given.
        allowance: of all edges, or by name [m]; that of their kind if not given.
    """
    reach = np.array([overlap, 0.0])
    corner, upper = lower[-1] + reach, np.vstack([upper[:-1], upper[-1:] + reach])[::-1]
    right, left = np.array([corner, upper[0]]), np.array([upper[-1], lower[0]])
    if rounded > 0.0:
        right, upper = _rounded(right, upper, rounded)
        upper, left = _rounded(upper, left, rounded)
    lines = {
        "lower": lower,
        "overlap": np.array([lower[-1], corner]),
        "right end": right,
        "upper": upper,
        "left end": left,
    }
    return [
        Edge(
            name=name, points=points, kind=kinds if isinstance(kinds, str) else kinds.get(name, "seam"),
            allowance=allowance.get(name) if isinstance(allowance, Mapping) else allowance,
        )
        for name, points in lines.items()
        if name != "overlap" or overlap > 0.0
    ]  # fmt: skip


def folded_strip(
    name: str,
    like: Piece,
    length: float,
    width: float,
    *,
    role: str,
    quantity: int = 1,
    allowance: Mapping[str, float] | float = NARROW,
    grain: tuple[float, float] | None = None,
    **other: Any,
) -> Piece:
    """Return a straight strip that is folded lengthwise, with cut edges.

    Args:
        name: of the piece.
        like: a piece of its size and cloth.
        length, width: finished [m].
        role, quantity, allowance: of the piece and its edges.
        grain: where its grain begins and how high it lies, as shares of the length and of the finished width.
        other: more lines and marks.
    """
    fold = np.array([[0.0, width], [length, width]])
    edges = Strip(length=length, height=2.0 * width).edges(kinds="cut", allowance=allowance)
    lines = {"fold line": fold, **other.pop("internal_lines", {})}
    if grain is not None:
        other["grain"] = np.array([[grain[0], grain[1]], [1.0 - grain[0], grain[1]]]) * [length, width]
    return new_piece(name, like, edges, role, quantity=quantity, internal_lines=lines, **other)


def _rounded(before: FloatArray, after: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return two lines that meet in a corner with that rounded; the round part goes to the line that is longer."""
    lengths = polyline_length(before), polyline_length(after)
    radius = min(radius, 0.9 * lengths[0], 0.9 * lengths[1])
    kept = part_between(before, 0.0, lengths[0] - radius), part_between(after, radius, lengths[1])
    curve = bezier(kept[0][-1], before[-1], kept[1][0], count=13)
    if lengths[0] > lengths[1]:
        return joined(kept[0], curve), kept[1]
    return kept[0], joined(curve, kept[1])
