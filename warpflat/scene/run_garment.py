"""Scenes whose pieces are a form on a mannequin."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from warpflat.core.activity import report_activity
from warpflat.core.manifest import remove_stale
from warpflat.core.memory_limit import require_memory_for_run
from warpflat.flattening.progress import Progress
from warpflat.garment.constraints import Constraint
from warpflat.garment.ease import SeamWish, seam_ratios
from warpflat.garment.form_plan import check_fold_grain, folds_of, plan_form
from warpflat.garment.garment import Garment, flatten_form
from warpflat.garment.pattern_files import PatternOptions, garment_files
from warpflat.mannequin.forms import FormResult, form_from_mapping, shipped_form
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.table import mannequin_from_table
from warpflat.scene.frames import FrameSchedule
from warpflat.scene.load import Scene, errors_named, expand_variables, scene_fabric, scene_relax_options, scene_wear
from warpflat.scene.pattern_options import pattern_options
from warpflat.scene.seams import scene_constraints, scene_wishes
from warpflat.scene.write import SceneResult

__all__ = ["GarmentPlan", "plan_garment", "run_garment", "scene_form"]


def scene_form(scene: Scene, mannequin: Mannequin | None = None) -> tuple[Mannequin, FormResult]:
    """The scene's mannequin, or another one, and the pieces of its form.

    Raises:
        InputError: the body, the form or a brick is wrong.
    """
    settings = scene.settings
    assert settings.mannequin is not None  # the schema sees to it
    if mannequin is None:
        with errors_named(f"{scene.where}: mannequin"):
            mannequin = mannequin_from_table(
                settings.mannequin, path_of=lambda file: scene.folder / expand_variables(file)
            )
    with errors_named(f"{scene.where}: form"):
        if isinstance(settings.form, str):
            form = shipped_form(settings.form)
        else:
            form = form_from_mapping(scene.name, settings.form or {})
        return mannequin, mannequin.form(form, half=settings.half)


@dataclass(frozen=True, kw_only=True, eq=False)
class GarmentPlan:
    """A scene's garment, checked, before anything of it is flattened.

    Attributes:
        scene: whose it is.
        mannequin, form: the body, and the pieces on it.
        drawing: what is written of its pattern.
        wishes: ease and gathers of its seams.
        constraints: on its edges and lines.
        settings: what else :func:`warpflat.garment.garment.flatten_form` takes.
    """

    scene: Scene
    mannequin: Mannequin
    form: FormResult
    drawing: PatternOptions
    wishes: Sequence[SeamWish]
    constraints: Sequence[Constraint]
    settings: Mapping[str, Any]

    def flatten(self, *, callback: Callable[[str, Progress], None] | None = None) -> Garment:
        """Flatten and sew it.

        Raises:
            InputError: as :func:`warpflat.garment.garment.flatten_form`.
        """
        with errors_named(self.scene.where):
            return flatten_form(
                self.mannequin,
                self.form,
                callback=callback,
                wishes=self.wishes,
                constraints=self.constraints,
                **self.settings,
            )


def plan_garment(scene: Scene, *, device: str | None = None) -> GarmentPlan:
    """What a scene asks of its garment.

    Args:
        scene: with a form on a mannequin.
        device: Warp device, before the scene's own.

    Raises:
        InputError: the body, the form, the fabric, a seam, a constraint, an edge of the pattern or a setting is wrong.
    """
    settings = scene.settings
    relax, fabric = scene_relax_options(scene), scene_fabric(scene)
    report_activity("building the mannequin")
    mannequin, form = scene_form(scene)
    with errors_named(f"{scene.where}: pattern"):
        drawing = pattern_options(settings.pattern, settings.marker)
        plan = plan_form(form, drawing.rules)
    with errors_named(f"{scene.where}: grain_angle"):
        check_fold_grain(folds_of(form, plan), settings.grain_angle)
    wishes = scene_wishes(settings.seams)
    with errors_named(f"{scene.where}: seams"):
        drawing = replace(drawing, rules=replace(drawing.rules, ease=seam_ratios(form, wishes).ease))
    with errors_named(scene.where):
        constraints = scene_constraints(
            settings.constraints,
            {name: piece.surface.lines for name, piece in form.pieces.items()},
            {name: piece.fold for name, piece in form.pieces.items() if piece.fold},
        )
    return GarmentPlan(
        scene=scene,
        mannequin=mannequin,
        form=form,
        drawing=drawing,
        wishes=wishes,
        constraints=constraints,
        settings={
            "fabric": fabric,
            "grain_angle": settings.grain_angle,
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
    on_progress: Callable[[Progress], None] | None = None,
    device: str | None = None,
) -> SceneResult:
    """Run a scene whose pieces are a form on a mannequin; see :func:`warpflat.scene.run.run_scene`."""
    from warpflat.core.atomic_files import expect_files
    from warpflat.cutting.remedies import advise
    from warpflat.export.letters import note_on_names
    from warpflat.export.usd import FrameWriter

    settings = scene.settings
    plan = plan_garment(scene, device=device)
    form, drawing = plan.form, plan.drawing
    expect_files(out, [f"{name}.obj" for name in form.pieces])
    others = _other_sizes(scene)
    schedules = {name: FrameSchedule(settings.output) for name in form.pieces}
    wanted = next(iter(schedules.values())).wanted
    require_memory_for_run(sum(len(piece.surface.vertices) for piece in form.pieces.values()), frames=wanted)
    with ExitStack() as stack:
        writer: FrameWriter | None = None
        if wanted:
            writer = stack.enter_context(FrameWriter(out / "frames.usdc"))
            for name, piece in form.pieces.items():
                writer.add_piece(name, piece.surface)

        def each_step(name: str, progress: Progress) -> None:
            if writer is not None and schedules[name].is_due(progress.step, progress.max_steps):
                writer.write(
                    name,
                    positions=progress.positions(),
                    face_energy_density=progress.face_energy_density(),
                    measures={"step": progress.step, "model_energy_j": progress.model_energy},
                )
            if on_progress is not None:
                on_progress(progress)

        garment = plan.flatten(callback=each_step)
        report_activity("measuring how it fits")
        garment = replace(garment, pieces={name: advise(piece) for name, piece in garment.pieces.items()})
        told = on_progress or (lambda progress: None)
        graded = {
            size: replace(plan, mannequin=body, form=other).flatten(callback=lambda _, progress: told(progress))
            for size, (body, other) in others.items()
        }
        if writer is not None:
            _last_frames(writer, garment)
    files = [*garment.write_files(out, picture=settings.output.picture), "metrics.json"]
    if settings.wear is not None and settings.output.picture:
        from warpflat.flattening.fit_picture import write_wear_sheet

        files.append("wear.png")
        write_wear_sheet(out / files[-1], list(garment.pieces.values()), title=garment.name)
    if wanted:
        files.append("frames.usdc")
    own = settings.mannequin.size_name if settings.mannequin is not None else ""
    sizes = {**graded, own: garment}
    pattern = garment_files(
        {size: sizes[size] for size in _in_order(sizes, settings.pattern.sizes)},
        out,
        name=scene.name,
        options=drawing,
        sample_size=own,
    )
    metrics, settled = remove_stale(
        out,
        {**garment.metrics(), **_of_sizes(graded), **pattern.metrics},
        name=scene.name,
        files=(*files, *pattern.files),
    )
    unnamed = note_on_names(garment.pieces) if settings.output.picture else ()
    notes = (*garment.notes, *pattern.notes, *unnamed, *settled)
    return SceneResult(metrics=metrics, files=(*files, *pattern.files), notes=notes)


def _of_sizes(graded: Mapping[str, Garment]) -> dict[str, Any]:
    """The entry `sizes` of `metrics.json`: of each besides the mannequin's own, whether its pattern is good."""
    return {"sizes": {size: garment.summary() for size, garment in graded.items()}} if graded else {}


def _in_order(sizes: Iterable[str], wanted: Sequence[str]) -> list[str]:
    """As the scene lists them; where it leaves out the mannequin's own, by their numbers."""
    if set(sizes) == set(wanted):
        return list(dict.fromkeys(wanted))
    return sorted(sizes, key=lambda size: (int("".join(filter(str.isdigit, size)) or 0), size))


def _other_sizes(scene: Scene) -> dict[str, tuple[Mannequin, FormResult]]:
    """The bodies and forms of the sizes that the pattern has besides the mannequin's own."""
    table = scene.settings.mannequin
    found = {}
    for size in scene.settings.pattern.sizes:
        if table is not None and size != table.size:
            with errors_named(f"{scene.where}: pattern.sizes"):
                found[size] = scene_form(
                    scene, mannequin_from_table(table.model_copy(update={"size": size}), path_of=Path)
                )
    return found


def _last_frames(writer: Any, garment: Garment) -> None:
    for name, piece in garment.pieces.items():
        writer.write(
            name,
            positions=piece.positions,
            face_energy_density=piece.face_energy_density,
            measures={"step": piece.stages[-1].steps, **piece.layout_measures},
        )
