"""What a scene's run leaves in its folder, and which of its steps become frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpflat.scene_types import OutputTable

if TYPE_CHECKING:
    from warpflat.flattening import Flattening
    from warpflat.pattern_files import PatternOptions
    from warpflat.scene import Scene
    from warpflat.surface_seams import NamedSeam

__all__ = ["FrameSchedule", "SceneResult", "write_surface"]


@dataclass(frozen=True, kw_only=True)
class SceneResult:
    """What a run did.

    Attributes:
        metrics: as `metrics.json`.
        files: names of the files that were written.
        notes: what was mended or chosen on the way, one sentence each.
    """

    metrics: dict[str, Any]
    files: tuple[str, ...]
    notes: tuple[str, ...]


class FrameSchedule:
    """Which steps become frames: every so many, or about a given number that thins out towards the end."""

    def __init__(self, output: OutputTable) -> None:
        self._every = output.frame_every
        self._number = output.frames
        self._next = 0

    @property
    def wanted(self) -> bool:
        """Whether there are frames at all."""
        return self._number > 0

    def is_due(self, step: int, max_steps: int) -> bool:
        """Whether the look at this step, of at most `max_steps`, becomes a frame; the first one always does.

        Looks may be several steps apart: one is due when a frame was due at or before it.
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


def write_surface(
    scene: Scene,
    pieces: Sequence[Flattening],
    folder: Path,
    *,
    drawing: PatternOptions,
    seams: Sequence[NamedSeam],
    more: Mapping[str, Any],
    frames: bool,
    notes: Sequence[str],
) -> SceneResult:
    """Write all files of a flattened surface but its film, and remove what earlier runs have left.

    Args:
        scene: whose surface it is.
        pieces: those into which cuts have parted it.
        folder: exists.
        drawing: what is written of the pattern.
        seams: those of the surface's border that were named.
        more: entries of `metrics.json` besides the pieces.
        frames: whether the folder has got `frames.usdc`.
        notes: what was mended or chosen until now.

    Raises:
        InputError: the folder cannot be written.
    """
    from warpflat.export import file_in
    from warpflat.export.letters import note_on_names
    from warpflat.leftovers import settle
    from warpflat.pattern_files import surface_files
    from warpflat.result_files import metrics_of, write_results

    settings = scene.settings
    files = write_results(pieces, folder, picture=settings.output.picture, frames=False, more=more)
    if settings.wear is not None and settings.output.picture:
        from warpflat.wear_picture import write_wear_picture

        for piece in pieces:
            picture = file_in(folder, piece.surface.name, ".wear.png")
            write_wear_picture(picture, piece)
            files.append(picture.name)
    if frames:
        files.append("frames.usdc")
    pattern = surface_files(pieces, folder, name=scene.name, options=drawing, seams=seams)
    metrics, settled = settle(
        folder,
        {**metrics_of(pieces, more), **pattern.metrics},
        name=scene.name,
        files=(*files, *pattern.files),
    )
    unnamed = note_on_names(piece.surface.name for piece in pieces) if settings.output.picture else ()
    told = (*notes, *pattern.notes, *unnamed, *settled)
    return SceneResult(metrics=metrics, files=(*files, *pattern.files), notes=told)
