"""Left and right of a scanned body: by how much they differ, and their average."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.mannequin.layout import Layout
from warpflat.mannequin.normals import vertex_normals
from warpflat.mannequin.profiles import convex_girth, scale_to_girth

__all__ = ["average_sides", "sides_note"]

# Left and right may differ by so much [m] before a note says so.
_TOLD = 0.010


def average_sides(vertices: FloatArray, layout: Layout) -> FloatArray:
    """Return the average of a body and its mirror image, girths kept (layout.vertex_count by 3 [m])."""
    out = 0.5 * (vertices + _mirror_image(vertices, layout))
    for ring in layout.rings[: layout.level_row["bust"] + 1]:
        out[ring] = scale_to_girth(out[ring], convex_girth(vertices[ring]))
    for grid in layout.legs.values():
        for row in grid[layout.leg_row["leg_thigh"] :]:
            girth = 0.5 * (convex_girth(vertices[row]) + convex_girth(vertices[layout.mirror[row]]))
            out[row] = scale_to_girth(out[row], girth)
    return out


def sides_note(vertices: FloatArray, layout: Layout, *, averaged: bool) -> tuple[str, ...]:
    """Return one sentence if left and right of a body differ by more than 10 mm across its surface, else nothing.

    Args:
        vertices: layout.vertex_count by 3 [m], before they are averaged.
        layout: the grid.
        averaged: whether they will be.
    """
    normals = vertex_normals(vertices, layout.faces)
    apart = np.abs(np.einsum("vk,vk->v", vertices - _mirror_image(vertices, layout), normals))
    limbs = {"arms": list(layout.arms.values()), "legs": list(layout.legs.values())}
    parts = {name: np.unique(np.concatenate([grid.ravel() for grid in grids])) for name, grids in limbs.items()}
    parts = {"trunk": np.setdiff1d(np.arange(layout.vertex_count), np.concatenate([*parts.values()])), **parts}
    unlike = []
    for name, of_part in parts.items():
        worst = of_part[np.argmax(apart[of_part])]
        if apart[worst] > _TOLD:
            unlike.append(f"{name} by up to {1000.0 * apart[worst]:.0f} mm at a height of {vertices[worst, 1]:.2f} m")
    if not unlike:
        return ()
    done = "their average is taken; symmetric = false keeps them" if averaged else "they are kept"
    return (f"left and right differ: {', '.join(unlike)}; {done}",)


def _mirror_image(vertices: FloatArray, layout: Layout) -> FloatArray:
    return vertices[layout.mirror] * np.array([-1.0, 1.0, 1.0])
