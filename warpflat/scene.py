"""Scene files: what a run is made of, as data, and the one function that runs it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from warpflat.arrays import IntArray
from warpflat.errors import InputError, nearest
from warpflat.fabric import DEFAULT_FABRIC, Fabric, find_fabric, load_library
from warpflat.fabric_file import FabricTable, fabric_from_table
from warpflat.mannequin.table import MannequinTable
from warpflat.memory import require_memory_for_run
from warpflat.names import checked_name, fitted_name, plain_name
from warpflat.relax import RelaxOptions
from warpflat.scene_cuts import AutoCutTable, CutStory, CutTable
from warpflat.scene_files import FrameSchedule, SceneResult, write_surface
from warpflat.scene_types import (
    BorderTable,
    ConstraintTable,
    FileSurface,
    LineTable,
    MarkerTable,
    OutputTable,
    PatternTable,
    RelaxTable,
    SeamTable,
    ShapeSurface,
    WearTable,
    kind_of_surface,
    text_or_table,
)
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
    from warpflat.film import Film
    from warpflat.flattening import Flattening, Progress
    from warpflat.ledger import Ledger
    from warpflat.pattern.from_garment import EdgeRules
    from warpflat.sew_surface import SewnSurface
    from warpflat.tightness import Wear

__all__ = [
    "FileSurface",
    "FrameSchedule",
    "LineTable",
    "OutputTable",
    "Scene",
    "SceneResult",
    "SceneTable",
    "ShapeSurface",
    "files_of_run",
    "flatten_scene",
    "load_scene",
    "make_scene",
    "run_scene",
    "scene_cuts",
    "scene_ledger",
]

_VARIABLE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)\}|\$([A-Za-z_][A-Za-z0-9_]*)")


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
    """A form's name, or a table of your own (see `warpflat.mannequin.form_from_mapping`)."""
    half: bool = False
    """Symmetric pieces as their left half, on the fold."""
    lines: dict[str, LineTable] = Field(default_factory=dict)
    cuts: list[CutTable] = Field(default_factory=list)
    auto_cut: AutoCutTable | None = None
    seams: list[SeamTable] = Field(default_factory=list)
    constraints: list[ConstraintTable] = Field(default_factory=list)
    datum: str | None = None
    grain_angle: Annotated[float, Field(ge=-360, le=360)] = 0.0
    model: Literal["springs", "membrane"] = "springs"
    wear: WearTable | None = None
    device: str | None = None
    relax: RelaxTable = Field(default_factory=RelaxTable)
    output: OutputTable = Field(default_factory=OutputTable)
    pattern: PatternTable = Field(default_factory=PatternTable)
    marker: MarkerTable | None = None

    @model_validator(mode="after")
    def _one_source(self) -> SceneTable:
        if (self.surface is None) == (self.mannequin is None):
            raise ValueError("a scene needs either a [surface] table or a [mannequin] table with a form")
        if (self.mannequin is None) != (self.form is None):
            raise ValueError('a mannequin and a form go together: [mannequin] size = "EU 38" and form = "basic_block"')
        if self.mannequin is not None and (self.lines or self.datum):
            raise ValueError("lines and datum belong to a [surface]; a form's pieces have their own")
        if self.mannequin is not None and (self.cuts or self.auto_cut):
            raise ValueError("cuts and auto_cut belong to a [surface]")
        if self.surface is not None and self.half:
            raise ValueError(
                "half belongs to a form's pieces; on a [surface] give the half's mesh, and in [pattern] kinds = { left = \"fold\" }"
            )
        for number, seam in enumerate(self.seams):
            if self.mannequin is None and seam.sides is None:
                raise ValueError(
                    f'seams[{number}]: on a [surface] give the two lines that are sewn, sides = ["left", "right"]; both sides '
                    "of its cuts are equally long anyway"
                )
            if self.mannequin is not None and seam.sides is not None:
                raise ValueError(
                    f"seams[{number}]: sides belong to a [surface]; those of a form's seams are known: leave them out"
                )
        if self.pattern.sizes and (self.mannequin is None or self.mannequin.size is None):
            raise ValueError('pattern.sizes needs a [mannequin] with a size, as size = "EU 38"')
        if self.pattern.sizes and self.mannequin is not None and self.mannequin.measurements:
            raise ValueError(
                "pattern.sizes are of the tables, as they are: leave out [mannequin.measurements], or pattern.sizes"
            )
        return self


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A checked scene, ready to be run.

    Attributes:
        name: of its piece and of its files.
        settings: what the file says.
        folder: from where relative paths are taken.
        where: what messages begin with: the file.
        sources: the files from which it was read.
    """

    name: str
    settings: SceneTable
    folder: Path
    where: str
    sources: tuple[Path, ...] = ()


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
    scene = make_scene(data, name=path.stem, folder=path.parent, where=str(path))
    return replace(scene, sources=(path.absolute(),))


def make_scene(data: Mapping[str, Any], *, name: str, folder: Path, where: str) -> Scene:
    """The scene of data laid out like a scene file.

    Args:
        data: nested tables.
        name: of the scene, unless the data have one; with "_" where no file can bear it.
        folder: from where relative paths are taken.
        where: what messages begin with.

    Raises:
        InputError: as `load_scene`.
    """
    settings = check_table(SceneTable, data, where)
    if settings.name is not None:
        with told_by(f"{where}: name"):
            checked_name(settings.name)
    return Scene(name=settings.name or fitted_name(name), settings=settings, folder=folder, where=where)


def run_scene(
    scene: Scene,
    out: str | Path,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    device: str | None = None,
    cuts: CutStory | None = None,
) -> SceneResult:
    """Flatten the scene's surface, or the pieces of its form, and write the result.

    Files: `metrics.json`, `NAME.obj` per piece, `frames.usdc`, `picture.png`, and the pattern (see `warpflat.pattern_files`). What an
    earlier run has left there and this one does not make is removed at the end (see `warpflat.leftovers`). All of that happens together;
    a run that fails leaves the folder as it was, and no run replaces a file that it has read.

    Args:
        scene: what to do.
        out: folder for the files, made if need be.
        on_progress: called after each step.
        device: Warp device, before the scene's own.
        cuts: to be made instead of the scene's own (see `warpflat.scene_cuts.story_of_entry`).

    Raises:
        InputError: the surface, a line, a cut, the fabric or a setting is wrong, `out` cannot be written, or a file there that the scene
            is made from would be replaced.
    """
    from warpflat.export import output_folder
    from warpflat.leftovers import require_own_metrics

    sources = (*scene.sources, *(() if cuts is None else cuts.surface.sources))
    with output_folder(out, files_of_run(scene), sources=sources) as folder:
        require_own_metrics(folder)
        if scene.settings.mannequin is not None:
            from warpflat.scene_garment import run_garment

            return run_garment(scene, folder, on_progress=on_progress, device=device)
        return _run_surface(scene, folder, on_progress=on_progress, device=device, cuts=cuts)


def _run_surface(
    scene: Scene,
    folder: Path,
    *,
    on_progress: Callable[[Progress], None] | None,
    device: str | None,
    cuts: CutStory | None,
) -> SceneResult:
    from warpflat.cutting import separate
    from warpflat.export import FrameWriter
    from warpflat.film import Film
    from warpflat.pattern_files import pattern_options
    from warpflat.scene_seams import scene_surface_seams
    from warpflat.wear_report import advise

    settings = scene.settings
    scene_relax_options(scene)  # a mistake is told before anything is made
    with told_by(scene.where):
        drawing = pattern_options(settings.pattern, settings.marker)
        seams = scene_surface_seams(settings.seams, scene.name)
    story = cuts or scene_cuts(scene, device=device)
    _check_edges(scene, story, drawing.rules)
    wanted = FrameSchedule(settings.output).wanted
    require_memory_for_run(len(story.surface.vertices), frames=wanted)
    with ExitStack() as stack:
        writer = stack.enter_context(FrameWriter(folder / "frames.usdc")) if wanted else None
        film = Film(writer, story.surface, lambda: FrameSchedule(settings.output))

        def each_step(progress: Progress) -> None:
            film(progress)
            if on_progress is not None:
                on_progress(progress)

        result, sewn = flatten_scene(scene, story, film=film, callback=each_step, device=device)
    pieces = [advise(piece) for piece in separate(result)]
    return write_surface(
        scene,
        pieces,
        folder,
        drawing=drawing,
        seams=seams,
        more={} if sewn is None else sewn.metrics(),
        frames=wanted,
        notes=(*result.told, *story.notes),
    )


def files_of_run(scene: Scene) -> list[str]:
    """The files that a run will write, as far as they are known before it: not those with the name of a form's or a cut's piece."""
    settings, name = scene.settings, scene.name
    output, formats, garment = settings.output, settings.pattern.formats, settings.mannequin is not None
    worn = output.picture and settings.wear is not None
    asked = {
        "metrics.json": True,
        f"{name}.obj": not garment,
        "frames.usdc": FrameSchedule(output).wanted,
        "picture.png": output.picture,
        "wear.png": worn and garment,
        f"{name}.wear.png": worn and not garment,
        **{f"{name}.{ending}": ending in formats for ending in ("dxf", "svg")},
        **{f"pattern.{ending}": ending in formats for ending in ("pdf", "json")},
        f"{name}.marker.svg": settings.marker is not None,
        f"{name}.marker.json": settings.marker is not None,
    }
    return [file for file, wanted in asked.items() if wanted]


def flatten_scene(
    scene: Scene,
    story: CutStory,
    *,
    film: Film | None = None,
    callback: Callable[[Progress], None] | None = None,
    device: str | None = None,
) -> tuple[Flattening, SewnSurface | None]:
    """The scene's surface flattened, cut and sewn, as its constraints hold it; and how it was sewn, if it was.

    Args:
        scene: with its fabric and settings.
        story: what is cut, of :func:`scene_cuts`.
        film: takes the last frame of every stage.
        callback: called after each step.
        device: Warp device, before the scene's own.

    Raises:
        InputError: a seam or a constraint asks what the piece cannot be, or a setting is wrong.
    """
    from warpflat.cutting import cut
    from warpflat.film import Film
    from warpflat.scene_seams import scene_constraints, scene_surface_seams
    from warpflat.sew_surface import sew_surface

    settings, relax = scene.settings, scene_relax_options(scene)
    film = film or Film(None, story.surface, lambda: FrameSchedule(settings.output))
    with told_by(scene.where):
        seams = scene_surface_seams(settings.seams, scene.name)
        result = _flatten(scene, story.surface, relax, callback=callback, device=device)
        film.last(result)
        for number, plan in enumerate(story.plans):
            if story.goes_on(result, number):
                film.mark(result, plan)
                result = cut(result, plan, relax=relax, callback=callback)
                film.last(result)
        lines = {result.surface.name: result.network.surface.lines}
        sewn = sew_surface(result, scene_constraints(settings.constraints, lines), seams=seams, options=relax)
    if sewn is None:
        return result, None
    film.last(sewn.result)
    return sewn.result, sewn


def _check_edges(scene: Scene, story: CutStory, rules: EdgeRules) -> None:
    """See that the pattern's kinds and allowances are of edges, whichever of the automatic cuts will be made.

    Raises:
        InputError: a name that no piece can have, or a cut that cannot be made.
    """
    from warpflat.cutting import cut_surfaces
    from warpflat.pattern.from_surface import check_edge_names

    if not (rules.kinds or rules.allowances):
        return
    with told_by(scene.where):
        surfaces = [piece for count in story.counts for piece in cut_surfaces(story.surface, list(story.plans[:count]))]
    with told_by(f"{scene.where}: pattern"):
        check_edge_names(surfaces, rules, cuts=[plan.name for plan in story.plans])


def _flatten(
    scene: Scene,
    surface: Surface,
    relax: RelaxOptions,
    *,
    callback: Callable[[Progress], None] | None = None,
    device: str | None = None,
) -> Flattening:
    from warpflat.flattening import flatten

    settings = scene.settings
    return flatten(
        surface,
        fabric=scene_fabric(scene),
        datum=settings.datum,
        grain_angle=settings.grain_angle,
        model=settings.model,
        wear=scene_wear(scene),
        relax=relax,
        callback=callback,
        device=device or settings.device,
    )


def scene_cuts(scene: Scene, *, device: str | None = None) -> CutStory:
    """The scene's surface with the paths of its cuts worked in, and the cuts; looks for those of `auto_cut`.

    Raises:
        InputError: the surface, a line or a cut is wrong.
    """
    from warpflat.scene_cuts import plan_automatic_cuts, plan_cuts

    settings = scene.settings
    surface = scene_surface(scene)
    with told_by(scene.where):
        story = plan_cuts(surface, settings.cuts)
        if settings.auto_cut is not None:
            story, _ = plan_automatic_cuts(
                story,
                settings.auto_cut,
                flatten=lambda piece, options: _flatten(scene, piece, options, device=device),
                relax=scene_relax_options(scene),
            )
    return story


def scene_ledger(scene: Scene, *, by: Literal["per_cm", "released"] = "per_cm", device: str | None = None) -> Ledger:
    """Candidates for the next cut of the scene's piece, after those that the scene makes, each tried and ranked; unsewn, as a note says.

    Raises:
        InputError: as :func:`scene_cuts`, or there is no candidate.
    """
    from warpflat.ledger import make_ledger
    from warpflat.scene_cuts import flatten_and_cut

    if scene.settings.mannequin is not None:
        raise InputError(f"{scene.where}: cuts are compared on a [surface], not on the pieces of a form")
    relax = scene_relax_options(scene)
    story = scene_cuts(scene, device=device)
    with told_by(scene.where):
        result = flatten_and_cut(
            story, flatten=lambda piece, options: _flatten(scene, piece, options, device=device), relax=relax
        )
        ledger = make_ledger(result, relax=relax, by=by)
    asked = [key for key in ("seams", "constraints") if getattr(scene.settings, key)]
    if not asked:
        return ledger
    return replace(
        ledger,
        notes=(f"candidates are compared without the scene's {' and '.join(asked)}; a run keeps them, --apply too",),
    )


def scene_surface(scene: Scene) -> Surface:
    """The scene's surface with its feature lines.

    Raises:
        InputError: the file or shape is wrong, an environment variable is not set, or a line is not on the surface.
    """
    from warpflat.scene_seams import scene_surface_seams
    from warpflat.surface_seams import surface_seams

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
    wanted = {} if scene.settings.datum is None else {"datum": scene.settings.datum}
    wanted |= {f"constraints[{i}]": constraint.line for i, constraint in enumerate(scene.settings.constraints)}
    named = scene_surface_seams(scene.settings.seams, scene.name)
    wanted |= {f"seams[{i}].sides[{k}]": seam.sides[k] for i, seam in enumerate(named) for k in (0, 1)}
    for key, name in wanted.items():
        if name not in surface.lines:
            with told_by(f"{scene.where}: {key}"):
                if name not in SIDES:
                    raise InputError(f"unknown line {name!r}; {nearest(name, {*surface.lines, *SIDES})}")
                surface = with_lines(surface, {name: line_on_border(surface, name)})
    with told_by(f"{scene.where}: seams"):
        surface_seams(surface, named)
    return surface


def _line(surface: Surface, table: LineTable) -> IntArray:
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


def scene_wear(scene: Scene) -> Wear | None:
    """How the scene's garment is meant to be worn, if it says so.

    Raises:
        InputError: a value out of its bounds.
    """
    from warpflat.tightness import Wear

    if scene.settings.wear is None:
        return None
    with told_by(scene.where):
        return Wear(**scene.settings.wear.model_dump())


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


@contextmanager
def told_by(where: str) -> Iterator[None]:
    """Begin the messages of mistakes inside with `where`, once: what is called there may have said so itself."""
    try:
        yield
    except InputError as error:
        told = str(error)
        raise InputError(told if told.startswith(f"{where}: ") else f"{where}: {told}") from None
