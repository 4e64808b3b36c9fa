"""The hierarchy of a piece: its coarser levels, each with its mesh, its network and its layout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.sparse import csr_array, eye

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.kernels.stiffness import sum_strain_fields, weigh_by_direction
from warpflat.model.network import SpringNetwork
from warpflat.solver.multigrid.coarsen import Coarsening, coarsen, is_coarsest, iterate_coarsenings
from warpflat.solver.multigrid.grid_coarsening import Transfer
from warpflat.surface.cells import make_cells
from warpflat.surface.grid import rows_and_columns
from warpflat.surface.half_edges import half_edges_of
from warpflat.surface.injective import border_edges_of
from warpflat.surface.mesh import Surface, drop_result, is_large
from warpflat.surface.untangle import untangle

__all__ = [
    "CoarseLevel",
    "drop_caches",
    "identity_coarsening",
    "make_coarse_levels",
]


# A cell compressed to less than this share of its area is repaired as if it were mirrored.
_LEAST_AREA = 1e-6
# The most vertices of a grid that is relaxed by steps (see `_is_lowest`).
_LOWEST_GRID = 240
# Bounds on the factors that calibrate the springs of coarser levels.
_FACTOR_BOUNDS = (0.1, 10.0)


@dataclass(frozen=True, kw_only=True)
class CoarseLevel:
    """A coarser level of one piece: the step from the finer mesh, its network, and its layout [m]."""

    coarsening: Coarsening
    network: SpringNetwork
    layout: FloatArray


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


def _calibrate(network: SpringNetwork, layout: FloatArray, fine: SpringNetwork, fine_layout: FloatArray) -> None:
    """Weigh the springs of a coarse network by direction, so that it stores the fine one's energy under uniform strain.

    Edge springs on triangles store that energy only roughly, each mesh with an error of its own.
    """
    if network.model != "springs" or network.surface.is_quad.all():
        return
    target, _ = _strain_fields(fine, fine_layout)
    _, products = _strain_fields(network, layout, products=True)
    factor = np.linalg.lstsq(products, target, rcond=1e-6)[0]
    s, stiffness = network.spring_arrays, network.spring_arrays.listed_stiffness.copy()
    given = [layout, s.around.offset, s.around.neighbor, wp.vec3d(*factor), *_FACTOR_BOUNDS]
    launch_each(weigh_by_direction, network.vertex_count, given, [stiffness])
    network.replace_stiffness(stiffness)


def make_coarse_levels(network: SpringNetwork, layout: FloatArray, *, repair: bool) -> list[CoarseLevel]:
    """Make all coarser levels of a piece, the finest first.

    Args:
        network: of the piece.
        layout: #V by 2, its layout [m].
        repair: turn back cells of coarser levels that are mirrored there.
    """
    coarse_levels: list[CoarseLevel] = []
    # First the surface's own coarsenings, down to one that is mirrored in this layout; from there on some that are not.
    ready: Iterator[Coarsening] = iterate_coarsenings(network.surface)
    while not _is_lowest(network):
        level = _make_level(network, layout, next(ready, None), repair=repair)
        if level is None:
            ready = iter(())
            level = _make_level(network, layout, coarsen(network.surface, layout))
        if level is None:
            break
        coarse_levels.append(level)
        network, layout = level.network, level.layout
    return coarse_levels


def drop_caches(network: SpringNetwork, coarse_levels: Sequence[CoarseLevel]) -> None:
    """Drop what making the networks of a large piece needs and a relaxation does not, up to a tenth of the memory.

    These are half-edges, and the numbers of springs on quads. Triangle meshes keep the latter, since they may be
    measured again.
    """
    if is_large(network.surface):
        border_edges_of(network.surface)  # The certificate of the result needs these, and makes them of half-edges.
        for made in (network, *(level.network for level in coarse_levels)):
            drop_result(made.surface, half_edges_of)
            if made.surface.is_quad.all():
                made.spring_arrays.around.drop_numbers()


def _is_lowest(network: SpringNetwork) -> bool:
    """Return whether a level is the coarsest, to be relaxed by steps.

    On a small grid of a stiff cloth steps take less time than another level below it would. In a soft cloth, or beside
    a crack that opens, they would be too many.
    """
    few = network.vertex_count <= _LOWEST_GRID and network.model == "springs" and not network.uses_line_relaxation
    return (few and rows_and_columns(network.surface) is not None) or is_coarsest(network.surface)


def _make_level(
    fine: SpringNetwork, fine_layout: FloatArray, coarsening: Coarsening | None, *, repair: bool = False
) -> CoarseLevel | None:
    """Make the level of a coarsening; None if there is none, or if some of its cells are mirrored in the layout."""
    if coarsening is None:
        return None
    start = fine_layout[coarsening.kept]
    found = _make_network(fine, coarsening.surface, start, coarsening.face_of, repair=repair)
    if found is None:
        return None
    network, layout = found
    _calibrate(network, layout, fine, fine_layout)
    return CoarseLevel(coarsening=coarsening, network=network, layout=layout)


def _make_network(
    fine: SpringNetwork, surface: Surface, layout: FloatArray, face_of: IntArray, *, repair: bool
) -> tuple[SpringNetwork, FloatArray] | None:
    """Make the network of a coarser surface.

    Args:
        fine: the finer network.
        surface: the coarser one.
        layout: #C by 2, its layout [m].
        face_of: #G, for each of its faces one of the finer ones in or beside it.
        repair: turn back mirrored cells.

    Returns:
        The network and its layout, repaired if need be; None where cells are mirrored.
    """
    layout = np.ascontiguousarray(layout)
    if (make_cells(surface).least_shares(layout) <= 0.0).any():
        layout, left = untangle(surface, layout, least_area=_LEAST_AREA) if repair else (layout, 1)
        if left:
            return None
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
    return network, layout


def identity_coarsening(surface: Surface) -> Coarsening:
    """Return the coarsening of a piece that has no coarser level where others have: the same mesh."""
    every = np.arange(len(surface.vertices), dtype=np.int32)
    return Coarsening(
        surface=surface,
        kept=every,
        transfer=Transfer(lambda: csr_array(eye(len(every), format="csr"))),
        face_of=np.arange(len(surface.faces), dtype=np.int32),
    )
