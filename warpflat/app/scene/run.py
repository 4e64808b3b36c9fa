"""A scene is run: its garment is flattened, cut and sewn, advised on, drafted as a pattern, and all files are written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from warpflat.app.review.page import pack_frames, pack_pictures, write_review
from warpflat.app.scene.cuts import CutSequence
from warpflat.app.scene.drape import drape_names, write_drape
from warpflat.app.scene.form_shaping import require_open_darts, settle_shape, with_open_darts
from warpflat.app.scene.frames import MANNEQUIN, Film
from warpflat.app.scene.load import Scene
from warpflat.app.scene.plan import Plan, plan_scene
from warpflat.app.scene.schema import FileSurface
from warpflat.core import StepError, report_activity, require_memory_for_run
from warpflat.flat import Progress, Remedy, Surface, extent_words, judge
from warpflat.garment import (
    FormResult,
    Garment,
    Mannequin,
    garment_files,
    size_names,
)
from warpflat.pattern import (
    Beside,
    LeftOut,
    WrittenPattern,
    expect_files,
    listening_to_left_out,
    note_on_names,
    notes_left_out,
    optional_file,
    optional_step,
    output_folder,
    pattern_names,
    remove_stale,
)

if TYPE_CHECKING:
    from functools import _lru_cache_wrapper

    from warpflat.pattern import DraftedOutline, Pattern

    Draw: TypeAlias = _lru_cache_wrapper[tuple[Pattern, tuple[str, ...]]]

# From so many vertices on, pictures and pattern follow the film: beside it and the fit they would take the most memory of a run.
_MANY = 500_000

__all__ = ["SceneResult", "files_of_run", "run_scene"]


@dataclass(frozen=True, kw_only=True)
class SceneResult:
    """The result of a run.

    Attributes:
        metrics: as `metrics.json`.
        files: names of the files that were written.
        notes: what was repaired or chosen, one sentence each.
        size: of what was read from a mesh file, in words; "" for anything else.
    """

    metrics: dict[str, Any]
    files: tuple[str, ...]
    notes: tuple[str, ...]
    size: str = ""


def run_scene(
    scene: Scene,
    out: str | Path,
    *,
    on_progress: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
    cuts: CutSequence | None = None,
    built: Callable[[], tuple[Mannequin, FormResult]] | None = None,
    further: Sequence[str] = (),
) -> SceneResult:
    """Flatten the scene's surface, all pieces of its file, or the pieces of its form, and write the result.

    Files: `metrics.json`, `NAME.obj` per piece, `frames.usdc`, `picture.png`, and the pattern (see
    `warpflat.pattern.export.pattern_files`). Files that an earlier run has left there and this one does not make are removed at the
    end (see `warpflat.pattern.files.output`). All of that happens together; a run that fails leaves the folder
    as it was, and no run replaces a file that it has read.

    Args:
        scene: what to do.
        out: folder for the files, made if need be.
        on_progress: called after each step.
        device: Warp device, before the scene's own.
        cuts: of a surface, to be made instead of the scene's own (see `warpflat.app.scene.ledger.cuts_of_entry`).
        built: gives the scene's mannequin and form, where they are built already.
        further: files that the caller adds to the folder, which the page lists, too.

    Raises:
        InputError: the surface, a line, a cut, the fabric or a setting is wrong, `out` cannot be written, or a file there that the scene
            is made from would be replaced.
    """
    sources = (*scene.sources, *(() if cuts is None else cuts.surface.sources))
    with output_folder(out, files_of_run(scene), sources=sources, guard=True) as folder:
        settled, notes = settle_shape(scene, device=device)

        def made(one: Scene) -> SceneResult:
            form = built() if built is not None and one is scene else None
            plan = plan_scene(one, device=device, cuts=cuts, built=form)
            return _run(plan, folder, on_progress=on_progress, device=device, further=further)

        _, result, closed = with_open_darts(settled, made)
        return replace(result, notes=(*notes, *closed, *result.notes))


def files_of_run(scene: Scene) -> list[str]:
    """Return the files that a run will write, as far as they are known; those of a form's pieces or of parts of a cut are not."""
    settings, output = scene.settings, scene.settings.output
    on_form, worn = settings.mannequin is not None, output.picture and settings.wear is not None
    alone = not on_form and getattr(settings.surface, "component", None) != "all"
    patterns = pattern_names(scene.name, settings.pattern.formats, marker=settings.marker is not None)
    asked = {
        "metrics.json": True,
        f"{scene.name}.obj": alone,
        "frames.usdc": output.frames > 0,
        "picture.png": output.picture,
        "review.html": output.picture and output.review,
        "wear.png": worn and on_form,
        f"{scene.name}.wear.png": worn and not on_form,
        "walked.png": output.picture and on_form and bool(patterns),
    }
    return [
        *(file for file, wanted in asked.items() if wanted),
        *patterns,
        *drape_names(scene, [scene.name] if alone else []),
    ]


def _run(
    plan: Plan,
    folder: Path,
    *,
    on_progress: Callable[[Progress], bool | None] | None,
    device: str | None,
    further: Sequence[str],
) -> SceneResult:
    """Flatten a garment and write its files into a folder that an `output_folder` holds; pictures and pattern beside the film.

    Raises:
        ClosedDarts: some darts of the scene's shape do not open.
    """
    scene, settings, output = plan.scene, plan.scene.settings, plan.scene.settings.output
    names = [surface.name for surface in plan.surfaces]
    vertices = sum(len(surface.vertices) for surface in plan.surfaces)
    filmed, body = output.frames > 0, plan.mannequin
    expect_files(folder, [f"{name}.obj" for name in names])
    expect_files(folder, [MANNEQUIN] if filmed and body is not None else [])
    expect_files(folder, drape_names(scene, names))
    require_memory_for_run(vertices, frames=filmed)
    others = plan.other_sizes()

    with ExitStack() as beside:
        with Film(folder, output, plan.surfaces, mannequin=body) as film:

            def each_step(name: str, progress: Progress) -> bool | None:
                film.recorders[name](progress)
                return None if on_progress is None else on_progress(progress)

            garment = plan.flatten(callback=each_step, recorders=film.recorders)
            require_open_darts(scene, [garment])
            film.worn = garment.pieces
            notes = plan.notes(garment)
            fit = beside.enter_context(Beside(partial(_measure_fit, plan, garment, folder), "measuring how it fits"))
            graded = dict[str, Garment]()
            for size, other in others.items():
                with optional_step(f"size {size} was left out"):
                    graded[size] = other.flatten(
                        callback=lambda _, progress: None if on_progress is None else on_progress(progress)
                    )
            require_open_darts(scene, graded.values())
            sizes = _in_order(plan, {**graded, plan.size: garment})
            draw, drawn = _draw_once(plan, sizes), None
            if (filmed or output.picture) and (garment.finishing or garment.pockets):
                with optional_step("the picture is without what finishing and pockets add", is_needed=False):
                    drawn, _ = draw()
            pattern = Beside(partial(_write_pattern, plan, sizes, folder, draw), "drafting the pattern")
            # The paper tells the verdict, which a drape gives.
            if vertices < _MANY and settings.drape is None:
                beside.enter_context(pattern)
            drafted = [] if drawn is None else _drafted(plan, garment, drawn)
            film.drafted = [copy for piece in drafted for copy in piece.worn]
            show = partial(garment.write_files, folder, picture=output.picture, drafted=drafted)
            pictures = Beside(show, "drawing the pictures")
            if vertices < _MANY:
                beside.enter_context(pictures)

        files = list(film.files)
        draped: dict[str, Any] = {}
        drape_notes: tuple[str, ...] = ()
        if settings.drape is not None:
            measured, fit_notes, remedies, worn = fit.result()
            garment = garment.advised(lambda part: part.with_remedies(remedies[part.surface.name]))
            with optional_step("it was not draped", of=StepError):
                draped, drape_files, drape_notes = write_drape(
                    scene, garment, folder, drawing=plan.drawing, device=device
                )
                files = list(dict.fromkeys([*drape_files, *files]))
                sizes[plan.size] = replace(sizes[plan.size], drape=draped["drape"])
                draw.cache_clear()
        # What is ready is packed for the review while other processes write.
        page, reviewed = folder / "review.html", output.picture and output.review
        packed: Mapping[str, Any] | None = None
        shown: dict[str, str] = {}
        if reviewed and "frames.usdc" in files:
            with optional_file(page, [], part="the film"):
                packed = pack_frames(folder)
        if settings.drape is None:
            measured, fit_notes, remedies, worn = fit.result()
        files += pictures.result()
        files += [*worn, "metrics.json"]
        if reviewed:
            with optional_file(page, []):
                shown = pack_pictures(folder, files)
        written = pattern.result()
        files += written.files
        measured |= {"sizes": {size: each.summary() for size, each in graded.items()}} if graded else {}
        measured |= {**draped, **written.metrics}
        if (verdict := judge(measured)) is not None:
            measured["verdict"] = verdict.as_dict()
        if reviewed:
            with optional_file(page, files):
                write_review(
                    folder,
                    measured | notes_left_out(folder),
                    (*files, *further),
                    name=scene.name,
                    film=packed,
                    pictures=shown,
                )

    drape = settings.drape is not None
    metrics, manifest_notes = remove_stale(folder, measured, name=scene.name, files=files, drape=drape)
    name_notes = note_on_names(garment.parts) if output.picture else ()
    size = ""
    if isinstance(settings.surface, FileSurface):
        size = extent_words(np.concatenate([surface.vertices for surface in plan.surfaces]), settings.surface.units)
    return SceneResult(
        metrics=metrics,
        files=tuple(files),
        notes=tuple(dict.fromkeys((*notes, *fit_notes, *written.notes, *drape_notes, *name_notes, *manifest_notes))),
        size=size,
    )


def _in_order(plan: Plan, garments: Mapping[str, Garment]) -> dict[str, Garment]:
    """Return the sizes of a garment as the scene has them, or as the tables do where the scene leaves out the mannequin's own."""
    wanted = list(dict.fromkeys(plan.scene.settings.pattern.sizes))
    if garments.keys() != set(wanted):
        names = size_names()
        wanted = sorted(garments, key=lambda size: (names.index(size) if size in names else len(names), size))
    return {size: garments[size] for size in wanted}


def _draw_once(plan: Plan, sizes: Mapping[str, Garment]) -> Draw:
    """Return a function that draws the pattern for all who show it: film, pictures and paper; it remembers what it has drawn."""

    @cache
    def draw() -> tuple[Pattern, tuple[str, ...]]:
        from warpflat.garment import pattern_of_garment

        heard = list[LeftOut]()
        with listening_to_left_out(heard.append):
            pattern, notes = pattern_of_garment(
                sizes, name=plan.scene.name, rules=plan.drawing.rules, sample_size=plan.size,
                cloth_width=plan.drawing.cloth_width,
            )  # fmt: skip
        found = () if plan.found is None else plan.found.seams
        return replace(pattern, found_seams=tuple(found)), (*notes, *(step.note for step in heard))

    return draw


def _drafted(plan: Plan, garment: Garment, pattern: Pattern) -> list[DraftedOutline]:
    """Return the pieces that finishing and pockets add, and where those of a form are worn."""
    from warpflat.pattern import DraftedOutline

    worn: Mapping[str, Sequence[Surface]] = {}
    with optional_step("drafted pieces are not shown on the body", is_needed=False):
        worn = plan.place_drafted(garment, pattern)
    return [
        DraftedOutline(
            name=piece.printed_name + (f", {piece.quantity} times" if piece.quantity > 1 else ""),
            points=piece.outline, worn=worn.get(piece.name, ()),
        )
        for piece in pattern.pieces[plan.size]
        if piece.name not in garment.pieces
    ]  # fmt: skip


def _measure_fit(
    plan: Plan, garment: Garment, folder: Path
) -> tuple[dict[str, Any], tuple[str, ...], dict[str, tuple[Remedy, ...]], list[str]]:
    """Measure a garment, look for cuts that would help it, and draw how it is worn, if that was asked for or its cloth is stretched.

    Returns:
        What goes into `metrics.json`, the garment's notes, by part the cuts that would help, and the names of the pictures.
    """
    report_activity("measuring how it fits")
    advised, files = garment, list[str]()
    with optional_step("no cuts that would help were looked for", is_needed=False):
        advised = garment.advised(plan.advise)
    stretched = advised.wearer is not None and advised.wearer.is_stretched
    if plan.scene.settings.output.picture and (plan.scene.settings.wear is not None or stretched):
        files = advised.write_wear(folder)
    remedies = {name: part.remedies for name, part in advised.parts.items()}
    measured = {**advised.metrics(), **plan.further_metrics(advised)}
    return measured, advised.notes, remedies, files


def _write_pattern(plan: Plan, sizes: Mapping[str, Garment], folder: Path, draw: Draw) -> WrittenPattern:
    """Write the files of the pattern in all sizes, and the picture of a form's seams, which is among the files that are returned."""
    scene = plan.scene
    pattern = garment_files(sizes, folder, name=scene.name, options=plan.drawing, draw=draw)
    if plan.mannequin is None or not (scene.settings.output.picture and pattern.walked):
        return pattern
    files = list(pattern.files)
    with optional_file(folder / "walked.png", files) as path:
        from warpflat.pattern import write_walked_picture

        write_walked_picture(path, pattern.walked, title=scene.name)
    return replace(pattern, files=tuple(files))
