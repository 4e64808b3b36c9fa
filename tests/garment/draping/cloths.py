"""Small sheets of cloth, and bodies under them, made without flattening anything."""

from __future__ import annotations

import numpy as np
import warp as wp
from devices import DEVICE
from surface_meshes import quads_between

from warpflat.flat.fabric.fabric import Fabric
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.sewn_cloth import SewnCloth

__all__ = ["cloth_of", "cylinder_body", "cylinder_cloth", "grid", "sheet"]


def cloth_of(**changes: float) -> Fabric:
    values = {
        "stiffness_warp": 1900.0, "stiffness_weft": 1500.0, "shear_stiffness": 26.0, "areal_density": 0.168,
        "bending": 1e-5,
    }  # fmt: skip
    return Fabric(name="cloth", **(values | changes))  # type: ignore[arg-type]


def grid(rows: int, columns: int) -> np.ndarray:
    """The faces of a grid of vertices, row by row."""
    return quads_between((rows, columns))


def sheet(flat: np.ndarray, space: np.ndarray, faces: np.ndarray, fabric: Fabric) -> SewnCloth:
    """One piece whose warp is +y."""
    count = len(faces)
    return SewnCloth(
        fabric=fabric, designed=space, faces=faces, flat_faces=faces, flat=flat,
        welded=np.arange(len(flat), dtype=np.int32), warp=np.tile([0.0, 1.0], (count, 1)),
        weft=np.tile([1.0, 0.0], (count, 1)), piece_faces={"piece": slice(0, count)},
        piece_vertices={"piece": slice(0, len(flat))}, lines={},
    )  # fmt: skip


def cylinder_cloth(fabric: Fabric, *, scale: float, radius: float, height: float, columns: int, rows: int) -> SewnCloth:
    """Half a cylinder about the y axis; its pattern is as wide as it is, times `scale`."""
    angle, y = np.linspace(-np.pi / 2, np.pi / 2, columns), np.linspace(0.0, height, rows)
    a, h = (each.ravel() for each in np.meshgrid(angle, y))
    chord = 2.0 * radius * np.sin(0.5 * (angle[1] - angle[0]))
    across = np.tile(scale * chord * np.arange(columns), rows)
    space = np.column_stack([radius * np.sin(a), h, radius * np.cos(a)])
    return sheet(np.column_stack([across, h]), space, grid(rows, columns), fabric)


def cylinder_body(*, radius: float, height: float, columns: int) -> Body:
    """A whole cylinder about the y axis with the vertices of `cylinder_cloth`, longer at both ends."""
    around, rows = 2 * (columns - 1), 9
    a, h = np.meshgrid(np.arange(around) * (2.0 * np.pi / around) + np.pi / 2, np.linspace(-0.05, height + 0.05, rows))
    i = np.arange(around * rows, dtype=np.int32).reshape(rows, around)
    ahead = np.roll(i, -1, axis=1)
    faces = np.stack([i[:-1], ahead[:-1], ahead[1:], i[1:]], axis=-1).reshape(-1, 4)
    space = np.column_stack([radius * np.sin(a.ravel()), h.ravel(), radius * np.cos(a.ravel())])
    return Body(space, faces, device=wp.get_device(DEVICE))
