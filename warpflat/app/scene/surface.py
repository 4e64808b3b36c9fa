"""The surface of a scene, with its feature lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from warpflat.app.scene.border import SIDES, line_on_border
from warpflat.app.scene.load import Scene, errors_named
from warpflat.app.scene.schema import (
    BorderTable,
    FileSurface,
    LineTable,
    ShapeSurface,
)
from warpflat.core import InputError, guarded, nearest
from warpflat.flat import (
    RawMesh,
    Surface,
    line_between,
    line_from_curve,
    line_from_indices,
    line_on_plane,
    read_mesh_file,
    surface_of_file,
    with_lines,
)
from warpflat.garment import SewnPanel, read_sewn_panels

__all__ = ["scene_pieces", "scene_sewn_panels", "scene_surface", "surface_file", "with_piece_tables"]


def scene_surface(scene: Scene, read: tuple[Path, RawMesh, float, list[Path]] | None = None) -> Surface:
    """Read or make the scene's surface, with its feature lines; `read` is its file, if it has been read before.

    Raises:
        InputError: the file or shape is wrong, an environment variable is not set, or a line is not on the surface.
    """
    from warpflat.app.scene.seams import scene_surface_seams
    from warpflat.garment import surface_seams

    table = scene.settings.surface
    if table is None:
        raise InputError(f"{scene.where}: the scene has no [surface]; this needs one piece, not a garment")
    if isinstance(table, ShapeSurface):
        from warpflat.app.scene.first_shapes import PIECES
        from warpflat.flat import make_shape

        with errors_named(f"{scene.where}: surface"):
            if table.shape in PIECES:
                raise InputError(f"{table.shape} has several pieces, and this needs one; take `warpflat run`")
            surface = make_shape(table.shape, **(table.model_extra or {}))
    else:
        path = surface_file(scene, table)
        if table.component == "all":
            raise InputError(
                f'{scene.where}: surface.component: this needs one piece; "all" is for `warpflat run` and `flatten`'
            )
        read = read or read_mesh_file(path, units=table.units, prim=table.prim, name=scene.name)
        surface = surface_of_file(read, component=table.component, name=scene.name)
    surface = replace(surface, name=scene.name)
    wanted = {} if scene.settings.datum is None else {"datum": scene.settings.datum}
    wanted |= {f"constraints[{i}]": constraint.line for i, constraint in enumerate(scene.settings.constraints)}
    named = scene_surface_seams(scene.settings.seams, scene.name)
    wanted |= {f"seams[{i}].sides[{k}]": seam.lines[k] for i, seam in enumerate(named) for k in (0, 1)}
    surface = _with_table_lines(surface, scene.settings.lines, wanted, where=f"{scene.where}: ")
    with errors_named(f"{scene.where}: seams"):
        surface_seams(surface, named)
    return surface


def with_piece_tables(scene: Scene, pieces: Sequence[Surface]) -> list[Surface]:
    """Return pieces with the lines that the scene draws on them by name.

    Raises:
        InputError: there is no such piece (names the nearest), or a line is not on it.
    """
    tables = scene.settings.pieces
    for name in tables:
        if name not in {piece.name for piece in pieces}:
            raise InputError(
                f"{scene.where}: pieces.{name}: there is no such piece; {nearest(name, [piece.name for piece in pieces])}"
            )
    made = []
    for piece in pieces:
        table = tables.get(piece.name)
        if table is not None:
            wanted = {} if table.datum is None else {"datum": table.datum}
            piece = _with_table_lines(piece, table.lines, wanted, where=f"{scene.where}: pieces.{piece.name}.")
        made.append(piece)
    return made


def _with_table_lines(
    surface: Surface, tables: Mapping[str, LineTable], wanted: Mapping[str, str], *, where: str
) -> Surface:
    """Return a surface with the lines of tables, and with sides of its border where these are wanted, by the key that wants each.

    Raises:
        InputError: a line is not on the surface, or unknown.
    """
    for name, line in tables.items():
        with errors_named(f"{where}lines.{name}"):
            if line.vertices is not None:
                ids = line_from_indices(surface, line.vertices, as_read=True)
            elif line.from_ is not None and line.to is not None:
                ids = line_between(surface, line.from_, line.to, as_read=True)
            elif line.plane is not None:
                ids = line_on_plane(surface, line.plane.point, line.plane.normal)
            elif isinstance(line.border, BorderTable):
                border = line.border
                ids = line_on_border(
                    surface, start=border.start, end=border.end, direction=border.direction, as_read=True
                )
            elif line.border is not None:
                ids = line_on_border(surface, line.border)
            elif isinstance(line.curve, list):
                ids = line_from_curve(surface, line.curve)
            else:
                curve = str(line.curve).rstrip("/").rpartition("/")[2]
                if curve not in surface.lines:
                    raise InputError(
                        f"the file has no curve {line.curve!r} on the piece; {nearest(curve, surface.lines)}"
                    )
                ids = surface.lines[curve]
            surface = with_lines(surface, {name: ids})
    for key, name in wanted.items():
        if name not in surface.lines:
            with errors_named(f"{where}{key}"):
                if name not in SIDES:
                    raise InputError(f"unknown line {name!r}; {nearest(name, {*surface.lines, *SIDES})}")
                surface = with_lines(surface, {name: line_on_border(surface, name)})
    return surface


def scene_pieces(scene: Scene) -> tuple[Surface, ...] | None:
    """Read or make all pieces of a scene whose `surface.component` is "all", or whose shape has several; None for other scenes.

    Raises:
        InputError: the file or a parameter of the shape is wrong, or an environment variable is not set.
    """
    from warpflat.app.scene.first_shapes import PIECES, make_pieces
    from warpflat.garment import read_pieces
    from warpflat.pattern import BORDERS_MEET

    table = scene.settings.surface
    if isinstance(table, ShapeSurface) and table.shape in PIECES:
        with errors_named(f"{scene.where}: surface"):
            return make_pieces(table.shape, **(table.model_extra or {}))
    if not isinstance(table, FileSurface) or table.component != "all":
        return None
    meet = BORDERS_MEET if table.meet_mm is None else 1e-3 * table.meet_mm
    return read_pieces(surface_file(scene, table), units=table.units, prim=table.prim, name=scene.name, meet=meet)


def scene_sewn_panels(scene: Scene) -> list[SewnPanel]:
    """Read the sewn panels of a scene whose `surface.pattern` is "uv"; none for other scenes.

    Raises:
        InputError: the file is wrong, or its texture is no pattern of true size.
    """
    table = scene.settings.surface
    if not isinstance(table, FileSurface) or table.pattern is None:
        return []
    return read_sewn_panels(surface_file(scene, table), units=table.units, prim=table.prim, name=scene.name)


def surface_file(scene: Scene, table: FileSurface) -> Path:
    """Return where the file of a scene's surface lies.

    Raises:
        InputError: it does not exist, or an environment variable is not set.
    """
    with errors_named(f"{scene.where}: surface.file"):
        path = scene.path(table.file)
        with guarded(path, "mesh", missing="does not exist"):
            path.stat()
    return path
