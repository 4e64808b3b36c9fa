"""What the studio shows of a piece at one moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np

from warpflat.app.studio.worker import Ticket
from warpflat.core import FloatArray
from warpflat.flat import Flattening, Progress, RelaxationStep, Surface, WornStrain, worn_strain

__all__ = ["BETWEEN", "PieceFrame", "Watch"]

#: Seconds between two frames, of the page and of a piece.
BETWEEN = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class PieceFrame:
    """A piece on the body and in the plane.

    Attributes:
        surface: in its present topology, #P vertices; those of a cut are doubled.
        positions: #P by 2, the pattern [m].
        worn: strain and energy per face.
        stage: what is being relaxed, with its number of steps; empty at the end.
    """

    surface: Surface
    positions: FloatArray
    worn: WornStrain
    stage: str = ""

    @classmethod
    def of_result(cls, piece: Flattening) -> PieceFrame:
        """Return the frame of a relaxed piece."""
        return cls(surface=piece.network.surface, positions=np.asarray(piece.positions), worn=piece.worn)

    @classmethod
    def of_progress(cls, progress: Progress) -> PieceFrame:
        """Return the frame of a piece that is being relaxed."""
        stage = f"{progress.stage}, step {progress.step}"
        return cls(surface=progress.surface, positions=progress.positions(), worn=progress.worn_strain(), stage=stage)

    @classmethod
    def of_step(cls, state: RelaxationStep) -> PieceFrame:
        """Return the frame of a relaxation that is stepped by hand."""
        return cls(
            surface=state.network.surface,
            positions=state.positions,
            worn=worn_strain(state.network, state.positions),
            stage=f"plain step {state.step}",
        )


class Watch:
    """The callback of a relaxation: it shows at most ten frames a second of a piece, and says when to stop."""

    def __init__(self, ticket: Ticket, show: Callable[[str, PieceFrame], None]) -> None:
        """Pass frames to `show`, with the piece's name, while the ticket lets the job go on."""
        self._ticket, self._show = ticket, show
        self._shown: dict[str, float] = {}

    def __call__(self, name: str, progress: Progress) -> bool:
        """Show a step if it is time; return whether the relaxation is to stop.

        Raises:
            Superseded: a newer request has come.
        """
        go_on = self._ticket.go_on()
        if self.is_time(name):
            self._show(name, PieceFrame.of_progress(progress))
        return not go_on

    def is_time(self, name: str) -> bool:
        """Return whether a piece may be shown again; if so, the next time begins."""
        now = monotonic()
        if now - self._shown.get(name, -1.0) < BETWEEN:
            return False
        self._shown[name] = now
        return True
