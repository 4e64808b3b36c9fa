"""How seams are looked for; known before anything is computed, so that a scene can be checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpflat.core import AXES, FloatArray, InputError, is_number, nearest, quote_value

__all__ = ["FAMILIES", "NO_PATTERN", "Direction", "SeamCut", "SeamOptions", "in_family"]

Direction = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
#: More than this share of the cloth beyond its limit is no pattern yet.
NO_PATTERN = 0.1
#: Names of seams that are found, without their side.
FAMILIES = (
    "armhole",
    "centre back",
    "centre front",
    "dart",
    "hood",
    "inseam",
    "panel",
    "princess",
    "shoulder",
    "side",
    "underarm",
    "waist",
    "yoke",
)

Point = Sequence[float]


def in_family(seam: str, family: str) -> bool:
    """Return whether a seam is of a family, as "side left" of "side"; "side left" is a family of one."""
    return seam == family or seam.startswith(f"{family} ")


@dataclass(frozen=True, kw_only=True)
class SeamCut:
    """A seam that the user draws on a whole garment, in one way.

    Attributes:
        name: of the seam; cuts of one name are one seam.
        points: places through which it runs straight over the cloth: points [m], or numbers of vertices of the file.
        line: points [m] of a polyline near the cloth, onto which it is projected.
        closed: points and line return to their first point.
        plane: point [m] and normal; the seam is where it meets the cloth.
        towards: only the half of the plane that lies in this direction from its point.
        nearest: only the one curve that is the nearest to the plane's point.
        edges: rows of vertices of the file, from 0, each joined to the next by an edge.
        where: what messages call it.
    """

    name: str | None = None
    points: tuple[Point | int, ...] = ()
    line: tuple[Point, ...] = ()
    closed: bool = False
    plane: tuple[Point, Point] | None = None
    towards: Point | None = None
    nearest: bool = False
    edges: tuple[Sequence[int], ...] = ()
    where: str = "cut"

    def validate(self) -> None:
        """Check the cut.

        Raises:
            InputError: it is given in no way or in several, or by what are no points or vertices.
        """
        ways = {"points": self.points, "line": self.line, "plane": self.plane, "edges": self.edges}
        given = [way for way, value in ways.items() if value]
        if len(given) != 1:
            raise InputError(f"{self.where}: give it in one way: {', '.join(ways)}")
        way = given[0]
        if self.closed and way not in ("points", "line"):
            raise InputError(f"{self.where}: closed belongs to points or a line, not to {way}")
        if (self.towards is not None or self.nearest) and way != "plane":
            raise InputError(
                f"{self.where}: {'nearest' if self.nearest else 'towards'} belongs to a plane, not to {way}"
            )
        least = 3 if self.closed else 2
        if way in ("points", "line") and len(ways[way] or ()) < least:
            raise InputError(f"{self.where}: {way} needs at least {least} places")
        places = [place for place in self.points if not is_number(place, whole=True)]
        for place in (*places, *self.line, *(self.plane or ()), *(() if self.towards is None else (self.towards,))):
            if not (isinstance(place, Sequence) and len(place) == 3 and all(map(_is_coordinate, place))):
                raise InputError(f"{self.where}: {place!r} is no point; a point is three numbers [m]")
        for direction in (() if self.plane is None else self.plane[1:]) + (
            () if self.towards is None else (self.towards,)
        ):
            if not any(direction):
                raise InputError(
                    f"{self.where}: a direction of (0, 0, 0) leads nowhere; give three numbers, one of them not 0"
                )
        for row in (*self.edges, *([place] for place in self.points if is_number(place, whole=True))):
            if not (isinstance(row, Sequence) and all(is_number(v, whole=True) and v >= 0 for v in row)):
                raise InputError(
                    f"{self.where}: {row!r} is no row of vertices; they are numbered from 0, as in the file"
                )
        if any(len(row) < 2 for row in self.edges):
            raise InputError(f"{self.where}: a row of one vertex has no edge; give two vertices or more")


def _is_coordinate(value: object) -> bool:
    return is_number(value) and math.isfinite(value) and abs(value) <= 1e6


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """How seams are looked for.

    Attributes:
        find: "auto" looks for seams beside those that the user draws; "none" makes these alone.
        cuts: seams that the user draws.
        up, front: directions as "+y" and "+z"; found from the shape if not given.
        no: seams that are left closed, by name, as "shoulder" or "shoulder left"; "dart" for no darts.
        keep: seams that are made in any case, by name: "waist", "side left".
        limit: share of the cloth that may stay beyond its strain limit before further seams and darts are looked for.
        smooth: wrinkles of draped or scanned cloth are smoothed over this length before anything is cut [m]; 0 leaves them.
        most_pieces: at most so many of one layer; as many as are usual for its kind if not given.
        waist: a place at the height of the body's waist [m], where seams called so are made; found from the shape if not given.
    """

    find: Literal["auto", "none"] = "auto"
    cuts: tuple[SeamCut, ...] = ()
    up: str | None = None
    front: str | None = None
    no: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    limit: float = 0.02
    most_pieces: int | None = None
    smooth: float = 0.0
    waist: Point | None = None

    def waist_along(self, up: FloatArray) -> float | None:
        """Return the height of the body's waist along a direction [m], if it is known."""
        return None if self.waist is None else float(np.array(self.waist) @ up)

    def forbids(self, seam: str) -> bool:
        """Return whether a seam is to be left closed."""
        return any(in_family(seam, no) for no in self.no)

    def keeps(self, seam: str) -> bool:
        """Return whether a seam is made in any case."""
        return any(in_family(seam, keep) for keep in self.keep)

    def validate(self) -> None:
        """Check the options.

        Raises:
            InputError: an unknown direction or seam, a cut that is none, or a value out of range.
        """
        if self.find not in ("auto", "none"):
            raise InputError(f"find = {self.find!r} is unknown; {nearest(str(self.find), ('auto', 'none'))}")
        for cut in self.cuts:
            cut.validate()
        for key, names in (("no", self.no), ("keep", self.keep)):
            for name in names:
                plain = str(name).removesuffix(" left").removesuffix(" right")
                if plain not in FAMILIES and not (key == "no" and in_family(name, "seam")):
                    raise InputError(
                        f"{key} = {quote_value(name)}: no seam has that name; {nearest(plain, FAMILIES)}, each with left or right behind it"
                    )
                if key == "keep" and plain == "dart":
                    raise InputError("keep = 'dart': where a dart lies is for the energy to say; draw it as a cut")
                if key == "keep" and self.forbids(name):
                    raise InputError(f"{quote_value(name)} is both in keep and in no; leave it out of one")
        for key, value in (("up", self.up), ("front", self.front)):
            if value is not None and str(value) not in AXES:
                raise InputError(f"{key} = {value!r} is no direction; {nearest(str(value), AXES)}")
        if self.waist is not None and not (len(self.waist) == 3 and all(map(_is_coordinate, self.waist))):
            raise InputError(f"waist = {self.waist!r} is no place; give three numbers [m], of which its height counts")
        if not 0.0 <= self.smooth <= 0.1:
            raise InputError(f"smooth = {1e3 * self.smooth:g} mm is out of range; it lies between 0 and 100 mm")
        if not 0.0 <= self.limit <= 1.0:
            raise InputError(f"limit = {self.limit:g} is no share of the cloth; it lies between 0 and 1")
        if self.most_pieces is not None and not 1 <= self.most_pieces <= 1000:
            raise InputError(f"most_pieces = {self.most_pieces} is no number of pieces from 1 to 1000")
        if self.up and self.front and self.up[1] == self.front[1]:
            raise InputError(
                f"up = {self.up!r} and front = {self.front!r} lie along one axis; they are at right angles"
            )
