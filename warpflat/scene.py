"""Scene files: what a run is made of, as data, and the one function that runs it."""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Discriminator, Field, Tag, create_model, model_validator

from warpflat.errors import InputError, nearest
from warpflat.fabric import DEFAULT_FABRIC, Fabric, find_fabric, load_library
from warpflat.fabric_file import FabricTable, fabric_from_table
from warpflat.mannequin.table import MannequinTable
from warpflat.relax import RelaxOptions
from warpflat.surface import (
    Surface,
    line_between,
    line_from_curve,
    line_from_indices,
    line_on_border,
    line_on_plane,
    read_surface,
    with_lines,
)
from warpflat.surface.border import SIDES
from warpflat.toml_file import Table, check_table, read_toml

if TYPE_CHECKING:
    from warpflat.flattening import Progress

__all__ = [
    "FileSurface",
    "LineTable",
    "OutputTable",
    "Scene",
    "SceneResult",
    "SceneTable",
    "ShapeSurface",
    "load_scene",
    "make_scene",
    "run_scene",
]

_VARIABLE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)\}|\$([A-Za-z_][A-Za-z0-9_]*)")

Point = Annotated[list[float], Field(min_length=3, max_length=3)]
Vertex = Annotated[int, Field(ge=0)]
PointOrVertex = Annotated[
    Annotated[Point, Tag("point")] | Annotated[Vertex, Tag("vertex")],
    Discriminator(lambda value: "point" if isinstance(value, list) else "vertex"),
]
Component = Annotated[
    Annotated[Literal["largest"], Tag("word")] | Annotated[int, Field(ge=0), Tag("number")],
    Discriminator(lambda value: "word" if isinstance(value, str) else "number"),
]


def _text_or_table(value: Any) -> str:
    return "text" if isinstance(value, str) else "table"


class FileSurface(Table):
    """A mesh file; `file` starts in the scene's folder and may name environment variables, ${WARPFLAT_DATA}/x.obj."""

    file: str = Field(min_length=1)
    units: str | None = None
    component: Component | None = None
    prim: str | None = None


class ShapeSurface(Table):
    """A surface by formula; its other keys are the parameters of that function of `warpflat.shapes`."""

    model_config = ConfigDict(extra="allow")
    shape: str


def _kind_of_surface(value: Any) -> str:
    given = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    return "by-formula" if "shape" in given and "file" not in given else "from-file"


class PlaneTable(Table):
    """A plane by a point on it [m] and its normal (any length)."""

    point: Point
    normal: Point


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
            Discriminator(_text_or_table),
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


class OutputTable(Table):
    """What is written besides `metrics.json` and `NAME.obj`."""

    frames: Annotated[int, Field(ge=0, le=100_000)] = 60
    """About how many frames, close together at first, when the pattern moves most; 0 for no `frames.usdc`."""
    frame_every: Annotated[int, Field(ge=1)] | None = None
    """A frame every so many steps instead."""
    picture: bool = True


_RELAX_FIELDS: dict[str, Any] = {
    field.name: (get_type_hints(RelaxOptions)[field.name] | None, None) for field in dataclasses.fields(RelaxOptions)
}
if TYPE_CHECKING:
    RelaxTable = Table
else:
    # The fields of RelaxOptions, each optional, so that the two cannot differ.
    RelaxTable = create_model("RelaxTable", __base__=Table, **_RELAX_FIELDS)


class SceneTable(Table):
    """A scene file; `datum` names a line given here, one that the file or shape brings, or a side of the border."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]*$", max_length=100)] | None = None
    fabric: Annotated[
        Annotated[str, Tag("text")] | Annotated[FabricTable, Tag("table")],
        Discriminator(_text_or_table),
    ] = DEFAULT_FABRIC
    fabric_files: list[str] = Field(default_factory=list)
    surface: (
        Annotated[
            Annotated[FileSurface, Tag("from-file")] | Annotated[ShapeSurface, Tag("by-formula")],
            Discriminator(_kind_of_surface),
        ]
        | None
    ) = None
    mannequin: MannequinTable | None = None
    form: (
        Annotated[
            Annotated[str, Tag("text")] | Annotated[dict[str, Any], Tag("table")],
            Discriminator(_text_or_table),
        ]
        | None
    ) = None
    """A form's name, or a table of your own (see `warpflat.mannequin.form_from_mapping`)."""
    half: bool = False
    """Symmetric pieces as their left half, on the fold."""
    lines: dict[str, LineTable] = Field(default_factory=dict)
    datum: str | None = None
    grain_angle: Annotated[float, Field(ge=-360, le=360)] = 0.0
    device: str | None = None
    relax: RelaxTable = Field(default_factory=RelaxTable)
    output: OutputTable = Field(default_factory=OutputTable)

    @model_validator(mode="after")
    def _one_source(self) -> SceneTable:
        if (self.surface is None) == (self.mannequin is None):
            raise ValueError("a scene needs either a [surface] table or a [mannequin] table with a form")
        if (self.mannequin is None) != (self.form is None):
            raise ValueError('a mannequin and a form go together: [mannequin] size = "EU 38" and form = "basic_block"')
        if self.mannequin is not None and (self.lines or self.datum):
            raise ValueError("lines and datum belong to a [surface]; a form's pieces have their own")
        return self


@dataclass(frozen=True, kw_only=True)
class SceneResult:
    """What a run did.

    Attributes:
        metrics: as `metrics.json`.
        files: names of the files that were written.
        notes: what was mended or chosen on the way, one sentence each.
    """

    metrics: dict[str, Any]
    files: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A checked scene, ready to be run.

    Attributes:
        name: of its piece and of its files.
        settings: what the file says.
        folder: from where relative paths are taken.
        where: what messages begin with: the file.
    """

    name: str
    settings: SceneTable
    folder: Path
    where: str


def load_scene(path: str | Path) -> Scene:
    """The scene of a TOML file.

    Raises:
        InputError: unreadable, not TOML, an unknown key (names the nearest), a value of the wrong kind
            or out of bounds; one line with file and key.
    """
    path = Path(path)
    data = read_toml(path)
    if not data:
        raise InputError(
            f'{path}: is empty; a scene needs at least a [surface] table with file = ... or shape = "dome"'
        )
    return make_scene(data, name=path.stem, folder=path.parent, where=str(path))


def make_scene(data: Mapping[str, Any], *, name: str, folder: Path, where: str) -> Scene:
    """The scene of data laid out like a scene file.

    Args:
        data: nested tables.
        name: of the scene, unless the data have one.
        folder: from where relative paths are taken.
        where: what messages begin with.

    Raises:
        InputError: as `load_scene`.
    """
    settings = check_table(SceneTable, data, where)
    return Scene(name=settings.name or name, settings=settings, folder=folder, where=where)


def run_scene(
    scene: Scene,
    out: str | Path,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    device: str | None = None,
) -> SceneResult:
    """Flatten the scene's surface, or the pieces of its form, and write `metrics.json`, `NAME.obj`, `frames.usdc` and `picture.png`.

    Args:
        scene: what to do.
        out: folder for the files, made if need be.
        on_progress: called after each step.
        device: Warp device, before the scene's own.

    Raises:
        InputError: the surface, a line, the fabric or a setting is wrong, or `out` cannot be written.
    """
    from warpflat.export import FrameWriter, prepare_folder
    from warpflat.flattening import flatten

    settings = scene.settings
    relax = scene_relax_options(scene)
    fabric = scene_fabric(scene)
    folder = prepare_folder(out)
    if settings.mannequin is not None:
        from warpflat.scene_garment import run_garment

        return run_garment(scene, folder, on_progress=on_progress, device=device)
    surface = scene_surface(scene)
    schedule = FrameSchedule(settings.output)
    with ExitStack() as stack:
        writer: FrameWriter | None = None
        if schedule.wanted:
            writer = stack.enter_context(FrameWriter(folder / "frames.usdc"))
            writer.add_piece(scene.name, surface)

        def each_step(progress: Progress) -> None:
            if writer is not None and schedule.is_due(progress.step, progress.max_steps):
                writer.write(
                    scene.name,
                    positions=progress.positions(),
                    face_energy_density=progress.face_energy_density(),
                    measures={"step": progress.step, "spring_energy_j": progress.spring_energy},
                )
            if on_progress is not None:
                on_progress(progress)

        with told_by(scene.where):
            result = flatten(
                surface,
                fabric=fabric,
                datum=settings.datum,
                grain_angle=settings.grain_angle,
                relax=relax,
                callback=each_step,
                device=device or settings.device,
            )
        if writer is not None:
            numbers = {key: value for key, value in result.measures.items() if isinstance(value, (int, float))}
            writer.write(
                scene.name,
                positions=result.positions,
                face_energy_density=result.face_energy_density,
                measures={"step": result.stages[-1].steps, **numbers},
            )
    files = result.save(folder, picture=settings.output.picture, frames=False)
    if schedule.wanted:
        files.append("frames.usdc")
    return SceneResult(metrics=result.metrics(), files=tuple(files), notes=result.notes)


def scene_surface(scene: Scene) -> Surface:
    """The scene's surface with its feature lines.

    Raises:
        InputError: the file or shape is wrong, an environment variable is not set, or a line is not on the surface.
    """
    table = scene.settings.surface
    if table is None:
        raise InputError(f"{scene.where}: the scene has no [surface]; this needs one piece, not a garment")
    if isinstance(table, ShapeSurface):
        from warpflat.shapes import make_shape

        with told_by(f"{scene.where}: surface"):
            surface = make_shape(table.shape, **(table.model_extra or {}))
    else:
        with told_by(f"{scene.where}: surface.file"):
            path = scene.folder / expand_variables(table.file)
        surface = read_surface(path, units=table.units, component=table.component, prim=table.prim, name=scene.name)
    surface = replace(surface, name=scene.name)
    for name, line in scene.settings.lines.items():
        with told_by(f"{scene.where}: lines.{name}"):
            surface = with_lines(surface, {name: _line(surface, line)})
    datum = scene.settings.datum
    if datum is not None and datum not in surface.lines:
        with told_by(f"{scene.where}: datum"):
            if datum not in SIDES:
                raise InputError(f"unknown line {datum!r}; {nearest(datum, {*surface.lines, *SIDES})}")
            surface = with_lines(surface, {datum: line_on_border(surface, datum)})
    return surface


def _line(surface: Surface, table: LineTable) -> NDArray[np.int32]:
    if table.vertices is not None:
        return line_from_indices(surface, table.vertices, as_read=True)
    if table.from_ is not None and table.to is not None:
        return line_between(surface, table.from_, table.to, as_read=True)
    if table.plane is not None:
        return line_on_plane(surface, table.plane.point, table.plane.normal)
    if isinstance(table.border, BorderTable):
        border = table.border
        return line_on_border(surface, start=border.start, end=border.end, direction=border.direction, as_read=True)
    if table.border is not None:
        return line_on_border(surface, table.border)
    if isinstance(table.curve, list):
        return line_from_curve(surface, table.curve)
    name = str(table.curve).rstrip("/").rpartition("/")[2]
    if name not in surface.lines:
        raise InputError(f"the file has no curve {table.curve!r} on the piece; {nearest(name, surface.lines)}")
    return surface.lines[name]


def scene_fabric(scene: Scene) -> Fabric:
    """The scene's fabric.

    Raises:
        InputError: an unknown name (names the nearest), or impossible values.
    """
    settings = scene.settings
    with told_by(f"{scene.where}: fabric_files"):
        files = [scene.folder / expand_variables(file) for file in settings.fabric_files]
    library = load_library(files)
    if isinstance(settings.fabric, FabricTable):
        return fabric_from_table(scene.name, settings.fabric, where=scene.where, library=library)
    with told_by(f"{scene.where}: fabric"):
        return find_fabric(settings.fabric, library)


def scene_relax_options(scene: Scene) -> RelaxOptions:
    """The scene's settings of the relaxation; what it does not set keeps its default.

    Raises:
        InputError: a value out of its bounds.
    """
    given = {key: value for key, value in scene.settings.relax.model_dump().items() if value is not None}
    options = RelaxOptions(**given)
    with told_by(scene.where):
        options.validate()
    return options


def expand_variables(text: str) -> str:
    """The text with ${NAME} and $NAME replaced from the environment.

    Raises:
        InputError: a variable that is not set.
    """

    def value(match: re.Match[str]) -> str:
        name = match.group(1) or match.group(2)
        if not os.environ.get(name):
            rest = text[match.end() :].lstrip("/") or "the file"
            raise InputError(f"environment variable {name} is not set; set it to the folder that holds {rest}")
        return os.environ[name]

    return _VARIABLE.sub(value, text)


class FrameSchedule:
    """Which steps become frames: every so many, or about a given number that thins out towards the end."""

    def __init__(self, output: OutputTable) -> None:
        self._every = output.frame_every
        self._number = output.frames
        self._next = 0

    @property
    def wanted(self) -> bool:
        """Whether there are frames at all."""
        return self._number > 0

    def is_due(self, step: int, max_steps: int) -> bool:
        """Whether the look at this step, of at most `max_steps`, becomes a frame; the first one always does.

        Looks may be several steps apart: one is due when a frame was due at or before it.
        """
        if step < self._next:
            return False
        if self._every is not None:
            self._next = step - step % self._every + self._every
        else:
            # Steps in a geometric row: as many frames between 10 and 20 as between 1,000 and 2,000.
            growth = max(max_steps, 2) ** (1.0 / self._number)
            self._next = max(step + 1, math.ceil(step * growth))
        return True


@contextmanager
def told_by(where: str) -> Iterator[None]:
    """Begin the messages of mistakes inside with `where`."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
