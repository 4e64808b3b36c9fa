"""From coarse to fine, on pieces too large to factor: a coarser mesh (`warpflat.solver.collapse`), the minimum there, carried up.

On the piece itself the paper's steps, which are good at what interpolation leaves, and L-BFGS go on (`warpflat.solver.minimise`).
"""

from __future__ import annotations

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray
from warpflat.core.launch import launch_each
from warpflat.kernels.stiffness import sum_strain_fields, weigh_by_direction
from warpflat.model.network import SpringNetwork
from warpflat.solver.collapse import iterate_coarsenings
from warpflat.solver.grain import GrainAlignment
from warpflat.solver.metric import CHEAP
from warpflat.solver.minimise import relax
from warpflat.solver.steps import Relaxation
from warpflat.surface.as_rigid import as_rigid_layout
from warpflat.surface.cells import make_cells
from warpflat.surface.grid import rows_and_columns
from warpflat.surface.untangle import untangle

__all__ = ["coarse_minimum"]

# A cell compressed to less than this share of its area is repaired as if it were mirrored.
_LEAST_AREA = 1e-6
# Bounds on the factors that calibrate the springs of the coarser mesh.
_FACTOR_BOUNDS = (0.1, 10.0)


def coarse_minimum(state: Relaxation) -> FloatArray:
    """Return the minimum of a piece on a coarser mesh, interpolated on its own, #V by 2 [m]; its present layout where that is better.

    A grid has a quarter of its vertices there, and starts from the minimum on a coarser grid itself (nested iteration). Any other mesh goes
    at once to one that is cheap to factor: what it gains by the meshes between is lost again by interpolation over uneven triangles.

    Args:
        state: the piece in its first layout; it is placed in the one returned.
    """
    fine, start = state.network, state.positions()
    steps = list(iterate_coarsenings(fine.surface, CHEAP))
    if rows_and_columns(fine.surface) is not None:
        steps = steps[:1]
    if not steps:
        return start
    kept = into = np.arange(fine.vertex_count, dtype=np.int32)
    face_of = np.arange(fine.face_count, dtype=np.int32)
    for step in steps:
        kept, into, face_of = kept[step.kept], step.into[into], face_of[step.face_of]
    surface, layout = steps[-1].surface, np.ascontiguousarray(start[kept])
    unfolded = as_rigid_layout(surface, layout) if len(kept) <= CHEAP else None
    layout = layout if unfolded is None else unfolded
    if (make_cells(surface).least_shares(layout) <= 0.0).any():
        layout, left = untangle(surface, layout, least_area=_LEAST_AREA)
        if left:
            return start
    network = SpringNetwork.build(
        surface,
        fine.fabric,
        layout,
        grain_angle=fine.grain_angle,
        device=fine.device,
        model=fine.model,
        stretch=None if fine.stretch is None else fine.stretch[face_of],
        # Measured on the finest mesh only.
        buckling_stiffness=float(fine.buckling_stiffness),
    )
    if network.model == "springs":
        # Springs are weighed by direction, so that the network stores the fine one's energy under uniform strain. Edge springs on
        # triangles store that energy only roughly, each mesh with an error of its own.
        target, _ = _strain_fields(fine, start)
        _, products = _strain_fields(network, layout, products=True)
        factor = np.linalg.lstsq(products, target, rcond=1e-6)[0]
        s, stiffness = network.spring_arrays, network.spring_arrays.listed_stiffness.copy()
        given = [layout, s.around.offset, s.around.neighbor, wp.vec3d(*factor), *_FACTOR_BOUNDS]
        launch_each(weigh_by_direction, network.vertex_count, given, [stiffness])
        network.replace_stiffness(stiffness)
    # Chords run between the coarser mesh's vertices that are nearest to their ends.
    alignments, every = [], np.arange(len(into))
    for each in state.alignments:
        lower, upper = int(into[each.lower]), int(into[each.upper])
        chord = layout[upper] - layout[lower]
        direction = tuple((chord / np.linalg.norm(chord)).tolist())
        held = np.unique(into[every[each.vertices]]).astype(np.int32)
        alignments.append(GrainAlignment(lower=lower, upper=upper, vertices=held, direction=direction))
    coarse = Relaxation(network, state.options, start=layout, alignments=alignments)
    coarse_minimum(coarse)
    relax(coarse)
    layout = coarse.positions()
    for step in reversed(steps):
        layout = step.prolongation @ layout
    before = state.energies().potential
    if (make_cells(fine.surface).least_shares(layout) <= 0.0).any():
        # Mirrored faces, such as single ones at a border.
        layout, _ = untangle(fine.surface, layout)
    state.place(layout)
    if not state.energies().potential < before:
        state.place(start)
    return state.positions()


def _strain_fields(network: SpringNetwork, layout: FloatArray, *, products: bool = False) -> tuple[FloatArray, ...]:
    """Return the energies that the springs store under uniform strains.

    Returns:
        3, the sums over the springs by the `strain_field` of their directions [J]; if `products`, 3 by 3, the
        derivatives of these sums by the three factors of `weigh_by_direction`, otherwise zeros.
    """
    s, count = network.spring_arrays, network.vertex_count
    stored, added = np.empty((count, 3)), np.empty((count if products else 0, 3, 3))
    given = [layout, s.around.offset, s.around.neighbor, s.listed_length, s.listed_stiffness]
    launch_each(sum_strain_fields, count, given, [stored, added])
    return stored.sum(axis=0), added.sum(axis=0)
