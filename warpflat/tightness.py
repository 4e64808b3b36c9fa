"""Tightness: how a pattern sits when it is worn, and how much smaller it is cut to sit tight.

Worn, the cloth lies on the body point for point as it was flattened. Strain and tension follow from that, and what the
cloth presses onto the skin is its tension times the curvature of the body along it (Laplace's law).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpflat.arrays import FloatArray, IntArray
from warpflat.errors import InputError, is_number
from warpflat.fabric import Fabric, grain_axes
from warpflat.kernels.curvature import bend_threads
from warpflat.launching import launch_each
from warpflat.membrane import plane_stress
from warpflat.network import SpringNetwork
from warpflat.strain import worn_cells
from warpflat.strain_map import place_in_words, smooth_to_vertices
from warpflat.surface import Surface
from warpflat.surface.curvature import curvature_tensors

__all__ = ["MAPS", "Misfit", "Wear", "WornFit", "assess_fit", "assess_pattern", "meant_stretch", "unused_stretch"]


# Cloth bridges what is smaller than this, and a scan is rough below it: curvature is taken over such lengths [m].
SKIN_LENGTH = 0.01
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
"""What is known of each face: a name for people, the factor to their unit, and that unit."""


@dataclass(frozen=True, kw_only=True)
class Wear:
    """How a garment is meant to be worn.

    Attributes:
        stretch_warp, stretch_weft: so much longer the cloth is on the body than flat; 0.2 for 20 %.
        pressure: on the skin [Pa], if that is what is asked for; the threads that run around the body, across its stronger
            curvature, get the stretch that gives it, face by face, and the other ones the stretch given here.
    """

    stretch_warp: float = 0.0
    stretch_weft: float = 0.0
    pressure: float | None = None

    def __post_init__(self) -> None:
        for key, highest, unit in (("stretch_warp", 2.0, ""), ("stretch_weft", 2.0, ""), ("pressure", 20_000.0, "Pa")):
            value = getattr(self, key)
            if value is None and key == "pressure":
                continue
            if not (is_number(value) and math.isfinite(value)):
                raise InputError(f"wear: {key} = {value!r} is not a number")
            if not 0.0 <= value <= highest:
                hint = f" (if that is in percent, write {value / 100:g})" if unit == "" and 2.0 < value <= 100.0 else ""
                raise InputError(
                    f"wear: {key} = {value:g} {unit}".rstrip() + f"; must be 0 to {highest:g} {unit}{hint}"
                )
        if self.pressure and self.stretch_warp > 0.0 and self.stretch_weft > 0.0:
            raise InputError(
                "wear: a pressure sets the stretch of the threads that run around the body: give stretch_warp or stretch_weft, that of "
                "the other threads, not both"
            )

    @property
    def is_tight(self) -> bool:
        """Whether anything but the body's own size is asked for."""
        return self.stretch_warp > 0.0 or self.stretch_weft > 0.0 or bool(self.pressure)


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
        """What is wrong and where, for a pattern maker. Seldom asked for: a rough mesh has thousands of regions."""
        state = "stretched" if self.worst > 0 else "slack"
        return (
            f"{state} {100 * abs(self.worst):.1f} % along {self.thread} (limit {100 * self.limit:.3g} %), "
            f"{place_in_words(self.surface, self.vertex)}; {1e4 * self.area:.3g} cm2 beyond the limit"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class WornFit:
    """A pattern as worn. Arrays are #F, means over each face by flat area.

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
        """Whether no more than 1 % of the cloth is strained beyond the fabric's limit, either way."""
        return self.outside <= TOLERATED

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`: fractions, N/m and Pa, each at 5, 50 and 95 % of the area, least, most and mean."""
        return {
            "fits": self.fits,
            "strain_limit": self.limit,
            "outside": self.outside,
            "hollow": self.hollow,
            "where_not": [misfit.words for misfit in self.misfits[:3]],
            **{name: _spread(getattr(self, name), self.area) for name in MAPS},
        }


def _spread(values: FloatArray, area: FloatArray) -> dict[str, float]:
    from warpflat.export.colours import weighted_percentiles

    percents = (5, 50, 95)
    at = weighted_percentiles(values, area, [percent / 100 for percent in percents])
    spread = {f"p{percent:02d}": value for percent, value in zip(percents, at, strict=True)}
    mean = float(values @ area) / max(float(area.sum()), 1e-300)
    return {"min": float(values.min()), **spread, "max": float(values.max()), "mean": mean}


def assess_pattern(surface: Surface, fabric: Fabric, pattern: ArrayLike, *, grain_angle: float = 0.0) -> WornFit:
    """How a given pattern of a surface sits in a fabric.

    Args:
        surface: the piece on the body.
        fabric: the cloth.
        pattern: #V by 2 [m], the piece flat, its grain along +y, or turned from it by `grain_angle` degrees.
        grain_angle: of the warp against +y, degrees.

    Raises:
        InputError: the pattern is no such array.
    """
    flat = np.asarray(pattern, dtype=np.float64)
    if flat.shape != (len(surface.vertices), 2) or not np.isfinite(flat).all():
        raise InputError(f"pattern has shape {flat.shape}; must be ({len(surface.vertices)}, 2) finite numbers [m]")
    return assess_fit(SpringNetwork.build(surface, fabric, flat, grain_angle=grain_angle, device="cpu"), flat)


def assess_fit(network: SpringNetwork, positions: FloatArray, *, smoothing_length: float = SKIN_LENGTH) -> WornFit:
    """How a layout (#V by 2 [m]) of the network's surface sits in the network's fabric, whatever the model.

    Args:
        network: of the piece.
        positions: #V by 2, its pattern [m].
        smoothing_length: over which the pressure is averaged [m].
    """
    fabric, surface = network.fabric, network.surface
    # By the fabric's own law with its curves, whatever the model.
    strain, stress, _, area = (np.array(of.numpy()) for of in worn_cells(network, positions, "membrane"))
    area = np.maximum(area, 0.0)
    along_warp, along_weft, crossed = _curvature_along(network, positions)
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

    pressure = _smoothed(surface, mean(load), smoothing_length)
    weight = np.maximum(face_area, 0.0)
    strain_warp, strain_weft = mean(strain[:, 0]), mean(strain[:, 1])
    excess = np.maximum(np.abs(strain_warp), np.abs(strain_weft)) - fabric.strain_limit
    total_area = max(float(weight.sum()), 1e-300)
    return WornFit(
        strain_warp=strain_warp,
        strain_weft=strain_weft,
        strain_bias=mean(bias),
        shear=mean(np.arcsin(sine)),
        tension_warp=mean(pull[:, 0]),
        tension_weft=mean(pull[:, 1]),
        pressure=np.maximum(pressure, 0.0),
        area=weight,
        limit=fabric.strain_limit,
        misfits=_misfits(surface, strain_warp, strain_weft, excess, weight, fabric.strain_limit),
        outside=float(weight[excess > 1e-9].sum()) / total_area,
        hollow=float(weight[pressure < -1e-9 * max(float(np.abs(pressure).max()), 1e-300)].sum()) / total_area,
    )


def _curvature_along(network: SpringNetwork, positions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """#C each: curvature of the body along the worn warp, along the worn weft, and the twist between them [1/m]."""
    cells, surface = network.cell_arrays, network.surface
    warp, weft = (wp.vec2d(*axis) for axis in grain_axes(network.grain_angle))
    along = np.empty((len(cells.laid), 4))
    body = [surface.vertices, cells.corner, cells.laid, curvature_tensors(surface)]
    launch_each(bend_threads, len(along), [np.asarray(positions, dtype=np.float64), *body, warp, weft], [along])
    if float(along[:, 3] @ cells.area) < 0.0:
        # Wound the other way round: a body is convex on the whole.
        along = -along
    return along[:, 0], along[:, 1], along[:, 2]


def _smoothed(surface: Surface, values: FloatArray, length: float) -> FloatArray:
    at_vertices = smooth_to_vertices(surface, values, smoothing_length=length)
    used = surface.faces >= 0
    corners = np.where(used, at_vertices[np.maximum(surface.faces, 0)], 0.0)
    return np.asarray(corners.sum(axis=1) / used.sum(axis=1))


def _misfits(
    surface: Surface, warp: FloatArray, weft: FloatArray, excess: FloatArray, area: FloatArray, limit: float
) -> tuple[Misfit, ...]:
    from warpflat.surface.topology import components, order_by

    outside = np.flatnonzero(excess > 1e-9)
    if len(outside) == 0:
        return ()
    part = components(surface.faces[outside])
    order, begin = order_by(part.astype(np.int32), int(part.max()) + 1)
    found = []
    for faces in np.split(outside[order], begin[1:-1]):
        worst = faces[np.argmax(excess[faces])]
        on_warp = abs(warp[worst]) >= abs(weft[worst])
        found.append(
            Misfit(
                surface=surface,
                faces=faces.astype(np.int32),
                area=float(area[faces].sum()),
                worst=float(warp[worst] if on_warp else weft[worst]),
                limit=limit,
                thread="warp" if on_warp else "weft",
                vertex=int(surface.faces[worst, 0]),
            )
        )
    return tuple(sorted(found, key=lambda misfit: -misfit.area))


def meant_stretch(
    surface: Surface, fabric: Fabric, positions: FloatArray, wear: Wear, *, grain_angle: float = 0.0
) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Length worn over length flat that is meant, per face along warp and weft, and notes.

    For a pressure, p = T_warp k_warp / s_weft + T_weft k_weft / s_warp is solved for the stretch s of the threads that run
    across the stronger curvature k, with the fabric's own curve for their tension T; k is that along the threads of the
    layout, averaged over 10 mm. No stretch goes beyond the fabric's limit.

    Args:
        surface: the piece on the body.
        fabric: the cloth.
        positions: #V by 2, a layout, for the directions of the threads [m].
        wear: what is meant.
        grain_angle: of the warp against +y, degrees.

    Returns:
        #F by 2, or None where the pattern is to be of the body's own size.
    """
    if not wear.is_tight:
        return None, ()
    stretch = np.tile([1.0 + wear.stretch_warp, 1.0 + wear.stretch_weft], (len(surface.faces), 1))
    if not wear.pressure:
        return stretch, ()
    network = SpringNetwork.build(surface, fabric, positions, grain_angle=grain_angle, device="cpu")
    area = network.cell_arrays.area
    face_area = np.maximum(np.bincount(network.cell_arrays.face, area, minlength=len(surface.faces)), 1e-300)
    curved = [
        _smoothed(
            surface,
            np.bincount(network.cell_arrays.face, area * k, minlength=len(surface.faces)) / face_area,
            SKIN_LENGTH,
        )
        for k in _curvature_along(network, positions)[:2]
    ]
    around = int(np.abs(curved[1]) @ face_area >= np.abs(curved[0]) @ face_area)
    thread = ("warp", "weft")[around]
    other = 1 - around
    still = stretch[:, other]
    c_warp, c_weft, c_cross = plane_stress(fabric)
    beyond = (c_warp - fabric.stiffness_warp, c_weft - fabric.stiffness_weft)

    def pull(along: int, e: FloatArray, across: FloatArray) -> FloatArray:
        return fabric.tension(e, "weft" if along else "warp") + beyond[along] * e + c_cross * across

    low, high = np.zeros(len(stretch)), np.full(len(stretch), fabric.strain_limit)
    for _ in range(60):
        middle = 0.5 * (low + high)
        pressure = pull(around, middle, still - 1.0) * curved[around] / still
        pressure += pull(other, still - 1.0, middle) * curved[other] / (1.0 + middle)
        enough = pressure >= wear.pressure
        high, low = np.where(enough, middle, high), np.where(enough, low, middle)
    stretch[:, around] = 1.0 + 0.5 * (low + high)
    short = float(face_area[low > fabric.strain_limit - 1e-6].sum() / face_area.sum())
    notes = [f"pressure {wear.pressure:g} Pa by stretch along {thread}, which runs around the body"]
    if unused := unused_stretch(wear, thread):
        notes.append(unused)
    if short > 0.001:
        notes.append(
            f"{wear.pressure:g} Pa cannot be reached within {fabric.name}'s limit of {100 * fabric.strain_limit:.3g} % on "
            f"{100 * short:.0f} % of the piece: too flat, or the cloth too soft"
        )
    return stretch, tuple(notes)


def unused_stretch(wear: Wear, around: str) -> str:
    """What is said of a stretch that a pressure overrides, along the threads ("warp" or "weft") around the body; "" if there is none."""
    value = wear.stretch_warp if around == "warp" else wear.stretch_weft
    if not (wear.pressure and value > 0.0):
        return ""
    return (
        f"stretch_{around} = {value:g} has no effect: {around} runs around the body, and the pressure sets its stretch"
    )
