"""All pieces of a garment from one file."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, InputError, IntArray, area_words, format_count, make_file_name
from warpflat.flat import (
    ALL_PRIMS,
    POSSIBLE,
    ClosedSurfaceError,
    Layer,
    Surface,
    check_size,
    flat_areas,
    make_surface,
    parts_of_faces,
    read_mesh_file,
    split_polygons,
    surplus_layers,
    wrong_size,
)
from warpflat.garment.construction.meet import meet_borders
from warpflat.garment.construction.overlapping_layers import overlap_notes
from warpflat.pattern import BORDERS_MEET

__all__ = ["make_piece_name", "object_parts", "read_pieces"]


def read_pieces(
    path: str | PathLike[str],
    *,
    units: str | None = None,
    prim: str | None = None,
    name: str | None = None,
    meet: float = BORDERS_MEET,
) -> tuple[Surface, ...]:
    """Read all pieces of a garment: each connected part of each object of an OBJ file, node of a GLB scene or mesh prim of a USD stage.

    Objects are repaired and checked each on its own, so that pieces stay apart whose borders lie at one place, as along a seam. They are
    named as in the file; those without a name are numbered, as are the parts of one object. Closed parts, such as buttons, and crumbs
    are left out with a note.

    Args:
        path: the file.
        units: as :func:`warpflat.read_surface`.
        prim: the path or name of the only mesh prim of a USD stage that is read; all if not given.
        name: for pieces that have none in the file; by default the file's stem.
        meet: borders that run along each other within this distance [m] are made to agree vertex by vertex, so that they are sewn; 0
            leaves them as they are.

    Returns:
        The pieces, in the order of the file; `input_vertices` are those of the piece's object.

    Raises:
        InputError: one line that names the file, and the object where there are several.
    """
    file, raw, scale, sources = read_mesh_file(path, units=units, prim=prim or ALL_PRIMS, name=name)
    vertices = raw.vertices * scale
    found: list[Surface] = []
    closed, small = list[float](), list[float]()
    largest = 0.0
    stem, objects = name or make_file_name(file.stem), list[tuple[str, int, NDArray[np.int64]]]()
    # Name, first vertex, and the faces in the object's own numbering.
    named_at, object_of = raw.objects or ([(0, "")], np.zeros(len(raw.polygons), dtype=np.int64))
    for number, (first, title) in enumerate(named_at):
        polygons = raw.polygons[object_of == number]
        if len(polygons):
            own = np.where(polygons >= 0, polygons - first, -1)
            objects.append((make_piece_name(title) if title else stem, first, own))
    notes = list(raw.notes)
    for title, first, polygons in objects:
        points = vertices[first : first + int(polygons.max()) + 1]
        source = str(file) if len(objects) == 1 else f"{file}: {title}"
        try:
            part, soup = object_parts(points, polygons, notes)
        except InputError as error:
            raise InputError(f"{source}: {error}") from error
        for number in range(int(part.max()) + 1):
            of = polygons[part == number]
            try:
                surface = make_surface(points, of, name=title, weld=soup, source=source)
            except ClosedSurfaceError:
                faces, _ = split_polygons(points, of)
                closed.append(float(flat_areas(points, faces).sum()))
                continue
            size = float(np.ptp(surface.vertices, axis=0).max())
            largest = max(largest, size)
            if size < POSSIBLE[0]:
                small.append(Layer(surface.vertices, surface.faces).area)
                continue
            check_size(surface, file, scale)
            found.append(replace(surface, sources=tuple(dict.fromkeys(sources))))
    if small and not found:
        raise wrong_size(largest, file, scale)
    if not found:
        raise InputError(f"{file}: every part is closed (it has no border) or a crumb; give the layer of cloth alone")
    if closed:
        notes.append(
            f"{format_count(len(closed), 'closed part')}, such as a button, left out ({area_words(sum(closed))})"
        )
    if small:
        notes.append(
            f"{format_count(len(small), 'part')} of less than {1e3 * POSSIBLE[0]:g} mm left out ({area_words(sum(small))})"
        )
    named = _named_apart(found)
    layers = [Layer(surface.vertices, surface.faces) for surface in named]
    surplus = surplus_layers(layers, [surface.name for surface in named])
    notes += surplus.values()
    rest = [number for number in range(len(named)) if number not in surplus]
    notes += overlap_notes([layers[number] for number in rest], [named[number].name for number in rest])
    # Without its second layer a piece may be alone of its name.
    kept, met = meet_borders(
        _named_apart([surface for number, surface in enumerate(found) if number not in surplus]), meet
    )
    notes += met
    return (replace(kept[0], notes=tuple(dict.fromkeys([*notes, *kept[0].notes]))), *kept[1:])


def make_piece_name(name: str) -> str:
    """Return a piece's name made of one that was not chosen for it, such as that of a material: an edge of it is "piece.edge"."""
    return make_file_name(name).replace(".", "_")


def object_parts(
    vertices: FloatArray, polygons: NDArray[np.int64], notes: list[str] | None = None
) -> tuple[IntArray, bool]:
    """Return the connected part of each face of an object (#F), and whether vertices at one place had to be joined for that.

    Faces that share no vertices, as in STL, are joined. Others are apart where the pattern or its texture is.

    Raises:
        InputError: as :func:`parts_of_faces`.
    """
    told = list[str]()
    part = parts_of_faces(vertices, polygons, weld=False, notes=told)
    soup = 2 * int(part.max() + 1) > len(polygons)
    if soup:
        told = []
        part = parts_of_faces(vertices, polygons, weld=True, notes=told)
    if notes is not None:
        notes += told
    return part, soup


def _named_apart(surfaces: list[Surface]) -> tuple[Surface, ...]:
    """Return surfaces with a number behind names that occur twice."""
    often = Counter(surface.name for surface in surfaces)
    seen = Counter[str]()
    named = []
    for surface in surfaces:
        seen[surface.name] += 1
        numbered = f"{surface.name}_{seen[surface.name]}"
        named.append(replace(surface, name=numbered) if often[surface.name] > 1 else surface)
    return tuple(named)
