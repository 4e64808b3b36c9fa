"""The `[mannequin]` table of a scene file, and the mannequin that it describes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpflat.core import InputError, Table, listening_to_reads
from warpflat.flat import read_scan
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.measurements import size_table
from warpflat.garment.mannequin.scan_pose import ScanOptions
from warpflat.pattern import MADE_TO_MEASURE

__all__ = ["MannequinTable", "mannequin_from_scan_file", "mannequin_from_table"]


class MannequinTable(Table):
    """A body: by size, by measurements [m], by a size of which measurements replace some, or by a scan."""

    size: str | None = None
    measurements: dict[str, float] | None = None
    table: Literal["women", "men", "children"] | None = None
    """Whose proportions complete the measurements; a size's own, or the women's, and the children's below 1.46 m."""
    scan: str | None = None
    """A mesh file, from the scene's folder on; may name environment variables."""
    units: str | None = None
    up: str | None = None
    facing: str | None = None
    landmarks: dict[str, float] = Field(default_factory=dict)
    pose: Literal["standing", "scan"] = "standing"
    symmetric: bool = True
    resolution_mm: Annotated[float, Field(ge=2.0, le=40.0)] = 10.0

    @model_validator(mode="after")
    def _one_source(self) -> MannequinTable:
        if (self.scan is None) == (self.size is None and self.measurements is None):
            raise ValueError(
                'give the body in one way: size = "EU 38" or [mannequin.measurements], or both, which replaces some of the size\'s; '
                'or scan = "FILE"'
            )
        if self.scan is not None and self.table is not None:
            raise ValueError("table completes measurements; a scan has its own: leave it out")
        of_scan = [key for key in ("units", "up", "facing", "landmarks") if getattr(self, key)]
        of_scan += ["pose"] if self.pose != "standing" else []
        of_scan += [] if self.symmetric else ["symmetric"]
        if self.scan is None and of_scan:
            body = "size" if self.size is not None else "measurements"
            raise ValueError(
                f"given with {body}, but of a scan only: {', '.join(of_scan)}; leave it out, or give a scan"
            )
        return self

    @property
    def size_name(self) -> str:
        """The name of the body's size on patterns."""
        if self.measurements is None and self.size is not None:
            return self.size
        return f"{self.size or ''} {MADE_TO_MEASURE}".strip()

    @property
    def label(self) -> str:
        """What lists call the body: its size, or its scan."""
        return self.size_name if self.scan is None else Path(self.scan).stem


def mannequin_from_table(table: MannequinTable, *, path_of: Callable[[str], Path]) -> Mannequin:
    """Return the mannequin of a scene's table.

    Args:
        table: checked.
        path_of: where a file named in the scene lies.

    Raises:
        InputError: an unknown size, one that another table completes, impossible measurements, or a scan that is no standing body.
    """
    given = dict(table.measurements or {})
    if table.size is not None:
        own = size_table(table.size)
        if table.table not in (None, own):
            raise InputError(
                f"size {table.size!r} is completed by the table {own!r}, not by {table.table!r}: leave the table out"
            )
        return Mannequin.from_size(table.size, resolution_mm=table.resolution_mm, **given)
    if table.measurements is not None:
        return Mannequin.from_measurements(table=table.table, resolution_mm=table.resolution_mm, **given)
    options = ScanOptions(
        unit=table.units, up=table.up, facing=table.facing, landmarks=table.landmarks, keep_pose=table.pose == "scan",
        symmetric=table.symmetric,
    )  # fmt: skip
    return mannequin_from_scan_file(path_of(str(table.scan)), options=options, resolution_mm=table.resolution_mm)


def mannequin_from_scan_file(path: Path, *, options: ScanOptions, resolution_mm: float) -> Mannequin:
    """Return the mannequin on a body scan in a mesh file.

    Raises:
        InputError: the file cannot be read as a mesh, or the mesh is no standing body.
    """
    sources: list[Path] = []
    with listening_to_reads(sources.append):
        vertices, faces = read_scan(path)
    try:
        mannequin = Mannequin.from_scan(vertices, faces, options=options, resolution_mm=resolution_mm)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return replace(mannequin, sources=tuple(sources))
