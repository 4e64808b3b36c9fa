"""The tables of a scene file's cuts, and the places in space that they and lines name."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from warpflat.core.file_names import plain_name
from warpflat.core.toml_file import Table

__all__ = ["AutoCutTable", "CutPlane", "CutTable", "PlaneTable", "Point", "PointOrVertex", "Share", "Vertex"]

# The square of a much larger coordinate overflows.
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Point = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
Vertex = Annotated[int, Field(ge=0)]
PointOrVertex = Annotated[
    Annotated[Point, Tag("point")] | Annotated[Vertex, Tag("vertex")],
    Discriminator(lambda value: "point" if isinstance(value, list) else "vertex"),
]


class PlaneTable(Table):
    """A plane by a point on it [m] and its normal (any length)."""

    point: Point
    normal: Point


Share = Annotated[float, Field(ge=0.0, le=1.0)]


class CutPlane(PlaneTable):
    """A plane through a point [m], as given and all through; of several curves the nearest to the point.

    With `towards` only the part from the point, which then lies on the piece, in that direction to the border.
    """

    towards: Point | None = None


class CutTable(Table):
    """A cut, given in one of three ways. Vertices count those of the file, from 0; points are in metres.

    `line` names a feature line, of which `part` takes a part by shares of its length; `from` and `to` are the ends of the
    straightest path on the surface, `through` places on its way; `plane` cuts as a ruler lies. The faces that a path
    between points or along a plane runs through are divided. Tables with one `name` are one cut.

    On a form a cut is a dart in one `piece`, along a `line` of it, from the border to its tip. Lines of a book's darts ("bust",
    "princess front left" and the like from the waist) need no `part`: `tip_mm` is how far before the bust point, or below
    the waist in a skirt, the dart ends. `at` names the line on which its mouth lies, as "shoulder left". `towards` puts it
    between two lines, `between` at that share of the way. `mouth_mm` is how wide it opens, or `like` another dart of its
    piece; the energy that this costs is told. With `pleat_mm` it is a pleat: folded, sewn this far from its mouth, and open
    below. It is `mirrored` unless that is false. A `part` of [0, 1] is a seam, which parts the piece; one with both shares
    inside is a dart with two tips, and `mouth_mm` its width half-way between them. `omit` leaves out the dart that the form's
    `shape` has there.
    """

    name: Annotated[str, Field(max_length=100), AfterValidator(lambda name: plain_name(name, " _.+-"))] | None = None
    line: str | None = None
    part: Annotated[list[Share], Field(min_length=2, max_length=2)] | None = None
    from_: PointOrVertex | None = Field(default=None, alias="from")
    to: PointOrVertex | None = None
    through: list[PointOrVertex] = Field(default_factory=list)
    plane: CutPlane | None = None
    tip_back: Annotated[float, Field(ge=0.0)] = 0.0
    """How far the tips of its darts are drawn back, [m]."""
    piece: str | None = None
    towards: str | None = None
    between: Share = 0.5
    tip_mm: Annotated[float, Field(ge=0.0, le=500.0)] | None = None
    mouth_mm: Annotated[float, Field(ge=1.0, le=300.0)] | None = None
    like: str | None = None
    pleat_mm: Annotated[float, Field(ge=1.0, le=500.0)] | None = None
    at: str | None = None
    omit: bool = False
    mirrored: bool = True

    @property
    def parts_piece(self) -> bool:
        """Whether it cuts a whole line."""
        return self.part is not None and set(self.part) == {0.0, 1.0}

    def check_for_form(self, where: str) -> None:
        """Refuse what a dart in a form does not have."""
        if self.line is None or self.piece is None:
            raise ValueError(
                f"{where}: on a form a dart needs its piece and a line of it, as "
                'piece = "front_bodice", line = "princess front left"'
            )
        if self.tip_back:
            raise ValueError(f"{where}: tip_back belongs to a [surface]; on a form give tip_mm")
        if self.part is not None and (self.tip_mm is not None or self.towards is not None or self.at is not None):
            raise ValueError(f"{where}: give part, or tip_mm, towards and at")
        if self.mouth_mm is not None and self.like is not None:
            raise ValueError(f"{where}: give mouth_mm or like")
        if self.parts_piece and (self.mouth_mm or self.like or self.pleat_mm):
            raise ValueError(
                f"{where}: a cut along the whole line is a seam, which has no mouth; leave out mouth_mm, like and pleat_mm"
            )

    def check_for_surface(self, where: str) -> None:
        """Refuse what only a dart in a form has."""
        given = self.model_fields_set & {
            "piece",
            "towards",
            "between",
            "tip_mm",
            "mouth_mm",
            "like",
            "pleat_mm",
            "at",
            "omit",
            "mirrored",
        }
        if given:
            raise ValueError(f"{where}: {sorted(given)[0]} belongs to a form's darts; leave it out on a [surface]")

    @model_validator(mode="after")
    def _one_way(self) -> CutTable:
        if (self.from_ is None) != (self.to is None):
            raise ValueError("a path needs both from and to")
        if sum(way is not None for way in (self.line, self.from_, self.plane)) != 1:
            raise ValueError("give the cut in one way: line, from and to, or plane")
        if self.part is not None and self.line is None:
            raise ValueError("part takes a part of a line; give line")
        if self.through and self.from_ is None:
            raise ValueError("through lists places between from and to; give both")
        return self


class AutoCutTable(Table):
    """Cutting by itself: the best of all candidates, again and again until it is enough (see `warpflat cuts`)."""

    max_cuts: Annotated[int, Field(ge=1, le=20)] = 2
    """At most so many; a mirrored pair counts as one."""
    stop_below: Annotated[float, Field(ge=0.0)] = 0.0
    """A piece of at most this model energy needs no further cut [J]."""
    stop_below_strain: Annotated[float, Field(ge=0.0)] = 0.0
    """A piece of which 98 % is strained by at most this share along warp and weft, as worn, needs no further cut."""
    by: Literal["released", "per_cm"] = "released"
    """What makes a cut the best: the energy it releases in all, or per centimetre."""
