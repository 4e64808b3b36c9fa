"""Shaping of a form: the same pieces with darts, or parted along the princess lines."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from warpflat.core import FloatArray
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.darts import standard_darts
from warpflat.garment.mannequin.elbow_darts import elbow_darts
from warpflat.garment.mannequin.forms import Form, PieceRecipe
from warpflat.garment.mannequin.halves import is_side
from warpflat.garment.mannequin.layout import Layout

__all__ = ["shaped_form"]

_UNDER_BUST = ("bust", "waist")
_SMALL_OF_BACK = ("waist", "hip")


def shaped_form(
    layout: Layout,
    form: Form,
    shape: Literal["none", "darts", "princess"],
    vertices: FloatArray | None = None,
    *,
    woven: bool = True,
) -> Form:
    """Return a form whose pieces are shaped: by the darts of a pattern book's block, or by princess seams.

    With a bust dart the cloth hangs straight from the bust to the waist, and with skirt darts it bridges the small of the back.
    A woven sleeve around a bent elbow has a dart there, whatever the shape.

    Args:
        layout: the grid.
        form: the form.
        shape: ``none``, ``darts`` or ``princess``.
        vertices: the body's, #V by 3 [m], which say whether its elbows are bent; without them none is.
        woven: whether the cloth is woven; a knit gives at the elbow.

    Raises:
        InputError: an unknown brick.
    """
    bricks = {name: select_bricks(layout, recipe.bricks) for name, recipe in form.pieces.items()}
    if woven and vertices is not None:
        form = replace(form, darts=(*form.darts, *elbow_darts(layout, bricks, vertices)))
    if shape == "none":
        return form
    if shape == "darts":
        darts = standard_darts(layout, bricks)
        # Legs are straight where the cloth hangs straight over the hollows of the body.
        ruled = [_UNDER_BUST] if any(dart.line == "bust" for dart in darts) else []
        bridged = [_SMALL_OF_BACK] if any(dart.line == "princess back left" for dart in darts) else []
        return replace(
            form,
            darts=(*form.darts, *darts),
            ruled=(*form.ruled, *ruled),
            bridged=(*form.bridged, *bridged),
        )
    pieces: dict[str, PieceRecipe] = {}
    for name, recipe in form.pieces.items():
        pieces |= _parted(name, recipe, bricks[name])
    return replace(form, pieces=pieces)


def _parted(name: str, recipe: PieceRecipe, bricks: list[str]) -> dict[str, PieceRecipe]:
    """Part a piece along the princess lines; one that none of them runs through stays."""
    centre = [b for b in bricks if b.endswith("-centre")]
    parts = {f"{name}_centre": (centre, recipe.datum)}
    for side in ("left", "right"):
        at_side = [b for b in bricks if b.endswith("-side") and is_side(b, side)]
        faces = {b.partition("/")[2].split("-")[0] for b in at_side}
        if len(faces) == 1:
            parts[f"{name}_side_{side}"] = (at_side, f"princess {faces.pop()} {side}")
    if not centre or sum(len(chosen) for chosen, _ in parts.values()) != len(bricks) or len(parts) == 1:
        return {name: recipe}
    return {
        part: replace(recipe, bricks=tuple(chosen), datum=datum, open=recipe.open if chosen is centre else ())
        for part, (chosen, datum) in parts.items()
        if chosen
    }
