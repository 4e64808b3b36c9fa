"""Frames of a run: the development, the relaxation, the line of a cut, and the crack as it opens."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from warpflat.scene.schema import OutputTable

if TYPE_CHECKING:
    from warpflat.flattening.result import Flattening

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.surface.half_edges import half_edges
from warpflat.surface.mesh import Surface

if TYPE_CHECKING:
    from warpflat.cutting.cut_plan import CutPlan
    from warpflat.export.usd import FrameWriter
    from warpflat.flattening.progress import Progress
    from warpflat.flattening.result import Flattening

__all__ = ["FrameRecorder", "FrameSchedule", "path_in_pattern"]


class Schedule(Protocol):
    """The choice of steps that become frames."""

    def is_due(self, step: int, max_steps: int) -> bool:
        """Return whether this step becomes a frame."""
        ...


class FrameRecorder:
    """Writes the frames of one piece; a callback of `flatten` and of `cut`."""

    def __init__(self, writer: FrameWriter | None, surface: Surface, new_schedule: Callable[[], Schedule]) -> None:
        """
        Args:
            writer: an open one, or None for no frames.
            surface: the piece, uncut.
            new_schedule: makes the schedule of a stage.
        """
        self._writer = writer
        self._surface = surface
        self._new_schedule = new_schedule
        self._schedule = new_schedule()
        self._plans: list[CutPlan] = []
        self._faces = surface.faces
        if writer is not None:
            writer.add_piece(surface.name, surface)

    def __call__(self, progress: Progress) -> None:
        """Write a frame if one is due."""
        if self._writer is None or not self._schedule.is_due(progress.step, progress.max_steps):
            return
        cut_surface = progress.surface
        was_cut = cut_surface.faces is not self._faces
        self._faces = cut_surface.faces
        self._writer.write(
            self._surface.name,
            positions=progress.positions(),
            face_energy_density=progress.face_energy_density(),
            faces=cut_surface.faces if was_cut else None,
            lines=cut_surface.lines if was_cut else None,
            cuts=self._cut_lines() if was_cut else None,
            measures={"step": progress.step, "model_energy_j": progress.model_energy},
        )

    def record_result(self, result: Flattening) -> None:
        """Write the frame of a finished result, with its measures."""
        if self._writer is None:
            return
        self._writer.write(
            self._surface.name,
            positions=result.positions,
            face_energy_density=result.face_energy_density,
            measures={"step": result.stages[-1].steps, **result.layout_measures},
        )

    def record_cut_line(self, result: Flattening, plan: CutPlan) -> None:
        """Write the frame in which the line of the next cut is drawn on the piece, and begin the next stage."""
        self._plans.append(plan)
        self._schedule = self._new_schedule()
        if self._writer is None:
            return
        self._writer.write(
            self._surface.name,
            positions=result.positions,
            face_energy_density=result.face_energy_density,
            cuts=self._cut_lines(),
            measures={"step": 0, "model_energy_j": result.stages[-1].model_energy_j},
        )

    def _cut_lines(self) -> dict[str, list[IntArray]]:
        return {
            plan.name: [run for path in plan.paths for run in path_in_pattern(self._surface.faces, self._faces, path)]
            for plan in self._plans
        }


def path_in_pattern(faces: IntArray, pattern_faces: IntArray, path: IntArray) -> list[IntArray]:
    """Return a path of the uncut surface in the pattern: both sides where it is cut, one line where it is not.

    Args:
        faces: #F by 4, uncut.
        pattern_faces: the same faces and corners in the pattern's numbering.
        path: vertices along edges of `faces`.
    """
    near = np.isin(faces, path).any(axis=1)
    old, new = half_edges(faces[near]), half_edges(pattern_faces[near])
    number = {edge: k for k, edge in enumerate(zip(old.tail.tolist(), old.head.tolist(), strict=True))}
    runs: list[list[int]] = []
    for forwards in (True, False):
        end = -1
        for a, b in pairwise(path.tolist()):
            k = number.get((a, b) if forwards else (b, a))
            if k is None:
                end = -1
                continue
            tail, head = int(new.tail[k]), int(new.head[k])
            first, second = (tail, head) if forwards else (head, tail)
            if first == end:
                runs[-1].append(second)
            else:
                runs.append([first, second])
            end = second
    return [np.array(run, dtype=np.int32) for run in dict.fromkeys(tuple(run) for run in runs)]


class FrameSchedule:
    """The schedule of a stage's frames: at a fixed interval of steps, or about a given number, closer together at first."""

    def __init__(self, output: OutputTable) -> None:
        self._every = output.frame_every
        self._number = output.frames
        self._next = 0

    @property
    def wanted(self) -> bool:
        """True if any frame is written."""
        return self._number > 0

    def is_due(self, step: int, max_steps: int) -> bool:
        """Return whether this step, of at most `max_steps`, becomes a frame; the first one always does.

        Calls may be several steps apart: a frame is due if one was due at this step or before.
        """
        if step < self._next:
            return False
        if self._every is not None:
            self._next = step - step % self._every + self._every
        else:
            # Steps in a geometric row: as many frames between 10 and 20 as between 1,000 and 2,000.
            growth = max(max_steps, 2) ** (1.0 / self._number)
            self._next = max(step + 1, math.ceil(step * growth))
        return True
