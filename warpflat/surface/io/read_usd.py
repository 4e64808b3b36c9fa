"""A mesh of a USD file, which is read in a process of its own."""

from __future__ import annotations

from pathlib import Path

from warpflat.core.input_files import note_read
from warpflat.core.usd_process import read_apart
from warpflat.surface.io.usd_stage import UsdMesh

__all__ = ["read_usd"]


def read_usd(path: Path, *, prim: str | None = None, metres_per_unit: float | None = None) -> UsdMesh:
    """Read one mesh prim of a USD file, in a process of its own.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        prim: the path of the mesh prim, or its name where that is unique; needed if there are several.
        metres_per_unit: overrides what the stage says.

    Raises:
        InputError: without the file's name: if the file is no stage, or there is no such mesh.
        OSError: it cannot be opened.
    """
    # The modules of `warpflat.surface` would bring Warp with them, which takes a second to load.
    result = read_apart(
        "warpflat.surface.io.usd_stage:read_usd_stage", path, prim=prim, metres_per_unit=metres_per_unit
    )
    assert isinstance(result, UsdMesh)
    for layer in result.layers:
        note_read(layer)
    return result
