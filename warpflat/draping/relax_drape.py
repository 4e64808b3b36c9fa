"""The sewn cloth comes to rest on the body: dynamic relaxation with contact and friction.

Each step gathers the forces at every vertex, lets the body and its friction act on them, and moves the vertex by its
velocity. Masses are fictitious: the sums of the stiffness around each vertex, so that any step is stable. The body is one
plane per vertex, renewed every ten steps. The cloth is at rest by its forces, never by its velocities.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.launch import Sequence, record
from warpflat.core.sums import range_offsets
from warpflat.draping.body import Body
from warpflat.draping.options import DrapeOptions
from warpflat.draping.sewn_cloth import SewnCloth
from warpflat.kernels.drape import (
    Bending,
    Contact,
    Motion,
    advance_drape,
    evaluate_cloth,
    evaluate_curvature,
    find_planes,
    watch_power,
)
from warpflat.kernels.reduce import sum_blocks
from warpflat.model.membrane import make_cloth

__all__ = ["DrapedCloth", "relax_drape"]

# Steps for which the body's planes hold, and after which the forces are looked at.
_STEPS_PER_PLANE = 10
_STEPS_PER_CHECK = 100
# Fictitious mass over the sum of the stiffness around a vertex. A quarter is the limit of stability at small strains;
# at 1 wrinkled cloth on a bodice keeps chattering, at 2 it comes to rest.
_MASS_SCALE = 2.0
# No vertex may have more force left than so many times the mean that is allowed.
_WORST = 100.0
_LONGEST_STEP = 1e-3  # [m]
_REACH = 0.15  # [m]
_BLOCKS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class DrapedCloth:
    """Cloth on a body.

    Attributes:
        positions: #V by 3 [m].
        pressing: #V, normal force on the body [N].
        residual: mean force that is left over a vertex's mean weight.
        converged: whether the cloth is at rest.
        steps: that were taken.
        seconds: wall clock.
    """

    positions: FloatArray
    pressing: FloatArray
    residual: float
    converged: bool
    steps: int
    seconds: float


class _State:
    """The cloth's arrays on a device, and its launches."""

    def __init__(
        self, cloth: SewnCloth, body: Body | None, options: DrapeOptions, start: FloatArray, held: BoolArray
    ) -> None:
        device = wp.get_device("cpu") if body is None else body.device
        self.count, self.device = len(start), device
        corner, _, gradient, area = cloth.cells()
        laplacian, stiffness = cloth.laplacian()
        fabric = cloth.fabric
        soft = replace(fabric, compression_factor=min(fabric.compression_factor, options.compression))
        law = make_cloth(soft, (np.array([0.0, 1.0]), np.array([1.0, 0.0])), device)

        def on(values: object, dtype: object) -> wp.array:
            return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device)

        self.weight = fabric.areal_density * options.gravity * cloth.vertex_areas()
        self.motion = Motion()
        self.motion.position, self.motion.velocity = on(start, wp.vec3d), wp.zeros(self.count, wp.vec3d, device)
        mass = _MASS_SCALE * _stiffness_sums(cloth)
        self.motion.mass, self.motion.weight = on(mass, wp.float64), on(self.weight, wp.float64)
        self.motion.fixed = on(held.astype(np.int8), wp.int8)
        self.contact = Contact()
        self.contact.centre, self.contact.normal = (wp.zeros(self.count, wp.vec3d, device) for _ in range(2))
        self.contact.friction, self.contact.longest_step = options.friction, _LONGEST_STEP
        self.power, self.residual, self.pressing = (wp.zeros(self.count, wp.float64, device) for _ in range(3))
        bending = Bending()
        bending.offset, bending.neighbor = on(laplacian.indptr, wp.int32), on(laplacian.indices, wp.int32)
        bending.weight, bending.stiffness = on(laplacian.data, wp.float64), on(stiffness, wp.float64)
        moment, force = wp.zeros(self.count, wp.vec3d, device), wp.zeros(3 * len(corner), wp.vec3d, device)
        offset = range_offsets(np.bincount(corner.ravel(), minlength=self.count))
        entry = np.argsort(corner.ravel(), kind="stable").astype(np.int32)
        halted, blocks = wp.zeros(1, wp.int32, device), min(_BLOCKS, self.count)
        begin = np.linspace(0, self.count, blocks + 1).astype(np.int32)
        sums = wp.zeros(blocks, wp.float64, device)
        x = self.motion.position
        cells = [x, on(corner, wp.vec3i), on(gradient, wp.vec4d), on(area, wp.float64), law]
        lists = [on(offset, wp.int32), on(entry, wp.int32), force, bending, moment, halted]
        at = {"device": device}
        step = [
            record(evaluate_cloth, dim=len(corner), inputs=cells, outputs=[force], least=512, **at),
            record(evaluate_curvature, dim=self.count, inputs=[x, bending], outputs=[moment], least=512, **at),
            record(
                advance_drape, dim=self.count, inputs=[self.motion, self.contact, *lists],
                outputs=[self.power, self.residual, self.pressing], least=256, **at,
            ),
            record(sum_blocks, dim=blocks, inputs=[self.power, on(begin, wp.int32)], outputs=[sums], **at),
            record(watch_power, dim=1, inputs=[sums], outputs=[halted], **at),
        ]  # fmt: skip
        planes = []
        if body is not None:
            outputs = [self.contact.centre, self.contact.normal]
            query = [wp.uint64(body.mesh.id), body.normals, x, _REACH]
            planes = [record(find_planes, dim=self.count, inputs=query, outputs=outputs, least=256, turns=4, **at)]
        self.round = Sequence([*planes, *(step * _STEPS_PER_PLANE)])
        self._keep = (body, cells, lists, sums)

    def check(self) -> tuple[float, float]:
        """Return the mean and the largest force that is left, over the mean weight of a vertex."""
        left = self.residual.numpy()
        mean = float(self.weight.mean())
        return float(left.mean()) / mean, float(left.max()) / mean


def _stiffness_sums(cloth: SewnCloth) -> FloatArray:
    """Return #V, bounds of the sums of the stiffness around each vertex [N/m], by Gershgorin's discs."""
    fabric, (corner, _, gradient, area), (laplacian, stiffness) = cloth.fabric, cloth.cells(), cloth.laplacian()
    along = np.stack([-(gradient[:, :2] + gradient[:, 2:]), gradient[:, :2], gradient[:, 2:]], axis=1)
    size = np.abs(along)
    total = size.sum(axis=1, keepdims=True)
    steepest = []
    for direction in ("warp", "weft"):
        points = np.array([(0.0, 0.0), *getattr(fabric, f"curve_{direction}")])
        slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
        steepest.append(max(getattr(fabric, f"stiffness_{direction}"), *slopes.tolist(), 0.0))
    share = 1.0 / (1.0 - fabric.poisson_ratio**2 * fabric.stiffness_weft / fabric.stiffness_warp)
    k = share * (1.0 + fabric.poisson_ratio) * np.array(steepest) + 2.0 * fabric.shear_stiffness
    own = (size * total) @ k
    own += fabric.shear_stiffness * (size * total[:, :, ::-1]).sum(axis=2)
    sums = np.bincount(corner.ravel(), (own * area[:, None]).ravel(), minlength=len(cloth.designed))
    entries = abs(laplacian)
    return np.asarray(sums + entries @ (stiffness * entries.sum(axis=1)))


def relax_drape(
    cloth: SewnCloth,
    body: Body | None,
    *,
    options: DrapeOptions | None = None,
    held: BoolArray | None = None,
    start: FloatArray | None = None,
    callback: Callable[[int, float], None] | None = None,
) -> DrapedCloth:
    """Let the cloth come to rest on a body.

    Args:
        cloth: the sewn cloth.
        body: on whose device it is draped; None for cloth that hangs freely, on the CPU.
        options: friction, tolerance and limits.
        held: #V, vertices that do not move.
        start: #V by 3 [m]; the designed surface if not given.
        callback: called with the number of steps and the residual at every check.

    Returns:
        the cloth; `converged` is False if it met the step limit before it was at rest.
    """
    began, options = time.perf_counter(), options or DrapeOptions()
    start = cloth.designed if start is None else start
    state = _State(cloth, body, options, start, np.zeros(len(start), bool) if held is None else held)
    steps, residual, converged = 0, np.inf, False
    while steps < options.max_steps and not converged:
        for _ in range(_STEPS_PER_CHECK // _STEPS_PER_PLANE):
            state.round.launch()
        steps += _STEPS_PER_CHECK
        residual, worst = state.check()
        converged = steps > _STEPS_PER_CHECK and residual <= options.tolerance and worst <= _WORST * options.tolerance
        if callback is not None:
            callback(steps, residual)
    positions, pressing = state.motion.position.numpy().copy(), state.pressing.numpy().copy()
    return DrapedCloth(
        positions=positions, pressing=pressing, residual=residual, converged=converged, steps=steps,
        seconds=time.perf_counter() - began,
    )  # fmt: skip
