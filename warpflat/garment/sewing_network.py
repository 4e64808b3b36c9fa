"""Several flattened pieces as one mesh and one network, to be relaxed together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.sums import range_offsets
from warpflat.flattening.applied_cut import cut_sides
from warpflat.flattening.progress import STEPS, Stage
from warpflat.flattening.result import Flattening
from warpflat.model.join import join_networks, join_surfaces
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import strain_energy
from warpflat.solver.grain import grain_alignments
from warpflat.solver.steps import Relaxation
from warpflat.solver.stop import Outcome
from warpflat.surface.injective import overlap_area

__all__ = ["SewingNetwork"]


class SewingNetwork:
    """Several pieces as one mesh, each with its own range of vertices.

    Attributes:
        pieces: by name.
        first: by piece, the number of its first vertex.
        surface: all pieces as one mesh.
        alignments: by piece, the chords that keep their direction: one, or one for each part of a piece that has been cut apart.
    """

    def __init__(self, pieces: Mapping[str, Flattening]) -> None:
        """Put the pieces, of one fabric, side by side."""
        self.pieces = pieces
        first = range_offsets([len(piece.positions) for piece in pieces.values()])
        self.first: dict[str, int] = dict(zip(pieces, first.tolist(), strict=False))
        self.surface = join_surfaces([piece.network.surface for piece in pieces.values()])
        self.alignments = {
            name: grain_alignments(piece.network.surface, piece.datum, piece.positions, first=self.first[name])
            for name, piece in pieces.items()
        }

    def numbers(self, name: str, vertices: IntArray) -> IntArray:
        """Return the numbers of a piece's vertices in the joined mesh."""
        return np.asarray(vertices, dtype=np.int32) + np.int32(self.first[name])

    def network(self) -> SpringNetwork:
        """Return the springs and cells of all pieces as one network on their device, not sewn yet.

        All pieces come to rest together.
        """
        # A copy: a single piece's own network must not stay sewn.
        return replace(join_networks([piece.network for piece in self.pieces.values()]))

    def overlaps(self, layout: FloatArray) -> dict[str, float]:
        """Return by name the area that each piece that lies over itself in a layout (#V by 2 [m]) covers more than once [m2]."""
        areas = {
            name: overlap_area(piece.network.surface, layout[own], cut_sides(piece.cuts))
            for name, piece in self.pieces.items()
            for own in [slice(self.first[name], self.first[name] + len(piece.positions))]
        }
        return {name: area for name, area in areas.items() if area}

    def split(self, state: Relaxation, outcome: Outcome, *, stage_name: str = "sew") -> dict[str, Flattening]:
        """Return each piece with its part of the layout, and in its history the stages of a relaxation with this outcome."""
        first, layout, sewn = outcome.first_steps, state.positions(), {}
        ends = [(stage_name, layout, outcome)]
        if first is not None and outcome.first_layout is not None:
            ends.insert(0, (STEPS, outcome.first_layout, first))
        for name, piece in self.pieces.items():
            own = slice(self.first[name], self.first[name] + len(piece.positions))
            stages = list(piece.stages)
            for stage, place, end in ends:
                energies = Relaxation(piece.network, state.options, start=place[own]).energies()
                stages.append(
                    Stage(
                        name=stage,
                        model_energy_j=energies.potential,
                        guard_energy_j=energies.guard,
                        strain_energy_j=strain_energy(piece.network, place[own]),
                        steps=end.steps,
                        work_units=end.work_units,
                        seconds=end.seconds,
                        converged=end.converged,
                        residual=None if np.isnan(end.residual) else end.residual,
                    )
                )
            sewn[name] = replace(piece, positions=layout[own], stages=tuple(stages), unsewn=piece.unsewn or piece)
        return sewn
