"""The coarser levels of a piece: of each the step to it, its network and where it lies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.sparse import csr_array, eye

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.free_memory import return_freed_memory
from warpflat.core.launch import launch_each
from warpflat.kernels.stiffness import sum_strain_fields, weigh_by_direction
from warpflat.model.network import SpringNetwork
from warpflat.solver.multigrid.coarsen import Coarser, coarser, is_coarsest, resampled_surface, steps_down
from warpflat.solver.multigrid.grid_coarsening import ResamplingKind, Transfer
from warpflat.surface.cells import cells_of
from warpflat.surface.grid import rows_and_columns
from warpflat.surface.half_edges import half_edges_of
from warpflat.surface.mesh import Surface, drop_result, is_large
from warpflat.surface.row_major_grid import row_major_grid
from warpflat.surface.untangle import untangle

__all__ = ["CoarseLevel", "device_levels", "let_go", "make_coarse_levels", "stay"]


# A cell pressed to less than this share of its area is mended as if it were mirrored.
_LEAST_AREA = 1e-6
# Vertices of such a grid.
_LOWEST_GRID = 240
# By so much springs of coarser levels may be made weaker or stronger, to store what the finer ones do.
_WEIGHTS = (0.1, 10.0)


@dataclass(frozen=True, kw_only=True)
class CoarseLevel:
    """A coarser level of one piece: the step to it, its network, and its layout [m]."""

    step: Coarser
    network: SpringNetwork
    layout: FloatArray


def _strain_fields(network: SpringNetwork, layout: FloatArray, *, products: bool = False) -> tuple[FloatArray, ...]:
    """3, the sums over the springs of what they store of uniform strains, by their directions; if asked for, 3 by 3, what each of three
    weights of directions adds to that."""
    s, count = network.spring_arrays, network.vertex_count
    stored, added = np.empty((count, 3)), np.empty((count if products else 0, 3, 3))
    given = [layout, s.around.offset, s.around.neighbor, s.listed_length, s.listed_stiffness]
    launch_each(sum_strain_fields, count, given, [stored, added])
    return stored.sum(axis=0), added.sum(axis=0)


def _calibrate(network: SpringNetwork, layout: FloatArray, fine: SpringNetwork, fine_layout: FloatArray) -> None:
    """Weigh the springs of a coarse network by their directions, so that under uniform strains it stores what the fine one does: edge
    springs on triangles store that only roughly, each mesh in its own way."""
    if network.model != "springs" or network.surface.is_quad.all():
        return
    wished, _ = _strain_fields(fine, fine_layout)
    _, products = _strain_fields(network, layout, products=True)
    factor = np.linalg.lstsq(products, wished, rcond=1e-6)[0]
    s, stiffness = network.spring_arrays, network.spring_arrays.listed_stiffness.copy()
    given = [layout, s.around.offset, s.around.neighbor, wp.vec3d(*factor), *_WEIGHTS]
    launch_each(weigh_by_direction, network.vertex_count, given, [stiffness])
    network.make_springs(stiffness)


def make_coarse_levels(
    network: SpringNetwork, layout: FloatArray, *, mend: bool, known: Mapping[Surface, CoarseLevel] | None = None
) -> list[CoarseLevel]:
    """All coarser levels of a piece, the finest first.

    Args:
        network: of the piece.
        layout: #V by 2, where it lies [m].
        mend: turn back what cells of coarser levels are mirrored there.
        known: levels that are there already, by their surfaces.
    """
    coarse_levels: list[CoarseLevel] = []
    # Those that the surface has anyway, as far as they are not mirrored where it lies; and beyond, some that are not.
    ready: Iterator[Coarser] = steps_down(network.surface)
    while not (_is_lowest(network) or (coarse_levels and coarse_levels[-1].step.is_lowest)):
        step = next(ready, None)
        rung = known.get(step.surface) if known and step is not None else None
        rung = rung or _rung(network, layout, step, mend=mend)
        if rung is None:
            ready = iter(())
            rung = _rung(network, layout, coarser(network.surface, layout))
        if rung is None:
            break
        coarse_levels.append(rung)
        network, layout = rung.network, rung.layout
    return coarse_levels


def let_go(network: SpringNetwork, coarse_levels: Sequence[CoarseLevel]) -> None:
    """Forget what the making of a large piece's networks asks for and a relaxation does not, up to a tenth of what that takes: sides of
    faces, and numbers of springs between quads. Triangles may be measured again, and keep these."""
    if is_large(network.surface):
        for made in (network, *(rung.network for rung in coarse_levels)):
            drop_result(made.surface, half_edges_of)
            if made.surface.is_quad.all():
                made.spring_arrays.around.forget_numbers()
        if row_major_grid(network.surface) is None:
            # What else is made on the way, so that what that frees goes back, too.
            for rung in coarse_levels:
                rung.step.transfer.make()
            return_freed_memory()


def _is_lowest(network: SpringNetwork) -> bool:
    """Whether a level is relaxed by steps. On a grid of a stiff cloth these take less time than another level below it would; in a soft
    one, or beside a crack that opens, they would be too many."""
    few = network.vertex_count <= _LOWEST_GRID and network.model == "springs" and not network.goes_along_lines
    return (few and rows_and_columns(network.surface) is not None) or is_coarsest(network.surface)


@dataclass(frozen=True, kw_only=True)
class DeviceLevels:
    """Where a large lattice starts: a small one's network and layout [m], what carries layouts up from it, in order, and the small one
    as one of the large one's levels, if it is."""

    network: SpringNetwork
    layout: FloatArray
    carries: Sequence[Callable[[FloatArray], FloatArray]]
    rung: CoarseLevel | None = None


def device_levels(network: SpringNetwork, layout: FloatArray, most: int) -> DeviceLevels | None:
    """The small grid that is spread over a grid, or the largest coarser one of any other lattice that has at most so many vertices; None
    if there is none, or where it would be mirrored."""
    spread = resampled_surface(network.surface, _spread_for(network))
    if spread is not None:
        surface, carry, face_of = spread
        found = _network_below(network, surface, carry.sample(layout), face_of, mend=True)
        return None if found is None else DeviceLevels(network=found[0], layout=found[1], carries=[carry])
    steps: list[Coarser] = []
    kept, face_of = (
        np.arange(network.vertex_count, dtype=np.int32),
        np.arange(len(network.surface.faces), dtype=np.int32),
    )
    for step in steps_down(network.surface):
        if step.smooth_carry is None or len(kept) <= most:
            break
        kept, face_of = kept[step.kept], face_of[step.face_of]
        steps.append(step)
    if not steps:
        return None
    found = _network_below(network, steps[-1].surface, layout[kept], face_of, mend=True)
    if found is None:
        return None
    rung = CoarseLevel(step=steps[-1], network=found[0], layout=found[1])
    carries = [step.smooth_carry for step in reversed(steps) if step.smooth_carry is not None]
    return DeviceLevels(network=rung.network, layout=rung.layout, carries=carries, rung=rung)


def _spread_for(network: SpringNetwork) -> ResamplingKind:
    if network.goes_along_lines:
        return "fine"
    return "thirds" if network.is_stiff else "halves"


def _rung(
    fine: SpringNetwork, fine_layout: FloatArray, step: Coarser | None, *, mend: bool = False
) -> CoarseLevel | None:
    """The level that a step leads to, unless there is none or some of its cells are mirrored where it lies."""
    if step is None:
        return None
    found = _network_below(fine, step.surface, fine_layout[step.kept], step.face_of, mend=mend)
    if found is None:
        return None
    network, layout = found
    _calibrate(network, layout, fine, fine_layout)
    return CoarseLevel(step=step, network=network, layout=layout)


def _network_below(
    fine: SpringNetwork, surface: Surface, layout: FloatArray, face_of: IntArray, *, mend: bool
) -> tuple[SpringNetwork, FloatArray] | None:
    """The network of a coarser surface, and where it lies, mended if need be; None where cells are mirrored."""
    layout = np.ascontiguousarray(layout)
    if (cells_of(surface).least_shares(layout) <= 0.0).any():
        layout, left = untangle(surface, layout, least_area=_LEAST_AREA) if mend else (layout, 1)
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
        # What threads are held by is a matter of the finest mesh.
        hold=float(fine.shear_hold),
    )
    return network, layout


def stay(surface: Surface) -> Coarser:
    """The step of a piece that has no coarser level, where others have."""
    every = np.arange(len(surface.vertices), dtype=np.int32)
    return Coarser(
        surface=surface,
        kept=every,
        transfer=Transfer(lambda: csr_array(eye(len(every), format="csr"))),
        face_of=np.arange(len(surface.faces), dtype=np.int32),
    )
