"""The fit of a pattern when it is worn: strain, tension, pressure, and regions beyond the fabric's limit.

Worn, the cloth lies on the body point for point as it was flattened. Strain and tension follow from that. The pressure
on the skin is the tension times the curvature of the body along it (Laplace's law).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.short_repr import short_repr
from warpflat.core.sorting import counting_sort
from warpflat.core.sums import weighted_percentiles
from warpflat.fabric.fabric import Fabric
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import worn_cell_strain
from warpflat.model.wear import SKIN_LENGTH, smooth_face_values, thread_curvatures
from warpflat.surface.connectivity import components
from warpflat.surface.energy_map import place_in_words
from warpflat.surface.mesh import Surface

__all__ = ["MAPS", "Misfit", "WornFit", "assess_fit", "assess_pattern"]


# A pattern fits if less than this share of its cloth is strained beyond the limit: a corner's last face may be.
TOLERATED = 0.01

MAPS: dict[str, tuple[str, float, str]] = {
    "strain_warp": ("worn strain along warp", 100.0, "%"),
    "strain_weft": ("worn strain along weft", 100.0, "%"),
    "strain_bias": ("worn strain on the bias", 100.0, "%"),
    "tension_warp": ("tension along warp", 1.0, "N/m"),
    "tension_weft": ("tension along weft", 1.0, "N/m"),
    "pressure": ("pressure on the skin", 1.0, "Pa"),
}
"""The maps of a worn pattern by attribute: title, factor to the unit shown, and that unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Misfit:
    """A connected region of cloth that is strained beyond the fabric's limit.

    Attributes:
        surface: whose cloth.
        faces: of the region.
        area: flat [m2].
        worst: the strain furthest beyond the limit. limit: the fabric's.
        thread: "warp" or "weft".
        vertex: a corner of the worst face.
    """

    surface: Surface = field(repr=False)
    faces: IntArray
    area: float
    worst: float
    limit: float
    thread: str
    vertex: int

    @cached_property
    def words(self) -> str:
        """The misfit and its place in words, for a pattern maker."""
        state = "stretched" if self.worst > 0 else "slack"
        return (
            f"{state} {100 * abs(self.worst):.1f} % along {self.thread} (limit {100 * self.limit:.3g} %), "
            f"{place_in_words(self.surface, self.vertex)}; {1e4 * self.area:.3g} cm2 beyond the limit"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class WornFit:
    """The fit of a pattern as worn; arrays are #F, means over each face by flat area.

    Attributes:
        strain_warp, strain_weft: length on the body over length flat, minus 1.
        strain_bias: the larger of those along both bisectors of warp and weft.
        shear: angle by which warp and weft are off the right angle [rad].
        tension_warp, tension_weft: force along the threads per width of the cloth as worn [N/m].
        pressure: on the skin [Pa]; 0 where the body is hollow and the cloth would lift off.
        area: flat [m2].
        limit: the fabric's.
        misfits: regions beyond the limit, largest first.
        outside: share of the flat area that is beyond the limit.
        hollow: share of the flat area where the tension would lift the cloth off.
    """

    __repr__ = short_repr

    strain_warp: FloatArray
    strain_weft: FloatArray
    strain_bias: FloatArray
    shear: FloatArray
    tension_warp: FloatArray
    tension_weft: FloatArray
    pressure: FloatArray
    area: FloatArray
    limit: float
    misfits: tuple[Misfit, ...] = field(default=())
    outside: float = 0.0
    hollow: float = 0.0

    @property
    def fits(self) -> bool:
        """True if at most 1 % of the cloth is strained beyond the fabric's limit, stretched or slack."""
        return self.outside <= TOLERATED

    def as_dict(self) -> dict[str, Any]:
        """Return the entries for `metrics.json`: fractions, N/m and Pa, with percentiles by area, extremes and mean."""
        distributions = {}
        for name in MAPS:
            values, percents = getattr(self, name), (5, 50, 95)
            at = weighted_percentiles(values, self.area, [percent / 100 for percent in percents])
            percentiles = {f"p{percent:02d}": value for percent, value in zip(percents, at, strict=True)}
            mean = float(values @ self.area) / max(float(self.area.sum()), 1e-300)
            distributions[name] = {"min": float(values.min()), **percentiles, "max": float(values.max()), "mean": mean}
        return {
            "fits": self.fits,
            "strain_limit": self.limit,
            "outside": self.outside,
            "hollow": self.hollow,
            "where_not": [misfit.words for misfit in self.misfits[:3]],
            **distributions,
        }


def assess_pattern(surface: Surface, fabric: Fabric, pattern: ArrayLike, *, grain_angle: float = 0.0) -> WornFit:
    """Return the fit of a given pattern of a surface in a fabric.

    Args:
        surface: the piece on the body.
        fabric: the cloth.
        pattern: #V by 2 [m], the piece flat, its grain along +y, or turned from it by `grain_angle` degrees.
        grain_angle: of the warp against +y, degrees.

    Raises:
        InputError: the pattern has another shape, or numbers that are not finite.
    """
    flat = np.asarray(pattern, dtype=np.float64)
    if flat.shape != (len(surface.vertices), 2) or not np.isfinite(flat).all():
        raise InputError(f"pattern has shape {flat.shape}; must be ({len(surface.vertices)}, 2) finite numbers [m]")
    return assess_fit(SpringNetwork.build(surface, fabric, flat, grain_angle=grain_angle, device="cpu"), flat)


def assess_fit(network: SpringNetwork, positions: FloatArray, *, smoothing_length: float = SKIN_LENGTH) -> WornFit:
    """Return the fit of a layout (#V by 2 [m]) of the network's surface in the network's fabric, with any model.

    Args:
        network: of the piece.
        positions: #V by 2, its pattern [m].
        smoothing_length: over which the pressure is averaged [m].
    """
    fabric, surface = network.fabric, network.surface
    # By the fabric's own law with its curves, with any model.
    strain, stress, _, area = (np.array(of.numpy()) for of in worn_cell_strain(network, positions, "membrane"))
    area = np.maximum(area, 0.0)
    along_warp, along_weft, crossed = thread_curvatures(network, positions)
    lengths = 1.0 + strain[:, :2]
    # sigma = P F^T / J: force per worn width, and per worn area times curvature.
    spread = np.maximum(np.sqrt(np.maximum((lengths[:, 0] * lengths[:, 1]) ** 2 - strain[:, 2] ** 2, 0.0)), 1e-12)
    pull = stress[:, :2] * lengths / spread[:, None]
    load = pull[:, 0] * along_warp + pull[:, 1] * along_weft + 2.0 * stress[:, 2] * crossed / spread
    unit = lengths[:, 0] ** 2 + lengths[:, 1] ** 2
    bias = np.sqrt(np.maximum(0.5 * (unit + 2.0 * np.abs(strain[:, 2])), 0.0)) - 1.0
    sine = np.clip(strain[:, 2] / np.maximum(lengths[:, 0] * lengths[:, 1], 1e-12), -1.0, 1.0)

    face, faces = network.cell_arrays.face, len(surface.faces)
    face_area = np.bincount(face, area, minlength=faces).astype(np.float64)

    def mean(values: FloatArray) -> FloatArray:
        total = np.bincount(face, area * values, minlength=faces)
        return np.asarray(np.divide(total, face_area, out=np.zeros(faces), where=face_area > 0.0))

    weight = np.maximum(face_area, 0.0)
    strain_warp, strain_weft = mean(strain[:, 0]), mean(strain[:, 1])
    strain_bias, shear = mean(bias), mean(np.arcsin(sine))
    tension_warp, tension_weft, loaded = mean(pull[:, 0]), mean(pull[:, 1]), mean(load)
    # A million faces of them take a tenth of a gigabyte each, and the smoothing more.
    del strain, stress, lengths, spread, pull, load, unit, bias, sine, along_warp, along_weft, crossed
    pressure = smooth_face_values(surface, loaded, smoothing_length)
    # A stretch that is asked for beyond the limit is meant: the cloth is judged from there.
    asked = np.zeros((faces, 2)) if network.stretch is None else network.stretch - 1.0
    held = np.column_stack([strain_warp, strain_weft]) - np.where(asked > fabric.strain_limit, asked, 0.0)
    excess = np.abs(held).max(axis=1) - fabric.strain_limit
    total_area = max(float(weight.sum()), 1e-300)
    # Regions that are held beyond the limit, the largest first.
    outside, misfits = np.flatnonzero(excess > 1e-9), list[Misfit]()
    if len(outside):
        part = components(surface.faces[outside])
        count = int(part.max()) + 1
        order, begin = counting_sort(part.astype(np.int32), count)
        members = outside[order].astype(np.int32)
        regions = np.bincount(part, weight[outside], minlength=count)
        # Of each region the face of the largest excess, and of several the first.
        worst = outside[np.lexsort((-excess[outside], part))[begin[:-1]]]
        on_warp = np.abs(held[worst, 0]) >= np.abs(held[worst, 1])
        largest = np.where(on_warp, strain_warp[worst], strain_weft[worst])
        for k in np.argsort(-regions, kind="stable").tolist():
            misfits.append(
                Misfit(
                    surface=surface,
                    faces=members[begin[k] : begin[k + 1]],
                    area=float(regions[k]),
                    worst=float(largest[k]),
                    limit=fabric.strain_limit,
                    thread="warp" if on_warp[k] else "weft",
                    vertex=int(surface.faces[worst[k], 0]),
                )
            )
    return WornFit(
        strain_warp=strain_warp,
        strain_weft=strain_weft,
        strain_bias=strain_bias,
        shear=shear,
        tension_warp=tension_warp,
        tension_weft=tension_weft,
        pressure=np.maximum(pressure, 0.0),
        area=weight,
        limit=fabric.strain_limit,
        misfits=tuple(misfits),
        outside=float(weight[outside].sum()) / total_area,
        hollow=float(weight[pressure < -1e-9 * max(float(np.abs(pressure).max()), 1e-300)].sum()) / total_area,
    )
