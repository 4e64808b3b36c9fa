"""`frames.usdc`: every piece in space and in the plane, over the time of the relaxation.

The writer streams: frames go to a hidden file that is saved every few frames, so that memory does not grow with their
number. The places of the patterns beside the surfaces are authored at the end, since they depend on how far each pattern
ever reached. Then the file takes its final name.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpflat._version import __version__
from warpflat.core import FloatArray, InputError
from warpflat.flat import Surface, triangulate, vertex_normals
from warpflat.pattern.export.colours import VertexColours, energy_scale
from warpflat.pattern.export.geometry import Polylines, face_areas, polylines_of
from warpflat.pattern.export.packing import rows_on_table
from warpflat.pattern.export.usd_prims import (
    FIRST_FRAME,
    MeshSamples,
    SampledLines,
    add_cameras,
    add_light,
    add_material,
    add_texture_coordinates,
    begin_stage,
    bounding_box,
    define_group,
    define_mesh,
    last_values_as_defaults,
    part_path,
    require_usd,
    set_face_map,
    set_points,
    usd_errors,
    valid_name,
)
from warpflat.pattern.files.output import atomic_path

__all__ = ["DRAFTED", "FrameWriter", "film_scale"]

#: Where pieces stand that have no frames.
DRAFTED = "/World/drafted"


class FramePiece:
    """State of a piece: a few arrays of its size, whatever the number of frames."""

    def __init__(self, stage: Any, path: str, surface: Surface, *, scale: float) -> None:
        """Author the surface with its feature lines, and prepare the pattern.

        Args:
            stage, path: where.
            surface: the piece in space.
            scale: upper end of the colours [J/m2].
        """
        from pxr import Usd

        self.surface, self.path = surface, path
        points = np.asarray(surface.vertices, dtype=np.float32)
        size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0))) if len(points) else 0.0
        width = float(np.clip(0.004 * size, 1e-5, 2e-3))

        def lines(below: str, colour: tuple[float, float, float]) -> SampledLines:
            return SampledLines(stage, part_path(path, below), width=width, colour=colour)

        default = Usd.TimeCode.Default()
        normals = vertex_normals(surface.vertices, triangulate(surface.faces)[0])
        self.on_surface = MeshSamples(stage, part_path(path, "surface"), normals=normals, per_face=False, scale=scale)
        self.on_surface.write(default, points, surface.faces)
        # Cuts change the number of vertices and never that of faces: one normal per face serves all frames.
        upright = np.tile([0.0, 0.0, 1.0], (len(surface.faces), 1))
        self.on_pattern = MeshSamples(stage, part_path(path, "pattern"), normals=upright, per_face=True, scale=scale)
        self.lines = polylines_of(surface.lines)
        self.cuts = dict[str, Polylines]()
        lines("surface_lines", _LINE_COLOUR).write(default, self.lines, points, changed=True)
        self.surface_cuts = lines("surface_cuts", _CUT_COLOUR)
        self.pattern_lines, self.pattern_cuts = lines("pattern_lines", _LINE_COLOUR), lines("pattern_cuts", _CUT_COLOUR)
        colours = VertexColours(surface.faces, face_areas(surface.vertices, surface.faces), len(points))
        self.colours = colours, colours  # of surface and pattern; one and the same until a cut
        self.faces = surface.faces
        self.to_surface = np.arange(len(points), dtype=np.int32)
        self.measures = dict[str, Any]()
        self.frames = 0
        self.last_positions = np.empty((0, 2), dtype=np.float32)
        self.low, self.high = np.full(2, np.inf), np.full(2, -np.inf)

    def change_faces(self, faces: ArrayLike | None, count: int, what: str) -> bool:
        """Take over new faces of a pattern with `count` vertices, and return whether they differ from those before.

        Raises:
            ValueError: they are not the faces of the surface in the pattern's numbering.
        """
        if faces is None:
            return False
        new, original = np.ascontiguousarray(faces, dtype=np.int32), self.surface.faces
        if new is self.faces or np.array_equal(new, self.faces):
            return False
        used = original >= 0
        if new.shape != original.shape or not np.array_equal(new >= 0, used) or new.max() >= count:
            raise ValueError(f"{what}: the faces are not those of the surface in the pattern's numbering")
        to_surface = np.zeros(count, dtype=np.int32)
        to_surface[new[used]] = original[used]
        if not np.array_equal(to_surface[new[used]], original[used]):
            raise ValueError(f"{what}: a pattern vertex stands for two vertices of the surface")
        self.faces, self.to_surface = new, to_surface
        areas = face_areas(self.surface.vertices, original)
        self.colours = self.colours[0], VertexColours(new, areas, count)
        return True

    def change_lines(
        self, lines: Mapping[str, Any] | None, cuts: Mapping[str, Any] | None, count: int, what: str, *, new_faces: bool
    ) -> bool:
        """Take over new lines and cuts of a pattern with `count` vertices, and return whether they or the faces are new.

        Raises:
            ValueError: a line refers to other vertices.
        """
        if not new_faces and lines is None and cuts is None:
            return False
        self.lines = self.lines if lines is None else polylines_of(lines)
        self.cuts = self.cuts if cuts is None else polylines_of(cuts)
        for line, parts in (*self.lines.items(), *self.cuts.items()):
            if any(part.max() >= count or part.min() < 0 for part in parts):
                raise ValueError(f"{what}: line {line!r} refers to vertices beyond the {count} positions")
        return True

    def cuts_on_surface(self) -> dict[str, Polylines]:
        """Return the cuts in the surface's numbering, where both sides of a crack are one line."""
        return {
            key: [
                np.array(line, dtype=np.int32)
                for line in dict.fromkeys(tuple(self.to_surface[part].tolist()) for part in parts)
            ]
            for key, parts in self.cuts.items()
        }


_LINE_COLOUR = (0.03, 0.05, 0.10)
_CUT_COLOUR = (0.02, 0.20, 0.75)
_DRAFTED_COLOUR = (0.34, 0.37, 0.42)
# The working file is saved when so many frames, of so many vertices together, are in memory; those take some 50 MB.
_FRAMES, _VERTICES = 16, 2_000_000
# USD's type of a measure; a bool is an int, too.
_TYPES = {bool: "Bool", int: "Int", float: "Double", str: "String"}

Measure = bool | int | float | str


def film_scale(surfaces: Sequence[Surface], densities: Sequence[ArrayLike]) -> float:
    """Return the upper end of a film's colour scale [J/m2]: 98 % of the area of all pieces stays below it in their last frames.

    Args:
        surfaces: the pieces.
        densities: #F of each, strain energy per area in its last frame [J/m2].
    """
    areas = np.concatenate([face_areas(surface.vertices, surface.faces) for surface in surfaces])
    return energy_scale(np.concatenate([np.asarray(density) for density in densities]), areas)


class FrameWriter:
    """Streaming writer of `frames.usdc`; used in a ``with`` block.

    ``/World/NAME/NAME_surface`` is the piece in space, where it lies in the input. ``/World/NAME/NAME_pattern`` is its pattern in
    the XY plane, facing +Z; its points are the positions as given, and a translation sets it beside the surfaces
    and the other patterns. Both carry the energy density per face and colours per vertex (linear Rec. 709) on one
    scale for all pieces and all frames, stated in the colours' custom data. The values of the last frame are also
    authored as defaults, for readers that do not ask for a time.

    When the block ends well the file appears under its final name, whole. When it ends with an exception, or the
    process is killed, nothing appears there.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        scale: float,
        save_every: int | None = None,
    ) -> None:
        """Prepare a writer; nothing is touched before the ``with`` block is entered.

        Args:
            path: the file, ``*.usdc``.
            scale: upper end of the colour scale [J/m2]; see :func:`film_scale`.
            save_every: frames kept in memory at most; if not given 16, or more of a small mesh.
        """
        if save_every is not None and save_every < 1:
            raise ValueError("save_every must be at least 1")
        self._final = Path(path)
        self._save_every = _FRAMES if save_every is None else int(save_every)
        self._save_after = _VERTICES if save_every is None else 0
        self._scale = float(scale)
        self._pieces: dict[str, FramePiece] = {}
        self._used_names = {"Looks", "cameras", "light", "drafted"}
        self._bodies: list[FloatArray] = []
        self._unsaved = self._unsaved_vertices = 0
        self._stage: Any = None

    def __enter__(self) -> FrameWriter:
        """Open the hidden working file.

        Raises:
            InputError: the place cannot be written.
        """
        self._writing = self._write_file()
        next(self._writing)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Complete the file and give it its name if the block ended well; otherwise remove it."""
        if kind is None:
            next(self._writing, None)
        else:
            self._writing.close()

    def _write_file(self) -> Generator[None, None, None]:
        """Open the file, and complete it once the block has ended well."""
        from pxr import Usd

        if self._final.suffix != ".usdc":  # the only format that can be saved bit by bit
            raise InputError(f"cannot write {self._final}: USD frames need the suffix .usdc")
        with atomic_path(self._final) as working:
            try:
                with usd_errors(self._final):
                    self._stage = Usd.Stage.CreateNew(str(working))
                begin_stage(self._stage, is_film=True)
                self._stage.GetRootLayer().documentation = f"Flat patterns while they relax, by warpflat {__version__}"
                yield
                with usd_errors(self._final):
                    self._place()
                    add_light(self._stage)
                    shown = [piece for piece in self._pieces.values() if piece.frames]
                    add_material(
                        self._stage,
                        [samples.mesh for piece in shown for samples in (piece.on_surface, piece.on_pattern)],
                    )
                    for piece in shown:
                        for samples in (piece.on_surface, piece.on_pattern):
                            add_texture_coordinates(samples.mesh, piece.surface, piece.faces, piece.last_positions)
                    last_values_as_defaults(self._stage, self._stage.Traverse())
                    self._save()
            finally:
                # Nothing may hold the file open when it is moved.
                self._stage = None
                self._pieces.clear()
            require_usd(working, self._final)

    def add_piece(self, name: str, surface: Surface) -> None:
        """Author the surface of a piece with its feature lines, and prepare its pattern.

        Args:
            name: unique; made a valid USD identifier, and kept as the display name where that differs.
            surface: the piece in space.

        Raises:
            ValueError: the name is taken.
        """
        from pxr import Kind

        if name in self._pieces:
            raise ValueError(f"piece {name!r} is already in the file")
        path = f"/World/{valid_name(name, self._used_names)}"
        define_group(self._stage, path, label=name, kind=Kind.Tokens.component)
        self._pieces[name] = FramePiece(self._stage, path, surface, scale=self._scale)

    def write_map(self, name: str, key: str, values: FloatArray, *, unit: str, state: str) -> None:
        """Write a value per face of a piece's pattern, see :func:`warpflat.pattern.export.usd_prims.set_face_map`."""
        mesh = part_path(self._pieces[name].path, "pattern")
        set_face_map(self._stage.GetRootLayer(), mesh, key, values, unit=unit, state=state)

    def refer_to_body(self, file: str, points: ArrayLike) -> None:
        """Show the mannequin of another file of the same folder under the pieces, by reference; its lines are guides.

        Args:
            file: name of a file of :func:`warpflat.garment.mannequin.usd.write_mannequin_usd`.
            points: #V by 3, of its body as it is shown [m]: a little smaller, so that cloth that lies on it is seen.
        """
        from pxr import UsdGeom

        path = "/World/mannequin"
        self._used_names.add("mannequin")
        self._stage.DefinePrim(path).GetReferences().AddReference(f"./{file}", path)
        shown = UsdGeom.Mesh(self._stage.OverridePrim(f"{path}/body"))
        set_points(shown, points)
        self._bodies.append(np.asarray(points, dtype=np.float64))
        UsdGeom.Imageable(self._stage.OverridePrim(f"{path}/lines")).CreatePurposeAttr(UsdGeom.Tokens.guide)

    def show_drafted(self, surfaces: Sequence[Surface]) -> None:
        """Show pieces that have no frames, such as collars, where they are worn: meshes of one colour below `/World/drafted`."""
        from pxr import Kind

        taken = set[str]()
        define_group(self._stage, DRAFTED, kind=Kind.Tokens.component)
        for surface in surfaces:
            path = f"{DRAFTED}/{valid_name(surface.name, taken)}"
            mesh = define_mesh(self._stage, path, surface.faces, surface.vertices, _DRAFTED_COLOUR)
            mesh.GetPrim().SetDisplayName(surface.name)
            self._bodies.append(surface.vertices)

    def write(
        self,
        name: str,
        *,
        positions: ArrayLike,
        face_energy_density: ArrayLike,
        faces: ArrayLike | None = None,
        lines: Mapping[str, Any] | None = None,
        cuts: Mapping[str, Any] | None = None,
        measures: Mapping[str, Measure] | None = None,
    ) -> int:
        """Append the next frame of a piece and return its number.

        Args:
            name: as given to :meth:`add_piece`.
            positions: #P by 2, the pattern [m].
            face_energy_density: #F, strain energy per area [J/m2].
            faces: #F by 4, where the topology changes: the surface's faces, in their order and with their corners in
                their order, in the pattern's numbering.
            lines: feature lines in the pattern's numbering, where they change; each a vertex-index array or a list of
                them. At first those of the surface.
            cuts: cut lines in the same form (say, both sides of a crack). At first none.
            measures: of this frame, as ``/World/NAME.warpflat:KEY`` of their own type: bool, int, double or string.

        Raises:
            ValueError: the arrays do not fit together, or hold NaN.
            InputError: the disk is full or the folder is gone.
        """
        from pxr import Usd, Vt

        piece = self._pieces[name]
        flat = np.asarray(positions, dtype=np.float32)
        density = np.asarray(face_energy_density, dtype=np.float32)
        number = FIRST_FRAME + piece.frames
        what = f"frame {number} of piece {name!r}"
        # Check the shapes and values of a frame.
        face_count = len(piece.surface.faces)
        if flat.ndim != 2 or flat.shape[1] != 2 or len(flat) == 0:
            raise ValueError(f"{what}: positions must be #P by 2, not {flat.shape}")
        if density.shape != (face_count,):
            raise ValueError(f"{what}: {density.shape} energy densities for {face_count} faces")
        if not (np.isfinite(flat).all() and np.isfinite(density).all()):
            raise ValueError(f"{what}: positions or energy densities are not finite")
        new_faces = piece.change_faces(faces, len(flat), what) or piece.frames == 0
        if len(flat) != len(piece.to_surface):
            raise ValueError(f"{what}: {len(flat)} positions for {len(piece.to_surface)} pattern vertices")
        new_lines = piece.change_lines(lines, cuts, len(flat), what, new_faces=new_faces)

        time = Usd.TimeCode(number)
        points = np.zeros((len(flat), 3), dtype=np.float32)
        points[:, :2] = flat
        piece.on_pattern.write(time, points, piece.faces if new_faces else None)
        energy, shades = Vt.FloatArray.FromNumpy(density), None
        for samples, colours in zip((piece.on_surface, piece.on_pattern), piece.colours, strict=True):
            if shades is None or colours is not piece.colours[0]:
                shades = colours.shades(density, self._scale)
            samples.write_energy(time, energy, shades)
        piece.pattern_lines.write(time, piece.lines, points, changed=new_lines)
        piece.pattern_cuts.write(time, piece.cuts, points, changed=new_lines)
        if new_lines:
            space = np.asarray(piece.surface.vertices, dtype=np.float32)
            piece.surface_cuts.write(time, piece.cuts_on_surface(), space, changed=True)
        piece.last_positions = flat
        low, high = bounding_box(flat)
        piece.low, piece.high = np.minimum(piece.low, low), np.maximum(piece.high, high)
        self._unsaved += 1
        self._unsaved_vertices += len(flat)
        if self._unsaved >= self._save_every and self._unsaved_vertices >= self._save_after:
            with usd_errors(self._final):
                self._save()
        return self._count(piece, measures or {}, time)

    def write_between(self, name: str, positions: ArrayLike | None, measures: Mapping[str, Measure]) -> int:
        """Append a frame that lies evenly between the layouts before and after it; return its number.

        USD interpolates energies, colours and lines linearly, and points that are not stored, so readers see all frames.

        Args:
            name: as given to :meth:`add_piece`.
            positions: #P by 2, the pattern [m]; None to store no points.
            measures: as of :meth:`write`.

        Raises:
            ValueError: the piece has no layout yet, or another number of vertices.
        """
        from pxr import Usd

        piece = self._pieces[name]
        if piece.frames == 0:
            raise ValueError(f"the first frame of piece {name!r} needs a layout")
        time = Usd.TimeCode(FIRST_FRAME + piece.frames)
        if positions is not None:
            flat = np.asarray(positions, dtype=np.float32)
            if len(flat) != len(piece.to_surface):
                raise ValueError(f"piece {name!r}: {len(flat)} positions for {len(piece.to_surface)} pattern vertices")
            piece.on_pattern.write(time, np.pad(flat, ((0, 0), (0, 1))))
        return self._count(piece, measures, time)

    def _count(self, piece: FramePiece, measures: Mapping[str, Measure], time: Any) -> int:
        """Author a frame's measures, count it and return its number."""
        from pxr import Sdf

        for key, value in measures.items():
            if key not in piece.measures:
                kind = next(name for known, name in _TYPES.items() if isinstance(value, known))
                piece.measures[key] = self._stage.GetPrimAtPath(piece.path).CreateAttribute(
                    f"warpflat:{key}", getattr(Sdf.ValueTypeNames, kind), custom=True
                )
            piece.measures[key].Set(value, time)
        piece.frames += 1
        self._stage.SetEndTimeCode(max(self._stage.GetEndTimeCode(), time.GetValue()))
        return int(time.GetValue())

    def _save(self) -> None:
        """Save the working file."""
        self._stage.Save()
        self._unsaved = self._unsaved_vertices = 0

    def _place(self) -> None:
        """Place the patterns beside the surfaces, as on a table, by the room that each took over the whole time; add cameras."""
        from pxr import Gf, UsdGeom

        shown = [piece for piece in self._pieces.values() if piece.frames]
        if not shown:
            return
        # The arms of a body reach beyond the cloth, and would stand in the patterns.
        space = [*(piece.surface.vertices for piece in self._pieces.values()), *self._bodies]
        low = np.min([vertices.min(axis=0) for vertices in space], axis=0)
        high = np.max([vertices.max(axis=0) for vertices in space], axis=0)
        gap = 0.15 * max(float(np.max(high - low)), *(float(np.max(piece.high - piece.low)) for piece in shown))
        middle = 0.5 * (low + high)
        corners = rows_on_table(np.array([piece.high - piece.low for piece in shown]), 0.4 * gap)
        table = np.max([corner + piece.high - piece.low for corner, piece in zip(corners, shown, strict=True)], axis=0)
        origin = np.array([high[0] + gap, middle[1] - 0.5 * table[1]])
        for piece, corner in zip(shown, corners, strict=True):
            offset = Gf.Vec3d(*(origin + corner - piece.low).tolist(), float(middle[2]))
            for prim in (piece.on_pattern.mesh.GetPrim(), piece.pattern_lines.prim, piece.pattern_cuts.prim):
                if prim is not None:
                    UsdGeom.Xformable(prim).AddTranslateOp().Set(offset)
        patterns = np.array([[*origin, middle[2]], [*(origin + table), middle[2]]])
        boxes = np.stack([low, high, *patterns])
        add_cameras(self._stage, np.stack([boxes.min(axis=0), boxes.max(axis=0)]), patterns)
