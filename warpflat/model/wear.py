"""How a garment is meant to be worn: stretch along its threads, and pressure on the skin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, is_number
from warpflat.core.launch import launch_each
from warpflat.fabric.fabric import Fabric, grain_axes
from warpflat.kernels.curvature import bend_threads
from warpflat.model.membrane import plane_stress
from warpflat.model.network import SpringNetwork
from warpflat.surface.curvature import curvature_tensors
from warpflat.surface.energy_map import smooth_to_vertices
from warpflat.surface.mesh import Surface

__all__ = ["SKIN_LENGTH", "Wear", "meant_stretch", "unused_stretch"]

# Cloth bridges what is smaller than this, and a scan is rough below it: curvature is taken over such lengths [m].
SKIN_LENGTH = 0.01


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


def curvature_along(network: SpringNetwork, positions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
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


def smoothed_along(surface: Surface, values: FloatArray, length: float) -> FloatArray:
    at_vertices = smooth_to_vertices(surface, values, smoothing_length=length)
    used = surface.faces >= 0
    corners = np.where(used, at_vertices[np.maximum(surface.faces, 0)], 0.0)
    return np.asarray(corners.sum(axis=1) / used.sum(axis=1))


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
        smoothed_along(
            surface,
            np.bincount(network.cell_arrays.face, area * k, minlength=len(surface.faces)) / face_area,
            SKIN_LENGTH,
        )
        for k in curvature_along(network, positions)[:2]
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
