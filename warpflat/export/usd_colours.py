"""Colours of the pieces in `frames.usdc`: for each vertex the mean energy of its faces, on one scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.colours import energy_colours, linear_rgb

__all__ = ["VertexColours"]

# Steps between the lowest energy and the highest.
_COLOURS = 1024


class VertexColours:
    """Colours of the vertices of one topology: a vertex has the mean energy of its faces by area."""

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

    def levels(self, density: NDArray[np.floating], scale: float, count: int) -> NDArray[np.int32]:
        """Return the level of each vertex (#V), from 0 to `count` - 1 at `scale`, for the energies of the faces (#F) [J/m2]."""
        share = self._shares @ density.astype(np.float32)
        share *= np.float32((count - 1) / scale)
        share += np.float32(0.5)
        return np.asarray(np.clip(share, 0, count - 1, out=share).astype(np.int32))

    def shades(self, density: NDArray[np.floating], scale: float) -> NDArray[np.float32]:
        """Return the colour of each vertex (#V by 3, linear Rec. 709) for the energies of the faces (#F) [J/m2]."""
        table = linear_rgb(energy_colours(np.arange(_COLOURS) / (_COLOURS - 1), 1.0)).astype(np.float32)
        return np.asarray(table[self.levels(density, scale, _COLOURS)])
