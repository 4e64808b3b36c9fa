"""Several flattened pieces as one mesh and one network, to be relaxed together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpflat.flattening import Flattening
from warpflat.network import CellArrays, SpringArrays, SpringNetwork
from warpflat.progress import Stage
from warpflat.relax import Relaxation, Upright
from warpflat.strain import strain_energy
from warpflat.surface.mesh import Surface
from warpflat.surface.topology import components

__all__ = ["Together"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


class Together:
    """Several pieces as one mesh, each with its own range of vertices.

    Attributes:
        pieces: by name.
        first: of each, the number of its first vertex.
        surface: all of them.
        upright: of each, the two vertices that lie one above the other.
    """

    def __init__(self, pieces: Mapping[str, Flattening]) -> None:
        """Put the pieces, of one fabric, side by side."""
        self.pieces = pieces
        self.first: dict[str, int] = {}
        total = 0
        for name, piece in pieces.items():
            self.first[name] = total
            total += len(piece.positions)
        surfaces = {name: piece.network.surface for name, piece in pieces.items()}
        vertices = np.concatenate([surface.vertices for surface in surfaces.values()])
        faces = np.concatenate(
            [np.where(surface.faces >= 0, surface.faces + self.first[name], -1) for name, surface in surfaces.items()]
        ).astype(np.int32)
        self.surface = Surface(
            vertices=vertices,
            faces=faces,
            name=" + ".join(pieces),
            input_vertices=vertices,
            input_index=np.arange(total, dtype=np.int32),
        )
        self.upright = {
            name: Upright(
                lower=int(piece.datum[0]) + self.first[name],
                upper=_upper_end(piece) + self.first[name],
                vertices=slice(self.first[name], self.first[name] + len(piece.positions)),
            )
            for name, piece in pieces.items()
        }

    def numbers(self, name: str, vertices: IntArray) -> IntArray:
        """Vertices of a piece in the whole's numbering."""
        return np.asarray(vertices, dtype=np.int32) + np.int32(self.first[name])

    def network(self, start: FloatArray) -> SpringNetwork:
        """The pieces' own springs and cells, as one network on their device, nothing sewn yet."""
        pieces = list(self.pieces.values())
        first = pieces[0]
        stretches = [piece.network.stretch for piece in pieces]
        built = SpringNetwork.build(
            self.surface,
            first.fabric,
            start,
            grain_angle=first.grain_angle,
            device=first.network.device,
            model=first.network.model,
            stretch=np.concatenate([s for s in stretches if s is not None]) if stretches[0] is not None else None,
        )
        # Built of their own arrays: a piece with fullness is not at rest at the body's lengths.
        held = [piece.network.held for piece in pieces]
        return replace(
            built,
            spring_arrays=self._springs(),
            cell_arrays=self._cells(),
            held=None if held[0] is None else np.concatenate([h for h in held if h is not None]),
        )

    def _springs(self) -> SpringArrays:
        own = [(self.first[name], piece.network.spring_arrays) for name, piece in self.pieces.items()]
        # Mesh edges first, then diagonals, as in each piece.
        parts = [(first, s, slice(None, s.edge_count)) for first, s in own]
        parts += [(first, s, slice(s.edge_count, None)) for first, s in own]
        return SpringArrays(
            ends=np.concatenate([s.ends[part] + np.int32(first) for first, s, part in parts]),
            rest_length=np.concatenate([s.rest_length[part] for _, s, part in parts]),
            stiffness=np.concatenate([s.stiffness[part] for _, s, part in parts]),
            edge_count=sum(s.edge_count for _, s in own),
            clamped_cells=sum(s.clamped_cells for _, s in own),
        )

    def _cells(self) -> CellArrays:
        faces = np.cumsum([0, *(len(piece.faces) for piece in self.pieces.values())])
        own = [
            (np.int32(self.first[name]), np.int32(face), piece.network.cell_arrays)
            for (name, piece), face in zip(self.pieces.items(), faces[:-1], strict=True)
        ]
        return CellArrays(
            corner=np.concatenate([c.corner + first for first, _, c in own]),
            face=np.concatenate([c.face + face for _, face, c in own]),
            weight=np.concatenate([c.weight for _, _, c in own]),
            edges=np.concatenate([c.edges for _, _, c in own]),
            area=np.concatenate([c.area for _, _, c in own]),
        )

    def split(self, state: Relaxation, *, converged: bool, seconds: float, residual: float) -> dict[str, Flattening]:
        """Each piece with its share of the layout, and a stage "sew" in its history."""
        layout, sewn = state.positions(), {}
        for name, piece in self.pieces.items():
            own = layout[self.first[name] : self.first[name] + len(piece.positions)]
            energies = Relaxation(piece.network, state.options, start=own).energies()
            stage = Stage(
                name="sew",
                spring_energy_j=energies.spring,
                guard_energy_j=energies.guard,
                strain_energy_j=strain_energy(piece.network, own),
                steps=state.steps,
                work_units=float(state.steps),
                seconds=seconds,
                converged=converged,
                residual=residual,
            )
            sewn[name] = replace(piece, positions=own, stages=(*piece.stages, stage))
        return sewn


def _upper_end(piece: Flattening) -> int:
    """The last vertex of the datum that hangs together with its first one: a cut may part it."""
    if not piece.cuts:
        return int(piece.datum[-1])
    part = components(piece.faces)
    part_of = np.full(len(piece.positions), -1)
    used = piece.faces >= 0
    part_of[piece.faces[used]] = np.broadcast_to(part[:, None], piece.faces.shape)[used]
    return int(piece.datum[part_of[piece.datum] == part_of[piece.datum[0]]][-1])
