"""A dress drawn from a few measures, to try patterns and their files with; it is developed from no surface.

The proportions are those of a plain block for women, grown by fixed steps per size: good for tests, not for sewing.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide

__all__ = ["sample_dress"]


def sample_dress(sizes: tuple[str, ...] = ("38",)) -> Pattern:
    """A bodice (front on the fold with two darts, back with one), a sleeve and a skirt in EU sizes 32 to 54.

    Raises:
        InputError: for a size that is no even number from 32 to 54.
    """
    pieces = {}
    for size in sizes:
        if not size.isdigit() or not 32 <= int(size) <= 54 or int(size) % 2:
            raise InputError(f"size {size!r}: the sample dress comes in EU sizes 32 to 54, even numbers")
        grow = (int(size) - 38) / 2
        front = _front(size, grow)
        back = _back(size, grow, front.edge("side_lower").length + front.edge("side_upper").length)
        cap = front.edge("armhole").length + back.edge("armhole").length
        pieces[size] = (
            front,
            back,
            _sleeve(size, grow, cap * 1.04),
            _skirt(size, grow, "front"),
            _skirt(size, grow, "back"),
        )
    return Pattern(name="Sample dress", pieces=pieces, seams=_seams())


def _curve(*control: tuple[float, float], count: int = 24) -> FloatArray:
    """Points along a Bézier, as a mesh border would give them."""
    t = np.linspace(0, 1, count)[:, None]
    points = [np.array(c, dtype=np.float64)[None] for c in control]
    while len(points) > 1:
        points = [(1 - t) * a + t * b for a, b in pairwise(points)]
    return points[0]


def _line(*points: tuple[float, float]) -> FloatArray:
    return np.array(points, dtype=np.float64)


def _front(size: str, grow: float) -> Piece:
    bust, waist = 0.235 + 0.010 * grow, 0.215 + 0.010 * grow
    neck, shoulder, top = 0.070 + 0.0012 * grow, 0.125 + 0.002 * grow, 0.410 + 0.003 * grow
    tip_waist, tip_side = (0.095 + 0.002 * grow, 0.165), (0.125 + 0.003 * grow, 0.195)
    left, right = 0.080 + 0.002 * grow, 0.110 + 0.002 * grow
    lower = (bust - 0.010, 0.136)
    leg = float(np.hypot(lower[0] - tip_side[0], lower[1] - tip_side[1]))
    upper = (bust - 0.002, tip_side[1] - float(np.sqrt(leg**2 - (bust - 0.002 - tip_side[0]) ** 2)))
    edges = [
        Edge(name="waist_inner", points=_curve((0, 0), (0.05, -0.002), (left, -0.0035), count=9)),
        Edge(name="waist_dart_left", points=_line((left, -0.0035), tip_waist), kind="dart"),
        Edge(name="waist_dart_right", points=_line(tip_waist, (right, -0.0035)), kind="dart"),
        Edge(name="waist_outer", points=_curve((right, -0.0035), (waist - 0.05, -0.002), (waist, 0.005), count=9)),
        Edge(name="side_lower", points=_line((waist, 0.005), lower)),
        Edge(name="bust_dart_left", points=_line(lower, tip_side), kind="dart"),
        Edge(name="bust_dart_right", points=_line(tip_side, upper), kind="dart"),
        Edge(name="side_upper", points=_line(upper, (bust, 0.205))),
        Edge(
            name="armhole",
            points=_curve(
                (bust, 0.205), (bust - 0.065, 0.207), (shoulder + 0.035, 0.245), (neck + shoulder, top - 0.045)
            ),
        ),
        Edge(name="shoulder", points=_line((neck + shoulder, top - 0.045), (neck, top))),
        Edge(
            name="neck", points=_curve((neck, top), (neck - 0.006, top - 0.055), (0.045, top - 0.078), (0, top - 0.078))
        ),
        Edge(name="centre_front", points=_line((0, top - 0.078), (0, 0)), kind="fold"),
    ]
    darts = [
        Dart(name="waist_dart", left="waist_dart_left", right="waist_dart_right"),
        Dart(name="bust_dart", left="bust_dart_left", right="bust_dart_right"),
    ]
    return Piece(
        name="front bodice",
        size=size,
        fabric="main",
        edges=edges,
        darts=darts,
        internal_lines={"bust_line": _line((0, 0.195), (bust - 0.011, 0.195))},
        grain=_line((0.035, 0.06), (0.035, 0.26)),
    )


def _back(size: str, grow: float, side: float) -> Piece:
    bust, waist = 0.225 + 0.010 * grow, 0.200 + 0.010 * grow
    neck, shoulder, top = 0.072 + 0.0012 * grow, 0.126 + 0.002 * grow, 0.420 + 0.003 * grow
    underarm = _side_end(waist, bust, side)
    left, right, tip = 0.085 + 0.002 * grow, 0.113 + 0.002 * grow, (0.099 + 0.002 * grow, 0.150)
    edges = [
        Edge(name="waist_inner", points=_line((0, 0), (left, -0.001))),
        Edge(name="waist_dart_left", points=_line((left, -0.001), tip), kind="dart"),
        Edge(name="waist_dart_right", points=_line(tip, (right, -0.001)), kind="dart"),
        Edge(name="waist_outer", points=_curve((right, -0.001), (waist - 0.04, 0), (waist, 0.004), count=8)),
        Edge(name="side", points=_line((waist, 0.004), underarm)),
        Edge(
            name="armhole",
            points=_curve(underarm, (bust - 0.05, 0.186), (shoulder + 0.052, 0.245), (neck + shoulder, top - 0.042)),
        ),
        Edge(name="shoulder", points=_line((neck + shoulder, top - 0.042), (neck, top))),
        Edge(
            name="neck", points=_curve((neck, top), (neck - 0.012, top - 0.018), (0.04, top - 0.022), (0, top - 0.022))
        ),
        Edge(name="centre_back", points=_line((0, top - 0.022), (0, 0)), allowance=0.020),
    ]
    return Piece(
        name="back bodice",
        size=size,
        fabric="main",
        quantity=2,
        edges=edges,
        darts=[Dart(name="waist_dart", left="waist_dart_left", right="waist_dart_right")],
        grain=_line((0.035, 0.06), (0.035, 0.28)),
    )


def _side_end(waist: float, bust: float, length: float) -> tuple[float, float]:
    """Top of the back's side seam, so that it is as long as the front's two parts."""
    return bust, 0.004 + float(np.sqrt(length**2 - (bust - waist) ** 2))


def _sleeve(size: str, grow: float, cap: float) -> Piece:
    wrist, length = 0.115 + 0.004 * grow, 0.43

    def cap_line(width: float) -> FloatArray:
        return np.concatenate(
            [
                _curve(
                    (width, length), (width * 0.62, length + 0.012), (width * 0.55, length + 0.135), (0, length + 0.14)
                ),
                _curve(
                    (0, length + 0.14), (-width * 0.52, length + 0.14), (-width * 0.60, length + 0.02), (-width, length)
                )[1:],
            ]
        )

    low, high = 0.10, 0.35
    for _ in range(60):
        width = (low + high) / 2
        total = polyline_length(cap_line(width))
        low, high = (width, high) if total < cap else (low, width)
    edges = [
        Edge(name="hem", points=_line((-wrist, 0), (wrist, 0)), kind="hem"),
        Edge(name="seam_front", points=_curve((wrist, 0), (wrist + 0.004, length * 0.5), (width, length), count=12)),
        Edge(name="cap", points=cap_line(width)),
        Edge(name="seam_back", points=_curve((-width, length), (-wrist - 0.004, length * 0.5), (-wrist, 0), count=12)),
    ]
    return Piece(
        name="sleeve",
        size=size,
        fabric="main",
        quantity=2,
        edges=edges,
        internal_lines={"elbow_line": _line((-wrist - 0.015, 0.24), (wrist + 0.015, 0.24))},
        grain=_line((0, 0.06), (0, 0.40)),
    )


def _skirt(size: str, grow: float, which: str) -> Piece:
    waist = (0.185 if which == "front" else 0.172) + 0.010 * grow
    hem, long = waist + 0.105, 0.60
    edges = [
        Edge(name="hem", points=_curve((0, 0), (hem * 0.5, 0), (hem, 0.022)), kind="hem"),
        Edge(name="side", points=_curve((hem, 0.022), (waist + 0.055, long - 0.20), (waist, long + 0.012))),
        Edge(name="waist", points=_curve((waist, long + 0.012), (waist * 0.5, long), (0, long))),
        Edge(name="centre", points=_line((0, long), (0, 0)), kind="fold" if which == "front" else "seam"),
    ]
    return Piece(
        name=f"skirt {which}",
        size=size,
        fabric="main",
        quantity=1 if which == "front" else 2,
        edges=edges,
        grain=_line((0.06, 0.12), (0.06, 0.48)),
    )


def _seams() -> tuple[Seam, ...]:
    def side(piece: str, *edges: str, reverse: bool = False) -> tuple[SeamSide, ...]:
        return tuple(SeamSide(piece=piece, edge=edge, reversed=reverse) for edge in edges)

    front, back = "front bodice", "back bodice"
    return (
        Seam(name="shoulder", sides=(side(front, "shoulder"), side(back, "shoulder"))),
        Seam(name="side", sides=(side(front, "side_lower", "side_upper"), side(back, "side"))),
        Seam(
            name="armhole",
            sides=(side(front, "armhole") + side(back, "armhole", reverse=True), side("sleeve", "cap")),
            ease=0.04,
        ),
        Seam(name="sleeve", sides=(side("sleeve", "seam_front"), side("sleeve", "seam_back", reverse=True))),
        Seam(name="skirt_side", sides=(side("skirt front", "side"), side("skirt back", "side"))),
    )
