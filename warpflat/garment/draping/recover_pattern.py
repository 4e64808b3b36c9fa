"""A pattern recovered from the shape in which its cloth hangs: the forces balance there, so that nothing has to be draped.

The places x of the cloth are given, and the flat vertices X are looked for, at which the forces f(x; X) of membrane, bending and
weight vanish wherever the cloth is not held. A pattern that is draped again and again may come to hang in other folds each time;
here the folds stay those that are given. Each step is one of Gauss and Newton's method: the displacement u of the flat vertices after
which the cloth would have the least displacement y to rest, measured by its own stiffness H,

    minimise 1/2 y H y + 1/2 d u S u + seams,  where H y = f + J u,  J = df/dX, S the stiffness of the cloth in its plane,

which is one sparse symmetric system in y and u. A small damping d keeps single cells from following the noise of x. A flat
displacement u strains a cell as its image -F u in space does, so that J needs no more than the stiffness of the cells. Compare Ly
et al. 2018, Inverse elastic shell design with contact and friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_array, csc_array, diags_array

from warpflat.core import BoolArray, FloatArray, InputError, factor_symmetric, short_repr
from warpflat.flat import Flattening, corner_triangles
from warpflat.garment.construction.garment import Garment
from warpflat.garment.draping.drape_energy import DrapeEnergy
from warpflat.garment.draping.drape_garment import held_vertices
from warpflat.garment.draping.moved_pattern import (
    cell_matrix,
    edge_lengths,
    hold_seams,
    largest_share,
    seam_differences,
    seam_edges,
    with_pattern,
)
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.sewn_cloth import SewnCloth, sew_cloth

__all__ = ["Recovery", "recover_cloth", "recover_pattern"]

# What holds back the cloth's strain in a step, over the cloth's stiffness.
_DAMPING = 1e-2
# The pattern is found when a step strains it by less than this on the mean.
_LEAST_STRAIN = 2e-5
# Strain up to which cloth under pressure counts as taut.
_TAUT = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovery:
    """A pattern recovered from a shape.

    Attributes:
        cloth: with the recovered pattern.
        off: #V, the displacement of each vertex from the given shape to rest, by the linear stiffness [m].
        strains: mean strain of the pattern in each step.
        converged: whether the last step was small.
    """

    __repr__ = short_repr

    cloth: SewnCloth
    off: FloatArray
    strains: tuple[float, ...]
    converged: bool

    def apply(self, garment: Garment | Flattening) -> Garment | Flattening:
        """Return the garment, or the piece, with the recovered pattern."""
        return with_pattern(garment, self.cloth)


def recover_pattern(
    garment: Garment | Flattening, *, hold: Sequence[str], options: DrapeOptions | None = None, steps: int = 40
) -> Recovery:
    """Find the pattern whose cloth hangs at rest in the shape of its designed surface, such as a scan of hanging cloth.

    The cloth lies on nothing. Both sides of a seam keep the difference of their lengths.

    Args:
        garment: flattened; its pattern is the first guess.
        hold: lines that stay where they are, as in :func:`warpflat.drape`.
        options: of which compression and gravity count.
        steps: the most.

    Raises:
        InputError: an unknown line, or nothing is held.
    """
    cloth = sew_cloth(garment)
    return recover_cloth(cloth, held_vertices(cloth, hold), options=options, steps=steps)


def recover_cloth(
    cloth: SewnCloth, held: BoolArray, *, options: DrapeOptions | None = None, steps: int = 40
) -> Recovery:
    """Find the pattern of sewn cloth that hangs from held vertices (#V); else as :func:`recover_pattern`.

    Raises:
        InputError: nothing is held.
    """
    if not held.any():
        raise InputError("recover_pattern: nothing holds the cloth; name at least one line in hold")
    options, seams = options or DrapeOptions(), seam_edges(cloth)
    difference = seam_differences(cloth.flat, seams)
    strains, off, converged = list[float](), np.zeros(len(held)), False
    while len(strains) < steps and not converged:
        # Newton's method for the places of the cloth at rest and the displacement of its flat vertices.
        energy = DrapeEnergy(cloth, None, options, held)
        x = cloth.designed
        force = -energy.at(x).gradient
        corner_flat, face, _ = corner_triangles(cloth.flat_faces)
        # The deformation gradient F of the designed shape, in the coordinates of the plane, #C by 3 by 2.
        axes = np.stack([cloth.warp[face], cloth.weft[face]])
        deformation = np.einsum("wca,wcl->cal", cloth.threads(x), axes)
        # A hanging weft has no tension, and rounding must not decide what is slack: the stiffness is that of a shape a little larger.
        taut = (1.0 + _TAUT) * x
        # J in cells: K F; and F K F, the cloth's stiffness in its plane.
        by_flat = np.einsum("cijab,cbk->ciajk", energy.cell_stiffness(taut), deformation)
        in_plane = np.einsum("cal,ciajk->ciljk", deformation, by_flat)
        space, flat = 3 * len(x), 2 * len(cloth.flat)
        rows, columns = (
            (3 * cloth.welded[corner_flat][..., None] + np.arange(3)),
            (2 * corner_flat[..., None] + np.arange(2)),
        )
        free = diags_array(np.repeat((~held).astype(np.float64), 3))
        jacobian = free @ cell_matrix(by_flat, rows, columns, (space, flat))
        damping = _DAMPING * cell_matrix(in_plane, columns, columns, (flat, flat))
        sides, right = hold_seams(cloth, seams, difference)
        matrix = csc_array(block_array([[energy.stiffness(taut), -jacobian], [-jacobian.T, -(damping + sides)]]))
        found = factor_symmetric(matrix)(np.concatenate([force.ravel(), -right]))
        off, u = np.linalg.norm(found[:space].reshape(-1, 3), axis=1), found[space:].reshape(-1, 2)
        moved = replace(cloth, flat=cloth.flat + largest_share(cloth, u) * u)
        # The mean change of the sides of the cells, as a share.
        edges = np.concatenate([corner_flat[:, [0, 1]], corner_flat[:, [1, 2]], corner_flat[:, [2, 0]]])
        strains.append(float(np.abs(edge_lengths(moved.flat, edges) / edge_lengths(cloth.flat, edges) - 1.0).mean()))
        cloth, converged = moved, strains[-1] < _LEAST_STRAIN
    return Recovery(cloth=cloth, off=off, strains=tuple(strains), converged=converged)
