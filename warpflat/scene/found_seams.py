"""The pieces of a scene's garment whose seams are found."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.errors import InputError, is_number, nearest
from warpflat.core.input_files import check_values, reading
from warpflat.core.memory_limit import require_memory_for_run
from warpflat.core.text import quote_value
from warpflat.scene.frames import FrameSchedule
from warpflat.scene.load import Scene, errors_named, expand_variables, scene_fabric
from warpflat.scene.schema import FileSurface, SeamCutTable
from warpflat.scene.surface import scene_surface

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpflat.flattening.result import Flattening
    from warpflat.seams.find import FoundSeams
    from warpflat.seams.options import SeamCut
    from warpflat.surface.mesh import Surface

__all__ = ["found_seams", "plain_panel", "read_edges", "seams_entry"]

# More than this share of the cloth beyond its limit is no pattern yet.
_NO_PATTERN = 0.1
# A mesh of fewer faces is too coarse for a garment.
_FEWEST = 60


def found_seams(scene: Scene) -> FoundSeams | None:
    """Find the seams of a scene's garment, and make those that it draws; None where it asks for none, or its one piece can lie flat.

    Raises:
        InputError: the file is wrong.
    """
    from warpflat.seams.find import find_seams
    from warpflat.seams.layers import read_garment
    from warpflat.seams.options import SeamOptions

    settings, table = scene.settings, scene.settings.surface
    asked = settings.find_seams
    drawn = settings.seams_cut
    if not isinstance(table, FileSurface) or table.component == "all":
        return None
    if asked is not None and asked.find == "none" and not (drawn or asked.keep):
        return None
    own = ("lines", "cuts", "auto_cut", "datum", "start", "constraints", "seams", "drape")
    if asked is None and not drawn and (table.component is not None or any(getattr(settings, key) for key in own)):
        return None
    with errors_named(f"{scene.where}: surface.file"):
        path = scene.folder / expand_variables(table.file)
    try:
        whole, marks = read_garment(path, units=table.units, prim=table.prim, name=scene.name)
        layers: Sequence[Surface] = whole
    except InputError:
        if asked is None and not drawn:
            return None
        raise
    # Before anything is tried on it, or read again.
    require_memory_for_run(sum(len(layer.vertices) for layer in layers), frames=FrameSchedule(settings.output).wanted)
    by_itself = asked is None and _is_whole_garment(layers[0])
    if asked is None and not drawn and not by_itself:
        return None
    if isinstance(table.component, int):
        if table.component >= len(layers):
            raise InputError(
                f"{path}: component {table.component} does not exist; the garment has {len(layers)} layers"
            )
        layers = [layers[table.component]]
    elif table.component == "largest":
        layers = layers[:1]
    given: dict[str, Any] = {} if asked is None else asked.model_dump(exclude={"smooth_mm"})
    given |= {"find": "auto" if by_itself else "none"} if asked is None else {}
    smooth = 0.0 if asked is None else 1e-3 * asked.smooth_mm
    cuts = tuple(cut for number, one in enumerate(drawn) for cut in _as_cuts(scene, number, one, marks))
    with errors_named(scene.where):
        options = SeamOptions(
            **{**given, "no": tuple(given.get("no", ())), "keep": tuple(given.get("keep", ()))},
            smooth=smooth,
            cuts=cuts,
        )
        found = find_seams(layers, options, fabric=scene_fabric(scene))
    why = "one piece cannot lie flat, so its seams were found; --seams none keeps it whole"
    if drawn:
        why = "one piece cannot lie flat, so other seams were found, too; --seams none makes no others than you have drawn"
    return replace(found, notes=(why, *found.notes)) if by_itself else found


def _as_cuts(scene: Scene, number: int, table: SeamCutTable, marks: Sequence[SeamCut]) -> list[SeamCut]:
    """Return the cuts of a table; `marks` are the lines of the garment's file.

    Raises:
        InputError: a line or a file is missing, or the file holds no rows of vertices.
    """
    from warpflat.seams.options import SeamCut

    where = f"seams_cut[{number}]"
    here = f"{scene.where}: {where}"
    if table.marked or isinstance(table.line, str):
        names = [mark.name or "" for mark in marks]
        chosen = [mark for mark in marks if table.marked or mark.name == table.line]
        if not chosen and table.marked:
            raise InputError(
                f"{here}: the file has no lines and no creases; mark edges in it, or give points, a plane or edges"
            )
        if not chosen:
            raise InputError(
                f"{here}: the file has no line {quote_value(table.line)}; {nearest(str(table.line), names)}"
            )
        return [replace(mark, name=table.name or mark.name) for mark in chosen]
    edges: Sequence[Sequence[int]] = ()
    if isinstance(table.edges, str):
        with errors_named(here):
            path = scene.folder / expand_variables(table.edges)
        edges = read_edges(path)
    elif table.edges is not None:
        edges = table.edges
    plane = table.plane
    line = table.line if isinstance(table.line, list) else []
    return [
        SeamCut(
            name=table.name,
            points=tuple(tuple(place) if isinstance(place, list) else place for place in table.points or ()),
            line=tuple(tuple(place) for place in line),
            closed=table.closed,
            plane=None if plane is None else (tuple(plane.point), tuple(plane.normal)),
            towards=None if plane is None or plane.towards is None else tuple(plane.towards),
            nearest=plane is not None and plane.nearest,
            edges=tuple(tuple(row) for row in edges),
            where=where,
        )
    ]


def read_edges(path: Path) -> list[list[int]]:
    """Read rows of vertices, each joined to the next by an edge: a row in each line of a text, or lists in JSON.

    Raises:
        InputError: one line that names the file: it is missing, or holds anything else.
    """
    right = "give the numbers of two vertices or more, from 0, as 12 13 14"
    with reading(path, "edges") as place:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
        rows: list[list[int]] = []
        if text.lstrip().startswith("["):
            data = json.loads(text)
            check_values(data)
            for number, row in enumerate(data):
                place.at = f"row {number + 1}"
                if not (
                    isinstance(row, list) and len(row) > 1 and all(is_number(v, whole=True) and v >= 0 for v in row)
                ):
                    raise InputError(f"{quote_value(row)} is no row of vertices; {right}")
                rows.append(row)
        else:
            for number, line in enumerate(text.splitlines(), start=1):
                words = line.partition("#")[0].replace(",", " ").split()
                place.at = f"line {number}"
                if words and not (len(words) > 1 and all(re.fullmatch("[0-9]{1,18}", word) for word in words)):
                    raise InputError(f"{quote_value(line.strip())} is no row of vertices; {right}")
                rows += [[int(word) for word in words]] if words else []
        place.at = ""
        if not rows:
            raise InputError(f"holds no rows of vertices; {right}")
    return rows


def plain_panel(scene: Scene) -> Surface | None:
    """Return the surface of a scene that asks for nothing of seams, where it can lie flat in one piece; None else."""
    settings, table = scene.settings, scene.settings.surface
    if not isinstance(table, FileSurface) or table.component is not None or settings.find_seams or settings.seams_cut:
        return None
    try:
        surface = scene_surface(scene)
    except InputError:
        return None
    return None if _is_whole_garment(surface) else surface


def _is_whole_garment(surface: Surface) -> bool:
    """Return whether a surface cannot lie flat in one piece: closed, with handles, forked, or a cap."""
    from warpflat.seams.cloth import Cloth
    from warpflat.seams.solid import is_panel, wide_borders
    from warpflat.surface.connectivity import border_loops, euler_characteristic
    from warpflat.surface.triangles import triangulate

    if len(surface.faces) < _FEWEST:
        return False
    cloth = Cloth(vertices=surface.vertices, faces=triangulate(surface.faces)[0].astype(np.int64))
    wide = wide_borders(cloth)
    handles = (2 - len(border_loops(surface.faces, surface.vertices)) - euler_characteristic(surface.faces)) // 2
    return len(wide) not in (1, 2) or handles > 0 or (len(wide) == 1 and not is_panel(cloth))


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
