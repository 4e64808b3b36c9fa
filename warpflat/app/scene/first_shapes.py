"""First projects by formula: things of several flat pieces, as they are sewn. Borders that lie at one place are seams; in metres, Y up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from warpflat.core import FloatArray
from warpflat.flat import Surface, check_range, grid_surface, make_named
from warpflat.garment import meet_borders
from warpflat.pattern import BORDERS_MEET

__all__ = ["PIECES", "apron", "make_pieces", "sun_hat", "tote"]

# Columns and rows of a piece: what is flat, or bends one way, needs few.
_CELLS = 24
# Width of a strap as it is cut, to be folded in four [m], and how far apart pieces lie that are not sewn to each other.
_STRAP, _APART = 0.10, 0.30
# Ease of a hat around the head [m].
_HAT_EASE = 0.02


def tote(*, width: float = 0.38, height: float = 0.40, depth: float = 0.10, handle: float = 0.60) -> list[Surface]:
    """Return a tote bag: front, back, a gusset around three sides, and two handles that are folded in four.

    Args:
        width, height: of the front [m].
        depth: of the gusset [m].
        handle: length of a handle [m].
    """
    for key, value, low, high in (
        ("width", width, 0.1, 1.0), ("height", height, 0.1, 1.0), ("depth", depth, 0.03, 0.4), ("handle", handle, 0.1, 1.5),
    ):  # fmt: skip
        check_range("tote", key, value, low, high)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, _CELLS + 1) * width, np.linspace(0.0, 1.0, _CELLS + 1) * height)
    front = np.stack([x, y, np.full_like(x, 0.5 * depth)], axis=-1)
    # Down the left side as one looks at it, along the bottom and up the right side.
    along = np.linspace(0.0, 1.0, _CELLS + 1)
    down = np.column_stack([np.full_like(along, -0.5 * width), height * (1.0 - along)])
    across = np.column_stack([width * (along - 0.5), np.zeros_like(along)])
    path = np.vstack([down, across[1:], (down * [-1.0, 1.0])[::-1][1:]])
    columns = np.linspace(-0.5, 0.5, 7) * depth
    gusset = np.stack([np.column_stack([path, np.full(len(path), z)]) for z in columns], axis=1)
    return [
        _piece("front", front, "top"),
        _piece("back", (front * [1.0, 1.0, -1.0])[:, ::-1], "top"),
        _piece("gusset", gusset, "bottom", "top"),
        *(_strap(f"handle_{side}", handle, (place, height)) for side, place in (("front", 1.0), ("back", 1.3))),
    ]


def apron(
    *, width: float = 0.62, height: float = 0.86, bib: float = 0.28, neck: float = 0.60, tie: float = 0.80
) -> list[Surface]:
    """Return an apron with a bib: its panel, on which the place of the pocket is drawn, the pocket, a neck strap and two ties.

    Args:
        width, height: of the panel [m].
        bib: width of its upper edge [m].
        neck, tie: lengths of the straps [m].
    """
    for key, value, low, high in (
        ("width", width, 0.2, 1.5), ("height", height, 0.3, 1.6), ("bib", bib, 0.08, 0.8), ("neck", neck, 0.2, 1.5), ("tie", tie, 0.2, 2.0),
    ):  # fmt: skip
        check_range("apron", key, value, low, high)
    check_range("apron", "bib", bib, 0.08, 0.95 * width)
    rows = np.linspace(0.0, 1.0, 2 * _CELLS + 1)
    waist = 0.62
    half = np.where(
        rows <= waist,
        0.5 * width,
        0.5 * bib + 0.5 * (width - bib) * np.clip((1.0 - rows) / (1.0 - waist), 0.0, 1.0) ** 2.2,
    )
    u = np.linspace(-1.0, 1.0, _CELLS + 1)
    panel = np.stack(
        [half[:, None] * u, np.repeat(height * rows[:, None], len(u), axis=1), np.zeros((len(rows), len(u)))], axis=-1
    )
    low, high, near, far = 15, 27, _CELLS // 4, 3 * _CELLS // 4
    index = np.arange(panel[..., 0].size, dtype=np.int32).reshape(len(rows), len(u))
    place = np.concatenate([index[high:low:-1, near], index[low, near:far], index[low : high + 1, far]])
    corners = panel[[low, high], :][:, [near, far]]
    pocket_wide, pocket_high = float(np.ptp(corners[..., 0])), float(np.ptp(corners[..., 1]))
    x, y = np.meshgrid(np.linspace(0.0, pocket_wide, _CELLS + 1) + 1.0, np.linspace(0.0, pocket_high, _CELLS + 1))
    return [
        grid_surface("panel", panel, lines={"pocket": place, "waist": index[round(2 * _CELLS * waist)]}),
        grid_surface("pocket", np.stack([x, y, np.zeros_like(x)], axis=-1)),
        _strap("neck_strap", neck, (1.6, 0.9)),
        *(_strap(f"tie_{side}", tie, (place_x, 0.9)) for side, place_x in (("left", 1.0), ("right", 1.3))),
    ]


def sun_hat(*, head: float = 0.57, height: float = 0.09, brim: float = 0.08, slope: float = 25.0) -> list[Surface]:
    """Return a sun hat: a round crown, a side in two halves and a brim in two halves, for a head with 2 cm of ease.

    Args:
        head: girth of the head [m].
        height: of the side [m].
        brim: its width [m].
        slope: of the brim below the level [degrees].
    """
    for key, value, low, high in (
        ("head", head, 0.3, 0.75), ("height", height, 0.04, 0.2), ("brim", brim, 0.02, 0.3), ("slope", slope, 0.0, 80.0),
    ):  # fmt: skip
        check_range("sun_hat", key, value, low, high)
    radius = (head + _HAT_EASE) / (2.0 * np.pi)
    top = 0.94 * radius
    # A square's grid laid into a circle.
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, _CELLS + 1), np.linspace(1.0, -1.0, _CELLS + 1))
    x, z = u * np.sqrt(1.0 - 0.5 * v * v), v * np.sqrt(1.0 - 0.5 * u * u)
    found = [_piece("crown", np.stack([top * x, np.full_like(x, height), top * z], axis=-1))]
    reach, fall = brim * np.cos(np.radians(slope)), brim * np.sin(np.radians(slope))
    for name, upper, lower in (
        ("side", (top, height), (radius, 0.0)), ("brim", (radius, 0.0), (radius + reach, -fall)),
    ):  # fmt: skip
        for face, turn in (("front", 0.0), ("back", np.pi)):
            angle = turn + np.linspace(-0.5, 0.5, 2 * _CELLS + 1) * np.pi
            w = np.linspace(0.0, 1.0, 9)[:, None]
            r, y = lower[0] + w * (upper[0] - lower[0]), lower[1] + w * (upper[1] - lower[1])
            points = np.stack([r * np.sin(angle), np.repeat(y, len(angle), axis=1), r * np.cos(angle)], axis=-1)
            found.append(_piece(f"{name}_{face}", points, *(["bottom"] if name == "brim" else [])))
    return found


PIECES: Mapping[str, Callable[..., list[Surface]]] = {"tote": tote, "apron": apron, "sun_hat": sun_hat}
"""What has several pieces, by the name that scene files use."""


def make_pieces(name: str, **parameters: Any) -> tuple[Surface, ...]:
    """Return the pieces of that name; borders that lie at one place agree vertex by vertex.

    Args:
        name: a key of `PIECES`.
        parameters: of its function.

    Raises:
        InputError: an unknown parameter (names the nearest), or one of the wrong kind or out of range.
    """
    return tuple(meet_borders(make_named(name, PIECES[name], parameters), BORDERS_MEET)[0])


def _piece(name: str, points: FloatArray, *free: str) -> Surface:
    """Return a piece that has lines on those sides only that are sewn to nothing: seams name the others, and borders may get vertices."""
    surface = grid_surface(name, points)
    return replace(surface, lines={line: surface.lines[line] for line in ("centre", *free)})


def _strap(name: str, length: float, corner: tuple[float, float]) -> Surface:
    """Return an upright strip whose lower left corner is given."""
    x, y = np.meshgrid(np.linspace(0.0, _STRAP, 5), np.linspace(0.0, length, _CELLS + 1))
    points: FloatArray = np.stack([x + corner[0], y + corner[1] + _APART, np.zeros_like(x)], axis=-1)
    return grid_surface(name, points)
