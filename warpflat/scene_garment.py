"""Scenes whose pieces are a form on a mannequin."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from warpflat.flattening import Progress
from warpflat.garment import Garment, flatten_form
from warpflat.leftovers import settle
from warpflat.mannequin import FormResult, Mannequin, form_from_mapping, shipped_form
from warpflat.mannequin.table import mannequin_from_table
from warpflat.pattern.from_garment import check_fold_grain, folds_of, plan_form
from warpflat.pattern_files import garment_files, pattern_options
from warpflat.scene import (
    FrameSchedule,
    Scene,
    SceneResult,
    expand_variables,
    scene_fabric,
    scene_relax_options,
    scene_sources,
    scene_wear,
    told_by,
)
from warpflat.scene_seams import scene_constraints, scene_wishes
from warpflat.seam_wishes import wished_seams

__all__ = ["run_garment", "scene_form"]


def scene_form(scene: Scene, mannequin: Mannequin | None = None) -> tuple[Mannequin, FormResult]:
    """The scene's mannequin, or another one, and the pieces of its form.

    Raises:
        InputError: the body, the form or a brick is wrong.
    """
    settings = scene.settings
    assert settings.mannequin is not None  # the schema sees to it
    if mannequin is None:
        with told_by(f"{scene.where}: mannequin"):
            mannequin = mannequin_from_table(
                settings.mannequin, path_of=lambda file: scene.folder / expand_variables(file)
            )
    with told_by(f"{scene.where}: form"):
        if isinstance(settings.form, str):
            form = shipped_form(settings.form)
        else:
            form = form_from_mapping(scene.name, settings.form or {})
        return mannequin, mannequin.form(form, half=settings.half)


def run_garment(
    scene: Scene,
    out: Path,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    device: str | None = None,
) -> SceneResult:
    """As :func:`warpflat.scene.run_scene`, for a garment: an OBJ per piece, one film, one picture, the seams measured."""
    from warpflat.export import FrameWriter
    from warpflat.export.letters import note_on_names

    settings = scene.settings
    relax = scene_relax_options(scene)
    fabric = scene_fabric(scene)
    mannequin, form = scene_form(scene)
    with told_by(f"{scene.where}: pattern"):
        drawing = pattern_options(settings.pattern, settings.marker)
        plan = plan_form(form, drawing.rules)
    with told_by(f"{scene.where}: grain_angle"):
        check_fold_grain(folds_of(form, plan), settings.grain_angle)
    wishes = scene_wishes(settings.seams)
    with told_by(f"{scene.where}: seams"):
        drawing = replace(drawing, rules=replace(drawing.rules, ease=wished_seams(form, wishes).ease))
    with told_by(scene.where):
        constraints = scene_constraints(
            settings.constraints,
            {name: piece.surface.lines for name, piece in form.pieces.items()},
            {name: piece.fold for name, piece in form.pieces.items() if piece.fold},
        )
    others = _other_sizes(scene)
    schedules = {name: FrameSchedule(settings.output) for name in form.pieces}
    wanted = next(iter(schedules.values())).wanted
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
                    measures={"step": progress.step, "spring_energy_j": progress.spring_energy},
                )
            if on_progress is not None:
                on_progress(progress)

        def flattened(body: Mannequin, form: FormResult, each_step: Callable[[str, Progress], None]) -> Garment:
            return flatten_form(
                body,
                form,
                fabric=fabric,
                grain_angle=settings.grain_angle,
                model=settings.model,
                wear=scene_wear(scene),
                relax=relax,
                callback=each_step,
                device=device or settings.device,
                wishes=wishes,
                constraints=constraints,
            )

        with told_by(scene.where):
            garment = flattened(mannequin, form, each_step)
            told = on_progress or (lambda progress: None)
            graded = {size: flattened(*other, lambda name, progress: told(progress)) for size, other in others.items()}
        if writer is not None:
            _last_frames(writer, garment)
    files = garment.save(out, picture=settings.output.picture)
    if settings.wear is not None and settings.output.picture:
        from warpflat.wear_picture import write_wear_sheet

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
    odd = [
        f"size {size}: {name} did not converge"
        for size, other in graded.items()
        for name, piece in other.pieces.items()
        if not piece.converged
    ]
    metrics, settled = settle(
        out,
        {**garment.metrics(), **pattern.metrics},
        name=scene.name,
        files=(*files, *pattern.files),
        sources=scene_sources(scene),
    )
    unnamed = note_on_names(garment.pieces) if settings.output.picture else ()
    notes = (*garment.notes, *odd, *pattern.notes, *unnamed, *settled)
    return SceneResult(metrics=metrics, files=(*files, *pattern.files), notes=notes)


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
            with told_by(f"{scene.where}: pattern.sizes"):
                found[size] = scene_form(
                    scene, mannequin_from_table(table.model_copy(update={"size": size}), path_of=Path)
                )
    return found


def _last_frames(writer: Any, garment: Garment) -> None:
    for name, piece in garment.pieces.items():
        numbers = {key: value for key, value in piece.measures.items() if isinstance(value, (int, float))}
        writer.write(
            name,
            positions=piece.positions,
            face_energy_density=piece.face_energy_density,
            measures={"step": piece.stages[-1].steps, **numbers},
        )
