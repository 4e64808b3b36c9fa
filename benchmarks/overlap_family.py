"""Pieces that lie over themselves when they are flattened: curled strips, spirals, horseshoes, slit disks and fronts with two legs."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface

__all__ = ["FAMILY", "curled_strip", "horseshoe", "slit_disk", "spiral", "two_legs"]

Place = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


def _band(place: Place, name: str, *, along: int, across: int, triangles: bool = False) -> Surface:
    """Return a band; `place` takes the shares of its length and of its width."""
    s, t = np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, across), indexing="ij")
    n = np.arange(s.size).reshape(s.shape)
    faces = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], axis=-1).reshape(-1, 4)
    return make_surface(np.stack(place(s, t), axis=-1).reshape(-1, 3), _split(faces, triangles), name=name)


def _split(faces: np.ndarray, triangles: bool) -> np.ndarray:
    """Return quads, or their halves along one diagonal."""
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]) if triangles else faces


def curled_strip(turns: float, *, along: int = 81, triangles: bool = False) -> Surface:
    """Return a ring of more than a turn, on a ramp."""

    def place(s: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        radius, angle = 0.2 - 0.1 * t, 2 * np.pi * turns * s
        return radius * np.cos(angle), 0.1 * turns * s, radius * np.sin(angle)

    return _band(place, "curled_strip", along=along, across=9, triangles=triangles)


def spiral(turns: float, *, triangles: bool = False) -> Surface:
    """Return a band that winds outwards by less than its width in each turn."""

    def place(s: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        angle = 2 * np.pi * turns * s
        radius = 0.1 + 0.09 * turns * s + 0.1 * (1 - t)
        return radius * np.cos(angle), 0.13 * turns * s, radius * np.sin(angle)

    return _band(place, "spiral", along=round(40 * turns) + 1, across=7, triangles=triangles)


def horseshoe(flare: float, *, triangles: bool = False) -> Surface:
    """Return most of a ring, whose wide ends flare towards each other."""

    def place(s: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        radius = 0.25 + (0.08 + 0.22 * (2 * s - 1) ** 8) * (0.5 - t)
        angle = 2 * np.pi * 0.9 * s + flare * (2 * s - 1) ** 9 * np.cos(np.pi * (t - 0.5))
        return radius * np.cos(angle), 0.05 * s, radius * np.sin(angle)

    return _band(place, "horseshoe", along=49, across=9, triangles=triangles)


def slit_disk(degrees: float, *, rings: int = 10) -> Surface:
    """Return a ruffled disk of more than 360 degrees around its middle, slit from the border to there."""
    around = np.linspace(0.0, 2.0 * np.pi, 73)

    def tilted(height: float) -> FloatArray:
        """Return rays that go up and down twice around."""
        tilt = height * np.cos(2 * around)
        return np.stack([np.cos(tilt) * np.cos(around), np.sin(tilt), np.cos(tilt) * np.sin(around)], axis=1)

    def angle(height: float) -> float:
        ray = tilted(height)
        return float(np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", ray[1:], ray[:-1]), -1, 1)).sum()))

    low, high = 0.0, 1.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if angle(middle) < degrees else (low, middle)
    ray = tilted(low)
    ray[-1] = ray[0]
    spokes = len(ray)
    n = 1 + np.arange(rings * spokes).reshape(rings, spokes)
    faces = [[0, n[0, k + 1], n[0, k]] for k in range(spokes - 1)]
    for inner, outer in pairwise(n):
        for k in range(spokes - 1):
            faces += [[inner[k], inner[k + 1], outer[k + 1]], [inner[k], outer[k + 1], outer[k]]]
    radii = 0.2 * np.arange(1, rings + 1) / rings
    return make_surface(np.concatenate([np.zeros((1, 3)), *(r * ray for r in radii)]), faces, name="slit_disk")


def two_legs(lean: float, *, columns: int = 9, triangles: bool = False) -> Surface:
    """Return a front with two legs that lean towards each other, one behind the other on the body, by so much at the hem [m]."""
    rows = 4 * columns
    x, y = np.meshgrid(np.linspace(0, 0.16, columns), np.linspace(0, -0.6, rows), indexing="xy")
    depth = np.clip((-y - 0.12) / 0.48, 0.0, 1.0)
    shift, lift = 0.5 * lean * depth**2, 0.12 * depth**2
    crotch = int(np.flatnonzero(depth[:, 0] > 0.0)[0])
    right = np.stack([x + 0.002 * depth - shift, y, lift], axis=-1)
    left = np.stack([-x[:, ::-1] - 0.002 * depth + shift, y, -lift], axis=-1)
    points, number = [], np.empty((2, rows, columns), dtype=int)
    count = 0
    for side, leg in enumerate((left, right)):
        for row in range(rows):
            for column in range(columns):
                if side == 1 and column == 0 and row <= crotch:
                    number[1, row, 0] = number[0, row, -1]
                    continue
                number[side, row, column] = count
                points.append(leg[row, column])
                count += 1
    faces = np.concatenate(
        [np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], axis=-1).reshape(-1, 4) for n in number]
    )
    return make_surface(np.array(points), _split(faces, triangles), name="two_legs")


FAMILY: dict[str, Callable[[], Surface]] = {
    "curled strip, 1.02 turns": lambda: curled_strip(1.02),
    "curled strip, 1.1 turns": lambda: curled_strip(1.1),
    "curled strip, 1.1, triangles": lambda: curled_strip(1.1, triangles=True),
    "curled strip, 1.5 turns": lambda: curled_strip(1.5),
    "curled strip, 2.2 turns": lambda: curled_strip(2.2, along=161),
    "spiral, 1.5 turns": lambda: spiral(1.5),
    "spiral, 2.5 turns": lambda: spiral(2.5),
    "spiral, 1.5, triangles": lambda: spiral(1.5, triangles=True),
    "horseshoe, flare 0.4": lambda: horseshoe(0.4),
    "horseshoe, flare 0.6": lambda: horseshoe(0.6, triangles=True),
    "slit disk, 362 degrees": lambda: slit_disk(362.0),
    "slit disk, 380 degrees": lambda: slit_disk(380.0),
    "slit disk, 450 degrees": lambda: slit_disk(450.0),
    "two legs, 4 cm": lambda: two_legs(0.04),
    "two legs, 8 cm": lambda: two_legs(0.08, triangles=True),
    "two legs, 16 cm": lambda: two_legs(0.16, columns=17),
}
