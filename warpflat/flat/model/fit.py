"""The fit of a pattern when it is worn: strain, shear, tension, pressure, and regions beyond the fabric's limits.

Worn, the cloth lies on the body point for point as it was flattened. Strain and tension follow from that. The pressure
on the skin is the tension times the curvature of the body along it (Laplace's law).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.short_repr import short_repr
from warpflat.core.sorting import counting_sort
from warpflat.core.sums import weighted_percentiles
from warpflat.core.text import area_words
from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.fabric.limits import Amount, Demand
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import shear_angles, worn_cell_strain
from warpflat.flat.model.wear import smooth_face_values, thread_curvatures
from warpflat.flat.surface.connectivity import border_of, components
from warpflat.flat.surface.curvature import curvature_tensors
from warpflat.flat.surface.energy_map import place_in_words, smooth_to_vertices
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import corner_means

__all__ = ["MAPS", "TOUCHING", "Misfit", "WornFit", "assess_fit", "assess_pattern"]


# So much of the cloth may be strained or sheared beyond a limit: a corner's last face may be.
TOLERATED = 0.01

# Curvature that shears cloth is gathered over so far [m].
_CURVED_OVER = 0.03

# A surface within this distance of the body is meant to touch it [m]: 6 cm of ease around a trunk. Farther off cloth hangs.
TOUCHING = 0.010

MAPS: dict[str, tuple[str, float, str]] = {
    "strain_warp": ("worn strain along warp", 100.0, "%"),
    "strain_weft": ("worn strain along weft", 100.0, "%"),
    "shear": ("shear, as worn", 1.0, "degrees"),
    "tension_warp": ("tension along warp", 1.0, "N/m"),
    "tension_weft": ("tension along weft", 1.0, "N/m"),
    "pressure": ("pressure on the skin", 1.0, "Pa"),
}
"""The maps of a worn pattern by attribute: title, factor to the unit shown, and that unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Misfit:
    """A connected region of cloth that is beyond a limit of the fabric.

    Attributes:
        surface: whose cloth.
        faces: of the region.
        area: flat [m2].
        worst: what is asked of the cloth at its worst face, and the limit.
        vertex: the corner of that face around which most is asked.
    """

    surface: Surface = field(repr=False)
    faces: IntArray
    area: float
    worst: Amount
    vertex: int

    @cached_property
    def words(self) -> str:
        """The misfit and its place in words, for a pattern maker."""
        worst = self.worst
        return (
            f"{worst.state} {worst.words} (limit {worst.limit_words}), {place_in_words(self.surface, self.vertex)}; "
            f"{area_words(self.area)} beyond the limit"
        )

    @cached_property
    def relieved_at(self) -> int:
        """The vertex where a cut relieves it: the worst one of strained threads, and of sheared ones what is curved between them.

        Threads that keep their lengths u, v are sheared by the curvature K that lies between them, d2 shear / du dv = -K
        (Chebyshev 1878), and most of all far from it. Within twice the region's width the place of most curvature is taken.
        """
        if self.worst.way != "shear":
            return self.vertex
        points = self.surface.vertices
        tensors = curvature_tensors(self.surface)
        gaussian = 0.5 * np.abs(np.trace(tensors, axis1=1, axis2=2) ** 2 - (tensors**2).sum(axis=(1, 2)))
        of_faces = corner_means(gaussian, self.surface.faces)
        curved = smooth_to_vertices(self.surface, of_faces, smoothing_length=_CURVED_OVER)
        curved[np.linalg.norm(points - points[self.vertex], axis=1) > 2.0 * np.sqrt(self.area)] = 0.0
        curved[border_of(self.surface)] = 0.0
        return int(curved.argmax()) if curved.any() else self.vertex


@dataclass(frozen=True, kw_only=True, eq=False)
class WornFit:
    """The fit of a pattern as worn; arrays are #F, means over each face by flat area.

    Attributes:
        strain_warp, strain_weft: length on the body over length flat, minus 1.
        shear: angle by which warp and weft are off the right angle [degrees].
        tension_warp, tension_weft: force along the threads per width of the cloth as worn [N/m].
        pressure: on the skin [Pa]; 0 where the body is hollow and the cloth would lift off.
        area: flat [m2].
        demand: what is asked of each face, as shares of the fabric's limits.
        misfits: regions beyond a limit, largest first.
        held_misfits, slack_misfits: those that are held beyond it, and those that are only slack. A dart helps the ones, the others fold.
        hollow: share of the flat area where the tension would lift the cloth off.
        close: #F, true where the surface lies close to the wearer's body; None if it does everywhere. Elsewhere the cloth hangs, and is not
            held.
    """

    __repr__ = short_repr

    strain_warp: FloatArray
    strain_weft: FloatArray
    shear: FloatArray
    tension_warp: FloatArray
    tension_weft: FloatArray
    pressure: FloatArray
    area: FloatArray
    demand: Demand
    misfits: tuple[Misfit, ...] = field(default=())
    held_misfits: tuple[Misfit, ...] = field(default=())
    slack_misfits: tuple[Misfit, ...] = field(default=())
    hollow: float = 0.0
    close: BoolArray | None = None

    @property
    def limit(self) -> float:
        """The fabric's limit of strain."""
        return self.demand.fabric.strain_limit

    @property
    def shear_limit(self) -> float | None:
        """The fabric's limit of shear [degrees]; None of an isotropic sheet, which has no threads."""
        return None if self.demand.fabric.is_isotropic else self.demand.fabric.shear_limit

    @cached_property
    def outside(self) -> float:
        """The share of the flat area that is beyond a limit, slack cloth included; a place counts once, whichever limit it is."""
        return self.demand.outside(self.area)

    @cached_property
    def held(self) -> float:
        """The share of the flat area that is stretched or sheared beyond a limit where it lies close to the body."""
        return self._share(self.demand.held if self.close is None else self.demand.held & self.close)

    @cached_property
    def slack(self) -> float:
        """The share of the flat area that is longer than the surface by more than the limit: it lies in folds."""
        return self._share(self.demand.slack)

    @cached_property
    def held_regions(self) -> tuple[Misfit, ...]:
        """The regions that are held beyond a limit where they lie close to the body, largest first."""
        return tuple(each for each in self.held_misfits if self.close is None or self.close[each.faces].any())

    def _share(self, chosen: BoolArray) -> float:
        return float(self.area[chosen].sum() / max(float(self.area.sum()), 1e-300))

    @property
    def within_limits(self) -> bool:
        """True if at most 1 % of the piece is stretched or sheared beyond the fabric's limits; whether a garment fits says its verdict."""
        return self.held <= TOLERATED

    def as_dict(self) -> dict[str, Any]:
        """Return the entries for `metrics.json`: fractions, degrees, N/m and Pa, with percentiles by area, extremes and mean."""
        distributions = {}
        for name in MAPS:
            values, percents = getattr(self, name), (5, 50, 95)
            at = weighted_percentiles(values, self.area, [percent / 100 for percent in percents])
            percentiles = {f"p{percent:02d}": value for percent, value in zip(percents, at, strict=True)}
            mean = float(values @ self.area) / max(float(self.area.sum()), 1e-300)
            distributions[name] = {"min": float(values.min()), **percentiles, "max": float(values.max()), "mean": mean}
        return {
            "strain_limit": self.limit,
            "shear_limit": self.shear_limit,
            "outside": self.outside,
            "held": self.held,
            "slack": self.slack,
            "hollow": self.hollow,
            "where_not": [misfit.words for misfit in self.held_regions[:3]],
            "where_slack": [misfit.words for misfit in self.slack_misfits[:3]],
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


def assess_fit(network: SpringNetwork, positions: FloatArray) -> WornFit:
    """Return the fit of a layout (#V by 2 [m]) of the network's surface in the network's fabric, with any model.

    Args:
        network: of the piece.
        positions: #V by 2, its pattern [m].
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
    sheared = 2.0 * stress[:, 2] * lengths.prod(axis=1) / spread
    load = pull[:, 0] * along_warp + pull[:, 1] * along_weft + sheared * crossed

    face, faces = network.cell_arrays.face, len(surface.faces)
    face_area = np.bincount(face, area, minlength=faces).astype(np.float64)

    def mean(values: FloatArray) -> FloatArray:
        total = np.bincount(face, area * values, minlength=faces)
        return np.asarray(np.divide(total, face_area, out=np.zeros(faces), where=face_area > 0.0))

    weight = np.maximum(face_area, 0.0)
    strain_warp, strain_weft, shear = mean(strain[:, 0]), mean(strain[:, 1]), mean(shear_angles(strain))
    tension_warp, tension_weft, loaded = mean(pull[:, 0]), mean(pull[:, 1]), mean(load)
    # A million faces of them take a tenth of a gigabyte each, and the smoothing more.
    del strain, stress, lengths, spread, pull, load, along_warp, along_weft, crossed
    pressure = smooth_face_values(surface, loaded)
    # A stretch that is asked for beyond the limit is meant: the cloth is judged from there.
    asked = np.zeros((faces, 2)) if network.stretch is None else network.stretch - 1.0
    meant = np.where(asked > fabric.strain_limit, asked, 0.0)
    demand = Demand.of(fabric, strain_warp - meant[:, 0], strain_weft - meant[:, 1], shear)
    total_area = max(float(weight.sum()), 1e-300)

    def regions(chosen: BoolArray, most: FloatArray, shares: FloatArray) -> tuple[Misfit, ...]:
        """Return the connected regions of chosen faces (#F), the largest first, by what is asked of each face, and of its ways."""
        outside, way = np.flatnonzero(chosen), shares.argmax(axis=1)
        if not len(outside):
            return ()
        part = components(surface.faces[outside])
        count = int(part.max()) + 1
        order, begin = counting_sort(part.astype(np.int32), count)
        members = outside[order].astype(np.int32)
        area = np.bincount(part, weight[outside], minlength=count)
        # Of each region the face of which most is asked, and of several the first.
        worst = outside[np.lexsort((-most[outside], part))[begin[:-1]]]
        # And of that face the corner around which most is asked, which is the same one on both sides of the body.
        corners, used = surface.faces[worst], surface.faces >= 0
        at = surface.faces[used]
        around = np.bincount(at, np.broadcast_to(most[:, None], used.shape)[used]) / np.maximum(np.bincount(at), 1)
        vertices = corners[np.arange(count), np.where(corners >= 0, around[corners].round(9), -np.inf).argmax(axis=1)]
        return tuple(
            Misfit(
                surface=surface,
                faces=members[begin[k] : begin[k + 1]],
                area=float(area[k]),
                worst=demand.amount(int(worst[k]), int(way[worst[k]])),
                vertex=int(vertices[k]),
            )
            for k in np.argsort(-area, kind="stable").tolist()
        )

    return WornFit(
        strain_warp=strain_warp,
        strain_weft=strain_weft,
        shear=shear,
        tension_warp=tension_warp,
        tension_weft=tension_weft,
        pressure=np.maximum(pressure, 0.0),
        area=weight,
        demand=demand,
        misfits=regions(demand.beyond, demand.most, np.abs(demand.shares)),
        held_misfits=regions(demand.held, demand.held_shares.max(axis=1), demand.held_shares),
        slack_misfits=regions(demand.slack, demand.most, np.abs(demand.shares)),
        hollow=float(weight[pressure < -1e-9 * max(float(np.abs(pressure).max()), 1e-300)].sum()) / total_area,
    )
