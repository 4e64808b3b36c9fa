"""Bricks: the quad patches between two profiles and two vertical lines, by names that a person can type."""

from __future__ import annotations

import fnmatch
import functools
import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core import InputError, IntArray, nearest
from warpflat.garment.mannequin.layout import ARM_LEVELS, LEG_LEVELS, RING_LEVELS, Layout

__all__ = ["TRUNK_LEVELS", "Brick", "brick", "select_bricks"]

#: Levels of the trunk from the top down; two of them name a band of bricks, ``waist-hip``.
TRUNK_LEVELS = ("shoulder", "yoke", "chest", *reversed(RING_LEVELS))
_ALIASES = {"across-chest": "chest", "neck-base": "neck", "shoulders": "shoulder", "upper-arm": "biceps"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Brick:
    """One brick.

    Attributes:
        name: ``upper-lower/column``, as ``waist-abdomen/front-left-centre``.
        vertices: #rows by #columns, vertex indices of the mannequin, rows upward, columns leftward around the body.
        faces: indices of its faces in the mannequin.
        neighbours: names of the bricks across its ``up``, ``down``, ``left`` and ``right`` side, empty at a border.
            A side has two neighbours where the armhole or the neckline begins midway.
    """

    name: str
    vertices: IntArray
    faces: NDArray[np.int64]
    neighbours: Mapping[str, tuple[str, ...]]


def brick(layout: Layout, name: str) -> Brick:
    """Return a brick by its name.

    Raises:
        InputError: if there is no such brick, or the name covers several.
    """
    chosen = select_bricks(layout, [name])
    if len(chosen) != 1:
        raise InputError(f"brick {name!r} covers {len(chosen)} bricks ({', '.join(chosen[:4])}, ...): name one")
    grid = layout.bricks[chosen[0]]
    index = list(layout.bricks).index(chosen[0])
    sides = {"up": grid[-1], "down": grid[0], "left": grid[:, -1], "right": grid[:, 0]}
    owners = _border_owners(layout)
    neighbours: dict[str, tuple[str, ...]] = {}
    for side, ids in sides.items():
        found: dict[str, None] = {}
        for edge in itertools.pairwise(ids.tolist()):
            for other in owners.get((min(edge), max(edge)), ()):
                if other != chosen[0]:
                    found[other] = None
        neighbours[side] = tuple(found)
    return Brick(name=chosen[0], vertices=grid, faces=np.flatnonzero(layout.face_brick == index), neighbours=neighbours)


@functools.lru_cache(maxsize=4)
def _border_owners(layout: Layout) -> dict[tuple[int, int], list[str]]:
    owners: dict[tuple[int, int], list[str]] = {}
    for name, grid in layout.bricks.items():
        for ids in (grid[0], grid[-1], grid[:, 0], grid[:, -1]):
            for a, b in itertools.pairwise(ids.tolist()):
                owners.setdefault((min(a, b), max(a, b)), []).append(name)
    return owners


def select_bricks(layout: Layout, patterns: Iterable[str]) -> list[str]:
    """Return names of the bricks that patterns cover, in the mannequin's order.

    Args:
        layout: the grid.
        patterns: ``upper-lower/column``. The levels may lie further apart than one brick (``waist-hip``,
            ``neck-waist``), the column may hold ``*`` (``front-*``, ``*-left-centre``).

    Raises:
        InputError: for a level or column that does not exist.
    """
    chosen: set[str] = set()
    for pattern in patterns:
        band, slash, column = pattern.strip().partition("/")
        for alias, level in _ALIASES.items():
            band = band.replace(alias, level)
        upper, dash, lower = band.partition("-")
        if not slash or not dash or not column:
            raise InputError(f"brick {pattern!r}: write upper-lower/column, as waist-hip/front-left-centre")
        top = "shoulder" if upper == "neck" else upper
        part = next((each for each in (TRUNK_LEVELS, ARM_LEVELS, LEG_LEVELS) if {top, lower} <= set(each)), None)
        if (upper, lower) == ("collar", "neck"):
            bands = {"collar-neck"}
        elif part is not None:
            i, j = part.index(top), part.index(lower)
            if i >= j:
                raise InputError(f"brick {pattern!r}: {upper} does not lie above {lower}; write the upper level first")
            bands = {f"{a}-{b}" for a, b in itertools.pairwise(part[i : j + 1])}
        else:
            known = {"collar", "neck", *TRUNK_LEVELS, *ARM_LEVELS, *LEG_LEVELS}
            for level in (upper, lower):
                if level not in known:
                    raise InputError(f"brick {pattern!r}: level {level!r} is unknown: {nearest(level, known)}")
            words = f"{upper} and {lower} are not levels of one part (neck, trunk, arm, leg)"
            raise InputError(f"brick {pattern!r}: {words}")
        columns = {name.partition("/")[2] for name in layout.bricks if name.partition("/")[0] in bands}
        matching = fnmatch.filter(columns, column)
        if not matching:
            raise InputError(f"brick {pattern!r}: no column {column!r} there: {nearest(column, columns)}")
        chosen |= {f"{b}/{c}" for b in bands for c in matching} & set(layout.bricks)
    return [name for name in layout.bricks if name in chosen]
