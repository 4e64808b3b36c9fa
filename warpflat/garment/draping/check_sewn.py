"""Sewn cloth is looked at before it is relaxed: whether its openings go around their limbs, and whether it is tangled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import warp as wp

from warpflat.core import BoolArray, FloatArray, IntArray, StepError, launch_each
from warpflat.flat import mesh_edges
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.limbs import links
from warpflat.garment.draping.openings import Opening
from warpflat.garment.draping.sew_around import stretches
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.kernels.pierced import find_pierced

__all__ = ["check_sewn", "pierced_edges"]

# Cloth is tangled if more than this share of its edges pierce it elsewhere, or more than this share of it is stretched by so much.
_PIERCED, _TORN = 0.1, (0.05, 0.5)
_REMEDY = 'say in [[pieces]] where it is, as at = "front", and in top how high it hangs, or draw it where it is worn'


def pierced_edges(cloth: SewnCloth, positions: FloatArray) -> tuple[BoolArray, IntArray]:
    """Return which edges of worn cloth (#E) pierce it elsewhere, and their vertices (#E by 2).

    Args:
        cloth: the sewn cloth.
        positions: #V by 3 [m].
    """
    body = Body(positions, cloth.faces, device=wp.get_device("cpu"))
    edges = mesh_edges(body.triangles)
    pierced = wp.zeros(len(edges), dtype=wp.int32, device="cpu")
    given = wp.array(edges, dtype=wp.vec2i, device="cpu")
    launch_each(find_pierced, len(edges), [wp.uint64(body.mesh.id), given], [pierced], least=256)
    return pierced.numpy() != 0, edges


def check_sewn(
    cloth: SewnCloth,
    positions: FloatArray,
    openings: Sequence[Opening],
    limbs: Sequence[str],
    lines: Mapping[str, FloatArray],
    *,
    buttoned: bool = False,
) -> None:
    """Refuse cloth that was sewn beside a limb, or tangled.

    Args:
        cloth: the sewn cloth.
        positions: #V by 3 [m].
        openings: of the garment.
        limbs: around which limb each of them should go; "" for the trunk and the neck.
        lines: the body's limbs: see :func:`warpflat.garment.draping.limbs.limb_lines`.
        buttoned: whether buttons or ties close the garment, which its openings do not tell.

    Raises:
        StepError: it was; the words name a piece, and say what would help.
    """
    around = [links(positions[opening.vertices], lines) for opening in openings]
    if around and not buttoned and not any(any(found.values()) for found in around):
        raise StepError(
            "falls off: the garment goes around no part of the body; close it by a seam, buttons or ties, or say in top how high it hangs"
        )
    for opening, limb, found in zip(openings, limbs, around, strict=True):
        # A hole in the cloth, as of a pocket, goes around nothing.
        wrong = (
            abs(found[limb]) != 1 or sum(map(bool, found.values())) > 1
            if limb
            else not (any(found.values()) or buttoned)
        )
        if wrong and not opening.is_hole:
            raise StepError(
                f"piece {min(opening.pieces)!r}: its opening of {1e3 * opening.length:.0f} mm was sewn beside the "
                f"{limb or 'body'} instead of around it: {_REMEDY}"
            )
    hit, edges = pierced_edges(cloth, positions)
    corner, _, _, area = cloth.cells()
    torn = stretches(cloth, positions) > _TORN[1]
    pierced, share = float(hit.mean()), float(area[torn].sum() / area.sum())
    if pierced > _PIERCED or share > _TORN[0]:
        count = np.bincount(np.concatenate([edges[hit].ravel(), corner[torn].ravel()]), minlength=len(positions))
        worst = max(
            cloth.piece_vertices, key=lambda name: float(count[cloth.welded[cloth.piece_vertices[name]]].mean())
        )
        if pierced <= _PIERCED:
            raise StepError(
                f"piece {worst!r}: {100 * share:.0f} % of the garment would be stretched by over {100 * _TORN[1]:.0f} %, most of it there: "
                f"it is too small for this body, or lies wrong: then {_REMEDY}"
            )
        raise StepError(
            f"the pieces were sewn into a tangle, most at {worst!r}: {100 * pierced:.0f} % of their edges pierce cloth, "
            f"{100 * share:.0f} % of it is stretched by over {100 * _TORN[1]:.0f} %: {_REMEDY}"
        )
