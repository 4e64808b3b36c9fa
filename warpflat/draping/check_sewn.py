"""Sewn cloth is looked at before it is relaxed: whether its openings go around their limbs, and whether it is tangled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.errors import StepError
from warpflat.core.launch import launch_each
from warpflat.draping.body import Body
from warpflat.draping.limbs import links
from warpflat.draping.openings import Opening
from warpflat.draping.sew_around import stretches
from warpflat.draping.sewn_cloth import SewnCloth
from warpflat.kernels.pierced import find_pierced

__all__ = ["check_sewn", "pierced_edges"]

# An opening shorter than this goes around no limb [m].
_SHORT = 0.12
# Cloth is tangled where more than this share of a piece's edges pierce cloth, or more than this share of it is stretched by so much.
_PIERCED, _TORN = 0.1, (0.05, 0.5)
_REMEDY = 'say in [[pieces]] where it is, as at = "left arm", and in top how high it hangs, or draw it where it is worn'


def pierced_edges(cloth: SewnCloth, positions: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Return which edges of worn cloth (#E) pierce it elsewhere, and their vertices (#E by 2).

    Args:
        cloth: the sewn cloth.
        positions: #V by 3 [m].
    """
    body = Body(positions, cloth.faces, device=wp.get_device("cpu"))
    sides = np.concatenate([body.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    edges = np.unique(np.sort(sides, axis=1), axis=0).astype(np.int32)
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
) -> None:
    """Refuse cloth that was sewn beside a limb, or tangled.

    Args:
        cloth: the sewn cloth.
        positions: #V by 3 [m].
        openings: of the garment.
        limbs: around which limb each of them should go; "" for the trunk and the neck.
        lines: the body's limbs: see :func:`warpflat.draping.limbs.limb_lines`.

    Raises:
        StepError: it was; the words name a piece, and say what would help.
    """
    for opening, limb in zip(openings, limbs, strict=True):
        found = links(positions[opening.vertices], lines)
        asked = (
            {each for each in found if found[each]} == {limb} and abs(found[limb]) == 1 if limb else any(found.values())
        )
        if opening.length >= _SHORT and not asked:
            where = f"beside the {limb} instead of around it" if limb else "beside the body"
            raise StepError(
                f"piece {min(opening.pieces)!r}: its opening of {1e3 * opening.length:.0f} mm was sewn {where}: {_REMEDY}"
            )
    hit, edges = pierced_edges(cloth, positions)
    corner, face, _, area = cloth.cells()
    torn = stretches(cloth, positions) > _TORN[1]
    for name, rows in cloth.piece_vertices.items():
        own = np.zeros(len(positions), dtype=bool)
        own[cloth.welded[rows]] = True
        of_piece = own[edges].all(axis=1)
        cells = np.isin(face, np.arange(len(face))[cloth.piece_faces[name]])
        pierced, share = hit[of_piece].mean(), area[cells & torn].sum() / area[cells].sum()
        if pierced > _PIERCED or share > _TORN[0]:
            raise StepError(
                f"piece {name!r} was sewn into a tangle: {100 * pierced:.0f} % of its edges pierce cloth, {100 * share:.0f} % of it is "
                f"stretched by over {100 * _TORN[1]:.0f} %: {_REMEDY}"
            )
