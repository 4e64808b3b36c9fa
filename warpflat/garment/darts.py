"""Darts of a form's pieces: their legs as seams, the widths of their mouths, and what they measure in the pattern."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import polyline_length
from warpflat.garment.constraints import DartMouth
from warpflat.garment.sewing import SeamPair

if TYPE_CHECKING:
    from warpflat.mannequin.forms import FormResult

__all__ = ["dart_constraints", "dart_pairs", "measure_darts"]


def dart_pairs(form: FormResult) -> list[SeamPair]:
    """Return the legs of every dart, to be sewn to each other."""
    return [
        SeamPair(name=f"{name}.{dart}", pieces=(name, name), vertices=(piece.edges[left], piece.edges[right][::-1]))
        for name, piece in form.pieces.items()
        for dart, (left, right) in piece.darts.items()
    ]


def dart_constraints(form: FormResult) -> list[DartMouth]:
    """Return the widths of mouths that the form asks for."""
    found = []
    for dart in form.darts:
        # A half piece has the left darts only.
        if dart.piece not in form.pieces or dart.name not in form.pieces[dart.piece].darts:
            continue
        if dart.asked.mouth_mm is not None:
            found.append(DartMouth(piece=dart.piece, dart=dart.name, width=1e-3 * dart.asked.mouth_mm))
        elif dart.asked.like is not None:
            side = dart.name.removeprefix(dart.asked.name)
            found.append(DartMouth(piece=dart.piece, dart=dart.name, like=f"{dart.asked.like}{side}"))
    return found


def measure_darts(form: FormResult, name: str, positions: FloatArray) -> list[dict[str, Any]]:
    """Return the entry `darts` of a piece in `metrics.json`.

    Args:
        form: whose piece it is.
        name: of the piece.
        positions: #V by 2, its pattern [m].
    """
    piece = form.pieces[name]
    placed = {dart.name: dart for dart in form.darts if dart.piece == name}
    found = []
    for dart, (left, right) in piece.darts.items():
        legs = [positions[piece.edges[edge]] for edge in (left, right)]
        found.append(
            {
                "name": dart,
                "line": placed[dart].asked.line,
                "intake_m": float(np.linalg.norm(legs[0][0] - legs[1][-1])),
                "legs_m": [polyline_length(leg) for leg in legs],
                "tip_to_point_m": placed[dart].to_point,
            }
        )
    return found
