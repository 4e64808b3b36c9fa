"""Shaping of a form: the same pieces with darts, or parted along the princess lines."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from warpflat.core import FloatArray
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.darts import standard_darts
from warpflat.garment.mannequin.elbow_darts import elbow_darts
from warpflat.garment.mannequin.forms import Form
from warpflat.garment.mannequin.layout import Layout
from warpflat.garment.mannequin.part_pieces import part_pieces, princess_seams

__all__ = ["shaped_form"]

_UNDER_BUST = ("bust", "waist")
_SMALL_OF_BACK = ("waist", "hip")


def shaped_form(
    layout: Layout,
    form: Form,
    shape: Literal["none", "darts", "princess"],
    vertices: FloatArray,
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
        vertices: the body's, #V by 3 [m].
        woven: whether the cloth is woven; a knit gives at the elbow.

    Raises:
        InputError: an unknown brick.
    """
    bricks = {name: select_bricks(layout, recipe.bricks) for name, recipe in form.pieces.items()}
    if woven:
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
    # A piece of front and back, or with a sleeve in one, stays whole.
    seams = [
        seam
        for name, chosen in bricks.items()
        if all(brick.endswith(("-centre", "-side")) for brick in chosen)
        and len(found := princess_seams(layout, chosen, name)) == 1
        for seam in found
    ]
    return part_pieces(layout, vertices, form, seams)
