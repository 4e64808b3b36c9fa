"""Tubes that seams have left are opened where it serves the garment: sleeves at the underarm, legs at the inseam, trunks at centre back."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warpflat.core import find_unused_name
from warpflat.flat import tube_borders
from warpflat.garment.seams.anatomy import Anatomy
from warpflat.garment.seams.cloth import Cloth, PieceMesh, edge_components
from warpflat.garment.seams.options import SeamOptions
from warpflat.garment.seams.tailor import FACING, LEFT, side_word

__all__ = ["open_tubes"]

Ids = NDArray[np.int64]
Cost = Callable[[Cloth, Ids], float]


def open_tubes(cloth: Cloth, anatomy: Anatomy, options: SeamOptions) -> Cloth:
    """Return the cloth with its tubes cut open along lines of a tailor; one through which none of these runs is left as it is.

    Args:
        cloth: with its seams, and the fields of a tailor (see `draw_fields`); without them nothing is opened.
        anatomy: of the garment.
        options: which seams are not to be made.
    """
    if FACING not in cloth.values:
        return cloth
    for _ in range(4 * (1 + len(anatomy.borders))):
        for mesh in cloth.pieces():
            if len(mesh.loops) > 1 and _tubes(mesh):
                made = _opened(cloth, mesh, anatomy, options)
                if made is not None:
                    cloth = made
                    break
        else:
            break
    return cloth


def _tubes(mesh: PieceMesh) -> int:
    """Return around how many of a piece's borders it is a tube."""
    return len(tube_borders(mesh.as_surface()))


def _opened(cloth: Cloth, mesh: PieceMesh, anatomy: Anatomy, options: SeamOptions) -> Cloth | None:
    """Return the cloth with one tube opened along the first line of a tailor that does so; None if none does."""
    before, used = _tubes(mesh), np.unique(mesh.vertex_of)
    limbs = [limb for limb in anatomy.limbs if np.isin(anatomy.borders[limb.border].vertices, used).all()]

    def height(cloth: Cloth, edges: Ids) -> float:
        return float((cloth.vertices[np.unique(edges)] @ anatomy.up).mean())

    def beside(cloth: Cloth, edges: Ids) -> float:
        return float(np.abs(anatomy.across(cloth.vertices[np.unique(edges)])).mean())

    def behind(cloth: Cloth, edges: Ids, sign: float = 1.0) -> float:
        facing = sign * float(cloth.values[FACING][np.unique(edges)].mean())
        return facing if facing < 0.0 else np.inf

    # Lines along which it may be opened, the best first: name, field, and what a part of the field's zero line costs.
    kinds, lines = [limb.kind for limb in limbs], list[tuple[str, str, Cost]]()
    if kinds == ["sleeve"]:
        lines.append(("underarm", FACING, height))
    if "leg" in kinds:
        lines.append(("inseam", FACING, beside))
    lines += [
        ("centre back", LEFT, behind),
        ("centre front", LEFT, partial(behind, sign=-1.0)),
        ("side", FACING, lambda cloth, edges: -beside(cloth, edges)),
    ]
    for name, level, cost in lines:
        made, _, own, along = cloth.parted(level, cloth.marked(mesh.face_of))
        parts = edge_components(made.new_edges(along), ends=np.union1d(made.border_edges, made.seam_edges()))
        chosen = [(cost(made, part), part) for part in parts]
        for value, part in sorted(chosen, key=lambda one: one[0]):
            across = float(anatomy.across(made.vertices[np.unique(part)]).mean())
            title = name if level == LEFT else f"{name} {side_word(across)}"
            if not np.isfinite(value) or options.forbids(title):
                continue
            trial = made.with_seam(find_unused_name(title, made.seams), part)
            # Still one piece, and less of a tube than before.
            pieces = [piece for piece in trial.pieces() if own[piece.face_of].any()]
            if len(pieces) == 1 and _tubes(pieces[0]) < before:
                return trial
    return None
