"""Darts of a form's pieces: their legs as seams, the widths of their mouths, and what they measure in the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, arc_lengths, nearest_on_polyline, polyline_length
from warpflat.flat import OVERLAP, check_tip_back
from warpflat.garment.construction.closed_cuts import CLOSED
from warpflat.garment.construction.constraints import DartMouth
from warpflat.garment.construction.sewn import Stitching

if TYPE_CHECKING:
    from warpflat.garment.mannequin.darts import FormDart
    from warpflat.garment.mannequin.forms import FormResult

__all__ = [
    "NEAR_ARMHOLE",
    "closed_darts",
    "crowded_darts",
    "dart_constraints",
    "dart_pairs",
    "measure_darts",
    "pleat_depths",
]


# A mouth narrower than this [m] is no dart that anybody would sew. It is less than `LEAST_MOUTH` of cuts that are advised: a dart that is
# left out in one size is so in all, and takes in more in others.
_NARROW = 3e-3
#: A dart that comes nearer to the armhole [m] is no dart that anybody would sew: the strip between them curls.
NEAR_ARMHOLE = 0.03


def dart_pairs(form: FormResult) -> list[Stitching]:
    """Return the legs of every dart, to be sewn to each other; those of a pleat as far as it is sewn."""
    pleats = pleat_depths(form)
    found = []
    for name, piece in form.pieces.items():
        for dart, legs in piece.legs().items():
            along = arc_lengths(piece.surface.vertices[legs[0]])
            # One edge of the mesh at least.
            count = max(2, int(np.searchsorted(along, pleats.get((name, dart), along[-1]) + 1e-9, "right")))
            found.append(
                Stitching(name=f"{name}.{dart}", pieces=(name, name), vertices=(legs[0][:count], legs[1][:count]))
            )
    return found


def pleat_depths(form: FormResult) -> dict[tuple[str, str], float]:
    """Return how far from its mouth every pleat is sewn [m], by piece and dart."""
    return {
        (dart.piece, dart.name): 1e-3 * dart.asked.pleat_mm for dart in form.darts if dart.asked.pleat_mm is not None
    }


def dart_constraints(form: FormResult) -> list[DartMouth]:
    """Return the widths of mouths that the form asks for."""
    found = []
    for dart, _ in form.sewn_darts():
        if dart.asked.mouth_mm is not None:
            found.append(DartMouth(piece=dart.piece, dart=dart.name, width=1e-3 * dart.asked.mouth_mm))
        elif dart.asked.like is not None:
            side = dart.name.removeprefix(dart.asked.name)
            found.append(DartMouth(piece=dart.piece, dart=dart.name, like=f"{dart.asked.like}{side}"))
    return found


def closed_darts(form: FormResult, positions: Mapping[str, FloatArray]) -> list[FormDart]:
    """Return the darts that do not open on one side of the body at least: their mouth is narrower than 3 mm, or their legs overlap.

    Args:
        form: whose darts they are.
        positions: by piece, #V by 2, its pattern [m].
    """
    found = []
    for dart, legs in form.sewn_darts():
        left, right = (positions[dart.piece][leg] for leg in legs)
        # The tips of a fish-eye dart may close a little.
        overlap = open_length(left, right)[1]
        most = OVERLAP if dart.name in form.pieces[dart.piece].fisheyes else CLOSED
        if overlap > most or np.linalg.norm(left - right, axis=1).max() < _NARROW:
            found.append(dart.asked)
    return list(dict.fromkeys(found))


def crowded_darts(form: FormResult, positions: Mapping[str, FloatArray]) -> list[FormDart]:
    """Return the darts from the border that come within 30 mm of their piece's armhole on one side of the body at least.

    Args and darts as of :func:`closed_darts`; one whose mouth lies on the armhole itself is none of them.
    """
    found = []
    for dart, legs in form.sewn_darts():
        piece, flat = form.pieces[dart.piece], positions[dart.piece]
        armholes = [ids for edge, ids in piece.edges.items() if piece.whole(edge).startswith("armhole")]
        if dart.name in piece.fisheyes or any(np.isin(legs, ids).any() for ids in armholes):
            continue
        away = [
            np.linalg.norm(nearest_on_polyline(point, flat[ids]) - point)
            for ids in armholes for leg in legs for point in flat[leg]
        ]  # fmt: skip
        if min(away, default=np.inf) < NEAR_ARMHOLE:
            found.append(dart.asked)
    return list(dict.fromkeys(found))


def measure_darts(form: FormResult, name: str, positions: FloatArray) -> list[dict[str, Any]]:
    """Return the entry `darts` of a piece in `metrics.json`.

    Args:
        form: whose piece it is.
        name: of the piece.
        positions: #V by 2, its pattern [m].
    """
    piece = form.pieces[name]
    placed = {dart.name: dart for dart in form.darts if dart.piece == name}
    pleats = pleat_depths(form)
    found = []
    for dart, ids in piece.legs().items():
        legs = [positions[leg] for leg in ids]
        found.append(
            {
                "name": dart,
                "line": placed[dart].asked.line,
                "intake_m": piece.mouth(dart, positions)[1],
                "legs_m": [polyline_length(leg) for leg in legs],
                "tip_to_point_m": placed[dart].to_point,
                **({"pleat_m": pleats[name, dart]} if (name, dart) in pleats else {}),
            }
        )
    return found


def open_length(left: FloatArray, right: FloatArray) -> tuple[int, float]:
    """Return how many of their points, from the border, two matched legs are open, and how far they overlap after that [m].

    Args:
        left, right: #P by 2 [m], from the border to the tip, which they share; the wedge lies on the right of the left leg.
    """
    middle = 0.5 * (left + right)
    along = np.gradient(middle, axis=0)
    across = right - left
    gap = (along[:, 1] * across[:, 0] - along[:, 0] * across[:, 1]) / np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    closed = np.flatnonzero(gap[:-1] <= 0.0)
    return (int(closed[0]) if len(closed) else len(left)), float(max(0.0, -gap[:-1].min()))


def pull_back_eye(left: FloatArray, right: FloatArray, station: int, tip_back: float) -> tuple[FloatArray, FloatArray]:
    """Return both sides of a fish-eye dart with their tips moved towards each other, as wide as before.

    Args:
        left, right: #P by 2 [m], matched, from the first tip to the last one.
        station: the index of the widest points, which stay.
        tip_back: of either tip [m].

    Raises:
        InputError: `tip_back` is negative or leaves no dart.
    """
    first, span = left[0], left[-1] - left[0]
    length = float(np.linalg.norm(span))
    axis = span / length
    widest = float((0.5 * (left[station] + right[station]) - first) @ axis)
    check_tip_back(tip_back, min(widest, length - widest), "shorter half")

    def shortened(side: FloatArray) -> FloatArray:
        reach = (side - first) @ axis
        short = np.where(
            reach < widest,
            widest - (widest - reach) * (1 - tip_back / widest),
            widest + (reach - widest) * (1 - tip_back / (length - widest)),
        )
        return side + np.multiply.outer(short - reach, axis)

    return shortened(left), shortened(right)
