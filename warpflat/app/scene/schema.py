"""The tables of a scene file, as pydantic models."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_type_hints

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    create_model,
    model_validator,
)

from warpflat.app.scene.auto_cut import AutoCutTable
from warpflat.app.scene.first_shapes import PIECES
from warpflat.app.scene.options import Dialect, Paper, PatternFormat, PrintedUnit
from warpflat.app.scene.plain_names import plain_name
from warpflat.core import Table, is_number, quote_value
from warpflat.flat import DEFAULT_FABRIC, FabricTable, RelaxOptions
from warpflat.garment import (
    Direction,
    DrapeOptions,
    FinishingTable,
    FormDart,
    MannequinTable,
    OpeningTable,
    PocketTable,
    SeamTable,
)

__all__ = [
    "PATH_KEYS",
    "BorderTable",
    "ClothTable",
    "ConstraintTable",
    "CutTable",
    "FileSurface",
    "FindSeamsTable",
    "LineTable",
    "MarkerTable",
    "OutputTable",
    "PatternTable",
    "PieceTable",
    "SceneTable",
    "SeamCutTable",
    "ShapeSurface",
    "kind_of_surface",
]


# The square of a much larger coordinate overflows.
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Point = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
Vertex = Annotated[int, Field(ge=0)]
PointOrVertex = Annotated[
    Annotated[Point, Tag("point")] | Annotated[Vertex, Tag("vertex")],
    Discriminator(lambda value: "point" if isinstance(value, list) else "vertex"),
]

# A text, or something that is none.
Other = TypeVar("Other")
_TEXT = Discriminator(lambda value: "text" if isinstance(value, str) else "other")
TextOr = Annotated[Annotated[str, Tag("text")] | Annotated[Other, Tag("other")], _TEXT]
CutName = Annotated[str, Field(max_length=100), AfterValidator(lambda name: plain_name(name, " _.+-"))]
Points = Annotated[list[Point], Field(min_length=2)]


class PlaneTable(Table):
    """A plane by a point on it [m] and its normal (any length)."""

    point: Point
    normal: Point


Share = Annotated[float, Field(ge=0.0, le=1.0)]


class CutPlane(PlaneTable):
    """A plane by a point on it [m] and its normal (any length), along which a piece or a garment is cut.

    Of a piece, of several curves the nearest to the point is cut, all through; with `towards` only the part from the point, which then
    lies on the piece, in that direction to the border. Of a garment all curves in which the plane meets it are cut; with `towards` only
    those in the half of the plane that lies in this direction from the point, with `nearest` only the one that is the nearest to it.
    """

    towards: Point | None = None
    nearest: bool = False


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

    name: CutName | None = None
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
        of_darts = {"omit", *(field.name for field in dataclasses.fields(FormDart))} - {"name", "line", "part"}
        if given := self.model_fields_set & of_darts:
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
        if self.plane is not None and self.plane.nearest:
            raise ValueError("plane: of a piece the nearest curve is cut anyway; leave nearest out")
        return self


def _as_component(value: Any) -> Any:
    if value not in ("largest", "all") and not (is_number(value, whole=True) and value >= 0):
        raise ValueError(f'should be "largest", "all" or a number from 0, largest first; got {quote_value(value)}')
    return value


Component = Annotated[Literal["largest", "all"] | int, BeforeValidator(_as_component)]


class FileSurface(Table):
    """A mesh file; `file` starts in the scene's folder and may name environment variables, ${WARPFLAT_DATA}/x.obj."""

    file: str = Field(min_length=1)
    units: str | None = None
    component: Component | None = None
    """Which connected part of the mesh: the largest, or a number from 0, largest first; with "all" every part of every object is a piece,
    and borders that meet are seams."""
    prim: str | None = None
    meet_mm: Annotated[float, Field(ge=0, le=10)] | None = None
    """With component = "all": borders that run along each other within this distance are sewn; 1 if not given, 0 for none but those at
    one place."""
    pattern: Literal["uv"] | None = None
    """"uv": the islands of the texture are the sewn pattern, in true size; it is taken as it is and compared with what flattening gives."""

    @model_validator(mode="before")
    @classmethod
    def _one_source(cls, data: Any) -> Any:
        if isinstance(data, dict) and {"file", "shape"} <= data.keys():
            raise ValueError("give the surface by its file or by a shape, not both")
        return data


class ShapeSurface(Table):
    """A surface by formula; its other keys are the parameters of that shape, see Shapes below."""

    model_config = ConfigDict(extra="allow")
    shape: str


def kind_of_surface(value: Any) -> str:
    given = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    return "by-formula" if "shape" in given and "file" not in given else "from-file"


class BorderTable(Table):
    """A stretch of the border between two of its vertices, or the ones nearest to two points [m]."""

    start: PointOrVertex
    end: PointOrVertex
    direction: Literal["shortest", "with", "against"] = "shortest"


class LineTable(Table):
    """A feature line, given in one of five ways. Vertices count those of the file, from 0; points are in metres.

    `vertices` lists every vertex, `from` and `to` are the ends of a shortest path, `plane` cuts the piece, `border` is
    a side (bottom, left, right, top) or a stretch, `curve` the points of a polyline or the prim path of a USD curve.
    """

    vertices: Annotated[list[Vertex], Field(min_length=2)] | None = None
    from_: PointOrVertex | None = Field(default=None, alias="from")
    to: PointOrVertex | None = None
    plane: PlaneTable | None = None
    border: TextOr[BorderTable] | None = None
    curve: TextOr[Points] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> LineTable:
        if (self.from_ is None) != (self.to is None):
            raise ValueError("a shortest path needs both from and to")
        ways = [self.vertices, self.from_, self.plane, self.border, self.curve]
        if sum(way is not None for way in ways) != 1:
            raise ValueError("give the line in one way: vertices, from and to, plane, border, or curve")
        return self


class PieceTable(Table):
    """What one piece of several has of its own: of a file with component = "all", or of a garment that is cut along seams.

    Vertices count those of the piece's object in the file, from 0, or those of its own OBJ file where the garment was cut.
    """

    datum: str | None = None
    """A line of `lines`, an edge of the piece as "to front", or a side of its border."""
    grain_angle: Annotated[float, Field(ge=-360, le=360)] | None = None
    """Angle from the datum to the warp, counter-clockwise; that of the scene if not given."""
    lines: dict[str, LineTable] = Field(default_factory=dict)
    cuts: list[CutTable] = Field(default_factory=list)


class FindSeamsTable(Table):
    """How the seams of a whole garment are found (see `warpflat.find_seams`); in a scene it is `[seams]`, a table, not `[[seams]]`.

    With `find = "auto"` the garment is cut where a tailor would cut it, with "none" only where `[[seams_cut]]` says. Without this table
    a garment that cannot lie flat in one piece is cut.
    """

    find: Literal["auto", "none", "file", "uv", "materials", "groups"] = "auto"
    """What is cut: "auto" along texture islands that look like cut pieces, else where a tailor would; "none" only what is drawn; "uv",
    "materials", "groups" along what the file has of these, "file" along the first of them that it has."""
    up: Direction | None = None
    front: Direction | None = None
    no: list[str] = Field(default_factory=list)
    """Seams that are left closed: "shoulder", or "shoulder left"; "dart" for no darts; "uv": islands of the texture are not followed."""
    keep: list[str] = Field(default_factory=list)
    """Seams that are made in any case: "waist", "yoke", "centre back", "side left"."""
    smooth_mm: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Length over which wrinkles of draped or scanned cloth are smoothed before it is cut; how far the cloth moves is told."""
    limit: Annotated[float, Field(ge=0, le=1)] = 0.02
    """Share of the cloth that may stay beyond its strain limit before further seams and darts are looked for."""
    most_pieces: Annotated[int, Field(ge=1, le=1000)] | None = None
    """At most so many pieces of one layer; as many as are usual for its kind if not given."""
    body: str | None = None
    """A mesh file of the body under the garment, in the same place and unit: a seam at the waist is made at the body's waist."""


class SeamCutTable(Table):
    """A seam of a whole garment that you draw (see `warpflat.SeamCut`), in one of five ways.

    `points` lists places through which it runs straight over the cloth: points [m], or vertices of the file, from 0. `line` is a polyline
    near the cloth, which is projected onto it: points [m], or the name of a line of the file. `plane` cuts where it meets the cloth.
    `edges` lists rows of vertices, or names a file of them: a row in each line, or JSON lists. `marked` takes all lines and creases that
    the file has. Tables with one `name` are one seam. All are made at once, whatever their order.
    """

    name: CutName | None = None
    points: Annotated[list[PointOrVertex], Field(min_length=2)] | None = None
    line: TextOr[Points] | None = None
    closed: bool = False
    """Points and lines return to their first point."""
    plane: CutPlane | None = None
    edges: TextOr[Annotated[list[Annotated[list[Vertex], Field(min_length=2)]], Field(min_length=1)]] | None = None
    marked: bool = False

    @model_validator(mode="after")
    def _one_way(self) -> SeamCutTable:
        ways = (self.points, self.line, self.plane, self.edges, self.marked or None)
        if sum(way is not None for way in ways) != 1:
            raise ValueError("give the seam in one way: points, line, plane, edges, or marked = true")
        if self.closed and self.points is None and not isinstance(self.line, list):
            raise ValueError("closed belongs to points, or to the points of a line")
        return self


class ConstraintTable(Table):
    """A constraint on an edge or a feature line, in one piece or in all that have it.

    `straight` lays it on a straight line: of any direction ("free"), parallel to the grain ("warp") or at right angles to it
    ("weft"). `length_mm` keeps every mesh edge at its length on the body ("body") or at its share of a length,
    that of the whole line, unfolded. `symmetric` makes the piece, cut whole, its own mirror image about the line.
    """

    line: str = Field(min_length=1)
    piece: str | None = None
    straight: Literal["free", "warp", "weft"] | None = None
    length_mm: (
        Annotated[
            Annotated[Literal["body"], Tag("text")] | Annotated[float, Field(ge=1, le=20_000), Tag("other")],
            _TEXT,
        ]
        | None
    ) = None
    symmetric: bool = False

    @model_validator(mode="after")
    def _something(self) -> ConstraintTable:
        if self.straight is None and self.length_mm is None and not self.symmetric:
            raise ValueError('ask for something: straight = "free", length_mm = "body", or symmetric = true')
        return self


class WearTable(Table):
    """The intended fit of the garment (see `warpflat.flat.model.wear.Wear`); an empty table asks how it sits, no more."""

    stretch_warp: float = 0.0
    stretch_weft: float = 0.0
    pressure: float | None = None


def _bounds_of_drape(name: str) -> Any:
    low, high = DrapeOptions.BOUNDS[name]
    return Field(ge=low, le=high)


class DrapeTable(Table):
    """The garment is sewn and put on its body (see `warpflat.drape`)."""

    friction: Annotated[float, _bounds_of_drape("friction")] = DrapeOptions.friction
    tolerance: Annotated[float, _bounds_of_drape("tolerance")] = DrapeOptions.tolerance
    max_steps: Annotated[int, _bounds_of_drape("max_steps")] = DrapeOptions.max_steps
    hold: list[str] = Field(default_factory=list)
    """Lines and edges that stay where they are: "piece.line", or "line" for every piece that has one."""
    correct: bool = False
    """Whether the pattern is corrected until the worn garment lies on the designed surface, or no nearer."""
    correct_fabric: str | None = None
    """Another cloth for the corrected pattern, in which it is to be worn in the same shape."""
    usd: bool = False
    """Whether the worn garment is written as one mesh with its pattern, `worn.usdc`, as Style3D has it."""

    def options(self) -> DrapeOptions:
        """Return how the garment comes to rest."""
        return DrapeOptions(friction=self.friction, tolerance=self.tolerance, max_steps=self.max_steps)


class OutputTable(Table):
    """Files written besides `metrics.json` and `NAME.obj`."""

    frames: Annotated[int, Field(ge=0, le=100_000)] = 60
    """About how many frames from the development to rest, with more for every cut; 0 for no `frames.usdc`."""
    frame_every: Annotated[int, Field(ge=1)] | None = None
    """A frame every so many steps instead, as they are."""
    compact_film: bool = False
    """Whether `frames.usdc` stores points of computed layouts only; USD interpolates those of frames between."""
    picture: bool = True
    review: bool = True
    """Whether a run with a picture writes `review.html`, too."""


class PatternTable(Table):
    """The pattern files: `NAME.dxf`, `NAME.svg`, `pattern.pdf`, `pattern.json`."""

    formats: list[PatternFormat] = ["dxf", "svg", "pdf", "json"]  # noqa: RUF012 (pydantic copies)
    """Formats that are written; an empty list writes none."""
    dialect: Dialect = "aama"
    paper: Paper = "A4"
    allowance_mm: Annotated[float, Field(ge=0, le=100)] = 10.0
    hem_mm: Annotated[float, Field(ge=0, le=200)] = 30.0
    kinds: dict[str, Literal["seam", "hem", "fold", "cut"]] = Field(default_factory=dict)
    """What an edge is, by its name: "front.neck", or "neck" for every piece that has one."""
    allowances_mm: dict[str, Annotated[float, Field(ge=0, le=200)]] = Field(default_factory=dict)
    """Allowances by edge, named as in `kinds` [mm]."""
    units: PrintedUnit = "cm"
    """Units of lengths in printed words."""
    names: dict[str, Annotated[str, Field(min_length=1, max_length=60)]] = Field(default_factory=dict)
    """What is printed instead of a piece's name: front_bodice = "Vorderteil"."""
    language: Literal["en", "de"] = "en"
    """Language of what is printed."""
    words: dict[str, Annotated[str, Field(min_length=1, max_length=200)]] = Field(default_factory=dict)
    """Other printed words, by the English phrase or name: "side" = "Seitennaht"."""
    tolerance_mm: Annotated[float, Field(ge=0.01, le=5)] | None = None
    """How far a drawn curve may lie from the mesh's border; 0.1 mm, or more on a ragged one, if not given."""
    sizes: list[str] = Field(default_factory=list)
    """More sizes of a mannequin's garment, flattened too and laid upon each other as a graded nest."""


class ClothTable(Table):
    """Cloth beside its fabric: what it loses in the wash, and what else the garment is cut from."""

    shrinkage_warp: Annotated[float, Field(ge=0, le=0.25)] = 0.0
    """Share of its length that the cloth loses along the warp; pieces are drawn larger by it."""
    shrinkage_weft: Annotated[float, Field(ge=0, le=0.25)] = 0.0
    lining: Annotated[str, Field(max_length=40)] = ""
    """What the lining is called; with a name the shell's pieces are lined."""
    repeat_warp_mm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Repeat of stripes or checks along the warp; 0 where there is none."""
    repeat_weft_mm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    match: list[str] = Field(default_factory=list)
    """Seams at whose first notch both sides lie on the same stripe in the marker."""
    interfacing: Annotated[str, Field(max_length=40)] = ""
    """What the interfacing is called; with a name facings, waistbands, cuffs, collars and flies are cut from it too."""
    pocketing: Annotated[str, Field(max_length=40)] = ""
    """What the cloth of pocket bags is called; with a name these are cut from it, not from the shell's cloth."""


class MarkerTable(Table):
    """The lay plan on a cloth (see `warpflat.Cloth`); one garment of each size. Lengths in metres."""

    width: Annotated[float, Field(ge=0.1, le=10)]
    one_way: bool = False
    reversible: bool = False
    gap: Annotated[float, Field(ge=0, le=0.1)] = 0.002
    seconds: Annotated[int, Field(ge=1, le=600)] = 5
    folded: bool = False
    """The cloth is folded lengthwise: halves lie against its fold, pairs are cut at once."""


_RELAX_FIELDS: dict[str, Any] = {
    field.name: (get_type_hints(RelaxOptions)[field.name] | None, None) for field in dataclasses.fields(RelaxOptions)
}
if TYPE_CHECKING:
    RelaxTable = Table
else:
    # The fields of RelaxOptions, each optional, so that the two cannot differ.
    RelaxTable = create_model("RelaxTable", __base__=Table, **_RELAX_FIELDS)


#: Keys of a scene under which files are named, from table to table; some have other values, too.
PATH_KEYS = (
    ("start",), ("fabric_files",), ("surface", "file"), ("mannequin", "scan"), ("seams", "body"), ("find_seams", "body"),
    ("seams_cut", "edges"),
)  # fmt: skip
# Keys of a scene that change the pattern of a mesh.
_CHANGES_PATTERN = (
    "lines", "cuts", "auto_cut", "pieces", "seams", "find_seams", "seams_cut", "constraints", "datum", "start", "grain_angle", "bands",
    "bands_shorter", "wear", "drape",
)  # fmt: skip
# Those that belong to one of several pieces.
_OF_ONE_PIECE = ("lines", "datum", "start", "cuts", "auto_cut", "seams", "drape")
# Those that a form has and a surface has not, with what is said where they are given there.
_OF_FORM = {
    "shape": "shape belongs to a form; on a [surface] give [[cuts]] or [auto_cut]",
    **{
        key: f"{key} belongs to a form's pieces; on a [surface] leave it out"
        for key in ("openings", "finishing", "pockets", "curves_mm")
    },
    **{key: f"{key} belongs to a form; a [surface] is as large as its mesh" for key in ("pulled_on", "ease")},
    "half": "half belongs to a form's pieces; on a [surface] give the half's mesh, and in [pattern] "
    'kinds = { left = "fold" }',
}
# And those that a surface has and a form has not.
_OF_SURFACE = {
    **dict.fromkeys(
        ("bands", "bands_shorter"),
        "bands and bands_shorter are for pieces of a [surface]; a form's bands are its [[finishing]]",
    ),
    **{
        key: f"{table} is for a garment from a file; a form has its own seams, and [[seams]] change them"
        for key, table in (("find_seams", "[seams]"), ("seams_cut", "[[seams_cut]]"))
    },
    "pieces": "pieces is for pieces from a file; on a form give [[cuts]] with their piece",
    "start": "start belongs to a [surface], whose mesh has one layout; a form's pieces start from their own",
    **dict.fromkeys(("lines", "datum"), "lines and datum belong to a [surface]; a form's pieces have their own"),
}


class SceneTable(Table):
    """A scene file; `datum` names a line given here, one that the file or shape brings, or a side of the border."""

    name: Annotated[str, Field(max_length=100), AfterValidator(plain_name)] | None = None
    fabric: TextOr[FabricTable] = DEFAULT_FABRIC
    fabric_files: list[str] = Field(default_factory=list)
    shear_limit: float | None = None
    surface: (
        Annotated[
            Annotated[FileSurface, Tag("from-file")] | Annotated[ShapeSurface, Tag("by-formula")],
            Discriminator(kind_of_surface),
        ]
        | None
    ) = None
    mannequin: MannequinTable | None = None
    form: TextOr[dict[str, Any]] | None = None
    """A form's name, or a table of your own (see `warpflat.form_from_mapping`)."""
    half: bool = False
    """Symmetric pieces as their left half, on the fold."""
    shape: Literal["none", "darts", "princess", "auto"] = "none"
    """How a form's pieces are shaped: not, by the darts of a pattern book's block, by seams along the princess lines, or by as
    many of a book's darts as bring the strain within the cloth's limit."""
    ease: str | dict[str, Any] | None = None
    """Wearing ease of a form: a preset (moulage, close, semi-fitted, loose), or a table of levels [cm], with a `preset` for the others."""
    pulled_on: bool = False
    """A form of a knit is pulled on: its neckline, and the ease of its other edges and levels, grow until what must pass through them
    does, stretched to the cloth's limit. Openings count. A note says what has grown."""
    curves_mm: Annotated[float, Field(ge=0, le=20)] | None = None
    """How far the borders of a form's pieces may move to be drawn as by hand: without wobble, and straight where a book has them
    straight; 3 mm if not given, 0 leaves them as the cloth rests."""
    lines: dict[str, LineTable] = Field(default_factory=dict)
    cuts: list[CutTable] = Field(default_factory=list)
    auto_cut: AutoCutTable | None = None
    pieces: dict[str, PieceTable] = Field(default_factory=dict)
    seams: list[SeamTable] = Field(default_factory=list)
    find_seams: FindSeamsTable | None = None
    seams_cut: list[SeamCutTable] = Field(default_factory=list)
    constraints: list[ConstraintTable] = Field(default_factory=list)
    datum: str | None = None
    start: str | None = None
    """An OBJ file of the same mesh, from whose texture coordinates the piece is relaxed."""
    grain_angle: Annotated[float, Field(ge=-360, le=360)] = 0.0
    bands: Literal["auto", "straight", "as worn"] = "auto"
    """Long strips of even width that are cut straight and stretched as they are sewn, as long as their shorter side is worn: "auto" slender
    rings that are sewn along one side, as a neck band, "straight" all, "as worn" none."""
    bands_shorter: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Share by which straight bands are cut shorter still, as rib is."""
    model: Literal["auto", "springs", "membrane"] = "auto"
    wear: WearTable | None = None
    drape: DrapeTable | None = None
    device: str | None = None
    relax: RelaxTable = Field(default_factory=RelaxTable)
    output: OutputTable = Field(default_factory=OutputTable)
    pattern: PatternTable = Field(default_factory=PatternTable)
    marker: MarkerTable | None = None
    cloth: ClothTable | None = None
    openings: list[OpeningTable] = Field(default_factory=list)
    finishing: list[FinishingTable] = Field(default_factory=list)
    pockets: list[PocketTable] = Field(default_factory=list)

    @model_validator(mode="before")
    @classmethod
    def _found_seams(cls, data: Any) -> Any:
        """Read a table `[seams]` as that of seams to be found; a list `[[seams]]` names seams."""
        if isinstance(data, dict) and isinstance(data.get("seams"), dict):
            if "find_seams" in data:
                raise ValueError("give [seams] or [find_seams], which are one table")
            data = {**data, "find_seams": data["seams"]}
            del data["seams"]
        return data

    def _is_given(self, key: str) -> bool:
        """Return whether a key says anything but what holds without it."""
        return bool(getattr(self, key) != type(self).model_fields[key].get_default(call_default_factory=True))

    @model_validator(mode="after")
    def _one_source(self) -> SceneTable:
        if (self.surface is None) == (self.mannequin is None):
            raise ValueError("a scene needs either a [surface] table or a [mannequin] table with a form")
        if (self.mannequin is None) != (self.form is None):
            raise ValueError('a mannequin and a form go together: [mannequin] size = "EU 38" and form = "basic_block"')
        for key, words in (_OF_FORM if self.mannequin is None else _OF_SURFACE).items():
            if self._is_given(key):
                raise ValueError(words)
        if self.pulled_on and self.wear is not None:
            raise ValueError(
                "pulled_on makes a garment as wide as it must be, and [wear] as tight as is asked; give one of them"
            )
        # Refuse sizes of a pattern that no size table can give.
        if self.pattern.sizes and (self.mannequin is None or self.mannequin.size is None):
            raise ValueError('pattern.sizes needs a [mannequin] with a size, as size = "EU 38"')
        if self.pattern.sizes and self.mannequin is not None and self.mannequin.measurements:
            raise ValueError(
                "pattern.sizes are of the tables, as they are: leave out [mannequin.measurements], or pattern.sizes"
            )
        if self.drape is not None and self.half:
            raise ValueError("a drape needs the whole garment: leave out half, or [drape]")
        return self

    @model_validator(mode="after")
    def _fits_a_form(self) -> SceneTable:
        if self.mannequin is None:
            return self
        if self.auto_cut and self.shape == "auto":
            raise ValueError('give [auto_cut] or shape = "auto"')
        for number, cut in enumerate(self.cuts):
            cut.check_for_form(f"cuts[{number}]")
        for number, seam in enumerate(self.seams):
            if seam.sides is not None:
                raise ValueError(
                    f"seams[{number}]: sides belong to a [surface]; those of a form's seams are known: leave them out"
                )
        return self

    @model_validator(mode="after")
    def _fits_a_surface(self) -> SceneTable:
        surface = self.surface
        if surface is None:
            return self
        file = surface if isinstance(surface, FileSurface) else None
        if file is not None and file.pattern is not None:
            for key in _CHANGES_PATTERN:
                if self._is_given(key):
                    name = {"find_seams": "seams"}.get(key, key)
                    raise ValueError(
                        f'{name} belongs to pieces that are flattened; with surface.pattern = "uv" the pattern is taken as it is: '
                        "leave one of them out"
                    )
            if file.component is not None:
                raise ValueError('surface.component: pattern = "uv" takes all islands of the texture; leave it out')
        asked = self.find_seams
        found = None if asked is None or (asked.find == "none" and not asked.keep) else asked.find
        whole = "[seams] keep" if found == "none" else f'[seams] find = "{found}"' if found else None
        whole = whole or ("[[seams_cut]]" if self.seams_cut else None)
        if whole and file is None:
            raise ValueError(f"{whole} takes a garment from a file")
        of_all_parts = file is not None and file.component == "all"
        if file is not None and file.meet_mm is not None and not of_all_parts:
            raise ValueError('surface.meet_mm is for component = "all"; leave it out')
        if of_all_parts and self.seams_cut:
            raise ValueError('[[seams_cut]] cuts a whole garment; with component = "all" leave it out')
        if of_all_parts or whole:
            for key in filter(self._is_given, _OF_ONE_PIECE):
                why = whole or 'component = "all"'
                own = f", or give it to a piece: [pieces.NAME] {key}" if key in PieceTable.model_fields else ""
                raise ValueError(f"{key} belongs to one piece; with {why} leave it out{own}")
        elif isinstance(surface, ShapeSurface) and surface.shape in PIECES:
            for key in filter(self._is_given, (*_OF_ONE_PIECE, "constraints")):
                raise ValueError(
                    f'{key} belongs to one surface; shape = "{surface.shape}" has several pieces: leave it out'
                )
        elif self.pieces and not found:
            raise ValueError('[pieces] is for several pieces: of component = "all", or along seams that are found')
        of_pieces = ((f"pieces.{name}.", piece.cuts) for name, piece in self.pieces.items())
        for where, cuts in (("", self.cuts), *of_pieces):
            for number, cut in enumerate(cuts):
                cut.check_for_surface(f"{where}cuts[{number}]")
        for number, seam in enumerate(self.seams):
            if seam.sides is None:
                raise ValueError(
                    f"seams[{number}]: on a [surface] give the two lines that are sewn, "
                    'sides = ["left", "right"]; both sides of its cuts are equally long anyway'
                )
        return self
