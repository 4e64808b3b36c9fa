"""The files of a scene's run are written here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpflat.core.beside import Beside
    from warpflat.flattening.result import Flattening
    from warpflat.garment.pattern_files import WrittenPattern
    from warpflat.scene.load import Scene

__all__ = [
    "SceneResult",
    "measure_fit",
    "packed_film",
    "packed_pictures",
    "review_files",
    "write_pieces",
    "write_surface",
]


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


def write_pieces(scene: Scene, pieces: Sequence[Flattening], folder: Path) -> list[str]:
    """Write an OBJ per piece and the picture of a flattened surface; return their names.

    Raises:
        InputError: the folder cannot be written.
    """
    from warpflat.flattening.result import write_files

    return write_files(pieces, folder, picture=scene.settings.output.picture, frames=False)


def measure_fit(
    scene: Scene, pieces: Sequence[Flattening], folder: Path
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Measure how each piece fits, and draw it where a way of wearing was asked for.

    Returns:
        The entries of `metrics.json` by piece, and the names of the pictures.

    Raises:
        InputError: the folder cannot be written.
    """
    from warpflat.core.activity import report_activity
    from warpflat.core.atomic_files import file_in
    from warpflat.core.optional_files import optional_file
    from warpflat.cutting.remedies import advise

    report_activity("measuring how it fits")
    advised = [advise(piece) for piece in pieces]
    files = list[str]()
    if scene.settings.wear is not None and scene.settings.output.picture:
        for piece in advised:
            with optional_file(file_in(folder, piece.surface.name, ".wear.png"), files) as picture:
                from warpflat.flattening.fit_picture import write_wear_picture

                write_wear_picture(picture, piece)
    return {piece.surface.name: piece.measures for piece in advised}, files


def write_surface(
    scene: Scene,
    pieces: Sequence[Flattening],
    folder: Path,
    *,
    pictures: Beside[list[str]],
    pattern: Beside[WrittenPattern],
    fit: Beside[tuple[dict[str, dict[str, Any]], list[str]]],
    more: Mapping[str, Any],
    files: Iterable[str] = (),
    notes: Sequence[str],
) -> SceneResult:
    """Write the last files of a flattened surface when all others are there, and remove what earlier runs have left.

    Args:
        scene: the scene.
        pieces: the pieces into which cuts have parted its surface.
        folder: an existing one.
        pictures, pattern: write the pieces with their picture, and the pattern.
        fit: measures how the pieces fit.
        more: entries of `metrics.json` besides the pieces.
        files: that have been written already, by name, `frames.usdc` among them if there is a film.
        notes: what was repaired or chosen until now.

    Raises:
        InputError: the folder cannot be written.
    """
    from warpflat.core.manifest import remove_stale
    from warpflat.export.letters import note_on_names
    from warpflat.flattening.result import run_metrics

    settings = scene.settings
    files = list(files)
    film = packed_film(scene, folder, files)
    files += pictures.result()
    entries, worn = fit.result()
    files += [*worn, "metrics.json"]
    images = packed_pictures(scene, folder, files)  # while the pattern is written
    drawn = pattern.result()
    measured = {**run_metrics(entries, pieces[0].network.device, more), **drawn.metrics}
    files += [*drawn.files, *review_files(scene, measured, folder, (*files, *drawn.files), film, images)]
    drape = settings.drape is not None
    metrics, manifest_notes = remove_stale(folder, measured, name=scene.name, files=files, drape=drape)
    name_notes = note_on_names(piece.surface.name for piece in pieces) if settings.output.picture else ()
    notes = (*notes, *drawn.notes, *name_notes, *manifest_notes)
    return SceneResult(metrics=metrics, files=tuple(files), notes=notes)


def packed_film(scene: Scene, folder: Path, files: Sequence[str]) -> Mapping[str, Any] | None:
    """Return the film, if it is among the files that have been written, packed for `review.html`.

    It is None if the scene wants no such page, or the film is too large for one, or cannot be packed, which is a note.
    """
    from warpflat.core.optional_files import optional_file

    output, packed = scene.settings.output, None
    if output.picture and output.review and "frames.usdc" in files:
        with optional_file(folder / "review.html", [], part="the film"):
            from warpflat.review.page import pack_frames

            packed = pack_frames(folder)
    return packed


def packed_pictures(scene: Scene, folder: Path, files: Sequence[str]) -> dict[str, str]:
    """Return the pictures among the files that have been written, packed for `review.html` if the scene wants it."""
    from warpflat.core.optional_files import optional_file

    output, packed = scene.settings.output, dict[str, str]()
    if output.picture and output.review:
        with optional_file(folder / "review.html", []):
            from warpflat.review.page import pack_pictures

            packed = pack_pictures(folder, files)
    return packed


def review_files(
    scene: Scene,
    metrics: Mapping[str, Any],
    folder: Path,
    files: Sequence[str],
    film: Mapping[str, Any] | None,
    pictures: Mapping[str, str],
) -> list[str]:
    """Write `review.html` if the scene wants it, and return its name in a list.

    Args:
        scene: the scene.
        metrics: of the run.
        folder: in which all else has been written.
        files: that all else, by name.
        film: of :func:`packed_film`.
        pictures: of :func:`packed_pictures`.
    """
    from warpflat.core.optional_files import optional_file

    output, written = scene.settings.output, list[str]()
    if output.picture and output.review:
        with optional_file(folder / "review.html", written):
            from warpflat.review.page import write_review

            write_review(folder, metrics, files, name=scene.name, film=lambda: film, pictures=pictures)
    return written
