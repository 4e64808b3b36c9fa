"""Colours of the pieces in `frames.usdc`: one table for all, and for each vertex of a frame its row of that table.

A row takes a byte or two where a colour takes twelve.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.colours import energy_colours, linear_rgb

__all__ = ["COLOURS", "VertexColours", "define_colour_table"]

COLOURS = 1024


def define_colour_table(mesh: Any, scale: float) -> Any:
    """Author the table of a mesh's `displayColor`, whose last row is the energy `scale` [J/m2]; return the attribute of rows."""
    from pxr import Vt

    table = linear_rgb(energy_colours(np.arange(COLOURS) / (COLOURS - 1), 1.0)).astype(np.float32)
    primvar = mesh.GetDisplayColorPrimvar()
    primvar.Set(Vt.Vec3fArray.FromNumpy(table))
    primvar.GetAttr().SetCustomData(
        {"quantity": "strainEnergyDensity", "unit": "J/m2", "rangeMin": 0.0, "rangeMax": float(scale)}
    )
    return primvar.CreateIndicesAttr()


class VertexColours:
    """Rows of the colour table around the vertices of one topology: a vertex has the mean of its faces by area."""

    def __init__(self, faces: IntArray, areas: FloatArray, count: int) -> None:
        """
        Args:
            faces: #F by 4, -1 as the fourth corner of a triangle.
            areas: #F, that count [m2].
            count: the number of vertices.
        """
        from scipy.sparse import csr_array

        used = faces >= 0
        face, vertex = np.nonzero(used)[0], faces[used]
        # A sliver without area still counts a little, so that a vertex among slivers only has a colour.
        weights = areas + (1e-9 * float(areas.max(initial=0.0)) or 1.0)
        whole = np.bincount(vertex, weights=weights[face], minlength=count)
        self._shares = csr_array(
            ((weights[face] / whole[vertex]).astype(np.float32), (vertex, face)), shape=(count, len(faces))
        )

    def rows(self, density: NDArray[np.float32], scale: float) -> NDArray[np.int32]:
        """Return the row of each vertex (#V) for the energies of the faces (#F) [J/m2]; the last row is `scale`."""
        share = self._shares @ density
        share *= np.float32((COLOURS - 1) / scale)
        share += np.float32(0.5)
        return np.asarray(np.clip(share, 0, COLOURS - 1, out=share).astype(np.int32))
