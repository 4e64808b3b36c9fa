"""Surfaces by formula: what is needed to try, to test and to compare, without a mesh file.

Each is a grid of quads over parameters u (to the right) and w (up), both from 0 to 1, as somebody sees it who looks at
its outside from +Z with Y up; in metres. Feature lines: ``centre`` (u = 1/2, from the bottom up), ``left``, ``right``,
``bottom`` and ``top``.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, is_number, nearest
from warpflat.flat.surface.grid import grid_quads
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface

__all__ = [
    "SHAPES",
    "bodice",
    "check_range",
    "cone",
    "cylinder",
    "dome",
    "grid_surface",
    "hemisphere",
    "make_named",
    "make_shape",
    "saddle",
    "strip",
]

Made = TypeVar("Made")

_MAX_RESOLUTION = 2048


def dome(*, size: float = 0.5, radius: float = 0.45, resolution: int = 33, triangles: bool = False) -> Surface:
    """Return a square patch of a sphere: x and y within +-size/2, z = sqrt(radius^2 - x^2 - y^2).

    Args:
        size: side of the square below it [m].
        radius: of the sphere [m], more than size / sqrt(2).
        resolution: vertices along each side.
        triangles: split each quad along the same diagonal.
    """
    check_range("dome", "size", size, 1e-3, 10.0)
    lowest = size / math.sqrt(2.0)
    if not lowest < radius <= 1e3:
        raise InputError(f"dome: radius = {radius:g} m; must lie between size / sqrt(2) = {lowest:.4g} and 1000 m")
    u, w = _parameters("dome", resolution)
    x, y = (u - 0.5) * size, (w - 0.5) * size
    return grid_surface("dome", np.stack([x, y, np.sqrt(radius**2 - x**2 - y**2)], axis=-1), triangles)


def bodice(*, resolution: int = 65, triangles: bool = False) -> Surface:
    """Return the front half of a torso with waist and bust, 0.45 m high; the line ``bust`` runs across at the bust points.

    Args:
        resolution: vertices along each side.
        triangles: split each quad along the same diagonal.
    """
    u, w = _parameters("bodice", resolution)
    t, y = (u - 0.5) * np.pi, 0.45 * w
    waist = 1.0 - 0.20 * np.exp(-(((y - 0.10) / 0.10) ** 2))
    bust = sum(0.045 * np.exp(-(((t - t0) / 0.30) ** 2 + ((y - 0.28) / 0.055) ** 2)) for t0 in (-0.55, 0.55))
    x, z = (0.170 * waist + bust) * np.sin(t), (0.115 * waist + bust) * np.cos(t)
    row = round(0.28 / 0.45 * (resolution - 1))
    return grid_surface("bodice", np.stack([x, y, z], axis=-1), triangles, rows={"bust": row})


def cylinder(
    *, radius: float = 0.15, height: float = 0.4, angle: float = 180.0, resolution: int = 33, triangles: bool = False
) -> Surface:
    """Return a part of an upright cylinder; its pattern is a rectangle.

    Args:
        radius: [m].
        height: [m].
        angle: how far it goes round [degrees], below 360.
        resolution: vertices along each side.
        triangles: split each quad along the same diagonal.
    """
    check_range("cylinder", "radius", radius, 1e-3, 100.0)
    check_range("cylinder", "height", height, 1e-3, 100.0)
    check_range("cylinder", "angle", angle, 1.0, 359.0)
    u, w = _parameters("cylinder", resolution)
    t = (u - 0.5) * math.radians(angle)
    points = np.stack([radius * np.sin(t), height * w, radius * np.cos(t)], axis=-1)
    return grid_surface("cylinder", points, triangles)


def cone(
    *,
    bottom: float = 0.25,
    top: float = 0.10,
    height: float = 0.4,
    angle: float = 180.0,
    resolution: int = 33,
    triangles: bool = False,
) -> Surface:
    """Return a part of a truncated cone, upright, such as half a skirt; its pattern is a ring's sector.

    Args:
        bottom: radius at the bottom [m].
        top: radius at the top [m].
        height: [m].
        angle: how far it goes round [degrees], below 360.
        resolution: vertices along each side.
        triangles: split each quad along the same diagonal.
    """
    for key, value in (("bottom", bottom), ("top", top), ("height", height)):
        check_range("cone", key, value, 1e-3, 100.0)
    check_range("cone", "angle", angle, 1.0, 359.0)
    u, w = _parameters("cone", resolution)
    t, r = (u - 0.5) * math.radians(angle), bottom + (top - bottom) * w
    return grid_surface("cone", np.stack([r * np.sin(t), height * w, r * np.cos(t)], axis=-1), triangles)


def strip(
    *,
    length: float = 0.6,
    width: float = 0.12,
    amplitude: float = 0.05,
    waves: float = 1.5,
    resolution: int = 33,
    triangles: bool = False,
) -> Surface:
    """Return a strip bent into waves along its length; its pattern is the straight strip.

    Args:
        length: from end to end along the ground [m].
        width: [m].
        amplitude: of the waves [m].
        waves: how many.
        resolution: vertices along its length; a quarter as many, and three at least, across.
        triangles: split each quad along the same diagonal.
    """
    check_range("strip", "length", length, 1e-3, 100.0)
    check_range("strip", "width", width, 1e-3, 100.0)
    check_range("strip", "amplitude", amplitude, 0.0, length)
    check_range("strip", "waves", waves, 0.0, 16.0)
    u, w = _parameters("strip", max(3, (resolution - 1) // 4 + 1) | 1, resolution)
    x, y = (u - 0.5) * width, (w - 0.5) * length
    return grid_surface("strip", np.stack([x, y, amplitude * np.sin(2.0 * np.pi * waves * w)], axis=-1), triangles)


def saddle(*, size: float = 0.4, curvature: float = 2.5, resolution: int = 33, triangles: bool = False) -> Surface:
    """Return a saddle: z = curvature / 2 (x^2 - y^2), x and y within +-size/2.

    Args:
        size: side of the square below it [m].
        curvature: in the middle, both ways [1/m].
        resolution: vertices along each side.
        triangles: split each quad along the same diagonal.
    """
    check_range("saddle", "size", size, 1e-3, 10.0)
    check_range("saddle", "curvature", curvature, 0.0, 4.0 / size)
    u, w = _parameters("saddle", resolution)
    x, y = (u - 0.5) * size, (w - 0.5) * size
    return grid_surface("saddle", np.stack([x, y, 0.5 * curvature * (x**2 - y**2)], axis=-1), triangles)


def hemisphere(*, radius: float = 0.2, opening: float = 80.0, resolution: int = 33, triangles: bool = False) -> Surface:
    """Return a spherical cap with a round border, up to more than half the sphere.

    The square grid is drawn onto the disc by the concentric map (Shirley and Chiu 1997) and the disc onto the cap along
    great circles, so quads stay of similar size; the border's four lines join at points of the round border.

    Args:
        radius: of the sphere [m].
        opening: angle between the pole and the border [degrees], 90 for half the sphere, at most 120.
        resolution: vertices along each side.
        triangles: split each quad along the same diagonal.
    """
    check_range("hemisphere", "radius", radius, 1e-3, 100.0)
    check_range("hemisphere", "opening", opening, 1.0, 120.0)
    u, w = _parameters("hemisphere", resolution)
    a, b = 2.0 * u - 1.0, 2.0 * w - 1.0
    wide = np.abs(a) >= np.abs(b)
    reach = np.where(wide, a, b)
    ratio = np.divide(np.where(wide, b, a), reach, out=np.zeros_like(reach), where=reach != 0.0)
    azimuth = np.where(wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    polar = np.abs(reach) * math.radians(opening)
    side = np.where(reach < 0.0, -1.0, 1.0)
    x, y = side * np.sin(polar) * np.cos(azimuth), side * np.sin(polar) * np.sin(azimuth)
    return grid_surface("hemisphere", radius * np.stack([x, y, np.cos(polar)], axis=-1), triangles)


SHAPES: dict[str, Callable[..., Surface]] = {
    "dome": dome,
    "bodice": bodice,
    "cylinder": cylinder,
    "cone": cone,
    "strip": strip,
    "saddle": saddle,
    "hemisphere": hemisphere,
}
"""The shapes by the name that scene files use."""


def make_shape(name: str, **parameters: Any) -> Surface:
    """Return the surface of that name.

    Args:
        name: a key of `SHAPES`.
        parameters: of that shape's function.

    Raises:
        InputError: an unknown shape or parameter (names the nearest), a parameter of the wrong kind or out of range.
    """
    if name not in SHAPES:
        raise InputError(f"unknown shape {name!r}; {nearest(name, SHAPES)}")
    return make_named(name, SHAPES[name], parameters)


def make_named(name: str, make: Callable[..., Made], parameters: Mapping[str, Any]) -> Made:
    """Return what a function makes of parameters from a file.

    Args:
        name: for messages.
        make: whose keyword arguments have defaults.
        parameters: by name.

    Raises:
        InputError: an unknown parameter (names the nearest), or one of the wrong kind or out of range.
    """
    known = inspect.signature(make).parameters
    for key, value in parameters.items():
        if key not in known:
            raise InputError(f"{key}: unknown key {key!r} for shape {name!r}; {nearest(key, known)}")
        wanted = type(known[key].default)
        right = isinstance(value, bool) if wanted is bool else is_number(value, whole=wanted is int)
        if not right:
            kind = {bool: "true or false", int: "a whole number", float: "a number"}[wanted]
            raise InputError(f"{key}: should be {kind}, such as {known[key].default}, got {value!r}")
    return make(**parameters)


def check_range(shape: str, key: str, value: float, lowest: float, highest: float) -> None:
    """Check a parameter.

    Raises:
        InputError: it is out of range.
    """
    if not lowest <= value <= highest:
        raise InputError(f"{shape}: {key} = {value:g}; must lie between {lowest:g} and {highest:g}")


def _parameters(shape: str, across: int, up: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return u and w at each vertex, both `up` by `across`."""
    up = across if up is None else up
    if not 3 <= up <= _MAX_RESOLUTION:
        raise InputError(f"{shape}: resolution = {up}; must lie between 3 and {_MAX_RESOLUTION}")
    u, w = np.meshgrid(np.linspace(0.0, 1.0, across), np.linspace(0.0, 1.0, up))
    return u, w


def grid_surface(
    name: str,
    points: FloatArray,
    triangles: bool = False,
    *,
    rows: Mapping[str, int] | None = None,
    lines: Mapping[str, IntArray] | None = None,
) -> Surface:
    """Return the surface of `points` (rows by columns by 3); further lines along `rows`, or through given vertices."""
    height, width = points.shape[:2]
    index = np.arange(height * width, dtype=np.int32).reshape(height, width)
    quads = grid_quads(index)
    faces = quads
    if triangles:
        pairs = np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
        faces = np.column_stack([pairs, np.full(len(pairs), -1, dtype=np.int32)])
    own = {
        "centre": index[:, width // 2],
        "left": index[:, 0],
        "right": index[:, -1],
        "bottom": index[0],
        "top": index[-1],
        **{key: index[row] for key, row in (rows or {}).items()},
        **(lines or {}),
    }
    return make_surface(points.reshape(-1, 3), faces, lines=own, name=name)
