"""The layers of a garment that was made as a whole: connected parts, without buttons and crumbs; the lines and seams that its file has."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpflat.core import (
    InputError,
    area_words,
    find_unused_name,
    format_count,
    make_file_name,
    plain_label,
    quote_value,
)
from warpflat.flat import (
    ALL_PRIMS,
    POSSIBLE,
    Layer,
    RawMesh,
    Surface,
    border_of,
    check_size,
    corner_means,
    euler_characteristic,
    flat_areas,
    half_edges_of,
    make_surface,
    parts_of_faces,
    read_mesh_file,
    surplus_layers,
    weld_map,
    wrong_size,
)
from warpflat.garment.construction.file_seams import FileSeams
from warpflat.garment.construction.overlapping_layers import surplus_faces
from warpflat.garment.construction.read_pieces import make_piece_name
from warpflat.garment.seams.options import SeamCut

if TYPE_CHECKING:
    from warpflat.garment.seams.find import FoundSeams
    from warpflat.pattern import FoundSeam

__all__ = ["GarmentFile", "read_garment", "read_layers"]

# A part is a trifle, such as a button, below this share of the area of all; a closed one below this.
_TRIFLE, _CLOSED_TRIFLE = 0.004, 0.05
# A body is no shorter than a newborn, and half of what it wears is as near as this [m].
_SHORTEST_BODY, _WORN = 0.45, 0.1
# So many parts at most are cut, each on its own.
_MOST_LAYERS = 40


class GarmentFile(NamedTuple):
    """The layers of a garment's file, its lines as cuts, and its mesh as it stands, of `scale` metres per unit."""

    layers: tuple[Surface, ...]
    marks: tuple[SeamCut, ...]
    raw: RawMesh
    scale: float

    def cuts_along(self, seams: FileSeams, layers: Sequence[Surface], file: str) -> list[SeamCut]:
        """Return a cut for each two islands that meet, along the edges that the layers still have within them after their repair.

        What ran along an inner shell, or to it across a thickness, is gone with that, or lies on the border.
        """
        place = weld_map(self.raw.vertices).astype(np.int64)

        def keys(edges: NDArray[np.int64]) -> NDArray[np.int64]:
            ends = np.sort(place[edges], axis=1)
            return ends[:, 0] * len(place) + ends[:, 1]

        sides = [(layer.input_index, half_edges_of(layer)) for layer in layers]
        there = [keys(index[each.edges[each.count > 1]].astype(np.int64)) for index, each in sides]
        is_left = np.isin(keys(seams.edges), np.concatenate(there))
        edges, beside = seams.edges[is_left], np.sort(seams.beside[is_left], axis=1)
        return [
            SeamCut(
                name=f"seam {a} {b}",
                edges=tuple(map(tuple, edges[(beside == (a, b)).all(axis=1)].tolist())),
                where=file,
            )
            for a, b in np.unique(beside, axis=0).tolist()
        ]

    def named(self, found: FoundSeams, seams: FileSeams) -> FoundSeams:
        """Return the pieces with the names that the file has for them, seams and edges named by the pieces that meet there.

        A piece is of the island of most of its cloth, and has its name. Groups and materials name pieces of a texture only where each has
        its own.
        """
        raw = self.raw
        tree = cKDTree(corner_means(raw.vertices, raw.polygons) * self.scale)
        islands, titles = list[int](), dict[str, list[str]](groups=[], materials=[])
        for piece in found.pieces:
            triangles = piece.faces[:, :3]
            area = flat_areas(piece.vertices, triangles)
            face = tree.query(piece.vertices[triangles].mean(axis=1))[1]
            islands.append(int(np.bincount(seams.island[face], area).argmax()))
            for way, of in (("groups", raw.face_group), ("materials", raw.face_material)):
                titles[way].append("" if of is None else of[1][int(np.bincount(of[0][face], area).argmax())])
        names = [piece.name for piece in found.pieces]
        for way in [seams.way] if seams.way in titles else titles:
            own = [make_piece_name(title) for title in titles[way]]
            if all(titles[way]) and (way == seams.way or len(set(own)) == len(own)):
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


def read_layers(
    path: str | PathLike[str], *, units: str | None = None, prim: str | None = None, name: str | None = None
) -> tuple[Surface, ...]:
    """Read a garment whose seams are to be found: each connected part is a layer, largest first; closed ones are kept.

    Vertices at one place are joined, so that seams of a texture do not part the cloth. Buttons, crumbs and second layers are left out
    with a note, as are a body that wears the rest, and a part that is no surface where another one is.

    Args:
        path, units: as :func:`warpflat.read_surface`.
        prim: of a USD stage or a GLB scene; all meshes if not given.
        name: of the layers; by default the file's stem.

    Raises:
        InputError: one line that names the file.
    """
    return read_garment(path, units=units, prim=prim, name=name).layers


def read_garment(
    path: str | PathLike[str], *, units: str | None = None, prim: str | None = None, name: str | None = None
) -> GarmentFile:
    """Read the layers of a garment as :func:`read_layers`, and as cuts the lines of its file.

    Lines are line elements of OBJ, edge elements of PLY, and curves and creases of USD.

    Raises:
        InputError: one line that names the file.
    """
    file, raw, scale, sources = read_mesh_file(path, units=units, prim=prim or ALL_PRIMS, name=name)
    vertices, title = raw.vertices * scale, name or make_file_name(file.stem)
    notes = list(raw.notes)
    polygons = raw.polygons
    try:
        apart = parts_of_faces(vertices, polygons, weld=False)
        # Faces that share no vertices are a soup, whose second layer falls away as they are joined.
        if 0 < apart.max() < len(polygons) // 2:
            surplus_of, told = surplus_faces(vertices, polygons, apart)
            notes += told
            polygons = polygons[~surplus_of]
        part = parts_of_faces(vertices, polygons, weld=True, notes=notes)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    found: list[Surface] = []
    faults: list[InputError] = []
    largest = 0.0
    counts = np.bincount(part[part >= 0])
    order = np.argsort(-counts, kind="stable")
    for number in order[:_MOST_LAYERS].tolist():
        try:
            surface = make_surface(
                vertices, polygons[part == number], name=title, weld=True, closed=True, source=str(file)
            )
        except InputError as error:
            faults.append(error)
            continue
        size = float(np.ptp(surface.vertices, axis=0).max())
        largest = max(largest, size)
        if size >= POSSIBLE[0] or len(order) == 1:
            found.append(surface)
    if not found:
        raise faults[0] if faults else wrong_size(largest, file, scale)
    # The body that wears the others is closed, without handles, as tall as one, and most of them lie on it.
    bodies = list[Surface]()
    for body in found:
        tall = float(np.ptp(body.vertices, axis=0).max())
        if tall < _SHORTEST_BODY or not _is_closed(body):
            continue
        worn = [other.vertices for other in found if other is not body and not _is_closed(other)]
        if not worn or euler_characteristic(body.faces) != 2:
            continue
        away = cKDTree(body.vertices).query(np.concatenate(worn))[0]
        if float(np.median(away)) < _WORN:
            bodies.append(body)
            notes.append(f"a body, {tall:.2f} m tall, left out: closed, and the rest lies around it")
    found = [surface for surface in found if all(surface is not body for body in bodies)]
    layers = [Layer(surface.vertices, surface.faces) for surface in found]
    total = sum(layer.area for layer in layers)
    surplus = surplus_layers(layers)
    notes += surplus.values()
    kept, trifles, area = list[Surface](), len(order) - len(found) - len(bodies) - len(faults), 0.0
    for number, (surface, layer) in enumerate(zip(found, layers, strict=True)):
        if number in surplus:
            continue
        if number and layer.area < (_CLOSED_TRIFLE if _is_closed(surface) else _TRIFLE) * total:
            trifles, area = trifles + 1, area + layer.area
        else:
            check_size(surface, file, scale)
            kept.append(replace(surface, sources=tuple(dict.fromkeys(sources))))
    if trifles:
        notes.append(f"{format_count(trifles, 'small part')}, such as buttons, left out ({area_words(area)})")
    notes += [f"a part left out: {str(fault).removeprefix(f'{file}: ')}" for fault in faults[:3]]
    kept.sort(key=lambda surface: -Layer(surface.vertices, surface.faces).area)
    marks = [
        SeamCut(name=plain_label(key), edges=(tuple(chain.tolist()),), where=f"line {quote_value(key)} of {file}")
        for key, chain in raw.chains.items()
    ]
    if raw.marked:
        rows = tuple(tuple(row.tolist()) for row in raw.marked)
        marks.append(SeamCut(name="marked", edges=rows, where=f"marked edges of {file}"))
    for key, curve in raw.curves.items():
        points = [tuple(point) for point in (curve * scale).tolist()]
        closed = len(points) > 3 and points[0] == points[-1]
        line = tuple(points[:-1] if closed else points)
        marks.append(
            SeamCut(name=plain_label(key), line=line, closed=closed, where=f"line {quote_value(key)} of {file}")
        )
    kept[0] = replace(kept[0], notes=tuple(dict.fromkeys([*notes, *kept[0].notes])))
    return GarmentFile(layers=tuple(kept), marks=tuple(marks), raw=raw, scale=scale)


def _is_closed(surface: Surface) -> bool:
    return len(border_of(surface)) == 0
