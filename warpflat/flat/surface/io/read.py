"""Surfaces from mesh files, of a format by their suffix and in a unit that the file or the user gives."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, expect, nearest
from warpflat.core.file_kinds import other_kind_words
from warpflat.core.file_names import check_file_name, make_file_name, plain_label
from warpflat.core.input_files import listening_to_reads, note_read, reading
from warpflat.core.text import quote_value
from warpflat.core.usd_process import read_apart
from warpflat.flat.surface.io.raw_mesh import ALL_PRIMS, RawMesh
from warpflat.flat.surface.io.read_obj import read_obj
from warpflat.flat.surface.io.read_off import read_off
from warpflat.flat.surface.io.read_trimesh import GLTF, read_with_trimesh
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.lines import line_from_curve, with_lines
from warpflat.flat.surface.repair.polygons import distinct_corners, split_polygons
from warpflat.flat.surface.repair.stray_vertex import stray_vertex, stray_words
from warpflat.flat.surface.repair.validate import check_positions, make_surface

__all__ = [
    "METRES_PER_UNIT",
    "POSSIBLE",
    "SUFFIXES",
    "check_size",
    "extent_words",
    "read_mesh_file",
    "read_scan",
    "read_surface",
    "surface_of_file",
    "wrong_size",
]


METRES_PER_UNIT = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}

_USD = (".usd", ".usda", ".usdc", ".usdz")
SUFFIXES = (*GLTF, ".obj", ".off", ".ply", ".stl", *_USD)

# A piece of a garment lies between these extents [m]; a usual one between the other two.
POSSIBLE = (3e-3, 20.0)
_USUAL = (0.02, 5.0)
# A garment that is worn, one unit of ten at most; and what is not doubted, pieces such as a pocket among it.
_WORN, _LIKELY = (0.25, 2.2), (0.08, 3.0)


def read_surface(
    path: str | PathLike[str],
    *,
    units: str | None = None,
    component: int | Literal["largest"] | None = None,
    name: str | None = None,
    prim: str | None = None,
    weld: bool | None = None,
) -> Surface:
    """Read, repair and check a surface.

    OBJ, OFF and USD keep their quads; PLY, STL, GLB and glTF are read with trimesh, which cuts polygons into
    triangles. GLB and glTF are in metres and Y up by their standard, USD says its unit and its up axis (Z up is turned
    to Y up); all other axes are taken as they are. Line elements of OBJ and linear BasisCurves beside or below a USD
    mesh, or in the group MESH_lines beside it, become feature lines.

    Args:
        path: the file.
        units: "m", "dm", "cm", "mm", "in" or "ft". Needed for OBJ, PLY, STL and OFF, which carry none; for the others it
            overrides what the file says.
        component: the connected part to take if there are several: "largest", or its number, that of the largest area first, from 0.
        name: of the piece (see :func:`warpflat.make_surface`); by default the file's stem, or the USD prim's or
            GLB node's name, with "_" where no file can bear it.
        prim: the mesh of a USD stage (a prim path or name) or of a GLB scene (a node's name) to take.
        weld: true to join vertices at the same place; by default the format and the mesh decide (see
            :func:`warpflat.make_surface`).

    Raises:
        InputError: one line that names the file.
    """
    return surface_of_file(
        read_mesh_file(path, units=units, prim=prim, name=name), component=component, name=name, weld=weld
    )


def surface_of_file(
    read: tuple[Path, RawMesh, float, list[Path]],
    *,
    component: int | Literal["largest"] | None = None,
    name: str | None = None,
    weld: bool | None = None,
) -> Surface:
    """Return the surface of a file that :func:`read_mesh_file` has read; see :func:`read_surface`.

    Raises:
        InputError: one line that names the file.
    """
    file, raw, scale, sources = read
    # A vertex far from all others would otherwise show as a piece too large, or as slivers.
    if (
        component is None
        and len(raw.vertices)
        and not float(np.ptp(raw.vertices, axis=0).max()) * scale <= POSSIBLE[1]  # true for NaN too
    ):
        used = np.unique(raw.polygons[raw.polygons >= 0])
        used = used[used < len(raw.vertices)]
        points = raw.vertices[used]
        # What is no number, or out of all bounds, is refused with the rest of what no mesh has.
        if len(points) and np.abs(points).max() < 1e20 and float(np.ptp(points, axis=0).max()) * scale > POSSIBLE[1]:
            stray = stray_vertex(points)
            if stray is not None:
                raise InputError(f"{file}: {stray_words(int(used[stray]), points[stray])}")
    surface = make_surface(
        raw.vertices * scale,
        raw.polygons,
        name=name or make_file_name(raw.name or file.stem),
        lines={plain_label(key): chain for key, chain in raw.chains.items()},
        component=component,
        weld=weld,
        split_corners=raw.split_corners,
        source=str(file),
    )
    check_size(surface, file, scale)
    if raw.curves:
        from scipy.spatial import cKDTree

        size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
        notes, lines = list(surface.notes), dict[str, IntArray]()
        curves = {plain_label(key): curve * scale for key, curve in raw.curves.items()}
        for title, curve in curves.items():
            try:
                lines[title] = line_from_curve(surface, curve, name=title)
            except InputError as error:
                notes.append(f"line left out: {error}")
                continue
            off, _ = cKDTree(curve).query(surface.vertices[lines[title]])
            if off.max() > 1e-6 * size:
                notes.append(f"line {quote_value(title)} was drawn along the nearest edges")
        surface = replace(with_lines(surface, lines), notes=tuple(notes))
    return replace(surface, notes=(*raw.notes, *surface.notes), sources=tuple(dict.fromkeys(sources)))


def read_scan(path: str | PathLike[str]) -> tuple[FloatArray, IntArray]:
    """Read any mesh as it stands, closed or in several parts or prims, such as the scan of a body.

    Returns:
        #V by 3, positions in the file's own unit, those of USD in metres; #F by 4, faces, -1 in the last column of a triangle.

    Raises:
        InputError: one line that names the file.
    """
    file = Path(path)
    with _reading_mesh(file):
        raw = _read(file, None, ALL_PRIMS)
        polygons, keep, _ = distinct_corners(raw.polygons)
        return raw.vertices, split_polygons(check_positions(raw.vertices), polygons[keep])[0]


def read_mesh_file(
    path: str | PathLike[str], *, units: str | None, prim: str | None, name: str | None
) -> tuple[Path, RawMesh, float, list[Path]]:
    """Read a mesh file as it stands.

    Returns:
        The file, its mesh, the metres per unit, and the files that were read for it.

    Raises:
        InputError: one line that names the file.
    """
    expect(path, (str, PathLike), "path", "that of a mesh file")
    file = Path(path)
    sources: list[Path] = []
    report_activity(f"reading {file.name}")
    with listening_to_reads(sources.append), _reading_mesh(file):
        if name:
            check_file_name(name)
        if units is not None and units not in METRES_PER_UNIT:
            raise InputError(f"unknown units {units!r}; {nearest(str(units), METRES_PER_UNIT)}")
        raw = _read(file, units, prim)
        if raw.scale is None:
            used = np.unique(raw.polygons[raw.polygons >= 0])
            points = raw.vertices[used[used < len(raw.vertices)]]
            points = points[np.isfinite(points).all(axis=1)]
            sides = {unit: (np.ptp(points, axis=0) * metres).tolist() for unit, metres in METRES_PER_UNIT.items()}
            extents = {unit: " x ".join(f"{side:.3g}" for side in extent) for unit, extent in sides.items()}
            sizes = "; ".join(f'"{unit}": {extent} m' for unit, extent in extents.items())
            likely = _likely_unit(max(sides["m"]))
            guess = f"; a garment is likeliest in {likely}" if likely else ""
            raise InputError(
                'carries no unit: say which with units = "m" in the scene or --units m on the command line '
                f"(m, dm, cm, mm, in, ft); the mesh would measure, as {sizes}{guess}"
            )
    report_activity("checking the mesh")
    return file, raw, raw.scale, sources


@contextmanager
def _reading_mesh(file: Path) -> Iterator[None]:
    """Guard the reading of a mesh file, which must have a known suffix and not be empty.

    Raises:
        InputError: the file cannot be read, for whatever reason.
    """
    with reading(file, "mesh", missing="does not exist"):
        if file.suffix.lower() not in SUFFIXES:
            known = f"unknown kind of file {file.suffix!r}; {nearest(file.suffix.lower(), SUFFIXES)}"
            raise InputError(other_kind_words(file, "a mesh") or known)
        if file.stat().st_size == 0:
            raise InputError("is empty")
        yield


def _read(file: Path, units: str | None, prim: str | None) -> RawMesh:
    suffix = file.suffix.lower()
    scale = METRES_PER_UNIT[units] if units else None
    if suffix in _USD:
        # The modules of `warpflat.flat.surface` would bring Warp with them, which takes a second to load.
        function = "warpflat.flat.surface.io.usd_stage:read_usd_stage"
        usd, layers = read_apart(function, file, prim=prim, metres_per_unit=scale)
        assert isinstance(usd, RawMesh)
        for layer in layers:
            note_read(layer)
        return usd
    if prim == ALL_PRIMS:
        prim = None
    if prim is not None and suffix not in GLTF:
        raise InputError(f"prim = {prim!r} only means something in a USD or GLB file; use component to choose a part")
    if suffix == ".obj":
        raw = read_obj(file)
    else:
        raw = read_off(file) if suffix == ".off" else read_with_trimesh(file, node=prim)
    return raw if scale is None else replace(raw, scale=scale)


def check_size(surface: Surface, file: Path, scale: float) -> None:
    """Check that a piece of a file of this scale [metres per unit] is as large as a piece of a garment can be.

    Raises:
        InputError: it is not; names the unit that would be right.
    """
    size = float(np.ptp(surface.vertices, axis=0).max())
    if not POSSIBLE[0] <= size <= POSSIBLE[1]:
        raise wrong_size(size, file, scale)


def wrong_size(size: float, file: Path, scale: float) -> InputError:
    """Return the error that a piece is not as large as a piece of a garment can be; it names the unit that would be right.

    Args:
        size: the longest side of its box [m].
        file: from which it was read.
        scale: metres per unit of the file, as it was read.
    """
    fitting = [u for u, metres in METRES_PER_UNIT.items() if _USUAL[0] <= size / scale * metres <= _USUAL[1]]
    what = "larger than any garment" if size > 1 else "smaller than any piece of a garment"
    advice = " or ".join(f'units = "{unit}" ({size / scale * METRES_PER_UNIT[unit]:.3g} m)' for unit in fitting)
    return InputError(
        f"{file}: the piece would be {size:.4g} m long, {what}; "
        + (f"plausible: {advice}" if advice else "no usual unit makes it plausible: scale the mesh")
    )


def _likely_unit(size: float) -> str | None:
    """Return the unit in which a garment of this size [units of the file] is as large as one that is worn; None if there is none."""
    return next(
        (unit for unit in ("m", "dm", "cm", "mm") if _WORN[0] <= size * METRES_PER_UNIT[unit] <= _WORN[1]), None
    )


def extent_words(vertices: FloatArray, units: str | None) -> str:
    """Return the size of what was read in words, and a unit that is likelier where it is not that of a garment.

    Args:
        vertices: #V by 3, of all pieces [m].
        units: in which the file was read; None for the file's own.
    """
    sides = np.ptp(vertices, axis=0)
    size, tall = float(sides.max()), bool(sides[1] >= 0.5 * sides.max())
    words = f"reads as {sides[1] if tall else size:.3g} m {'tall' if tall else 'long'} ({' x '.join(f'{side:.3g}' for side in sides)} m)"
    likely = None if units is None else _likely_unit(size / METRES_PER_UNIT[units])
    if likely in (None, units) or _LIKELY[0] <= size <= _LIKELY[1]:
        return words
    return f"{words}; in {likely} it would be {size / METRES_PER_UNIT[units or 'm'] * METRES_PER_UNIT[likely or 'm']:.3g} m"
