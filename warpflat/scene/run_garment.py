"""Scenes whose pieces are a form on a mannequin."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from warpflat.core.activity import report_activity
from warpflat.core.atomic_files import files_written
from warpflat.core.beside import Beside
from warpflat.core.manifest import remove_stale
from warpflat.core.memory_limit import require_memory_for_run
from warpflat.core.optional_files import optional_file
from warpflat.fabric.library import as_fabric
from warpflat.flattening.progress import Progress
from warpflat.flattening.result import Flattening
from warpflat.garment.constraints import Constraint
from warpflat.garment.drawn_curves import CURVES_MM
from warpflat.garment.ease import SeamWish, cap_wishes, seam_ratios
from warpflat.garment.form_plan import check_fold_grain, find_fold_lines, plan_form
from warpflat.garment.garment import Garment, flatten_form
from warpflat.garment.openings import Opening, place_opening
from warpflat.garment.pattern_files import PatternOptions, WrittenPattern, check_names, garment_files
from warpflat.mannequin.bricks import select_bricks
from warpflat.mannequin.darts import dart_along
from warpflat.mannequin.forms import FormResult
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.table import mannequin_from_table
from warpflat.scene.closed_darts import ClosedDarts, require_open_darts
from warpflat.scene.drape import write_drape
from warpflat.scene.form import scene_form, scene_recipe
from warpflat.scene.form_cuts import cut_of_dart
from warpflat.scene.frames import MANNEQUIN, Film, FrameSchedule
from warpflat.scene.load import Scene, errors_named, scene_fabric, scene_relax_options, scene_wear
from warpflat.scene.openings import scene_finishing, scene_openings, scene_pockets, sewn_centres, straight_stands
from warpflat.scene.pattern_options import pattern_options
from warpflat.scene.seams import scene_constraints, scene_wishes
from warpflat.scene.write import SceneResult, packed_film, packed_pictures, review_files

__all__ = ["GarmentPlan", "plan_garment", "run_garment"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GarmentPlan:
    """A scene's garment, checked and not yet flattened.

    Attributes:
        scene: the scene.
        mannequin, form: the body, and the pieces on it.
        drawing: options of the pattern files.
        wishes: fullness and gathers of seams.
        constraints: on edges and lines.
        openings: along seams.
        settings: further arguments of :func:`warpflat.garment.garment.flatten_form`.
    """

    scene: Scene
    mannequin: Mannequin
    form: FormResult
    drawing: PatternOptions
    wishes: Sequence[SeamWish]
    constraints: Sequence[Constraint]
    openings: Sequence[Opening]
    settings: Mapping[str, Any]

    def flatten(
        self,
        *,
        callback: Callable[[str, Progress], bool | None] | None = None,
        known: Mapping[str, Flattening] | None = None,
    ) -> Garment:
        """Flatten and sew the garment; `callback` and `known` as :func:`warpflat.garment.garment.flatten_form` takes them.

        Raises:
            InputError: as :func:`warpflat.garment.garment.flatten_form`.
        """
        with errors_named(self.scene.where):
            garment = flatten_form(
                self.mannequin,
                self.form,
                callback=callback,
                known=known,
                wishes=self.wishes,
                constraints=self.constraints,
                **self.settings,
            )
            finishing = scene_finishing(self.scene.settings.finishing)
            pockets = scene_pockets(self.scene.settings.pockets)
            return replace(garment, openings=tuple(self.openings), finishing=finishing, pockets=pockets)


def plan_garment(
    scene: Scene, *, device: str | None = None, built: tuple[Mannequin, FormResult] | None = None
) -> GarmentPlan:
    """Check what a scene asks of its garment.

    Args:
        scene: with a form on a mannequin.
        device: Warp device, before the scene's own.
        built: the scene's mannequin and form, if they have been built before.

    Raises:
        InputError: the body, the form, the fabric, a seam, a constraint, an edge of the pattern or a setting is wrong.
    """
    settings = scene.settings
    relax, fabric = scene_relax_options(scene), scene_fabric(scene)
    report_activity("building the mannequin")
    mannequin, form = built or scene_form(scene)
    with errors_named(f"{scene.where}: pattern"):
        drawing = pattern_options(settings.pattern, settings.marker, settings.cloth)
        openings = scene_openings(settings.openings)
        if settings.half:
            drawing = replace(drawing, rules=sewn_centres(drawing.rules, openings))
        plan = plan_form(form, drawing.rules)
        check_names(drawing.names, form.pieces)
    for number, opening in enumerate(openings):
        with errors_named(f"{scene.where}: openings[{number}]"):
            place_opening(form, opening, {name: piece.surface.vertices for name, piece in form.pieces.items()})
    with errors_named(f"{scene.where}: grain_angle"):
        check_fold_grain(find_fold_lines(form, plan), settings.grain_angle)
    wishes = scene_wishes(settings.seams)
    with errors_named(f"{scene.where}: seams"):
        seam_ratios(form, wishes)
        wishes += cap_wishes(form, as_fabric(fabric), wishes)
    with errors_named(scene.where):
        constraints = scene_constraints(
            settings.constraints,
            {name: piece.surface.lines for name, piece in form.pieces.items()},
            {name: piece.fold for name, piece in form.pieces.items() if piece.fold},
        )
    constraints += [each for each in straight_stands(form, openings) if each not in constraints]
    return GarmentPlan(
        scene=scene,
        mannequin=mannequin,
        form=form,
        drawing=drawing,
        wishes=wishes,
        constraints=constraints,
        openings=openings,
        settings={
            "fabric": fabric,
            "grain_angle": settings.grain_angle,
            "curves_mm": CURVES_MM if settings.curves_mm is None else settings.curves_mm,
            "model": settings.model,
            "wear": scene_wear(scene),
            "relax": relax,
            "device": device or settings.device,
        },
    )


def run_garment(
    scene: Scene,
    out: Path,
    *,
    on_progress: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
    built: tuple[Mannequin, FormResult] | None = None,
) -> SceneResult:
    """Run a scene whose pieces are a form on a mannequin; see :func:`warpflat.scene.run.run_scene`."""
    notes: tuple[str, ...] = ()
    while True:
        try:
            plan = plan_garment(scene, device=device, built=built)
            result = _run_plan(plan, out, on_progress=on_progress, device=device)
        except ClosedDarts as closed:
            scene, left_out, built = closed.without, closed.notes, None
            notes += left_out
        else:
            return replace(result, notes=(*notes, *result.notes))


def _run_plan(
    plan: GarmentPlan,
    out: Path,
    *,
    on_progress: Callable[[Progress], bool | None] | None,
    device: str | None,
) -> SceneResult:
    """Flatten the garment and write its files; pictures and pattern in processes of their own.

    Raises:
        ClosedDarts: some darts of the scene's shape do not open.
    """
    from warpflat.core.atomic_files import expect_files

    scene = plan.scene
    expect_files(out, [f"{name}.obj" for name in plan.form.pieces])
    if FrameSchedule(scene.settings.output).wanted:
        expect_files(out, [MANNEQUIN])
    if scene.settings.drape is not None:
        expect_files(out, [f"{name}.draped.obj" for name in plan.form.pieces])
    others = _other_sizes(scene)
    report = on_progress or (lambda progress: None)
    with ExitStack() as beside:
        with _film(plan, out) as film:
            garment = _flatten_with_frames(plan, film, on_progress=on_progress)
            require_open_darts(scene, [garment])
            report_activity("measuring how it fits")
            garment = replace(garment, pieces=_advised(plan, garment))
            drawn = partial(_write_pieces, plan, garment, out)
            pictures = beside.enter_context(Beside(drawn, "drawing the pictures"))
            graded = {
                size: replace(plan, mannequin=body, form=form).flatten(callback=lambda _, progress: report(progress))
                for size, (body, form) in others.items()
            }
            require_open_darts(scene, graded.values())
            drafted = partial(_write_pattern, plan, {**graded, _own_size(plan): garment}, out)
            pattern = beside.enter_context(Beside(drafted, "drafting the pattern"))
        draped, files = write_drape(scene, garment, out, device=device)
        return _finish(
            plan,
            garment,
            graded,
            out,
            draped=draped,
            files=list(dict.fromkeys([*files, *film.files])),
            pictures=pictures,
            pattern=pattern,
        )


def _advised(plan: GarmentPlan, garment: Garment) -> dict[str, Flattening]:
    """Return the pieces with cuts that would help, each with the table of a scene's `[[cuts]]` that makes it, if one can."""
    from warpflat.cutting.remedies import advise

    layout, recipes = plan.mannequin.layout, scene_recipe(plan.scene, plan.mannequin)[1].pieces
    found: dict[str, Flattening] = {}
    for name, piece in garment.pieces.items():
        advised, cloth = advise(piece), plan.form.pieces[name]
        bricks = select_bricks(layout, recipes[name].bricks)
        on_fold = () if cloth.fold is None else cloth.grid_vertices[cloth.edges[cloth.fold]].tolist()
        remedies = []
        for remedy in advised.remedies:
            row = cloth.grid_vertices[remedy.path]
            words = remedy.words.split(",")[0].removeprefix("a ").removesuffix(" left").removesuffix(" right")
            dart = dart_along(layout, plan.form.vertices, bricks, row, piece=name, name=words)
            table = None if dart is None or row[-1] in on_fold else cut_of_dart(dart)
            remedies.append(replace(remedy, table=table))
        found[name] = advised.with_remedies(remedies) if remedies else advised
    return found


def _film(plan: GarmentPlan, out: Path) -> Film:
    """Return the film of the garment's pieces, for a ``with`` block."""
    output, surfaces = plan.scene.settings.output, [piece.surface for piece in plan.form.pieces.values()]
    require_memory_for_run(sum(len(surface.vertices) for surface in surfaces), frames=FrameSchedule(output).wanted)
    return Film(out, output, surfaces, mannequin=plan.mannequin)


def _flatten_with_frames(
    plan: GarmentPlan, film: Film, *, on_progress: Callable[[Progress], bool | None] | None = None
) -> Garment:
    """Flatten and sew the garment, and record its layouts."""

    def each_step(name: str, progress: Progress) -> bool | None:
        film.recorders[name](progress)
        return None if on_progress is None else on_progress(progress)

    garment = plan.flatten(callback=each_step)
    for name, piece in garment.pieces.items():
        if piece.unsewn is not None:
            film.recorders[name].record_result(piece.unsewn)
        film.recorders[name].record_result(piece)
    return garment


def _write_pieces(plan: GarmentPlan, garment: Garment, out: Path) -> list[str]:
    """Write an OBJ per piece, the picture of the flattened garment, and that of how it is worn; return their names.

    The latter is drawn if it was asked for or the cloth is stretched. One process draws both: the library for it takes long to load.
    """
    settings, wearer = plan.scene.settings, garment.wearer
    files = garment.write_files(out, picture=settings.output.picture)
    if not settings.output.picture or (settings.wear is None and (wearer is None or not wearer.is_stretched)):
        return files
    with optional_file(out / "wear.png", files) as path:
        from warpflat.flattening.fit_picture import write_wear_sheet

        on_body = [] if wearer is None else [wearer.pieces[name].as_dict() for name in garment.pieces]
        write_wear_sheet(path, list(garment.pieces.values()), title=garment.name, on_body=on_body)
    return files


def _own_size(plan: GarmentPlan) -> str:
    """Return the size of the mannequin; empty if it has none."""
    table = plan.scene.settings.mannequin
    return "" if table is None else table.size_name


def _write_pattern(plan: GarmentPlan, sizes: Mapping[str, Garment], out: Path) -> WrittenPattern:
    """Write the files of the pattern in all sizes, and the picture of its seams, which is among the files that are returned."""
    scene, settings = plan.scene, plan.scene.settings
    pattern = garment_files(
        {size: sizes[size] for size in _in_order(sizes, settings.pattern.sizes)},
        out,
        name=scene.name,
        options=plan.drawing,
        sample_size=_own_size(plan),
    )
    if not (settings.output.picture and pattern.walked):
        return pattern
    files = list(pattern.files)
    with optional_file(out / "walked.png", files) as path:
        from warpflat.export.picture_walked import write_walked_picture

        write_walked_picture(path, pattern.walked, title=scene.name)
    return replace(pattern, files=tuple(files))


def _finish(
    plan: GarmentPlan,
    garment: Garment,
    graded: Mapping[str, Garment],
    out: Path,
    *,
    draped: Mapping[str, Any],
    files: Sequence[str],
    pictures: Beside[list[str]],
    pattern: Beside[WrittenPattern],
) -> SceneResult:
    """Write the last files of a garment when all others are there, and remove what earlier runs have left.

    Args:
        plan: what was asked for.
        garment: in the mannequin's own size.
        graded: the garment in the other sizes of the pattern.
        out: an existing folder.
        draped: entries of the drape.
        files: of the drape, and the film if there is one.
        pictures, pattern: write the pieces with their pictures, and the pattern.
    """
    from warpflat.export.letters import note_on_names

    scene, settings = plan.scene, plan.scene.settings
    measured, film = garment.metrics(), packed_film(scene, out, files)
    images = packed_pictures(scene, out, files)
    drawn = pictures.result()
    files = [*drawn, *files, "metrics.json"]
    images |= packed_pictures(scene, out, drawn)  # while the pattern is drafted
    written = pattern.result()
    measured |= {**_metrics_of_sizes(graded), **draped, **written.metrics}
    if settings.mannequin is not None:
        measured["mannequin"] = {**measured["mannequin"], "table": settings.mannequin.model_dump(exclude_defaults=True)}
    files += written.files
    files += [*review_files(scene, measured, out, tuple(files), film, images)]
    drape = settings.drape is not None
    # The body belongs to the film.
    known = [*files, *([MANNEQUIN] if any(name == MANNEQUIN for _, name in files_written()) else [])]
    metrics, manifest_notes = remove_stale(out, measured, name=scene.name, files=known, drape=drape)
    name_notes = note_on_names(garment.pieces) if settings.output.picture else ()
    notes = (*garment.notes, *written.notes, *name_notes, *manifest_notes)
    return SceneResult(metrics=metrics, files=tuple(files), notes=notes)


def _metrics_of_sizes(graded: Mapping[str, Garment]) -> dict[str, Any]:
    """Return the entry `sizes` of `metrics.json`: a summary of each size besides the mannequin's own."""
    return {"sizes": {size: garment.summary() for size, garment in graded.items()}} if graded else {}


def _in_order(sizes: Iterable[str], wanted: Sequence[str]) -> list[str]:
    """Return the sizes in the scene's order, or by their numbers if the scene leaves out the mannequin's own."""
    if set(sizes) == set(wanted):
        return list(dict.fromkeys(wanted))
    return sorted(sizes, key=lambda size: (int("".join(filter(str.isdigit, size)) or 0), size))


def _other_sizes(scene: Scene) -> dict[str, tuple[Mannequin, FormResult]]:
    """Return the bodies and forms of the sizes that the pattern has besides the mannequin's own."""
    table = scene.settings.mannequin
    found = {}
    for size in scene.settings.pattern.sizes:
        if table is not None and size != table.size:
            with errors_named(f"{scene.where}: pattern.sizes"):
                found[size] = scene_form(
                    scene, mannequin_from_table(table.model_copy(update={"size": size}), path_of=Path)
                )
    return found
