"""The waist of a body, at which a garment may be cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpflat.core import InputError
from warpflat.flat import read_scan
from warpflat.garment import Slicer, common_body_of_scan, finer_body

__all__ = ["waist_of_body"]


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
        body = common_body_of_scan(vertices, faces, name=path.stem)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    cut = Slicer(body.vertices, finer_body()[1]).cut(np.array([0.0, 1.0, 0.0]), body.level("waist"))
    trunk = max((part.points for part in cut), key=lambda points: float(np.ptp(points[:, 0])))
    x, y, z = (scale * ((trunk.mean(axis=0) - body.shift) @ np.linalg.inv(body.turn))).tolist()
    return x, y, z
