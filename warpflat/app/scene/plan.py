"""A scene's garment, checked and not yet flattened. Its pieces and seams come from a mesh, from several, or from a form."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from warpflat.app.scene.cuts import CutSequence, cut_of_dart, plan_automatic_cuts, plan_cuts
from warpflat.app.scene.form import scene_form, scene_mannequin
from warpflat.app.scene.found_seams import found_seams, plain_panel
from warpflat.app.scene.frames import FrameRecorder
from warpflat.app.scene.load import (
    Scene,
    errors_named,
    fabric_of_correction,
    scene_fabric,
    scene_relax_options,
    scene_wear,
)
from warpflat.app.scene.pattern_options import pattern_options
from warpflat.app.scene.schema import PieceTable
from warpflat.app.scene.seams import scene_constraints, scene_surface_seams
from warpflat.app.scene.surface import scene_pieces, scene_sewn_panels, scene_surface, with_piece_tables
from warpflat.core import InputError, StepError, report_activity, without_side
from warpflat.flat import (
    Flattening,
    Progress,
    RelaxOptions,
    Surface,
    advise,
    cut,
    cut_surfaces,
    flatten,
    flatten_all,
)
from warpflat.garment import (
    GRAIN,
    Constraint,
    FormGarment,
    FormResult,
    FoundSeams,
    Garment,
    Mannequin,
    OpeningTable,
    SeamTable,
    SewnPanel,
    Straight,
    cap_wishes,
    check_edge_names,
    check_fold_grain,
    find_fold_lines,
    flatten_form,
    garment_as_cut,
    name_seams,
    plan_form,
    sew_pieces,
    sewn_centres,
    sized_opening,
    straight_stands,
    unsewn_notes,
)
from warpflat.pattern import PatternOptions, check_names, optional_step

if TYPE_CHECKING:
    from warpflat.pattern import Pattern

__all__ = [
    "FormScenePlan",
    "MeshPlan",
    "Plan",
    "flatten_surface",
    "plan_form_scene",
    "plan_mesh",
    "plan_scene",
    "scene_cuts",
]

# How a note begins on pieces that cannot be sewn.
_UNSEWN = "the pieces are not sewn, and their seams do not match: each lies as it does on its own"
# Work units that a piece takes alone at most before it is sewn to others.
_ALONE = 4000


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan(ABC):
    """A garment, wherever its pieces come from. Who takes one does not ask for its kind.

    Attributes:
        scene: the scene.
        drawing: options of the pattern files.
        device: Warp device, before the scene's own.
        mannequin: who wears it, if anybody does.
        found: seams that were found on a whole garment, which its pieces come from.
    """

    scene: Scene
    drawing: PatternOptions
    device: str | None = None
    mannequin: Mannequin | None = None
    found: FoundSeams | None = None

    @property
    @abstractmethod
    def surfaces(self) -> list[Surface]:
        """The pieces in space, uncut."""

    @abstractmethod
    def flatten(
        self,
        *,
        callback: Callable[[str, Progress], bool | None] | None = None,
        recorders: Mapping[str, FrameRecorder] | None = None,
    ) -> Garment:
        """Flatten, cut and sew the garment.

        Args:
            callback: called with a piece's name and its `Progress` after every step.
            recorders: of the film by piece; they keep the last frame of every stage.

        Raises:
            InputError: a piece cannot be flattened, or a seam or a constraint asks what it cannot be.
        """

    @abstractmethod
    def in_cloth(self, scene: Scene) -> Plan:
        """Return the same garment as another scene has it, which differs in its fabric; its pieces have the same points.

        Raises:
            InputError: the fabric is wrong.
        """

    def advise(self, piece: Flattening) -> Flattening:
        """Return a piece with cuts that would help where it does not fit."""
        return advise(piece)

    def notes(self, garment: Garment) -> list[str]:
        """Return what is told of the garment besides."""
        return []

    def further_metrics(self, garment: Garment) -> dict[str, Any]:
        """Return the entries of `metrics.json` that the garment does not know."""
        return {}

    def place_drafted(self, garment: Garment, pattern: Pattern) -> Mapping[str, Sequence[Surface]]:
        """Return what of a pattern has no surface, such as collars, where it is worn, by piece."""
        return {}

    @property
    def size(self) -> str:
        """The size of who wears it."""
        return ""

    def other_sizes(self) -> dict[str, Plan]:
        """Return the garment in the sizes that its pattern has besides its own.

        Raises:
            InputError: there is no such size, or the pieces cannot be made in it.
        """
        return {}


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshPlan(Plan):
    """A garment whose pieces are meshes: one, perhaps to be cut, or all of a file.

    Attributes:
        sequences: the pieces, uncut, each with its cuts.
        seams: those that the scene names.
        panels: of the sewn pattern that the file has, which is taken as it is.
    """

    sequences: Sequence[CutSequence]
    seams: Sequence[SeamTable] = ()
    panels: Sequence[SewnPanel] = ()

    @property
    def surfaces(self) -> list[Surface]:
        """The pieces in space, uncut."""
        return [sequence.surface for sequence in self.sequences]

    def flatten(
        self,
        *,
        callback: Callable[[str, Progress], bool | None] | None = None,
        recorders: Mapping[str, FrameRecorder] | None = None,
    ) -> Garment:
        """See :meth:`Plan.flatten`."""
        scene, settings, relax = self.scene, self.scene.settings, scene_relax_options(self.scene)
        tables = settings.pieces
        names, recorders = [surface.name for surface in self.surfaces], recorders or {}
        steps = {name: None if callback is None else partial(callback, name) for name in names}
        with errors_named(scene.where):
            if len(names) == 1 and self.found is None and not tables and not self.panels:
                step = steps[names[0]]
                pieces = [flatten_surface(scene, self.surfaces[0], relax, callback=step, device=self.device)]
            else:
                options, own = flatten_options(scene, self.device), [tables.get(name, PieceTable()) for name in names]
                if self.found is not None and self.found.seams:
                    # How a piece would lie alone is where sewing begins: it need not be known to the last where it is found slowly.
                    options["relax"] = replace(relax, max_steps=min(_ALONE, relax.max_steps))
                options["grain_angle"] = [
                    settings.grain_angle if table.grain_angle is None else table.grain_angle for table in own
                ]
                # Pieces of a garment whose seams were found know how their grain runs.
                options["datum"] = [
                    table.datum or (GRAIN if GRAIN in surface.lines else None)
                    for table, surface in zip(own, self.surfaces, strict=True)
                ]
                pieces = flatten_all(
                    self.surfaces,
                    callback=None if callback is None else lambda number, progress: callback(names[number], progress),
                    **options,
                )
            for place, (name, sequence) in enumerate(zip(names, self.sequences, strict=True)):
                recorder = recorders.get(name)
                if recorder is not None:
                    recorder.record_result(pieces[place])
                for number, plan in enumerate(sequence.plans):
                    if sequence.is_needed(pieces[place], number):
                        if recorder is not None:
                            recorder.record_cut_line(pieces[place], plan)
                        pieces[place] = cut(pieces[place], plan, relax=relax, callback=steps[name])
                        if recorder is not None:
                            recorder.record_result(pieces[place])
            lines = {piece.surface.name: piece.network.surface.lines for piece in pieces}
            constraints = scene_constraints(settings.constraints, lines)
            # Where nobody has said what meets what, a seam is eased as a tailor does it.
            eased = self.found is not None or bool(self.panels)
            sewing = partial(
                sew_pieces, pieces, constraints, seams=self.seams, options=relax, name=scene.name, eased=eased, bands=settings.bands,
                shorter=settings.bands_shorter,
            )  # fmt: skip
            with optional_step(_UNSEWN, of=StepError) as unsewn:
                garment = sewing()
            if unsewn:
                garment = sewing(relaxed=False)
            if self.panels:
                garment = garment_as_cut(
                    self.panels, self.surfaces, fabric=scene_fabric(scene), name=scene.name, flattened=garment,
                    device=self.device or settings.device,
                )  # fmt: skip
        if garment.sewn is not None or self.panels:
            for name, recorder in recorders.items():
                recorder.record_result(garment.pieces[name])
        found = () if self.found is None else (self.found.describe(), *self.found.notes)
        return replace(
            garment, remarks=(*unsewn, *found, *(note for sequence in self.sequences for note in sequence.notes))
        )

    def in_cloth(self, scene: Scene) -> MeshPlan:
        """See :meth:`Plan.in_cloth`; cuts that were found automatically are all made."""
        return replace(self, scene=scene, sequences=[replace(sequence, auto=None) for sequence in self.sequences])

    def notes(self, garment: Garment) -> list[str]:
        """Return what is told of the garment besides: borders that may have been forgotten."""
        # What lies beside a seam that was found, such as a hem, was not.
        return [] if self.found is not None else unsewn_notes(garment)

    def further_metrics(self, garment: Garment) -> dict[str, Any]:
        """See :meth:`Plan.further_metrics`: the seams that were found."""
        if self.found is None:
            return {}
        return {"garment": self.found.entry(list(garment.pieces.values()), self.drawing.rules.seam)}


@dataclass(frozen=True, kw_only=True, eq=False)
class FormScenePlan(Plan):
    """A garment whose pieces are a form on a mannequin.

    Attributes:
        form: the pieces on the mannequin.
        wishes: fullness and gathers of seams.
        constraints: on edges and lines.
        openings: along seams.
        settings: further arguments of :func:`warpflat.garment.construction.form_garment.flatten_form`.
    """

    mannequin: Mannequin
    form: FormResult
    wishes: Sequence[SeamTable]
    constraints: Sequence[Constraint]
    openings: Sequence[OpeningTable]
    settings: Mapping[str, Any]

    @property
    def surfaces(self) -> list[Surface]:
        """The pieces in space."""
        return [piece.surface for piece in self.form.pieces.values()]

    def flatten(
        self,
        *,
        callback: Callable[[str, Progress], bool | None] | None = None,
        recorders: Mapping[str, FrameRecorder] | None = None,
        known: Mapping[str, Flattening] | None = None,
    ) -> FormGarment:
        """See :meth:`Plan.flatten`; `known` as :func:`warpflat.flatten_form` takes it."""
        with errors_named(self.scene.where):
            flattened = partial(
                flatten_form,
                self.mannequin,
                self.form,
                callback=callback,
                known=known,
                wishes=self.wishes,
                constraints=self.constraints,
                **self.settings,
            )
            with optional_step(_UNSEWN, of=StepError) as unsewn:
                garment = flattened()
            if unsewn:
                garment = flattened(sewn=False)
        for name, recorder in (recorders or {}).items():
            piece = garment.pieces[name]
            for layout in (piece.unsewn, piece):
                if layout is not None:
                    recorder.record_result(layout)
        return replace(
            garment,
            openings=tuple(self.openings),
            finishing=self.scene.settings.finishing,
            pockets=self.scene.settings.pockets,
            remarks=(*unsewn, *garment.remarks),
        )

    def in_cloth(self, scene: Scene) -> FormScenePlan:
        """See :meth:`Plan.in_cloth`; a form that is pulled on grows by its cloth, any other stays; darts for woven cloth stay, too."""
        built = self.mannequin, self.form
        if scene.settings.pulled_on:
            built = scene_form(self.scene, self.mannequin, strain_limit=scene_fabric(scene).strain_limit)
        return plan_form_scene(scene, device=self.device, built=built)

    def advise(self, piece: Flattening) -> Flattening:
        """Return a piece with cuts that would help, each with the table of a scene's `[[cuts]]` that makes it, if one can."""
        name, advised = piece.surface.name, advise(piece)
        cloth, remedies = self.form.pieces[name], []
        on_fold = () if cloth.fold is None else cloth.grid_vertices[cloth.edges[cloth.fold]].tolist()
        for remedy in advised.remedies:
            row = cloth.grid_vertices[remedy.path]
            title = without_side(remedy.words.split(",")[0].removeprefix("a "))
            dart = self.form.dart_along(name, row, title)
            table = None if dart is None or row[-1] in on_fold else cut_of_dart(dart)
            remedies.append(replace(remedy, table=table))
        return advised.with_remedies(remedies) if remedies else advised

    def further_metrics(self, garment: Garment) -> dict[str, Any]:
        """See :meth:`Plan.further_metrics`: how the scene gives its body."""
        table = self.scene.settings.mannequin
        assert table is not None
        return {"mannequin": {**self.mannequin.metrics(), "table": table.model_dump(exclude_defaults=True)}}

    def place_drafted(self, garment: Garment, pattern: Pattern) -> Mapping[str, Sequence[Surface]]:
        """See :meth:`Plan.place_drafted`."""
        from warpflat.garment import place_drafted

        assert isinstance(garment, FormGarment)
        return place_drafted(pattern, garment)

    @property
    def size(self) -> str:
        """The size of the mannequin."""
        table = self.scene.settings.mannequin
        return "" if table is None else table.size_name

    def other_sizes(self) -> dict[str, Plan]:
        """See :meth:`Plan.other_sizes`."""
        found = dict[str, Plan]()
        for size in self.scene.settings.pattern.sizes:
            if size != self.size:
                with errors_named(f"{self.scene.where}: pattern.sizes"):
                    built = scene_form(self.scene, scene_mannequin(self.scene, size=size))
                    found[size] = plan_form_scene(self.scene, device=self.device, built=built)
        return found


def plan_scene(
    scene: Scene,
    *,
    device: str | None = None,
    cuts: CutSequence | None = None,
    built: tuple[Mannequin, FormResult] | None = None,
) -> Plan:
    """Check what a scene asks of its garment, wherever its pieces come from; see :func:`plan_mesh` and :func:`plan_form_scene`.

    Raises:
        InputError: the source, a line, a cut, the fabric, a seam or a setting is wrong.
    """
    fabric_of_correction(scene)  # a mistake is reported before anything is made
    if scene.settings.mannequin is None:
        return plan_mesh(scene, device=device, cuts=cuts)
    return plan_form_scene(scene, device=device, built=built)


def plan_mesh(scene: Scene, *, device: str | None = None, cuts: CutSequence | None = None) -> MeshPlan:
    """Read the meshes of a scene, and plan their cuts.

    Args:
        scene: with a surface.
        device: Warp device, before the scene's own.
        cuts: to be made instead of the scene's own.

    Raises:
        InputError: the surface, a line, a cut, a seam, an edge of the pattern or a setting is wrong.
    """
    settings = scene.settings
    scene_relax_options(scene)  # a mistake is reported before anything is made
    with errors_named(scene.where):
        drawing = pattern_options(settings.pattern, settings.marker, settings.cloth)
        seams = scene_surface_seams(settings.seams, scene.name)
    panels = [] if cuts is not None else scene_sewn_panels(scene)
    surface = None if cuts is not None or panels else plain_panel(scene)
    found = None if cuts is not None or surface is not None or panels else found_seams(scene)
    parts: Sequence[Surface] | None = [panel.surface for panel in panels] or None
    if not panels and cuts is None:
        parts = found.pieces if found is not None else scene_pieces(scene)
    # A pattern that is taken as it is keeps its corners.
    drawing = replace(drawing, true=drawing.true and not panels)
    if parts is None:
        sequences = [cuts or scene_cuts(scene, device=device, surface=surface)]
    else:
        if settings.drape is not None:
            raise InputError(
                f'{scene.where}: a drape takes one piece, or the folder of a run: warpflat drape DIR --body "EU 38"'
            )
        # Lines along seams name the edges of the pattern. What a piece is cut along may be one of them.
        opened = []
        for part in with_piece_tables(scene, name_seams(parts) if settings.pieces else parts):
            table = settings.pieces.get(part.name)
            with errors_named(f"{scene.where}: pieces.{part.name}" if table is not None else scene.where):
                opened.append(plan_cuts(part, [] if table is None else table.cuts))
        sequences = [
            replace(each, surface=surface, notes=tuple(f"{surface.name}: {note}" for note in each.notes))
            for each, surface in zip(opened, name_seams([each.surface for each in opened]), strict=True)
        ]
    rules = drawing.rules
    if rules.kinds or rules.allowances or drawing.names:
        with errors_named(scene.where):
            # Whichever of the automatic cuts are made.
            surfaces = [
                piece
                for sequence in sequences
                for count in sequence.counts
                for piece in cut_surfaces(sequence.surface, list(sequence.plans[:count]))
            ]
        with errors_named(f"{scene.where}: pattern"):
            check_edge_names(surfaces, rules, cuts=[plan.name for sequence in sequences for plan in sequence.plans])
            check_names(drawing.names, {surface.name: None for surface in surfaces})
    return MeshPlan(
        scene=scene, drawing=drawing, sequences=sequences, seams=seams, found=found, panels=panels, device=device
    )


def scene_cuts(scene: Scene, *, device: str | None = None, surface: Surface | None = None) -> CutSequence:
    """Plan the cuts of a scene and work their paths into its surface; those of `auto_cut` are looked for.

    Args:
        scene: with a surface.
        device: Warp device, before the scene's own.
        surface: the scene's, if it has been read before.

    Raises:
        InputError: the surface, a line or a cut is wrong.
    """
    settings = scene.settings
    surface = surface or scene_surface(scene)
    with errors_named(scene.where):
        sequence = plan_cuts(surface, settings.cuts)
        if settings.auto_cut is not None:
            sequence = plan_automatic_cuts(
                sequence,
                settings.auto_cut,
                flatten=partial(flatten_surface, scene, device=device),
                relax=scene_relax_options(scene),
            )
    return sequence


def flatten_surface(
    scene: Scene,
    surface: Surface,
    relax: RelaxOptions,
    *,
    callback: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
) -> Flattening:
    """Flatten a surface by the settings of a scene, before it is cut or sewn.

    Raises:
        InputError: it cannot be flattened, or the file of `start` is wrong.
    """
    settings, start = scene.settings, None
    if settings.start is not None:
        from warpflat.app.scene.read_layout import read_layout

        with errors_named(f"{scene.where}: start"):
            start = read_layout(scene.path(settings.start))
    options = {**flatten_options(scene, device), "relax": relax}
    return flatten(surface, datum=settings.datum, start=start, callback=callback, **options)


def flatten_options(scene: Scene, device: str | None = None) -> dict[str, Any]:
    """Return what a scene says of how each piece is flattened, as :func:`warpflat.flatten` takes it.

    Raises:
        InputError: the fabric or a setting is wrong.
    """
    return {
        "fabric": scene_fabric(scene),
        "grain_angle": scene.settings.grain_angle,
        "model": scene.settings.model,
        "wear": scene_wear(scene),
        "relax": scene_relax_options(scene),
        "device": device or scene.settings.device,
    }


def _sized_openings(scene: Scene, form: FormResult) -> list[OpeningTable]:
    """Return the openings of a scene, each as long as it is on a form, which is the one of a size."""
    on_form, found = {name: piece.surface.vertices for name, piece in form.pieces.items()}, list[OpeningTable]()
    for number, opening in enumerate(scene.settings.openings):
        if scene.settings.cloth is not None and scene.settings.cloth.lining:
            # A lining is sewn to the inner edges of the facings of button stands.
            opening = opening.model_copy(update={"facing": opening.facing or "separate"})
        with errors_named(f"openings[{number}]"):
            found.append(sized_opening(form, opening, on_form))
    return found


def plan_form_scene(
    scene: Scene, *, device: str | None = None, built: tuple[Mannequin, FormResult] | None = None
) -> FormScenePlan:
    """Check what a scene asks of its garment.

    Args:
        scene: with a form on a mannequin.
        device: Warp device, before the scene's own.
        built: the scene's mannequin and form, if they have been built before.

    Raises:
        InputError: the body, the form, the fabric, a seam, a constraint, an edge of the pattern or a setting is wrong.
    """
    settings, options = scene.settings, flatten_options(scene, device)
    report_activity("building the mannequin")
    mannequin, form = built or scene_form(scene)
    with errors_named(scene.where):
        openings = _sized_openings(scene, form)
    with errors_named(f"{scene.where}: pattern"):
        drawing = pattern_options(settings.pattern, settings.marker, settings.cloth)
        if settings.half:
            drawing = replace(drawing, rules=sewn_centres(drawing.rules, openings))
        plan = plan_form(form, drawing.rules)
        check_names(drawing.names, form.pieces)
    with errors_named(f"{scene.where}: grain_angle"):
        check_fold_grain(find_fold_lines(form, plan), settings.grain_angle)
    wishes = [*settings.seams]
    with errors_named(f"{scene.where}: seams"):
        wishes += cap_wishes(form, options["fabric"], wishes)
    with errors_named(scene.where):
        constraints = scene_constraints(
            settings.constraints,
            {name: piece.surface.lines for name, piece in form.pieces.items()},
            {name: piece.fold for name, piece in form.pieces.items() if piece.fold},
        )
    ruled = {(each.piece, each.line) for each in constraints if isinstance(each, Straight)}
    constraints += [each for each in straight_stands(form, openings) if (each.piece, each.line) not in ruled]
    return FormScenePlan(
        scene=scene,
        drawing=drawing,
        device=device,
        mannequin=mannequin,
        form=form,
        wishes=wishes,
        constraints=constraints,
        openings=openings,
        settings=options if settings.curves_mm is None else {**options, "curves_mm": settings.curves_mm},
    )
