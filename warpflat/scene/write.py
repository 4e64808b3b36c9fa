"""The files of a scene's run are written here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpflat.flattening.result import Flattening
    from warpflat.garment.pattern_files import PatternOptions
    from warpflat.scene.load import Scene
    from warpflat.surface.border_seams import NamedSeam

__all__ = ["SceneResult", "review_files", "write_surface"]


@dataclass(frozen=True, kw_only=True)
class SceneResult:
    """The result of a run.

    Attributes:
        metrics: as `metrics.json`.
        files: names of the files that were written.
        notes: what was repaired or chosen, one sentence each.
    """

    metrics: dict[str, Any]
    files: tuple[str, ...]
    notes: tuple[str, ...]


def write_surface(
    scene: Scene,
    pieces: Sequence[Flattening],
    folder: Path,
    *,
    drawing: PatternOptions,
    seams: Sequence[NamedSeam],
    more: Mapping[str, Any],
    files: Sequence[str] = (),
    frames: bool,
    notes: Sequence[str],
) -> SceneResult:
    """Write all files of a flattened surface but its frames, and remove what earlier runs have left.

    Args:
        scene: the scene.
        pieces: the pieces into which cuts have parted its surface.
        folder: an existing one.
        drawing: options of the pattern files.
        seams: named seams of the surface's border.
        more: entries of `metrics.json` besides the pieces.
        files: that have been written already, by name.
        frames: whether `frames.usdc` has been written.
        notes: what was repaired or chosen until now.

    Raises:
        InputError: the folder cannot be written.
    """
    from warpflat.core.atomic_files import file_in
    from warpflat.core.manifest import remove_stale
    from warpflat.export.letters import note_on_names
    from warpflat.flattening.result import run_metrics, write_files
    from warpflat.garment.pattern_files import surface_files

    settings = scene.settings
    files = [*files, *write_files(pieces, folder, picture=settings.output.picture, frames=False), "metrics.json"]
    if settings.wear is not None and settings.output.picture:
        from warpflat.flattening.fit_picture import write_wear_picture

        for piece in pieces:
            picture = file_in(folder, piece.surface.name, ".wear.png")
            write_wear_picture(picture, piece)
            files.append(picture.name)
    if frames:
        files.append("frames.usdc")
    pattern = surface_files(pieces, folder, name=scene.name, options=drawing, seams=seams)
    entries = {piece.surface.name: piece.measures for piece in pieces}
    measured = {**run_metrics(entries, pieces[0].network.device, more), **pattern.metrics}
    files += [*pattern.files, *review_files(scene, measured, folder, (*files, *pattern.files))]
    metrics, manifest_notes = remove_stale(folder, measured, name=scene.name, files=files)
    name_notes = note_on_names(piece.surface.name for piece in pieces) if settings.output.picture else ()
    notes = (*notes, *pattern.notes, *name_notes, *manifest_notes)
    return SceneResult(metrics=metrics, files=tuple(files), notes=notes)


def review_files(scene: Scene, metrics: Mapping[str, Any], folder: Path, files: Sequence[str]) -> list[str]:
    """Write `review.html` if the scene wants it, and return its name in a list.

    Args:
        scene: the scene.
        metrics: of the run.
        folder: in which all else has been written.
        files: that all else, by name.
    """
    output = scene.settings.output
    if not (output.picture and output.review):
        return []
    from warpflat.review.page import write_review

    return [write_review(folder, metrics, files, name=scene.name)]
