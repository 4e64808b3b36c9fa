"""The garment of a scene is draped, if the scene says so."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpflat.core.activity import report_activity
from warpflat.scene.frames import FrameSchedule
from warpflat.scene.load import Scene, errors_named
from warpflat.scene.schema import DrapeTable

if TYPE_CHECKING:
    from warpflat.draping.result import Drape
    from warpflat.flattening.result import Flattening
    from warpflat.garment.garment import Garment

__all__ = ["drape_scene", "write_drape"]


def write_drape(
    scene: Scene, garment: Garment | Flattening, folder: Path, *, device: str | None = None
) -> tuple[dict[str, Any], list[str]]:
    """Drape a scene's garment or piece, and write its files.

    Args:
        scene: the scene.
        garment: flattened.
        folder: an existing one.
        device: Warp device.

    Returns:
        The entries of `metrics.json`, and the names of the files; none of both without a `[drape]` table.

    Raises:
        InputError: an unknown line, or the folder cannot be written.
    """
    from warpflat.draping.write import write_drape_files

    if scene.settings.drape is None:
        return {}, []
    draped = drape_scene(scene, garment, device=device)
    output = scene.settings.output
    files = write_drape_files(draped, folder, picture=output.picture, frames=FrameSchedule(output).wanted)
    return {"drape": draped.measures()}, files


def drape_scene(scene: Scene, garment: Garment | Flattening, *, device: str | None = None) -> Drape:
    """Drape a scene's garment or piece by the settings of its `[drape]` table, or by the defaults.

    Args:
        scene: the scene.
        garment: flattened.
        device: Warp device.

    Raises:
        InputError: an unknown line, or half pieces.
    """
    from warpflat.draping.drape_garment import drape
    from warpflat.draping.options import DrapeOptions

    table = scene.settings.drape or DrapeTable()
    report_activity("draping")
    with errors_named(scene.where):
        options = DrapeOptions(friction=table.friction, tolerance=table.tolerance, max_steps=table.max_steps)
        return drape(garment, hold=table.hold, options=options, device=device or scene.settings.device)
