"""Sewing: all pieces of a garment are relaxed together, so that both sides of every seam become equally long.

Each edge of a seam has its partner on the other side, the same edge of the body: 1/2 k (l_1 - r l_2 + o)^2 with r the
wished ratio (1, or with ease). The stiffness is finite, so that the steps stay cheap; the offset o grows by what is
still amiss after each round (augmented Lagrangian), until the lengths agree. The minimum is that of the pieces' own
energy under the constraint, and what it costs, in joules, is reported.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.errors import InputError
from warpflat.flattening import Flattening, Stage
from warpflat.kernels.seams import compute_seam_misses
from warpflat.network import SpringNetwork
from warpflat.relax import Relaxation, RelaxOptions, Upright, relax
from warpflat.strain import signed_cell_areas, worn_strain
from warpflat.surface.mesh import Surface

__all__ = ["SeamPair", "Sewn", "sew"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Of a seam's springs over the stiffest structural springs of its edges, the rounds it is given, and what may be amiss [m].
_STIFFNESS = 4.0
_ROUNDS = 30
_EDGE_TOLERANCE = 2e-5
_SEAM_TOLERANCE = 1e-4
# While seams do not agree yet, the pieces need not come to rest as well as at the end.
_COARSE = 10.0


@dataclass(frozen=True, kw_only=True)
class SeamPair:
    """Two chains of vertices that are sewn together, edge by edge.

    Attributes:
        name: the seam's.
        pieces: names of the two pieces; the same twice where one is sewn to itself.
        vertices: of the two pieces, in corresponding order.
        ratio: wished length of the first side over the second.
    """

    name: str
    pieces: tuple[str, str]
    vertices: tuple[IntArray, IntArray]
    ratio: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Sewn:
    """What sewing gave.

    Attributes:
        pieces: by name, relaxed together.
        converged: whether all came to rest with the seams' sides equal.
        steps: approximate implicit steps over all pieces.
        energy_before, energy_after: of all pieces, springs and guard [J].
        largest_difference: of a seam's two sides [m], ease taken out.
        seconds: wall clock.
    """

    pieces: Mapping[str, Flattening]
    converged: bool
    steps: int
    energy_before: float
    energy_after: float
    largest_difference: float
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`."""
        return {
            "converged": self.converged,
            "steps": self.steps,
            "seconds": self.seconds,
            "energy_before_j": self.energy_before,
            "energy_after_j": self.energy_after,
            "price_j": self.price,
            "largest_difference_mm": 1e3 * self.largest_difference,
        }

    @property
    def price(self) -> float:
        """What equal seams cost [J]."""
        return self.energy_after - self.energy_before


def sew(
    pieces: Mapping[str, Flattening],
    seams: Sequence[SeamPair],
    *,
    straight: Mapping[str, IntArray] | None = None,
    options: RelaxOptions | None = None,
) -> Sewn:
    """Relax pieces together under their seams.

    Args:
        pieces: relaxed one by one, of one fabric.
        seams: what is sewn to what.
        straight: by piece, vertices that must lie on one line along the grain, as on a fold or a straight centre front.
        options: of the relaxation.

    Raises:
        InputError: a piece cannot be laid with its fold straight.
    """
    begun = time.perf_counter()
    options = options or RelaxOptions()
    union = _Union(pieces)
    straight = straight or {}
    guided = union.numbers(straight)
    start = np.concatenate([_straightened(piece, straight.get(name)) for name, piece in pieces.items()])
    first = next(iter(pieces.values()))
    stretches = [piece.network.stretch for piece in pieces.values()]
    network = SpringNetwork.build(
        union.surface,
        first.fabric,
        start,
        grain_angle=first.grain_angle,
        device=first.network.device,
        model=first.network.model,
        stretch=np.concatenate([s for s in stretches if s is not None]) if stretches[0] is not None else None,
    )
    ends, ratio, seam_of = union.pairs(seams)
    if guided:
        network.guide(np.concatenate(guided))
    if len(ends):
        network.sew(ends, ratio, np.full(len(ends), _STIFFNESS * float(np.median(network.spring_arrays.stiffness))))
    state = Relaxation(
        network, options, start=start, upright=[u for name, u in union.upright.items() if name not in straight]
    )
    before = sum(_energy(piece.network, piece.positions) for piece in pieces.values())
    converged, difference, coarse = False, np.inf, bool(len(ends))
    for _ in range(_ROUNDS):
        looser = _COARSE if coarse else 1.0
        state.options = replace(
            options,
            energy_tolerance=min(1.0, looser * options.energy_tolerance),
            residual_tolerance=looser * options.residual_tolerance,
        )
        outcome = relax(state)
        if not len(ends):
            converged, difference = outcome.converged, 0.0
            break
        miss = _misses(network, state)
        difference = float(np.abs(np.bincount(seam_of, miss)).max())
        agreed = difference < _SEAM_TOLERANCE and float(np.abs(miss).max()) < _EDGE_TOLERANCE
        converged = outcome.converged and agreed and not coarse
        if converged or state.steps >= options.max_steps:
            break
        coarse = coarse and not agreed
        assert network.seams is not None
        network.seams.offset.assign(network.seams.offset.numpy() + miss)
    seconds = time.perf_counter() - begun
    sewn = union.split(pieces, state, converged=converged, seconds=seconds, residual=outcome.residual)
    return Sewn(
        pieces=sewn,
        converged=converged,
        steps=state.steps,
        energy_before=before,
        energy_after=sum(_energy(piece.network, piece.positions) for piece in sewn.values()),
        largest_difference=difference,
        seconds=seconds,
    )


def _straightened(piece: Flattening, vertices: IntArray | None) -> FloatArray:
    """The piece's layout with these vertices on one line along the grain and no face mirrored.

    Raises:
        InputError: neither its pattern nor its development can be laid so.
    """
    if vertices is None:
        return piece.positions
    cells = piece.network.cell_arrays
    for layout in (piece.positions, piece.development.positions):
        start = layout.copy()
        start[vertices, 0] = start[vertices, 0].mean()
        if (signed_cell_areas(cells.corner, start) > 0.01 * cells.area / cells.weight).all():
            return start
    raise InputError(
        f"piece {piece.surface.name!r} cannot be laid with a straight fold: its fold line bends too much on the body; "
        "cut the whole piece (half = false), or ease the form there"
    )


class _Union:
    """Several pieces as one mesh, each with its own range of vertices."""

    def __init__(self, pieces: Mapping[str, Flattening]) -> None:
        self.first: dict[str, int] = {}
        total = 0
        for name, piece in pieces.items():
            self.first[name] = total
            total += len(piece.positions)
        self.positions = np.concatenate([piece.positions for piece in pieces.values()])
        vertices = np.concatenate([piece.surface.vertices for piece in pieces.values()])
        faces = np.concatenate(
            [
                np.where(piece.surface.faces >= 0, piece.surface.faces + self.first[name], -1)
                for name, piece in pieces.items()
            ]
        ).astype(np.int32)
        self.surface = Surface(
            vertices=vertices,
            faces=faces,
            name=" + ".join(pieces),
            input_vertices=vertices,
            input_index=np.arange(total, dtype=np.int32),
        )
        # A piece with a guided line needs no other hold: the line cannot turn.
        self.upright = {
            name: Upright(
                lower=int(piece.datum[0]) + self.first[name],
                upper=int(piece.datum[-1]) + self.first[name],
                vertices=slice(self.first[name], self.first[name] + len(piece.positions)),
            )
            for name, piece in pieces.items()
        }

    def numbers(self, vertices: Mapping[str, IntArray]) -> list[IntArray]:
        return [np.asarray(ids, dtype=np.int32) + np.int32(self.first[name]) for name, ids in vertices.items()]

    def pairs(self, seams: Sequence[SeamPair]) -> tuple[IntArray, FloatArray, IntArray]:
        """#P by 4 ends, #P wished ratios, #P the seam of each pair of edges."""
        ends, ratio, seam_of = [], [], []
        for number, seam in enumerate(seams):
            a, b = (np.asarray(ids) + self.first[name] for name, ids in zip(seam.pieces, seam.vertices, strict=True))
            ends.append(np.column_stack([a[:-1], a[1:], b[:-1], b[1:]]))
            ratio.append(np.full(len(a) - 1, seam.ratio))
            seam_of.append(np.full(len(a) - 1, number, dtype=np.int32))
        if not ends:
            return np.zeros((0, 4), dtype=np.int32), np.zeros(0), np.zeros(0, dtype=np.int32)
        return np.concatenate(ends).astype(np.int32), np.concatenate(ratio), np.concatenate(seam_of)

    def split(
        self,
        pieces: Mapping[str, Flattening],
        state: Relaxation,
        *,
        converged: bool,
        seconds: float,
        residual: float,
    ) -> dict[str, Flattening]:
        """Each piece with its share of the layout, and a stage "sew" in its history."""
        layout, sewn = state.positions(), {}
        for name, piece in pieces.items():
            own = layout[self.first[name] : self.first[name] + len(piece.positions)]
            energies = Relaxation(piece.network, state.options, start=own).energies()
            stage = Stage(
                name="sew",
                spring_energy_j=energies.spring,
                guard_energy_j=energies.guard,
                strain_energy_j=float(worn_strain(piece.network, own).energy.sum()),
                steps=state.steps,
                work_units=float(state.steps),
                seconds=seconds,
                converged=converged,
                residual=residual,
            )
            sewn[name] = replace(piece, positions=own, stages=(*piece.stages, stage))
        return sewn


def _energy(network: SpringNetwork, positions: FloatArray) -> float:
    return Relaxation(network, RelaxOptions(), start=positions).energies().potential


def _misses(network: SpringNetwork, state: Relaxation) -> FloatArray:
    """#P, l_1 - r l_2 of each pair of edges [m]."""
    miss = wp.zeros(network.seam_count, dtype=wp.float64, device=network.device)
    wp.launch(
        compute_seam_misses,
        dim=network.seam_count,
        inputs=[state.position, network.seams, 0],
        outputs=[miss],
        device=network.device,
    )
    return np.array(miss.numpy(), dtype=np.float64)
