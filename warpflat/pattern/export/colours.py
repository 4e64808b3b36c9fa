"""The colours of maps: scales of values, the colour map of energy, and values of faces as those of vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core import FloatArray, IntArray, weighted_percentile

__all__ = [
    "DRAFTED_CLOTH",
    "ENERGY",
    "LEAST_GAP",
    "LEAST_PRESSURE",
    "SHARE",
    "SKIN",
    "SMALLEST_SCALE",
    "Scale",
    "VertexColours",
    "energy_colours",
    "energy_scale",
    "linear_rgb",
]

#: The name of this module's own colour map.
ENERGY = "energy"
#: Colours of bodies, and of cloth that was drafted and bears no map, sRGB.
SKIN, DRAFTED_CLOTH = (0.88, 0.86, 0.82), (0.62, 0.64, 0.68)
#: The least upper ends of scales of gaps between cloth and body [mm], and of pressure on the skin [Pa].
LEAST_GAP, LEAST_PRESSURE = 5.0, 10.0
#: Of the cloth, by area, within a scale: a few sliver faces would otherwise make the rest of a map pale.
SHARE = 0.98


# Cloth of 1 kN/m stores this much per area at a strain of 4e-5. Below it a map would show rounding errors.
SMALLEST_SCALE = 1e-6  # [J/m2]

# Near-white where there is little energy, dark where there is much: legible on paper, in grey, and without red-green
# vision. Lightness falls evenly, so that lines and labels stay legible on most of a pattern.
_ANCHORS = np.array(
    [
        [0.965, 0.957, 0.925],
        [0.992, 0.910, 0.690],
        [0.996, 0.796, 0.478],
        [0.984, 0.640, 0.365],
        [0.945, 0.460, 0.325],
        [0.845, 0.285, 0.345],
        [0.690, 0.165, 0.385],
        [0.500, 0.095, 0.385],
        [0.310, 0.055, 0.325],
    ]
)

_CLOTH, _NO_VALUE = (0.955, 0.94, 0.90), "#c8c8c8"


def energy_colours(density: ArrayLike, scale: float) -> FloatArray:
    """Return sRGB colours (#N by 3, 0 to 1) of energy densities [J/m2] (#N), the last colour above `scale`."""
    shares, places = np.asarray(density, dtype=np.float64) / scale, np.linspace(0.0, 1.0, len(_ANCHORS))
    return np.stack([np.interp(shares, places, channel) for channel in _ANCHORS.T], axis=-1)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """What colour a value has.

    Attributes:
        low, high: its ends; values beyond them have the colours of the ends.
        colours: `ENERGY`, or a colour map of Matplotlib, drawn a little darker where it is white: cloth at rest must not look like paper.
    """

    low: float = 0.0
    high: float
    colours: str = ENERGY

    @classmethod
    def from_zero(cls, values: FloatArray, areas: FloatArray, least: float, colours: str = "YlOrRd") -> Scale:
        """Return the scale from 0 to a value that `SHARE` of the area does not pass, or to the `least` end."""
        return cls(high=max(least, weighted_percentile(values, areas, SHARE)), colours=colours)

    @classmethod
    def both_ways(cls, values: FloatArray, areas: FloatArray, least: float, most: float = np.inf) -> Scale:
        """Return the scale around 0, red above and blue below, whose ends lie from `least` to `most`."""
        reach = min(most, max(least, weighted_percentile(np.abs(values), areas, SHARE)))
        return cls(low=-reach, high=reach, colours="RdBu_r")

    @property
    def mappable(self) -> Any:
        """The scale as Matplotlib's colour bars take it; grey is what is not a number."""
        from matplotlib import colormaps
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import ListedColormap, Normalize

        places = np.linspace(0.0, 1.0, 256)
        if self.colours == ENERGY:
            shades = energy_colours(places, 1.0)
        else:
            shades = colormaps[self.colours](places)[:, :3] * _CLOTH
        return ScalarMappable(Normalize(self.low, self.high), ListedColormap(shades).with_extremes(bad=_NO_VALUE))

    def css(self) -> str:
        """Return the colours from end to end as the stops of a CSS gradient."""
        shades = 255.0 * self.rgb(np.linspace(self.low, self.high, 17))
        return ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in shades)

    def rgb(self, values: FloatArray) -> FloatArray:
        """Return the sRGB colours (#N by 3, 0 to 1) of values (#N)."""
        if self.colours == ENERGY:
            return energy_colours(values, self.high)
        return np.asarray(self.mappable.to_rgba(values)[:, :3])


def linear_rgb(colours: ArrayLike) -> FloatArray:
    """Convert sRGB to linear Rec. 709, the space in which USD reads ``displayColor`` (IEC 61966-2-1)."""
    srgb = np.asarray(colours, dtype=np.float64)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def energy_scale(density: ArrayLike, areas: ArrayLike) -> float:
    """Return the upper end of the colour scale [J/m2]: the value below which `SHARE` of the area stays, rounded up.

    The value is rounded up to 1, 1.5, 2, 2.5, 3, 4, 5, 6 or 8 times a power of ten, so that the scale is easy to read
    and to compare.

    Args:
        density: #F, energy per area [J/m2].
        areas: #F, the areas that count [m2].
    """
    robust = weighted_percentile(density, areas, SHARE)
    if not robust > SMALLEST_SCALE:
        return SMALLEST_SCALE
    steps = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])
    power = 10.0 ** np.floor(np.log10(robust))
    return float(power * steps[min(np.searchsorted(steps, robust / power * (1.0 - 1e-12)), len(steps) - 1)])


# Steps between the lowest energy and the highest.
_COLOURS = 1024


class VertexColours:
    """Values and colours of the vertices of one topology: a vertex has the mean of its faces by area."""

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

    def mean(self, values: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the values of the vertices (#V) for those of the faces (#F); 0 where no face is."""
        return np.asarray(self._shares @ values.astype(np.float32))

    def levels(self, density: NDArray[np.floating], scale: float, count: int) -> NDArray[np.int32]:
        """Return the level of each vertex (#V), from 0 to `count` - 1 at `scale`, for the energies of the faces (#F) [J/m2]."""
        share = self.mean(density)
        share *= np.float32((count - 1) / scale)
        share += np.float32(0.5)
        return np.asarray(np.clip(share, 0, count - 1, out=share).astype(np.int32))

    def shades(self, density: NDArray[np.floating], scale: float) -> NDArray[np.float32]:
        """Return the colour of each vertex (#V by 3, linear Rec. 709) for the energies of the faces (#F) [J/m2]."""
        table = linear_rgb(energy_colours(np.arange(_COLOURS) / (_COLOURS - 1), 1.0)).astype(np.float32)
        return np.asarray(table[self.levels(density, scale, _COLOURS)])
