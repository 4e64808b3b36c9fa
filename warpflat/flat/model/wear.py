"""The intended wear of a garment: stretch along its threads, and pressure on the skin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, is_number
from warpflat.core.launch import launch_each
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.model.membrane import plane_stress
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.surface.curvature import curvature_tensors
from warpflat.flat.surface.energy_map import smooth_to_vertices
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import corner_means
from warpflat.kernels.curvature import bend_threads

__all__ = ["SKIN_LENGTH", "Wear", "intended_stretch", "unused_stretch"]

# Cloth bridges what is smaller than this, and a scan is rough below it: curvature is taken over such lengths [m].
SKIN_LENGTH = 0.01
# Bisections of a strain, and rounds over both threads.
_HALVINGS, _ROUNDS = 50, 6
# Both threads are said to carry a pressure where one is strained by this share of the other.
_BOTH = 0.1


@dataclass(frozen=True, kw_only=True)
class Wear:
    """The intended wear of a garment.

    Attributes:
        stretch_warp, stretch_weft: elongation of the cloth on the body over its flat length; 0.2 for 20 %.
        pressure: intended pressure on the skin [Pa], if any. Threads get the stretch that gives it, face by face, each by the curvature
            along it: on a tube those around it, on a ball both. Where a stretch is given, the threads across the stronger curvature get
            that, and those along it the rest.
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
                    f"wear: {key} = {value:g} {unit}".rstrip() + f"; must be 0 to {highest:g} {unit}".rstrip() + hint
                )
        if self.pressure and self.stretch_warp > 0.0 and self.stretch_weft > 0.0:
            raise InputError(
                "wear: a pressure sets the stretch of the threads that run around the body: give stretch_warp or "
                "stretch_weft, that of the other threads, not both"
            )

    @property
    def is_tight(self) -> bool:
        """True if the garment is to be smaller than the body."""
        return self.stretch_warp > 0.0 or self.stretch_weft > 0.0 or bool(self.pressure)


def thread_curvatures(network: SpringNetwork, positions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the body's curvature along the worn warp and weft, and the twist between them, #C each [1/m]."""
    cells, surface = network.cell_arrays, network.surface
    warp, weft = (wp.vec2d(*axis) for axis in grain_axes(network.grain_angle))
    along = np.empty((len(cells.laid), 4))
    body = [surface.vertices, cells.corner, cells.laid, curvature_tensors(surface)]
    launch_each(bend_threads, len(along), [np.asarray(positions, dtype=np.float64), *body, warp, weft], [along])
    if float(along[:, 3] @ cells.area) < 0.0:
        # The surface is oriented inwards: a body is convex on the whole.
        along = -along
    return along[:, 0], along[:, 1], along[:, 2]


def smooth_face_values(surface: Surface, values: FloatArray) -> FloatArray:
    """Return face values (#F) smoothed as skin is, #F."""
    return corner_means(smooth_to_vertices(surface, values, smoothing_length=SKIN_LENGTH), surface.faces)


def intended_stretch(
    surface: Surface, fabric: Fabric, positions: FloatArray, wear: Wear, *, grain_angle: float = 0.0
) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return the intended length worn over length flat along warp and weft, #F by 2, and notes.

    A pressure p = n_warp k_warp + n_weft k_weft is carried by the forces n = T / s per worn width, where k is the curvature along the
    threads of the layout, averaged over 10 mm, T the fabric's own tension, and s the stretch of the other threads. Each thread gets
    n_i = p k_i^3 / (k_warp^4 + k_weft^4): pR around a tube, whatever the noise of the curvature along it, and pR / 2 both ways on a
    ball. If the stretch across the stronger curvature is given, only the other one is solved for. No stretch of a pressure goes beyond
    the fabric's limit.

    Args:
        surface: the piece on the body.
        fabric: the cloth.
        positions: #V by 2, a layout, for the directions of the threads [m].
        wear: what is intended.
        grain_angle: of the warp against +y, degrees.

    Returns:
        #F by 2, or None for a pattern of the body's own size; sentences for the maker.
    """
    if not wear.is_tight:
        return None, ()
    stretch = np.tile([1.0 + wear.stretch_warp, 1.0 + wear.stretch_weft], (len(surface.faces), 1))
    limit = f"{fabric.name}'s limit of {100 * fabric.strain_limit:.3g} %"

    def beyond(asked: float) -> tuple[str, ...]:
        """Return what is told of a stretch that is asked for beyond the limit."""
        words = f"a stretch of {100 * asked:.3g} % is asked for, beyond {limit}: the fit is judged from there"
        return (words,) if asked > fabric.strain_limit else ()

    if not wear.pressure:
        return stretch, beyond(max(wear.stretch_warp, wear.stretch_weft))
    network = SpringNetwork.build(surface, fabric, positions, grain_angle=grain_angle, device="cpu")
    area = network.cell_arrays.area
    face_area = np.maximum(np.bincount(network.cell_arrays.face, area, minlength=len(surface.faces)), 1e-300)
    curved = [
        smooth_face_values(
            surface, np.bincount(network.cell_arrays.face, area * k, minlength=len(surface.faces)) / face_area
        )
        for k in thread_curvatures(network, positions)[:2]
    ]
    around = int(np.abs(curved[1]) @ face_area >= np.abs(curved[0]) @ face_area)
    thread = ("warp", "weft")[around]
    other = 1 - around
    given = (wear.stretch_warp, wear.stretch_weft)[other]
    strain = _strain_for_pressure(fabric, wear.pressure, curved, around, given)
    stretch = 1.0 + strain
    short = float(face_area[strain[:, around] > fabric.strain_limit - 1e-6].sum() / face_area.sum())
    along = f"{thread}, which runs around the body"
    if not given and float(strain[:, other] @ face_area / face_area.sum()) > _BOTH * float(strain[:, around].mean()):
        along = "warp and weft, by the body's curvature along each"
    notes = [f"pressure {wear.pressure:g} Pa by stretch along {along}", *beyond(given)]
    if unused := unused_stretch(wear, thread):
        notes.append(unused)
    if short > 0.001:
        notes.append(
            f"{wear.pressure:g} Pa cannot be reached within {limit} on {100 * short:.0f} % of the piece: too flat, or the cloth too soft"
        )
    return stretch, tuple(notes)


def _strain_for_pressure(
    fabric: Fabric, pressure: float, curved: Sequence[FloatArray], around: int, given: float
) -> FloatArray:
    """Solve for the strains of the threads, each by bisection while the other stays, since only Poisson's ratio couples them.

    Args:
        fabric: the cloth.
        pressure: intended [Pa].
        curved: #F each, curvature along warp and weft [1/m].
        around: 0 if the warp runs around the body, 1 if the weft does.
        given: strain of the other threads; 0 leaves them to the pressure, too.

    Returns:
        #F by 2, strains along warp and weft; the fabric's limit where the pressure cannot be reached.
    """
    c_warp, c_weft, c_cross = plane_stress(fabric)
    excess = (c_warp - fabric.stiffness_warp, c_weft - fabric.stiffness_weft)
    other, k = 1 - around, np.maximum(np.stack(curved, axis=1), 0.0)
    strain = np.zeros((len(k), 2))
    strain[:, other] = given

    def force(thread: int, own: FloatArray) -> FloatArray:
        """Return the force of threads per worn width [N/m], of strains of theirs (#F)."""
        tension = fabric.tension(own, "weft" if thread else "warp") + excess[thread] * own
        return np.asarray((tension + c_cross * strain[:, 1 - thread]) / (1.0 + strain[:, 1 - thread]))

    share = k**3 / np.maximum((k**4).sum(axis=1, keepdims=True), 1e-300)
    for _ in range(1 if given else _ROUNDS):
        for thread in (around,) if given else (around, other):
            low, high = np.zeros(len(k)), np.full(len(k), fabric.strain_limit)
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                if given:
                    strain[:, around] = middle
                    carried = force(around, middle) * curved[around] + force(other, strain[:, other]) * curved[other]
                    enough = carried >= pressure
                else:
                    enough = force(thread, middle) >= pressure * share[:, thread]
                high, low = np.where(enough, middle, high), np.where(enough, low, middle)
            strain[:, thread] = 0.5 * (low + high)
    return strain


def unused_stretch(wear: Wear, around: str) -> str:
    """Return the note on a stretch along the threads `around` the body, which a pressure overrides, or ""."""
    value = wear.stretch_warp if around == "warp" else wear.stretch_weft
    if not (wear.pressure and value > 0.0):
        return ""
    return (
        f"stretch_{around} = {value:g} has no effect: {around} runs around the body, and the pressure sets its stretch"
    )
