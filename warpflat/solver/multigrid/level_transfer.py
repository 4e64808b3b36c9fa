"""Transfer between a level and the next coarser one: the buffers, and the launches over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.sparse import block_diag, csr_array

from warpflat.core.launch import Launch, launch_each, record
from warpflat.core.sums import range_offsets
from warpflat.kernels.prolongation import Transpose, Weights, coarse_difference, coarse_load, inject, transfer
from warpflat.kernels.reduce import subtract
from warpflat.solver.multigrid.coarsen import Coarsening
from warpflat.solver.relaxation import Relaxation

__all__ = ["LevelTransfer", "make_level_transfer", "set_displacement"]


@dataclass(frozen=True, kw_only=True)
class LevelTransfer:
    """The transfer from a level to the next coarser one and back.

    Attributes:
        coarse: the state of the coarser level.
        coarsenings: for each piece, the step to its coarser mesh.
        inject: launch; coarse vertices get the positions of their fine ones.
        restrict_load: launch; the coarse load becomes the one under which the coarse forces equal the restricted fine
            residual forces.
        subtract_base: launch; the difference of the coarse layout from `base`.
        prolong_correction: launch; that difference interpolated on the fine level, into `correction`.
        prolong_layout: launch; the coarse layout interpolated on the fine level.
        base: #V vec2d of the fine level, the layout before a correction [m].
        correction: #V vec2d of the fine level [m]; valid until the forces there are evaluated.
    """

    coarse: Relaxation
    coarsenings: Sequence[Coarsening]
    inject: Launch
    restrict_load: Launch
    subtract_base: Launch
    prolong_correction: Launch
    prolong_layout: Launch
    base: wp.array
    correction: wp.array

    def compute_correction(self, fine: Relaxation) -> None:
        """Compute the coarse level's correction of the present fine layout, which becomes `base`."""
        wp.copy(self.base, fine.position)
        self.subtract_base.launch()
        self.prolong_correction.launch()


def make_level_transfer(fine: Relaxation, coarsenings: Sequence[Coarsening], coarse: Relaxation) -> LevelTransfer:
    """Record the transfer between two levels; `coarsenings` has the step of each piece."""
    device, n, c = coarse.network.device, fine.network.vertex_count, coarse.network.vertex_count
    first = range_offsets([net.vertex_count for net in fine.network.pieces])
    ids = [each.kept + at if at else each.kept for each, at in zip(coarsenings, first, strict=False)]
    kept = wp.array(ids[0] if len(ids) == 1 else np.concatenate(ids), dtype=wp.int32, device=device, copy=False)
    weights = _block_weights([each.prolongation for each in coarsenings], device)
    transpose = _block_transpose([each.transfer.transpose for each in coarsenings], device)
    base, correction = wp.empty(n, dtype=wp.vec2d, device=device), fine.scratch
    difference = wp.empty(c, dtype=wp.vec2d, device=device)
    return LevelTransfer(
        coarse=coarse,
        coarsenings=coarsenings,
        inject=record(inject, dim=c, inputs=[kept, fine.position], outputs=[coarse.position], device=device),
        restrict_load=record(
            coarse_load,
            dim=c,
            inputs=[weights, transpose, fine.force, coarse.force],
            outputs=[coarse.load],
            device=device,
        ),
        subtract_base=record(
            coarse_difference, dim=c, inputs=[kept, base, coarse.position], outputs=[difference], device=device
        ),
        prolong_correction=record(transfer, dim=n, inputs=[weights, difference], outputs=[correction], device=device),
        prolong_layout=record(
            transfer, dim=n, inputs=[weights, coarse.position], outputs=[fine.position], device=device
        ),
        base=base,
        correction=correction,
    )


def set_displacement(state: Relaxation, base: wp.array, displacement: wp.array) -> None:
    """Set `displacement` to the present layout minus `base`, #V vec2d each [m]."""
    launch_each(subtract, len(displacement), [state.position, base], [displacement], device=state.network.device)


def _block_weights(blocks: Sequence[csr_array], device: wp.Device) -> Weights:
    """Return the block diagonal matrix of the blocks for the kernels."""
    weights, matrix = Weights(), _block_diagonal(blocks)
    weights.offset, weights.column = _pattern(matrix, device)
    weights.weight = wp.array(matrix.data.astype(np.float64, copy=False), dtype=wp.float64, device=device, copy=False)
    return weights


def _block_transpose(blocks: Sequence[csr_array], device: wp.Device) -> Transpose:
    """Return the transpose of that matrix; each block is a transpose whose values are the numbers of the entries."""
    transpose, first = Transpose(), range_offsets([block.nnz for block in blocks])
    matrix = _block_diagonal(
        [csr_array((b.data + at, b.indices, b.indptr), shape=b.shape) for b, at in zip(blocks, first, strict=False)]
        if len(blocks) > 1
        else blocks
    )
    transpose.offset, transpose.row = _pattern(matrix, device)
    transpose.entry = wp.array(matrix.data, dtype=wp.int32, device=device, copy=False)
    return transpose


def _block_diagonal(blocks: Sequence[csr_array]) -> csr_array:
    return blocks[0] if len(blocks) == 1 else csr_array(block_diag(blocks, format="csr"))


def _pattern(matrix: csr_array, device: wp.Device) -> tuple[wp.array, wp.array]:
    """Return where rows begin, and the columns; on the CPU the matrix's own arrays."""
    return tuple(
        wp.array(index.astype(np.int32, copy=False), dtype=wp.int32, device=device, copy=False)
        for index in (matrix.indptr, matrix.indices)
    )
