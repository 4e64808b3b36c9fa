"""The pieces of a scene's garment whose seams are found."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from warpflat.app.scene.load import Scene, errors_named, scene_fabric
from warpflat.app.scene.schema import FileSurface, FindSeamsTable, SeamCutTable
from warpflat.app.scene.surface import scene_surface, surface_file
from warpflat.core import (
    InputError,
    check_values,
    format_count,
    is_number,
    nearest,
    quote_value,
    reading,
    require_memory_for_run,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpflat.flat import Surface
    from warpflat.garment import FoundSeams, SeamCut

__all__ = ["found_seams", "plain_panel", "read_edges", "waist_of_body"]

# What of a garment's file is not followed where `no` names it.
_TEXTURE = "uv"


def found_seams(scene: Scene) -> FoundSeams | None:
    """Find the seams of a scene's garment, and make those that it draws; None where it asks for none, or its one piece can lie flat.

    Raises:
        InputError: the file is wrong.
    """
    from warpflat.garment import (
        NO_PATTERN,
        SeamOptions,
        asked_seams,
        file_seams,
        find_seams,
        is_whole_garment,
        like_cut_pieces,
        object_parts,
        read_garment,
    )

    settings, table = scene.settings, scene.settings.surface
    drawn, asked = settings.seams_cut, settings.find_seams or FindSeamsTable()
    # With a table [seams] somebody has said what is to be cut; without it what is drawn, or what cannot lie flat.
    is_asked = settings.find_seams is not None
    is_silent = not is_asked and not drawn
    if not isinstance(table, FileSurface) or (asked.find == "none" and not (drawn or asked.keep)):
        return None
    all_parts, of_file = table.component == "all", asked.find not in ("auto", "none")
    of_one_piece = ("lines", "cuts", "auto_cut", "datum", "start", "constraints", "seams", "drape")
    if is_silent and (table.component not in (None, "all") or any(getattr(settings, key) for key in of_one_piece)):
        return None
    if all_parts and asked.find == "none":
        return None
    path = surface_file(scene, table)
    try:
        read = read_garment(path, units=table.units, prim=table.prim, name=scene.name)
    except InputError:
        if is_silent or (all_parts and not of_file):
            return None
        raise
    layers: Sequence[Surface] = read.layers
    # Before anything is tried on it, or read again.
    require_memory_for_run(sum(len(layer.vertices) for layer in layers), frames=settings.output.frames > 0)
    seams, notes = file_seams(read.raw), list[str]()
    taken = asked_seams(path, asked.find, seams) if of_file else None
    by_itself = not is_asked and not all_parts and is_whole_garment(layers[0])
    looked_for = by_itself or (is_asked and asked.find == "auto")
    islands = seams.get("uv")
    if asked.find == "auto" and _TEXTURE not in asked.no and islands is not None and len(islands.edges):
        why = like_cut_pieces(read.raw, islands)
        parts = int(object_parts(read.raw.vertices, read.raw.polygons)[0].max()) + 1 if all_parts else 1
        if not why and (looked_for or (len(islands.names) > parts and not drawn)):
            taken = islands
        elif why and looked_for and not all_parts:
            notes.append(f"{islands.describe()} were not taken for cut pieces, as {why}; --seams uv takes them")
    if taken is None and (all_parts or (is_silent and not by_itself)):
        return None
    if isinstance(table.component, int):
        if table.component >= len(layers):
            raise InputError(
                f"{path}: component {table.component} does not exist; the garment has {len(layers)} layers"
            )
        layers = [layers[table.component]]
    elif table.component == "largest":
        layers = layers[:1]
    by_hand = [cut for number, one in enumerate(drawn) for cut in _as_cuts(scene, number, one, read.marks)]
    of_islands: list[SeamCut] = []
    if taken is not None:
        if taken.joined:
            notes.append(
                f"{format_count(taken.joined, 'island')} of less than a thousandth of the cloth joined to a neighbour"
            )
        of_islands = read.cuts_along(taken, layers, f"{path}")
        if not of_islands and not of_file:
            # They parted the inner shell from the outer one.
            taken = None
            if is_silent and not by_itself:
                return None
    waist = None
    if asked.body is not None:
        with errors_named(f"{scene.where}: find_seams.body"):
            waist = waist_of_body(scene.path(asked.body), read.scale)
        notes.append(f"a waist is looked for where the body of {Path(asked.body).name} has its own")
    with errors_named(scene.where):
        options = SeamOptions(
            find="auto" if taken is None and looked_for else "none", cuts=(*by_hand, *of_islands), up=asked.up, front=asked.front,
            no=tuple(name for name in asked.no if name != _TEXTURE), keep=tuple(asked.keep), limit=asked.limit,
            most_pieces=asked.most_pieces, smooth=1e-3 * asked.smooth_mm, waist=waist,
        )  # fmt: skip
        fabric = scene_fabric(scene)
        found = find_seams(layers, options, fabric=fabric)
        if taken is not None and looked_for and (beyond := found.beyond_limit(fabric)) > NO_PATTERN:
            knit = found.knit_for(fabric)
            notes.append(
                f"{taken.describe()} were not taken, as {100 * beyond:.0f} % of the cloth would be beyond its limit; "
                f"{f'--fabric {knit} would do, and ' if knit else ''}--seams uv takes them"
            )
            taken, options = None, replace(options, find="auto", cuts=tuple(by_hand))
            found = find_seams(layers, options, fabric=fabric)
    if taken is not None:
        why = "islands of the texture were taken, as they look like cut pieces; --no uv leaves them, --seams none keeps it whole"
        if left := [name for name in asked.no if name != _TEXTURE]:
            other = "--seams auto" if of_file else "--no uv"
            notes.append(
                f"no = {', '.join(map(repr, left))} had no effect: the file's own seams were taken; {other} looks for others"
            )
        found = read.named(found, taken)
        return replace(found, notes=(*(() if of_file else (why,)), *notes, *found.notes))
    if not by_itself:
        return replace(found, notes=(*notes, *found.notes))
    why = "one piece cannot lie flat, so its seams were found; --seams none keeps it whole"
    if drawn:
        why = "one piece cannot lie flat, so other seams were found, too; --seams none makes no others than you have drawn"
    return replace(found, notes=(why, *notes, *found.notes))


def waist_of_body(path: Path, scale: float) -> tuple[float, float, float]:
    """Return a place at the height of a body's waist [m], as its file has the body.

    Args:
        path: of a mesh of a standing body, which is where the garment is worn.
        scale: metres per unit of the file.

    Raises:
        InputError: the file cannot be read as a mesh, or the mesh is no standing body.
    """
    from warpflat.flat import read_scan
    from warpflat.garment import CommonBody

    vertices, faces = read_scan(path)
    with errors_named(str(path)):
        body = CommonBody.of_scan(vertices, faces, name=path.stem)
    x, y, z = (scale * body.middle_in_file("waist")).tolist()
    return x, y, z


def _as_cuts(scene: Scene, number: int, table: SeamCutTable, marks: Sequence[SeamCut]) -> list[SeamCut]:
    """Return the cuts of a table; `marks` are the lines of the garment's file.

    Raises:
        InputError: a line or a file is missing, or the file holds no rows of vertices.
    """
    from warpflat.garment import SeamCut

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
            path = scene.path(table.edges)
        with errors_named(f"{here}: edges"):
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
    """Return the surface of a scene that asks for nothing of seams, where it can lie flat in one piece; None else.

    A file whose texture has several islands may bring its seams.
    """
    from warpflat.flat import read_mesh_file
    from warpflat.garment import file_seams, is_whole_garment

    settings, table = scene.settings, scene.settings.surface
    if not isinstance(table, FileSurface) or table.component is not None or settings.find_seams or settings.seams_cut:
        return None
    try:
        read = read_mesh_file(surface_file(scene, table), units=table.units, prim=table.prim, name=scene.name)
        surface = scene_surface(scene, read)
    except InputError:
        return None
    has_islands = read[1].texture is not None and len(file_seams(read[1])["uv"].names) > 1
    return None if has_islands or is_whole_garment(surface) else surface
