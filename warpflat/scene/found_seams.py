"""The pieces of a scene's garment whose seams are found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.errors import InputError
from warpflat.core.memory_limit import require_memory_for_run
from warpflat.scene.frames import FrameSchedule
from warpflat.scene.load import Scene, errors_named, expand_variables, scene_fabric
from warpflat.scene.schema import FileSurface

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpflat.flattening.result import Flattening
    from warpflat.seams.find import FoundSeams
    from warpflat.surface.mesh import Surface

__all__ = ["found_seams", "seams_entry"]

# More than this share of the cloth beyond its limit is no pattern yet.
_NO_PATTERN = 0.1
# A mesh of fewer faces is too coarse for a garment.
_FEWEST = 60


def found_seams(scene: Scene) -> FoundSeams | None:
    """Find the seams of a scene's garment; None where it asks for none, or its one piece can lie flat.

    Raises:
        InputError: the file is wrong.
    """
    from warpflat.seams.find import find_seams
    from warpflat.seams.layers import read_layers
    from warpflat.seams.options import SeamOptions

    settings, table = scene.settings, scene.settings.surface
    asked = settings.find_seams
    if not isinstance(table, FileSurface) or table.component == "all" or (asked is not None and asked.find == "none"):
        return None
    own = ("lines", "cuts", "auto_cut", "datum", "start", "constraints", "seams", "drape")
    if asked is None and (table.component is not None or any(getattr(settings, key) for key in own)):
        return None
    with errors_named(f"{scene.where}: surface.file"):
        path = scene.folder / expand_variables(table.file)
    try:
        layers: Sequence[Surface] = read_layers(path, units=table.units, prim=table.prim, name=scene.name)
    except InputError:
        if asked is None:
            return None
        raise
    # Before anything is tried on it, or read again.
    require_memory_for_run(sum(len(layer.vertices) for layer in layers), frames=FrameSchedule(settings.output).wanted)
    if asked is None and not _is_whole_garment(layers[0]):
        return None
    if isinstance(table.component, int):
        if table.component >= len(layers):
            raise InputError(
                f"{path}: component {table.component} does not exist; the garment has {len(layers)} layers"
            )
        layers = [layers[table.component]]
    elif table.component == "largest":
        layers = layers[:1]
    given: dict[str, Any] = {} if asked is None else asked.model_dump(exclude={"find", "smooth_mm"})
    smooth = 0.0 if asked is None else 1e-3 * asked.smooth_mm
    options = SeamOptions(**{**given, "no": tuple(given.get("no", ())), "smooth": smooth})
    found = find_seams(layers, options, fabric=scene_fabric(scene))
    why = "one piece cannot lie flat, so its seams were found; --seams none keeps it whole"
    return found if asked is not None else replace(found, notes=(why, *found.notes))


def _is_whole_garment(surface: Surface) -> bool:
    """Return whether a surface cannot lie flat in one piece: closed, with handles, forked, or a cap."""
    from warpflat.seams.anatomy import HOLE
    from warpflat.seams.find import cloth_of
    from warpflat.seams.solid import is_panel
    from warpflat.surface.connectivity import border_loops, euler_characteristic

    if len(surface.faces) < _FEWEST:
        return False
    loops = border_loops(surface.faces, surface.vertices)
    cloth = cloth_of(surface)
    least = HOLE * np.sqrt(float(cloth.face_areas.sum()))
    rings = [surface.vertices[np.append(loop, loop[0])] for loop in loops]
    wide = sum(float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum()) > least for ring in rings)
    handles = (2 - len(loops) - euler_characteristic(surface.faces)) // 2
    return wide > 2 or wide == 0 or handles > 0 or (wide == 1 and not is_panel(cloth))


def seams_entry(found: FoundSeams, pieces: Sequence[Flattening]) -> Mapping[str, Any]:
    """Return the entry `garment` of `metrics.json`: what it is, its seams, and whether this is a pattern yet."""
    area = np.array([float(piece.fit.area.sum()) for piece in pieces])
    outside = np.array([piece.fit.outside for piece in pieces])
    share = float((outside * area).sum() / area.sum())
    entry: dict[str, Any] = {
        "what": found.what,
        "outside": share,
        "found_seams": [seam.as_dict() for seam in found.seams],
        "notes": list(found.notes),
    }
    if share > _NO_PATTERN:
        worst = pieces[int((outside * area).argmax())].surface.name
        entry["no_pattern"] = (
            f"no pattern yet: {100 * share:.0f} % of the cloth is beyond its limit, most of it in {worst}; take a fabric that gives more, "
            "smooth wrinkles (--smooth 5), or cut the mesh further"
        )
    return entry
