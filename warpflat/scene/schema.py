"""The tables of a scene file, as pydantic models."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

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

from warpflat.core.errors import is_number
from warpflat.core.file_names import plain_name
from warpflat.core.text import quote_value
from warpflat.core.toml_file import Table
from warpflat.fabric.fabric import DEFAULT_FABRIC
from warpflat.fabric.file import FabricTable
from warpflat.mannequin.table import MannequinTable
from warpflat.scene.cut_tables import AutoCutTable, CutTable, PlaneTable, Point, PointOrVertex, Vertex
from warpflat.scene.making_up_tables import ClothTable, FinishingTable, MarkerTable, OpeningTable, PocketTable
from warpflat.solver.options import FORMER_SOLVERS, RelaxOptions, Solver

__all__ = [
    "BorderTable",
    "ConstraintTable",
    "FileSurface",
    "FindSeamsTable",
    "LineTable",
    "OutputTable",
    "PatternTable",
    "SceneTable",
    "SeamTable",
    "ShapeSurface",
    "kind_of_surface",
    "text_or_table",
]


def _as_component(value: Any) -> Any:
    if value not in ("largest", "all") and not (is_number(value, whole=True) and value >= 0):
        raise ValueError(f'should be "largest", "all" or a number from 0, largest first; got {quote_value(value)}')
    return value


Direction = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Component = Annotated[Literal["largest", "all"] | int, BeforeValidator(_as_component)]


def text_or_table(value: Any) -> str:
    return "text" if isinstance(value, str) else "table"


class FileSurface(Table):
    """A mesh file; `file` starts in the scene's folder and may name environment variables, ${WARPFLAT_DATA}/x.obj."""

    file: str = Field(min_length=1)
    units: str | None = None
    component: Component | None = None
    """Which connected part of the mesh; with "all" every part of every object is a piece, and edges that meet in space are seams."""
    prim: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_source(cls, data: Any) -> Any:
        if isinstance(data, dict) and {"file", "shape"} <= data.keys():
            raise ValueError("give the surface by its file or by a shape, not both")
        return data


class ShapeSurface(Table):
    """A surface by formula; its other keys are the parameters of that function of `warpflat.surface.shapes`."""

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
    border: (
        Annotated[
            Annotated[str, Tag("text")] | Annotated[BorderTable, Tag("table")],
            Discriminator(text_or_table),
        ]
        | None
    ) = None
    curve: (
        Annotated[
            Annotated[str, Tag("text")] | Annotated[list[Point], Field(min_length=2), Tag("points")],
            Discriminator(lambda value: "text" if isinstance(value, str) else "points"),
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _one_way(self) -> LineTable:
        if (self.from_ is None) != (self.to is None):
            raise ValueError("a shortest path needs both from and to")
        ways = [self.vertices, self.from_, self.plane, self.border, self.curve]
        if sum(way is not None for way in ways) != 1:
            raise ValueError("give the line in one way: vertices, from and to, plane, border, or curve")
        return self


class SeamTable(Table):
    """A seam: on a form one of those that it has, on a [surface] two lines along its border that are sewn together.

    A form's seam is named as in the pattern, and one side is longer than the other. On a [surface] `sides` names the two lines,
    as "left" or "piece.left"; they may be equally long.

    `fullness` is eased in near the seam (0.02 is 2 %), at a sleeve's cap above its notches only. `gather` is the ratio of the
    lengths, and its fullness falls on through the piece. `longer` names the piece, "piece.edge" or line that is longer; the
    seam's second side if not given.
    """

    name: str = Field(min_length=1)
    sides: Annotated[list[str], Field(min_length=2, max_length=2)] | None = None
    fullness: Annotated[float, Field(ge=0, le=0.3)] | None = None
    gather: Annotated[float, Field(ge=1, le=5)] | None = None
    longer: str | None = None

    @model_validator(mode="after")
    def _one_way(self) -> SeamTable:
        given = (self.fullness is not None) + (self.gather is not None)
        if given > 1 or (given == 0 and self.sides is None):
            raise ValueError("give either fullness = 0.02 (2 %, eased in) or gather = 1.5 (times as long)")
        return self


class FindSeamsTable(Table):
    """How the seams of a whole garment are found (see `warpflat.find_seams`); in a scene it is `[seams]`, a table, not `[[seams]]`.

    With `find = "auto"` the garment is cut where a tailor would cut it, with "none" it is kept whole. Without this table a garment that
    cannot lie flat in one piece is cut.
    """

    find: Literal["auto", "none"] = "auto"
    up: Direction | None = None
    front: Direction | None = None
    no: list[str] = Field(default_factory=list)
    """Seams that are left closed: "shoulder", or "shoulder left"; "dart" for no darts."""
    smooth_mm: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Length over which wrinkles of draped or scanned cloth are smoothed before it is cut; how far the cloth moves is told."""
    limit: Annotated[float, Field(ge=0, le=1)] = 0.01
    """Share of the cloth that may stay beyond its strain limit before further seams and darts are looked for."""
    most_pieces: Annotated[int, Field(ge=1, le=1000)] | None = None
    """At most so many pieces of one layer; as many as are usual for its kind if not given."""


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
            Annotated[Literal["body"], Tag("word")] | Annotated[float, Field(ge=1, le=20_000), Tag("number")],
            Discriminator(lambda value: "word" if isinstance(value, str) else "number"),
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
    """The intended fit of the garment (see `warpflat.model.wear.Wear`); an empty table asks how it sits, no more."""

    stretch_warp: float = 0.0
    stretch_weft: float = 0.0
    pressure: float | None = None


class DrapeTable(Table):
    """The garment is sewn and put on its body (see `warpflat.drape`)."""

    friction: Annotated[float, Field(ge=0, le=2)] = 0.3
    tolerance: Annotated[float, Field(ge=1e-6, le=1)] = 5e-3
    max_steps: Annotated[int, Field(ge=1, le=10_000_000)] = 20_000
    hold: list[str] = Field(default_factory=list)
    """Lines and edges that stay where they are: "piece.line", or "line" for every piece that has one."""
    correct: bool = False
    """Whether the pattern is corrected until the worn garment lies on the designed surface, or no nearer."""
    correct_fabric: str | None = None
    """Another cloth for the corrected pattern, in which it is to be worn in the same shape."""


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

    formats: list[Literal["dxf", "svg", "pdf", "json"]] = ["dxf", "svg", "pdf", "json"]  # noqa: RUF012 (pydantic copies)
    """Formats that are written; an empty list writes none."""
    dialect: Literal["aama", "astm"] = "aama"
    paper: Literal["A4", "Letter", "A0", "Projector"] = "A4"
    allowance_mm: Annotated[float, Field(ge=0, le=100)] = 10.0
    hem_mm: Annotated[float, Field(ge=0, le=200)] = 30.0
    kinds: dict[str, Literal["seam", "hem", "fold", "cut"]] = Field(default_factory=dict)
    """What an edge is, by its name: "front.neck", or "neck" for every piece that has one."""
    allowances_mm: dict[str, Annotated[float, Field(ge=0, le=200)]] = Field(default_factory=dict)
    """Allowances by edge, named as in `kinds` [mm]."""
    units: Literal["mm", "cm", "in"] = "cm"
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


def _as_solver(value: object) -> object:
    """Read the names of earlier versions."""
    return FORMER_SOLVERS.get(value, value) if isinstance(value, str) else value


_RELAX_FIELDS: dict[str, Any] = {
    field.name: (get_type_hints(RelaxOptions)[field.name] | None, None) for field in dataclasses.fields(RelaxOptions)
}
_RELAX_FIELDS["solver"] = (Annotated[Solver | None, BeforeValidator(_as_solver)], None)
if TYPE_CHECKING:
    RelaxTable = Table
else:
    # The fields of RelaxOptions, each optional, so that the two cannot differ.
    RelaxTable = create_model("RelaxTable", __base__=Table, **_RELAX_FIELDS)


class SceneTable(Table):
    """A scene file; `datum` names a line given here, one that the file or shape brings, or a side of the border."""

    name: Annotated[str, Field(max_length=100), AfterValidator(plain_name)] | None = None
    fabric: Annotated[
        Annotated[str, Tag("text")] | Annotated[FabricTable, Tag("table")],
        Discriminator(text_or_table),
    ] = DEFAULT_FABRIC
    fabric_files: list[str] = Field(default_factory=list)
    surface: (
        Annotated[
            Annotated[FileSurface, Tag("from-file")] | Annotated[ShapeSurface, Tag("by-formula")],
            Discriminator(kind_of_surface),
        ]
        | None
    ) = None
    mannequin: MannequinTable | None = None
    form: (
        Annotated[
            Annotated[str, Tag("text")] | Annotated[dict[str, Any], Tag("table")],
            Discriminator(text_or_table),
        ]
        | None
    ) = None
    """A form's name, or a table of your own (see `warpflat.form_from_mapping`)."""
    half: bool = False
    """Symmetric pieces as their left half, on the fold."""
    shape: Literal["none", "darts", "princess", "auto"] = "none"
    """How a form's pieces are shaped: not, by the darts of a pattern book's block, by seams along the princess lines, or by as
    many of a book's darts as bring the strain within the cloth's limit."""
    ease: str | dict[str, Any] | None = None
    """Wearing ease of a form: a preset (moulage, close, semi-fitted, loose), or a table of levels [cm], with a `preset` for the others."""
    curves_mm: Annotated[float, Field(ge=0, le=20)] | None = None
    """How far the borders of a form's pieces may move to be drawn as by hand: without wobble, and straight where a book has them
    straight; 3 mm if not given, 0 leaves them as the cloth rests."""
    lines: dict[str, LineTable] = Field(default_factory=dict)
    cuts: list[CutTable] = Field(default_factory=list)
    auto_cut: AutoCutTable | None = None
    seams: list[SeamTable] = Field(default_factory=list)
    find_seams: FindSeamsTable | None = None
    constraints: list[ConstraintTable] = Field(default_factory=list)
    datum: str | None = None
    start: str | None = None
    """An OBJ file of the same mesh, from whose texture coordinates the piece is relaxed."""
    grain_angle: Annotated[float, Field(ge=-360, le=360)] = 0.0
    model: Literal["springs", "membrane"] = "springs"
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

    @model_validator(mode="after")
    def _consistent(self) -> SceneTable:
        if (self.surface is None) == (self.mannequin is None):
            raise ValueError("a scene needs either a [surface] table or a [mannequin] table with a form")
        if (self.mannequin is None) != (self.form is None):
            raise ValueError('a mannequin and a form go together: [mannequin] size = "EU 38" and form = "basic_block"')
        if self.mannequin is None:
            self._check_surface()
        else:
            self._check_garment()
        self._check_sizes()
        return self

    @model_validator(mode="after")
    def _whole_drape(self) -> SceneTable:
        if self.drape is not None and self.half:
            raise ValueError("a drape needs the whole garment: leave out half, or [drape]")
        return self

    def _check_surface(self) -> None:
        """Refuse what belongs to the form on a mannequin."""
        if self.shape != "none":
            raise ValueError("shape belongs to a form; on a [surface] give [[cuts]] or [auto_cut]")
        for key in ("openings", "finishing", "pockets"):
            if getattr(self, key):
                raise ValueError(f"{key} belongs to a form's pieces; on a [surface] leave it out")
        if self.curves_mm is not None:
            raise ValueError("curves_mm belongs to a form's pieces; on a [surface] leave it out")
        if self.ease is not None:
            raise ValueError("ease belongs to a form; a [surface] is as large as its mesh")
        found = self.find_seams is not None and self.find_seams.find == "auto"
        if found and not isinstance(self.surface, FileSurface):
            raise ValueError('[seams] find = "auto" takes a garment from a file')
        if isinstance(self.surface, FileSurface) and (self.surface.component == "all" or found):
            for key in ("lines", "datum", "start", "cuts", "auto_cut", "seams", "constraints", "drape"):
                if getattr(self, key):
                    why = '[seams] find = "auto"' if found else 'component = "all"'
                    raise ValueError(f"{key} belongs to one piece; with {why} leave it out")
        for number, cut in enumerate(self.cuts):
            cut.check_for_surface(f"cuts[{number}]")
        if self.half:
            raise ValueError(
                "half belongs to a form's pieces; on a [surface] give the half's mesh, and in [pattern] "
                'kinds = { left = "fold" }'
            )
        for number, seam in enumerate(self.seams):
            if seam.sides is None:
                raise ValueError(
                    f"seams[{number}]: on a [surface] give the two lines that are sewn, "
                    'sides = ["left", "right"]; both sides of its cuts are equally long anyway'
                )

    def _check_garment(self) -> None:
        """Refuse what belongs to a surface."""
        if self.find_seams is not None:
            raise ValueError("[seams] is for a garment from a file; a form has its own, and [[seams]] change them")
        if self.lines or self.datum:
            raise ValueError("lines and datum belong to a [surface]; a form's pieces have their own")
        if self.auto_cut and self.shape == "auto":
            raise ValueError('give [auto_cut] or shape = "auto"')
        for number, cut in enumerate(self.cuts):
            cut.check_for_form(f"cuts[{number}]")
        for number, seam in enumerate(self.seams):
            if seam.sides is not None:
                raise ValueError(
                    f"seams[{number}]: sides belong to a [surface]; those of a form's seams are known: leave them out"
                )

    def _check_sizes(self) -> None:
        """Refuse sizes of a pattern that no size table can give."""
        if not self.pattern.sizes:
            return
        if self.mannequin is None or self.mannequin.size is None:
            raise ValueError('pattern.sizes needs a [mannequin] with a size, as size = "EU 38"')
        if self.mannequin.measurements:
            raise ValueError(
                "pattern.sizes are of the tables, as they are: leave out [mannequin.measurements], or pattern.sizes"
            )
