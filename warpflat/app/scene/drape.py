"""The garment of a scene is draped, if the scene says so."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpflat.app.scene.load import Scene, errors_named, fabric_of_correction
from warpflat.app.scene.schema import DrapeTable
from warpflat.core import StepError, report_activity
from warpflat.garment import Garment, garment_files
from warpflat.pattern import pattern_names

if TYPE_CHECKING:
    from warpflat.garment import Drape
    from warpflat.pattern import PatternOptions

__all__ = ["drape_names", "drape_scene", "write_drape"]


def drape_names(scene: Scene, pieces: Iterable[str]) -> list[str]:
    """Return the files that a scene's drape will write, of pieces with these names."""
    output, table = scene.settings.output, scene.settings.drape
    if table is None:
        return []
    from warpflat.garment import files_of_drape

    names = files_of_drape(pieces, picture=output.picture, frames=output.frames > 0, usd=table.usd)
    if table.correct or table.correct_fabric is not None:
        names += ["corrected.png"] if output.picture else []
        names += pattern_names(f"{scene.name}.corrected", _corrected_formats(scene))
    return names


def _corrected_formats(scene: Scene) -> list[str]:
    """Return the formats of the corrected pattern: the PDF and the JSON have one name in a folder, which is the first pattern's."""
    return [each for each in scene.settings.pattern.formats if each not in ("pdf", "json")]


def write_drape(
    scene: Scene, garment: Garment, folder: Path, *, drawing: PatternOptions, device: str | None = None
) -> tuple[dict[str, Any], list[str], tuple[str, ...]]:
    """Drape a scene's garment, and write its files.

    Args:
        scene: with a `[drape]` table.
        garment: flattened.
        folder: an existing one.
        drawing: options of the pattern files.
        device: Warp device.

    Returns:
        The entries of `metrics.json`, the names of the files, and notes on the corrected pattern.

    Raises:
        InputError: an unknown line, or the folder cannot be written.
    """
    from warpflat.garment import write_drape_files

    draped = drape_scene(scene, garment, device=device)
    output = scene.settings.output
    table = scene.settings.drape
    assert table is not None
    files = write_drape_files(draped, folder, picture=output.picture, frames=output.frames > 0, usd=table.usd)
    metrics, notes = {"drape": draped.measures()}, tuple[str, ...]()
    if table.correct or table.correct_fabric is not None:
        # Correct the pattern, and write it beside the first.
        from warpflat.garment import correct_pattern
        from warpflat.pattern import optional_file, optional_step

        report_activity("correcting the pattern")
        with optional_step("the pattern was not corrected", of=StepError):
            with errors_named(scene.where):
                other = fabric_of_correction(scene)
                found = correct_pattern(draped, hold=table.hold, fabric=other, worn_shape=other is not None)
            if output.picture:
                with optional_file(folder / "corrected.png", files) as path:
                    from warpflat.garment import write_correction_picture

                    write_correction_picture(path, found)
            corrected = found.apply(garment)
            assert isinstance(corrected, Garment)
            drawing = replace(drawing, formats=_corrected_formats(scene), cloth=None)
            written = garment_files({"": corrected}, folder, name=f"{scene.name}.corrected", options=drawing)
            metrics["drape"]["correction"] = found.measures(garment)
            files += written.files
            notes = written.notes
    return metrics, files, notes


def drape_scene(
    scene: Scene,
    garment: Garment,
    *,
    callback: Callable[[int, float], None] | None = None,
    device: str | None = None,
) -> Drape:
    """Drape a scene's garment by the settings of its `[drape]` table, or by the defaults.

    Args:
        scene: the scene.
        garment: flattened.
        callback: called with the number of steps and the residual now and then.
        device: Warp device.

    Raises:
        InputError: an unknown line, or half pieces.
    """
    from warpflat.garment import drape

    table = scene.settings.drape or DrapeTable()
    report_activity("draping")
    with errors_named(scene.where):
        return drape(
            garment, hold=table.hold, elastics=[each.edge for each in scene.settings.finishing if each.elastic],
            options=table.options(), callback=callback, device=device or scene.settings.device,
        )  # fmt: skip
