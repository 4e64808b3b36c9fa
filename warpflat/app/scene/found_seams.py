"""The pieces of a scene's garment whose seams are found."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpflat.app.scene.load import Scene, errors_named, scene_fabric
from warpflat.app.scene.schema import FileSurface, FindSeamsTable, SeamCutTable
from warpflat.app.scene.surface import scene_surface
from warpflat.core import (
    InputError,
    check_values,
    find_unused_name,
    format_count,
    is_number,
    make_piece_name,
    nearest,
    quote_value,
    reading,
    require_memory_for_run,
)
from warpflat.flat import corner_means, half_edges, weld_map

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpflat.flat import Fabric, Flattening, Surface
    from warpflat.garment import FileSeams, FoundSeams, GarmentFile, SeamCut
    from warpflat.pattern import FoundSeam

__all__ = ["NO_PATTERN", "found_seams", "plain_panel", "read_edges", "seams_entry", "waist_of_body"]

#: More than this share of the cloth beyond its limit is no pattern yet.
NO_PATTERN = 0.1
# What of a garment's file is not followed where `no` names it.
_TEXTURE = "uv"
# A pattern is nowhere narrower than this share of its seams' allowance.
_WIDTH = 0.5
# A ring that lacks more than this share of a full turn does not lie flat: its cloth would be stretched by as much.
_CONE = 0.05
# A mesh of fewer faces is too coarse for a garment.
_FEWEST = 60


def found_seams(scene: Scene) -> FoundSeams | None:
    """Find the seams of a scene's garment, and make those that it draws; None where it asks for none, or its one piece can lie flat.

    Raises:
        InputError: the file is wrong.
    """
    from warpflat.flat import object_parts
    from warpflat.garment import FILE_SEAMS, SeamOptions, file_seams, find_seams, like_cut_pieces, read_garment

    settings, table = scene.settings, scene.settings.surface
    drawn, asked = settings.seams_cut, settings.find_seams or FindSeamsTable()
    # With a table [seams] somebody has said what is to be cut; without it what is drawn, or what cannot lie flat.
    is_asked = settings.find_seams is not None
    is_silent = not is_asked and not drawn
    if not isinstance(table, FileSurface) or (asked.find == "none" and not (drawn or asked.keep)):
        return None
    all_parts, of_file = table.component == "all", asked.find in ("file", *FILE_SEAMS)
    of_one_piece = ("lines", "cuts", "auto_cut", "datum", "start", "constraints", "seams", "drape")
    if is_silent and (table.component not in (None, "all") or any(getattr(settings, key) for key in of_one_piece)):
        return None
    if all_parts and asked.find == "none":
        return None
    with errors_named(f"{scene.where}: surface.file"):
        path = scene.path(table.file)
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
    taken = _asked_of_file(path, asked.find, seams) if of_file else None
    by_itself = not is_asked and not all_parts and _is_whole_garment(layers[0])
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
        of_islands = _cuts_of_file(taken, read, layers, f"{path}")
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
        if taken is not None and looked_for and (beyond := _beyond_limit(found.pieces, fabric)) > NO_PATTERN:
            knit = _knit_for(found.pieces, fabric)
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
        found = _named_by_file(found, taken, read)
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
    from warpflat.garment import Slicer, common_body_of_scan, finer_body

    vertices, faces = read_scan(path)
    with errors_named(str(path)):
        body = common_body_of_scan(vertices, faces, name=path.stem)
    cut = Slicer(body.vertices, finer_body()[1]).cut(np.array([0.0, 1.0, 0.0]), body.level("waist"))
    trunk = max((part.points for part in cut), key=lambda points: float(np.ptp(points[:, 0])))
    x, y, z = (scale * ((trunk.mean(axis=0) - body.shift) @ np.linalg.inv(body.turn))).tolist()
    return x, y, z


def _asked_of_file(path: Path, find: str, seams: Mapping[str, FileSeams]) -> FileSeams:
    """Return those of a file's seams that are asked for.

    Raises:
        InputError: the file has none of them, or too many for a pattern.
    """
    from warpflat.garment import FILE_SEAMS, MOST_ISLANDS

    wanted = FILE_SEAMS if find == "file" else (find,)
    taken = next((seams[way] for way in wanted if way in seams), None)
    if taken is None:
        lacks = {"uv": "texture coordinates", "materials": "more than one material", "groups": "more than one group"}
        other = f"seams by {' and '.join(seams)}" if seams else "no other seams either"
        raise InputError(
            f"{path}: find = {find!r}: the file does not have {' or '.join(lacks[way] for way in wanted)}; it has {other}: "
            'give find = "auto" (--seams auto) to look for seams'
        )
    if len(taken.names) > MOST_ISLANDS:
        raise InputError(
            f"{path}: find = {find!r}: {taken.describe()} are too many for a pattern, which has at most {MOST_ISLANDS} pieces; "
            'find = "auto" (--seams auto) looks for seams'
        )
    return taken


def _beyond_limit(pieces: Sequence[Surface], fabric: Fabric) -> float:
    """Return the share of the cloth that is beyond its limit where pieces are laid flat, about."""
    from warpflat.flat import area_vectors, triangulate
    from warpflat.garment import laid_flat

    vectors = [area_vectors(piece.vertices, triangulate(piece.faces)[0]) for piece in pieces]
    area = [float(np.linalg.norm(each, axis=1).sum()) for each in vectors]
    return float(np.average([laid_flat(piece, fabric, 0.0).outside for piece in pieces], weights=area))


def _knit_for(pieces: Sequence[Surface], fabric: Fabric) -> str:
    """Return the name of the knit that gives the least of those in which pieces are a pattern; "" if there is none."""
    from warpflat.flat import load_library

    knits = [knit for knit in load_library().values() if knit.is_knit and knit.strain_limit > fabric.strain_limit]
    for knit in sorted(knits, key=lambda one: one.strain_limit):
        if _beyond_limit(pieces, knit) <= NO_PATTERN:
            return knit.name
    return ""


def _cuts_of_file(seams: FileSeams, read: GarmentFile, layers: Sequence[Surface], file: str) -> list[SeamCut]:
    """Return a cut for each two islands that meet, along the edges that the layers still have within them after their repair.

    What ran along an inner shell, or to it across a thickness, is gone with that, or lies on the border.
    """
    from warpflat.garment import SeamCut

    place = weld_map(read.raw.vertices).astype(np.int64)

    def keys(edges: NDArray[np.int64]) -> NDArray[np.int64]:
        ends = np.sort(place[edges], axis=1)
        return ends[:, 0] * len(place) + ends[:, 1]

    sides = [half_edges(layer.faces) for layer in layers]
    there = [
        layer.input_index[each.edges[each.count > 1]].astype(np.int64)
        for layer, each in zip(layers, sides, strict=True)
    ]
    edges = seams.edges[np.isin(keys(seams.edges), np.concatenate([keys(ends) for ends in there]))]
    beside = np.sort(seams.beside[np.isin(keys(seams.edges), np.concatenate([keys(ends) for ends in there]))], axis=1)
    return [
        SeamCut(
            name=f"seam {a} {b}", edges=tuple(map(tuple, edges[(beside == (a, b)).all(axis=1)].tolist())), where=file
        )
        for a, b in np.unique(beside, axis=0).tolist()
    ]


def _named_by_file(found: FoundSeams, seams: FileSeams, read: GarmentFile) -> FoundSeams:
    """Return the pieces with the names that the file has for them, seams and edges named by the pieces that meet there.

    A piece is of the island of most of its cloth, and has its name. Groups and materials name pieces of a texture only where each has
    its own.
    """
    from scipy.spatial import cKDTree

    raw = read.raw
    tree = cKDTree(corner_means(raw.vertices, raw.polygons) * read.scale)
    islands, titles = list[int](), list[list[str]]()
    named = {"materials": raw.face_material, "groups": raw.face_group}
    for piece in found.pieces:
        triangles = piece.vertices[piece.faces[:, :3]]
        area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        face = tree.query(triangles.mean(axis=1))[1]
        islands.append(int(np.bincount(seams.island[face], area).argmax()))
        titles.append(
            ["" if of is None else of[1][int(np.bincount(of[0][face], area).argmax())] for of in named.values()]
        )
    ways = [seams.way] if seams.way in named else ["groups", "materials"]
    names = [piece.name for piece in found.pieces]
    for way in ways:
        own = [make_piece_name(title[list(named).index(way)]) for title in titles]
        if all(title[list(named).index(way)] for title in titles) and (way == seams.way or len(set(own)) == len(own)):
            taken: set[str] = set()
            names = []
            for name in own:
                number = [f"{name}_{k + 1}" for k in range(len(own))] if own.count(name) > 1 else [name]
                names.append(next(one for one in number if one not in taken))
                taken.add(names[-1])
            break
    known = dict(zip(islands[::-1], names[::-1], strict=True))
    edge = re.compile(r"seam (\d+) (\d+)")

    def renamed(title: str, own: str | None = None) -> str:
        match = edge.match(title)
        if match is None:
            return title
        pair = [known.get(int(match[k]), "piece") for k in (1, 2)]
        if own is None:
            words = f"{pair[0]} to {pair[1]}" if pair[0] != pair[1] else f"seam of {pair[0]}"
            return words.replace("_", " ")
        return f"to {pair[1] if pair[0] == own else pair[0]}" if pair[0] != pair[1] else "seam"

    pieces: list[Surface] = []
    made: list[FoundSeam] = []
    titled = set[str]()
    for piece, name, island in zip(found.pieces, names, islands, strict=True):
        lines: dict[str, Any] = {}
        for title, line in piece.lines.items():
            lines[find_unused_name(renamed(title, known[island]), lines)] = line
        pieces.append(replace(piece, name=name, lines=lines))
    for seam in found.seams:
        title = find_unused_name(renamed(seam.name), titled)
        titled.add(title)
        made.append(replace(seam, name=title))
    # A seam that ends inside the cloth is told by its name.
    notes = [edge.sub(lambda match: renamed(match[0]), note) for note in found.notes]
    along = seams.describe(len(set(islands)))
    return replace(found, pieces=tuple(pieces), seams=tuple(made), notes=tuple(notes), along=along)


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
    from warpflat.garment import file_seams

    settings, table = scene.settings, scene.settings.surface
    if not isinstance(table, FileSurface) or table.component is not None or settings.find_seams or settings.seams_cut:
        return None
    try:
        with errors_named(f"{scene.where}: surface.file"):
            path = scene.path(table.file)
        read = read_mesh_file(path, units=table.units, prim=table.prim, name=scene.name)
        surface = scene_surface(scene, read)
    except InputError:
        return None
    has_islands = read[1].texture is not None and len(file_seams(read[1])["uv"].names) > 1
    return None if has_islands or _is_whole_garment(surface) else surface


def _is_whole_garment(surface: Surface) -> bool:
    """Return whether a surface cannot lie flat in one piece: closed, with handles, forked, a cap, or a cone with its tip cut off."""
    from warpflat.flat import border_loops, euler_characteristic, inner_borders, triangulate
    from warpflat.garment import Cloth, is_panel, wide_borders

    if len(surface.faces) < _FEWEST:
        return False
    cloth = Cloth(vertices=surface.vertices, faces=triangulate(surface.faces)[0].astype(np.int64))
    wide = wide_borders(cloth)
    handles = (2 - len(border_loops(surface.faces, surface.vertices)) - euler_characteristic(surface.faces)) // 2
    if len(wide) == 2:
        # Between a flat ring and a tube, which is cut open, lies what neither is nor becomes flat, such as a poncho.
        lack = 1.0 + inner_borders(surface)[0][1] / (2.0 * np.pi)
        return handles > 0 or _CONE < lack < 0.5
    return len(wide) != 1 or handles > 0 or not is_panel(cloth)


def seams_entry(found: FoundSeams, pieces: Sequence[Flattening], allowance: float) -> Mapping[str, Any]:
    """Return the entry `garment` of `metrics.json`: what it is, its seams, and whether this is a pattern yet.

    Args:
        found: the seams.
        pieces: flat.
        allowance: of seams [m].
    """
    from warpflat.garment import parts_within

    area = np.array([float(piece.fit.area.sum()) for piece in pieces])
    outside = np.array([piece.fit.outside for piece in pieces])
    share = float((outside * area).sum() / area.sum())
    entry: dict[str, Any] = {
        "what": found.what,
        "outside": share,
        "found_seams": [seam.as_dict() for seam in found.seams],
        "notes": list(found.notes),
    }
    if share > NO_PATTERN:
        worst = pieces[int((outside * area).argmax())].surface.name
        entry["no_pattern"] = (
            f"no pattern yet: {100 * share:.0f} % of the cloth is beyond its limit, most of it in {worst}; take a fabric that gives more, "
            "smooth wrinkles (--smooth 5), or cut the mesh further"
        )
    elif narrow := [
        one.surface.name for one in pieces if parts_within(one.faces, one.positions, _WIDTH * allowance) != 1
    ]:
        entry["no_pattern"] = (
            f"no pattern yet: {', '.join(narrow)} {'is' if len(narrow) == 1 else 'are'} somewhere narrower than "
            f"{1e3 * _WIDTH * allowance:g} mm, so that nothing is left within the seams; leave seams out (--no), or draw "
            "others (--cut-seam)"
        )
    return entry
