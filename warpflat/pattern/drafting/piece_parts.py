"""Parts of a pattern's piece: edges, darts and holes; validated when they are made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, InputError, IntArray, nearest, polyline_length

__all__ = [
    "DEFAULT_ALLOWANCE",
    "EDGE_KINDS",
    "FOLD_STRAIGHT",
    "HEMMED_LEVELS",
    "LEFT_OUT",
    "MOST_ALLOWANCE",
    "SAME_POINT",
    "Dart",
    "Edge",
    "FoundSeam",
    "Hole",
    "check_points",
]

#: Allowance [m] of an edge that names none, by its kind.
DEFAULT_ALLOWANCE: Mapping[str, float] = {"seam": 0.010, "hem": 0.030, "fold": 0.0, "cut": 0.0, "dart": 0.0}
#: The widest allowance [m].
MOST_ALLOWANCE = 0.5
EDGE_KINDS = tuple(DEFAULT_ALLOWANCE)
#: Levels at which a free lower edge is hemmed. One at the waist or above is the line of a block, to be joined to a
#: skirt, a band or a facing.
HEMMED_LEVELS = frozenset(("abdomen", "hip", "thigh", "knee", "calf", "ankle", "biceps", "elbow", "forearm", "wrist"))

#: Ends the name of a line inside a piece that is the border of a hole which cannot be cut.
LEFT_OUT = " left out"
#: Ends of neighbouring edges that are closer than this [m] are one corner.
SAME_POINT = 1e-6
#: How far [m] an edge on the fold of the cloth may stray from straight.
FOLD_STRAIGHT = 5e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Edge:
    """One named stretch of a piece's outline, from corner to corner.

    Attributes:
        name: unique in its piece; it survives into every file.
        points: #P by 2 [m], from the first corner to the last, in the direction of the outline (counter-clockwise).
        kind: "seam", "hem", "fold" (lies on the fold of the cloth), "cut" (raw, no allowance) or "dart" (a dart's leg).
        allowance: [m]; None for the default of the kind.
        vertices: #P, the mesh vertex of each point, where the edge comes from a mesh.
        as_drawn: whether the points are the line as a file has it, straight between them, not samples of a curve.
    """

    name: str
    points: FloatArray
    kind: str = "seam"
    allowance: float | None = None
    vertices: IntArray | None = None
    as_drawn: bool = False

    def __post_init__(self) -> None:
        if self.kind not in EDGE_KINDS:
            raise InputError(f"edge {self.name!r}: unknown kind {self.kind!r}; {nearest(self.kind, EDGE_KINDS)}")
        points = check_points(self.points, f"edge {self.name!r}", at_least=2)
        if polyline_length(points) < SAME_POINT:
            raise InputError(f"edge {self.name!r} has no length; an edge runs between two different corners")
        _check_allowance(f"edge {self.name!r}", self.allowance)
        if self.kind == "fold" and self.allowance:
            raise InputError(f"edge {self.name!r} lies on the fold: its allowance must be 0, not {self.allowance!r} m")
        object.__setattr__(self, "points", points)

    @property
    def width(self) -> float:
        """Allowance [m] of this edge, its own or that of its kind."""
        return DEFAULT_ALLOWANCE[self.kind] if self.allowance is None else float(self.allowance)

    @property
    def length(self) -> float:
        """Length [m] along the points."""
        return polyline_length(self.points)


@dataclass(frozen=True, kw_only=True)
class Dart:
    """A wedge that is sewn shut: two neighbouring edges of kind "dart" that meet in its tip.

    Attributes:
        name: unique in its piece.
        left: the edge that runs from the border to the tip (it comes first, counter-clockwise).
        right: the edge that runs from the tip back to the border.
        fold_to: the side to which the wedge is pressed, "left" or "right"; None lets the piece decide: downwards for
            a dart that lies across the grain, towards the fold or the middle of the piece for one along it.
        cut: the wedge is cut away and its legs get a seam's allowance, as in wide darts, where the mouth has room for
            that.
        pleat: how far from the border a pleat is sewn [m]; it is folded, and open from there on. None for a dart.
    """

    name: str
    left: str
    right: str
    fold_to: str | None = None
    cut: bool = False
    pleat: float | None = None

    def __post_init__(self) -> None:
        if self.fold_to not in (None, "left", "right"):
            raise InputError(f"dart {self.name!r}: fold_to is {self.fold_to!r}; it must be 'left', 'right' or None")


@dataclass(frozen=True, kw_only=True, eq=False)
class Hole:
    """A closed line inside a piece.

    Attributes:
        name: unique in its piece.
        points: #P by 2 [m], counter-clockwise, the first not repeated.
        kind: "cutout" (cut away) or "dart" (a fish-eye dart: sewn shut, not cut; drill holes at its two ends).
        allowance: [m] of a cutout, inwards from its points; None for that of a seam.
    """

    name: str
    points: FloatArray
    kind: str = "cutout"
    allowance: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in ("cutout", "dart"):
            raise InputError(
                f"hole {self.name!r}: unknown kind {self.kind!r}; {nearest(self.kind, ('cutout', 'dart'))}"
            )
        _check_allowance(f"hole {self.name!r}", self.allowance)
        points = check_points(self.points, f"hole {self.name!r}", at_least=3)
        if np.linalg.norm(points[0] - points[-1]) < SAME_POINT:
            points = points[:-1]
        object.__setattr__(self, "points", points)

    @property
    def width(self) -> float:
        """Allowance [m] inside a cutout."""
        if self.kind == "dart":
            return 0.0
        return DEFAULT_ALLOWANCE["seam"] if self.allowance is None else float(self.allowance)


def _check_allowance(where: str, allowance: float | None) -> None:
    if allowance is not None and not 0 <= allowance <= MOST_ALLOWANCE:
        raise InputError(f"{where}: allowance {allowance!r} m; it must be between 0 and {MOST_ALLOWANCE:g} m")


def check_points(points: ArrayLike, where: str, *, at_least: int) -> FloatArray:
    """Return points (#P by 2 [m]) as an array.

    Raises:
        InputError: another shape, fewer than `at_least`, or a value that is not finite.
    """
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < at_least:
        raise InputError(f"{where}: points have shape {array.shape}; they must be #P by 2 with #P at least {at_least}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise InputError(f"{where}: point {row} is not finite; all coordinates are metres")
    return array


@dataclass(frozen=True, kw_only=True)
class FoundSeam:
    """A seam that was found on a whole garment, and its price.

    Attributes:
        name: as "side left"; where pieces are named by what they cover, their seams in the pattern may be parts of it.
        length: on the garment as it is worn [m]; its sides in the pattern may differ, as those of a band that is stretched.
        released: strain energy that it releases, by trial [J]; None where nothing was tried.
        needed: why the cloth cannot lie flat without it: "opens a tube"; "" where it can.
    """

    name: str
    length: float
    released: float | None = None
    needed: str = ""

    def as_dict(self) -> dict[str, object]:
        """Return plain data."""
        return {"name": self.name, "length_m": self.length, "released_j": self.released, "needed": self.needed}
