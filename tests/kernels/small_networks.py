"""A network of a handful of quads, and single kernels launched over it."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp
from devices import DEVICE
from numpy.typing import NDArray
from warpflat.kernels.cells import ALL, CellForces
from warpflat.kernels.guard import compute_guard_energy, evaluate_guard, evaluate_guard_potential
from warpflat.kernels.implicit import (
    BondForces,
    VertexForces,
    advance,
    gather_forces,
    gather_potential,
    stop,
)
from warpflat.kernels.springs import compute_spring_energy, compute_spring_tension

from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.steps import IMPLICIT_STEP
from warpflat.flat.surface.repair.validate import make_surface

CLOTH = Fabric(
    name="cloth",
    stiffness_warp=1000.0,
    stiffness_weft=600.0,
    shear_stiffness=50.0,
    areal_density=0.15,
    poisson_ratio=0.1,
)


def small_network(*, fabric: Fabric = CLOTH, grain_angle: float = 0.0) -> SpringNetwork:
    """Four quads on a bent patch of 0.2 m by 0.24 m, one of which begins at another corner."""
    x, y = np.meshgrid([-0.1, 0.0, 0.1], [0.0, 0.11, 0.24])
    points = np.stack([x + 0.01 * y, y, 1.5 * x**2 - 0.8 * y**2], axis=-1).reshape(-1, 3)
    faces = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [5, 8, 7, 4]]
    surface = make_surface(points, faces)
    return SpringNetwork.build(
        surface, fabric, surface.vertices[:, :2], grain_angle=grain_angle, model="springs", device=DEVICE
    )


def shaken(network: SpringNetwork, *, scale: float, noise: float = 0.004, seed: int = 3) -> NDArray[np.float64]:
    """#V by 2, the patch seen from the front, made smaller or larger and shaken."""
    rng = np.random.default_rng(seed)
    return scale * network.surface.vertices[:, :2] + rng.normal(scale=noise, size=(network.vertex_count, 2))


def corner_vertices(network: SpringNetwork) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Of all faces' corners the places in what kernels give per corner, and their vertices."""
    corners = network.surface.faces.ravel()
    slots = np.flatnonzero(corners >= 0)
    return slots, corners[slots]


def vec2(values: NDArray[np.float64]) -> wp.array:
    return wp.array(np.ascontiguousarray(values), dtype=wp.vec2d, device=DEVICE)


def zeros(count: int, dtype: type = wp.float64) -> wp.array:
    return wp.zeros(count, dtype=dtype, device=DEVICE)


def filled(struct: Any, arrays: dict[str, wp.array]) -> Any:
    """A struct of arrays, each given by its name."""
    made = struct()
    for name in struct.vars:
        setattr(made, name, arrays[name])
    return made


@dataclass
class Launched:
    """The kernels of one step, launched one by one in as many pieces as asked for; every output kept.

    A kernel is given what it asks for by name, from the network or from `arrays`.
    """

    network: SpringNetwork
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64] | None = None
    time_step: float = 0.01
    pieces: int = 1
    scope: int = ALL
    coefficients: tuple[float, float, float] = IMPLICIT_STEP
    arrays: dict[str, wp.array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, f = self.network.vertex_count, self.network.face_count
        still = np.zeros((n, 2))
        self.arrays = {
            "position": vec2(self.positions),
            "velocity": vec2(still if self.velocities is None else self.velocities),
            "face_acting": zeros(f, wp.int8),
            "face_clearance": zeros(f),
            "face_force": zeros(4 * f, wp.vec2d),
            "face_viscosity": zeros(4 * f, wp.vec2d),
            "face_stiffness": zeros(4 * f),
            "face_energy": zeros(f),
            "force": zeros(n, wp.vec2d),
            "power": zeros(n),
            "driving_force": zeros(n, wp.vec2d),
            "first_guess": zeros(n, wp.vec2d),
            "stiffness": zeros(n),
            "anchor": zeros(n, wp.vec2d),
            "reach": zeros(n),
            "guarded": zeros(n, wp.int8),
            "tension": zeros(n),
            "coefficients": wp.array(np.array([self.coefficients]), dtype=wp.vec3d, device=DEVICE),
            "energy": zeros(n),
        }

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return np.array(self.arrays[name].numpy(), copy=True)

    def _launch(self, kernel: wp.Kernel, count: int, *, per_face: bool = False) -> None:
        given = {
            name: getattr(self.network, name) for name in ("springs", "cells", "guard", "mass", "spring_stiffness")
        }
        given |= {
            "bonds": getattr(self.network, "bonds", None),
            "time_step": self.time_step,
            "scope": self.scope,
        }
        # no seam binds this network
        bonds = {"force": zeros(0, wp.vec2d), "viscosity": zeros(0, wp.vec2d), "stiffness": zeros(0)}
        of_faces = {name[5:]: array for name, array in self.arrays.items() if name.startswith("face_")}
        cell_forces, vertex_forces = filled(CellForces, of_faces), filled(VertexForces, self.arrays)
        given |= {"cell_forces": cell_forces, "bond_forces": filled(BondForces, bonds), "at": vertex_forces}
        given |= {"load": zeros(self.network.vertex_count, wp.vec2d)}
        given |= self.arrays
        given |= {"out": vertex_forces} if not per_face else {"out": cell_forces, "energy": self.arrays["face_energy"]}
        names = [argument.label for argument in kernel.adj.args]
        for first, last in pairwise(np.linspace(0, count, self.pieces + 1).astype(int).tolist()):
            wp.launch(
                kernel, dim=last - first, inputs=[{**given, "first": first}[name] for name in names], device=DEVICE
            )

    def evaluate_guard(self) -> Launched:
        self._launch(evaluate_guard, self.network.face_count, per_face=True)
        return self

    def evaluate_potential(self) -> Launched:
        self._launch(evaluate_guard_potential, self.network.face_count, per_face=True)
        self._launch(gather_potential, self.network.vertex_count)
        return self

    def gather_forces(self) -> Launched:
        self._launch(gather_forces, self.network.vertex_count)
        return self

    def stop(self) -> Launched:
        self._launch(stop, self.network.vertex_count)
        return self

    def advance(self) -> Launched:
        self._launch(advance, self.network.vertex_count)
        return self

    def spring_energy(self) -> NDArray[np.float64]:
        self._launch(compute_spring_energy, self.network.vertex_count)
        return self["energy"]

    def spring_tension(self) -> NDArray[np.float64]:
        self._launch(compute_spring_tension, self.network.vertex_count)
        return self["tension"]

    def guard_energy(self) -> NDArray[np.float64]:
        self._launch(compute_guard_energy, self.network.face_count, per_face=True)
        return self["face_energy"]
