"""Sewn cloth is looked at before it is relaxed: whether limbs go through its openings and not its cloth, and whether it is tangled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import warp as wp

from warpflat.core import BoolArray, FloatArray, IntArray, StepError, launch_each
from warpflat.flat import mesh_edges
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.limbs import crossings, hangs_beyond, links
from warpflat.garment.draping.openings import Opening
from warpflat.garment.draping.sew_around import stretches
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.kernels.pierced import find_pierced

__all__ = ["check_sewn", "pierced_edges"]

# Cloth is tangled if more than this share of its edges pierce it elsewhere.
_PIERCED = 0.1
# A limb through cloth that is stretched by more than this share does not come free: of sixty sewn garments those that came to rest had up
# to .93 there, those that did not 1 to 5. Beside the limbs sewn cloth may be stretched by 1.4, and come to rest at .06.
_TAUT = 1.0
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
    """Refuse cloth that was sewn beside a limb, tangled, or drawn through a limb.

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
            (abs(found[limb]) != 1 or sum(map(bool, found.values())) > 1)
            and not hangs_beyond(positions[opening.vertices], limb, lines)
            if limb
            else not (any(found.values()) or buttoned)
        )
        if wrong and not opening.is_hole:
            raise StepError(
                f"piece {min(opening.pieces)!r}: its opening of {1e3 * opening.length:.0f} mm was sewn beside the "
                f"{limb or 'body'} instead of around it: {_REMEDY}"
            )
    hit, edges = pierced_edges(cloth, positions)
    pierced = float(hit.mean())
    if pierced > _PIERCED:
        raise StepError(
            f"the pieces were sewn into a tangle, most at {_worst_piece(cloth, edges[hit])!r}: {100 * pierced:.0f} % of their edges "
            f"pierce cloth: {_REMEDY}"
        )
    corner, _, _, _ = cloth.cells()
    taut = corner[stretches(cloth, positions) > _TAUT]
    for limb, line in lines.items():
        through = crossings(line, positions[taut]).any(axis=0)
        if through.any():
            raise StepError(
                f"piece {_worst_piece(cloth, taut[through])!r}: the {limb} would go through it where it is stretched by over "
                f"{100 * _TAUT:.0f} %: it is too small for this body, or lies wrong: then {_REMEDY}"
            )


def _worst_piece(cloth: SewnCloth, vertices: IntArray) -> str:
    """Return the piece with the largest share of vertices, each counted as often as it is given."""
    count = np.bincount(vertices.ravel(), minlength=len(cloth.designed))
    return max(cloth.piece_vertices, key=lambda name: float(count[cloth.welded[cloth.piece_vertices[name]]].mean()))
