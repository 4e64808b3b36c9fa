"""The `[mannequin]` table of a scene file, and the mannequin it asks for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpflat.errors import InputError
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.scan_pose import ScanOptions
from warpflat.toml_file import Table

__all__ = ["MannequinTable", "mannequin_from_scan_file", "mannequin_from_table"]


class MannequinTable(Table):
    """A body: by size, by measurements [m], or by a scan. Exactly one of the three."""

    size: str | None = None
    measurements: dict[str, float] | None = None
    table: Literal["women", "men"] = "women"
    """Whose proportions complete the measurements."""
    scan: str | None = None
    """A mesh file, from the scene's folder on; may name environment variables."""
    units: str | None = None
    up: str | None = None
    facing: str | None = None
    landmarks: dict[str, float] = Field(default_factory=dict)
    mirror: bool = False
    resolution_mm: Annotated[float, Field(ge=2.0, le=60.0)] = 10.0

    @model_validator(mode="after")
    def _one_source(self) -> MannequinTable:
        if sum(source is not None for source in (self.size, self.measurements, self.scan)) != 1:
            raise ValueError('give the body in one way: size = "EU 38", [mannequin.measurements], or scan = "FILE"')
        of_scan = [key for key in ("units", "up", "facing", "landmarks", "mirror") if getattr(self, key)]
        if self.scan is None and of_scan:
            body = "size" if self.size is not None else "measurements"
            raise ValueError(
                f"given with {body}, but of a scan only: {', '.join(of_scan)}; leave it out, or give a scan"
            )
        return self


def mannequin_from_table(table: MannequinTable, *, path_of: Callable[[str], Path]) -> Mannequin:
    """The mannequin of a scene's table.

    Args:
        table: checked.
        path_of: where a file named in the scene lies.

    Raises:
        InputError: an unknown size, impossible measurements, or a scan that is no standing body.
    """
    if table.size is not None:
        return Mannequin.from_size(table.size, resolution_mm=table.resolution_mm)
    if table.measurements is not None:
        return Mannequin.from_measurements(
            table=table.table, resolution_mm=table.resolution_mm, **dict(table.measurements)
        )
    options = ScanOptions(
        unit=table.units, up=table.up, facing=table.facing, landmarks=table.landmarks, mirror=table.mirror
    )
    return mannequin_from_scan_file(path_of(str(table.scan)), options=options, resolution_mm=table.resolution_mm)


def mannequin_from_scan_file(path: Path, *, options: ScanOptions, resolution_mm: float) -> Mannequin:
    """The mannequin on a body scan in a mesh file.

    Raises:
        InputError: the file cannot be read as a mesh, or the mesh is no standing body.
    """
    import trimesh

    if not path.exists():
        raise InputError(f"{path}: no such file; give the mesh of a body (OBJ, PLY, STL, GLB)")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the mesh of a body (OBJ, PLY, STL, GLB)")
    try:
        mesh = trimesh.load(path, process=False, force="mesh")
        vertices, faces = mesh.vertices.view(), mesh.faces.view()
    except Exception as error:  # whatever a reader makes of noise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cannot be read as a mesh ({reason}); OBJ, PLY, STL and GLB can") from None
    if len(faces) == 0:
        raise InputError(f"{path}: has no faces; give the mesh of a body")
    try:
        return Mannequin.from_scan(vertices, faces, options=options, resolution_mm=resolution_mm)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
