"""A relaxation that is stepped by hand: the paper's plain approximate implicit steps, one at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.fabric.fabric import DEFAULT_FABRIC, Fabric
from warpflat.flat.flattening.flatten_piece import check_settings, check_surface, develop_piece
from warpflat.flat.model.membrane import ModelChoice
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import worn_strain
from warpflat.flat.model.wear import Wear
from warpflat.flat.solver.grain import GrainAlignment, remove_rotation
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.mesh import Surface

__all__ = ["RelaxationStep", "relaxation"]


@dataclass(frozen=True, kw_only=True, eq=False)
class RelaxationStep:
    """The state after a step.

    Attributes:
        step: steps so far; 0 is the layout from which it starts.
        positions: #V by 2, the layout, read-only [m].
        model_energy_j: springs and guard, or membrane and guard; None where no energy was asked for [J].
        residual: largest force on a vertex over the mean spring force; None likewise.
        converged: whether it is at rest; False where no energy was asked for.
        network: the springs.
    """

    step: int
    positions: FloatArray
    model_energy_j: float | None
    residual: float | None
    converged: bool
    network: SpringNetwork

    def face_energy_density(self) -> FloatArray:
        """Return the strain energy per flat area of each face, #F [J/m2]."""
        return worn_strain(self.network, self.positions).energy_density

    def __repr__(self) -> str:
        energy = "" if self.model_energy_j is None else f", {self.model_energy_j:.6g} J"
        return f"RelaxationStep({self.step}{energy}{', at rest' if self.converged else ''})"


def relaxation(
    surface: Surface,
    *,
    fabric: Fabric | str = DEFAULT_FABRIC,
    datum: str | ArrayLike | None = None,
    grain_angle: float = 0.0,
    model: ModelChoice = "auto",
    wear: Wear | None = None,
    relax: RelaxOptions | None = None,
    device: str | None = None,
    energy_every: int = 1,
    force: Callable[[FloatArray], ArrayLike] | None = None,
) -> Iterator[RelaxationStep]:
    """Iterate over the plain steps of a relaxation, from where `flatten` would start until it is at rest or the step limit is reached.

    L-BFGS, repeated measuring of directions and contact are left to :func:`warpflat.flatten`, which is faster.

    Args:
        surface, fabric, datum, grain_angle, model, wear, relax, device: as `flatten` takes them.
        energy_every: energies are measured every so many steps, and convergence with them.
        force: a force of one's own beside those of the cloth: takes the layout, #V by 2 [m], before each step, and gives #V by 2 [N]. What
            of it only turns the piece is left out, since the grain is kept upright. Energies are those of the cloth alone; at rest is where
            both forces balance, so a force that pushes the piece as a whole finds no rest.

    Raises:
        InputError: what was given cannot be flattened, or `force` gives no finite force per vertex; one line says what, where, and what
            would be right.
    """
    if not isinstance(energy_every, int) or isinstance(energy_every, bool) or energy_every < 1:
        raise InputError(f"energy_every = {energy_every!r} must be a whole number, at least 1")
    settings = check_settings(fabric, grain_angle=grain_angle, model=model, wear=wear, relax=relax, device=device)
    check_surface(surface)
    piece = develop_piece(surface, datum, settings, None)
    return _steps(piece.network, piece.development.positions, settings.options, piece.task.datum, energy_every, force)


def _steps(
    network: SpringNetwork,
    start: FloatArray,
    options: RelaxOptions,
    datum: Any,
    energy_every: int,
    force: Callable[[FloatArray], ArrayLike] | None,
) -> Iterator[RelaxationStep]:
    grain = GrainAlignment(lower=int(datum[0]), upper=int(datum[-1]), vertices=slice(0, network.vertex_count))
    state = Relaxation(network, options, start=start, alignments=[grain])
    status = state.check_start()
    yield _snapshot(state, measured=True)
    # A piece that is free of strain may still be pushed.
    while not (status.at_rest and (force is None or state.steps)) and state.steps < options.max_steps:
        if force is not None:
            own = np.array(force(state.positions()), dtype=np.float64)
            if own.shape != (network.vertex_count, 2) or not np.isfinite(own).all():
                raise InputError(
                    f"force: gave an array of shape {own.shape}; should be ({network.vertex_count}, 2), a finite force [N] per vertex"
                )
            # Beside the load that holds the grain, which `hold_grain` sets anew after the step: what is left then is cloth and own force.
            remove_rotation([grain], state.position.numpy(), own, network.spring_stiffness.numpy())
            state.load.assign(state.load.numpy() + own)
        state.step()
        state.hold_grain()
        measured = state.steps % energy_every == 0 or state.steps == options.max_steps
        if measured:
            status = state.check_convergence(state.steps % energy_every or energy_every)
        yield _snapshot(state, measured=measured)


def _snapshot(state: Relaxation, *, measured: bool) -> RelaxationStep:
    positions, status = state.positions(), state.status
    positions.flags.writeable = False
    return RelaxationStep(
        step=state.steps,
        positions=positions,
        model_energy_j=status.energies.potential if measured else None,
        residual=status.residual if measured and state.steps else None,
        converged=status.at_rest if measured else False,
        network=state.network,
    )
