"""The waist of a body, at which a garment may be cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpflat.core.errors import InputError
from warpflat.mannequin.mannequin import Mannequin
from warpflat.surface.io.read import read_scan

__all__ = ["waist_of_body"]

# The waist's height needs no finer mannequin [mm].
_RESOLUTION = 20.0


def waist_of_body(path: Path, scale: float) -> tuple[float, float, float]:
    """Return a place at the height of a body's waist [m], as its file has the body.

    Args:
        path: of a mesh of a standing body, which is where the garment is worn.
        scale: metres per unit of the file.

    Raises:
        InputError: the file cannot be read as a mesh, or the mesh is no standing body.
    """
    vertices, faces = read_scan(path)
    try:
        body = Mannequin.from_scan(vertices, faces, resolution_mm=_RESOLUTION)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    assert body.scan is not None
    upright = body.scan[0][:, 1]
    share = (body.levels()["waist"].height - upright.min()) / np.ptp(upright)
    used = scale * vertices[np.unique(faces[faces >= 0])]
    # On the way from the lowest corner of its box to the highest, whichever of the axes is up.
    x, y, z = ((1.0 - share) * used.min(axis=0) + share * used.max(axis=0)).tolist()
    return x, y, z
