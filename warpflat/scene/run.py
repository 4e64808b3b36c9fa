"""A scene is run: its surface is flattened, cut and sewn, and all files are written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from warpflat.core.beside import Beside
from warpflat.core.errors import InputError
from warpflat.core.memory_limit import require_memory_for_run
from warpflat.scene.cuts import CutSequence
from warpflat.scene.frames import FrameSchedule
from warpflat.scene.load import (
    Scene,
    errors_named,
    expand_variables,
    scene_fabric,
    scene_relax_options,
    scene_wear,
)
from warpflat.scene.surface import scene_surface
from warpflat.scene.write import SceneResult, measure_fit, write_pieces, write_surface
from warpflat.solver.options import RelaxOptions
from warpflat.surface.mesh import Surface

if TYPE_CHECKING:
    from warpflat.cutting.ledger import Ledger
    from warpflat.flattening.progress import Progress
    from warpflat.flattening.result import Flattening
    from warpflat.garment.pattern_files import PatternOptions
    from warpflat.garment.sew_pieces import SewnPieces
    from warpflat.garment.sew_surface import SewnSurface
    from warpflat.mannequin.forms import FormResult
    from warpflat.mannequin.mannequin import Mannequin
    from warpflat.scene.frames import Film, FrameRecorder
    from warpflat.scene.schema import SceneTable
    from warpflat.surface.border_seams import NamedSeam

# From so many vertices on, pictures and pattern follow the film: beside it and the fit they would take the most memory of a run.
_MANY = 500_000

__all__ = ["files_of_run", "flatten_scene", "run_scene", "scene_cuts", "scene_ledger"]


def run_scene(
    scene: Scene,
    out: str | Path,
    *,
    on_progress: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
    cuts: CutSequence | None = None,
    built: Callable[[], tuple[Mannequin, FormResult]] | None = None,
) -> SceneResult:
    """Flatten the scene's surface, or the pieces of its form, and write the result.

    Files: `metrics.json`, `NAME.obj` per piece, `frames.usdc`, `picture.png`, and the pattern (see
    `warpflat.garment.pattern_files`). Files that an earlier run has left there and this one does not make are removed at the
    end (see `warpflat.core.output`). All of that happens together; a run that fails leaves the folder
    as it was, and no run replaces a file that it has read.

    Args:
        scene: what to do.
        out: folder for the files, made if need be.
        on_progress: called after each step.
        device: Warp device, before the scene's own.
        cuts: of a surface, to be made instead of the scene's own (see `warpflat.scene.cuts.cuts_of_entry`).
        built: gives the scene's mannequin and form, where they are built already.

    Raises:
        InputError: the surface, a line, a cut, the fabric or a setting is wrong, `out` cannot be written, or a file there that the scene
            is made from would be replaced.
    """
    from warpflat.core.output import output_folder, require_own_metrics

    sources = (*scene.sources, *(() if cuts is None else cuts.surface.sources))
    with output_folder(out, files_of_run(scene), sources=sources, guard=True) as folder:
        require_own_metrics(folder)
        if scene.settings.mannequin is not None:
            from warpflat.scene.run_garment import run_garment

            notes: tuple[str, ...] = ()
            if scene.settings.auto_cut is not None or scene.settings.shape == "auto":
                from warpflat.scene.form_shaping import settle_shape

                scene, notes = settle_shape(scene, device=device)
                built = None
            form = None if built is None else built()
            result = run_garment(scene, folder, on_progress=on_progress, device=device, built=form)
            return replace(result, notes=(*notes, *result.notes))
        return _run_surface(scene, folder, on_progress=on_progress, device=device, cuts=cuts)


def _run_surface(
    scene: Scene,
    folder: Path,
    *,
    on_progress: Callable[[Progress], bool | None] | None,
    device: str | None,
    cuts: CutSequence | None,
) -> SceneResult:
    from warpflat.cutting.separate_pieces import separate
    from warpflat.garment.pattern_files import surface_files
    from warpflat.scene.drape import write_drape
    from warpflat.scene.found_seams import found_seams, seams_entry
    from warpflat.scene.frames import Film
    from warpflat.scene.pattern_options import pattern_options
    from warpflat.scene.seams import scene_surface_seams
    from warpflat.scene.surface import scene_pieces
    from warpflat.seams.find import seam_words

    settings = scene.settings
    scene_relax_options(scene)  # a mistake is reported before anything is made
    with errors_named(scene.where):
        drawing = pattern_options(settings.pattern, settings.marker, settings.cloth)
        seams = scene_surface_seams(settings.seams, scene.name)
    found = None if cuts is not None else found_seams(scene)
    parts = found.pieces if found is not None else None if cuts is not None else scene_pieces(scene)
    if parts is not None and settings.drape is not None:
        raise InputError(
            f'{scene.where}: a drape takes one piece, or the folder of a run: warpflat drape DIR --body "EU 38"'
        )
    sequences = [cuts or scene_cuts(scene, device=device)] if parts is None else _opened(scene, parts)
    _check_edges(scene, sequences, drawing)
    surfaces = [sequence.surface for sequence in sequences]
    notes = [note for sequence in sequences for note in sequence.notes]
    vertices = sum(len(surface.vertices) for surface in surfaces)
    require_memory_for_run(vertices, frames=FrameSchedule(settings.output).wanted)
    with ExitStack() as beside:
        with Film(folder, settings.output, surfaces) as film:

            def each_step(number: int, progress: Progress) -> bool | None:
                film.recorders[surfaces[number].name](progress)
                return None if on_progress is None else on_progress(progress)

            whole: tuple[Flattening, ...]
            sewn: SewnSurface | SewnPieces | None
            if parts is None:
                recorder, callback = film.recorders[surfaces[0].name], partial(each_step, 0)
                result, sewn = flatten_scene(scene, sequences[0], recorder=recorder, callback=callback, device=device)
                pieces, whole = separate(result), (result,)
            else:
                pieces, sewn = _flatten_pieces(scene, surfaces, film, callback=each_step, device=device)
                whole = pieces
                if sewn is None and len(pieces) > 1:
                    notes.append("no borders meet in space, vertex by vertex: the pieces are not sewn to each other")
            garment = {} if found is None else {"garment": seams_entry(found, pieces)}
            notes = [*_unsewn(whole, seams), *notes] if found is None else [seam_words(found), *found.notes, *notes]
            notes += [message for piece in whole for message in piece.messages]
            fit = beside.enter_context(Beside(partial(measure_fit, scene, pieces, folder), "measuring how it fits"))
            pictures = Beside(partial(write_pieces, scene, pieces, folder), "drawing the pictures")
            drawn = partial(surface_files, pieces, folder, name=scene.name, options=drawing, seams=seams)
            pattern = Beside(drawn, "drafting the pattern")
            if vertices < _MANY:
                beside.enter_context(pictures)
                beside.enter_context(pattern)
        drape_metrics, drape_files = write_drape(scene, whole[0], folder, device=device)
        return write_surface(
            scene,
            pieces,
            folder,
            pictures=pictures,
            pattern=pattern,
            fit=fit,
            more={**({} if sewn is None else sewn.metrics()), **drape_metrics, **garment},
            files=dict.fromkeys([*drape_files, *film.files]),
            notes=notes,
        )


def _corrects(settings: SceneTable) -> bool:
    return settings.drape is not None and (settings.drape.correct or settings.drape.correct_fabric is not None)


def files_of_run(scene: Scene) -> list[str]:
    """Return the files that a run will write, as far as they are known; those of a form's pieces or of parts of a cut are not."""
    settings, name = scene.settings, scene.name
    output, formats, garment = settings.output, settings.pattern.formats, settings.mannequin is not None
    worn = output.picture and settings.wear is not None
    asked = {
        "metrics.json": True,
        f"{name}.obj": not garment and not _takes_all(settings),
        "frames.usdc": FrameSchedule(output).wanted,
        "picture.png": output.picture,
        "drape.png": output.picture and settings.drape is not None,
        "corrected.png": output.picture and _corrects(settings),
        "drape.webp": output.picture and settings.drape is not None and FrameSchedule(output).wanted,
        f"{name}.draped.obj": settings.drape is not None and not garment,
        "review.html": output.picture and output.review,
        "wear.png": worn and garment,
        f"{name}.wear.png": worn and not garment,
        "walked.png": output.picture and garment and bool(formats or settings.marker is not None),
        **{f"{name}.{ending}": ending in formats for ending in ("dxf", "svg")},
        **{f"pattern.{ending}": ending in formats for ending in ("pdf", "json")},
        **{f"{name}.corrected.{ending}": ending in formats and _corrects(settings) for ending in ("dxf", "svg")},
        f"{name}.marker.svg": settings.marker is not None,
        f"{name}.marker.json": settings.marker is not None,
    }
    return [file for file, wanted in asked.items() if wanted]


def flatten_scene(
    scene: Scene,
    sequence: CutSequence,
    *,
    recorder: FrameRecorder | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
) -> tuple[Flattening, SewnSurface | None]:
    """Flatten, cut and sew the scene's surface; return the piece, and how it was sewn, if it was.

    Args:
        scene: with its fabric and settings.
        sequence: what is cut, of :func:`scene_cuts`.
        recorder: writes the last frame of every stage.
        callback: called after each step.
        device: Warp device, before the scene's own.

    Raises:
        InputError: a seam or a constraint asks what the piece cannot be, or a setting is wrong.
    """
    from warpflat.cutting.cut_piece import cut
    from warpflat.garment.sew_surface import sew_surface
    from warpflat.scene.frames import FrameRecorder
    from warpflat.scene.seams import scene_constraints, scene_surface_seams

    settings, relax = scene.settings, scene_relax_options(scene)
    recorder = recorder or FrameRecorder(None, sequence.surface, lambda: FrameSchedule(settings.output))
    with errors_named(scene.where):
        seams = scene_surface_seams(settings.seams, scene.name)
        result = _flatten(scene, sequence.surface, relax, callback=callback, device=device)
        recorder.record_result(result)
        for number, plan in enumerate(sequence.plans):
            if sequence.is_needed(result, number):
                recorder.record_cut_line(result, plan)
                result = cut(result, plan, relax=relax, callback=callback)
                recorder.record_result(result)
        lines = {result.surface.name: result.network.surface.lines}
        sewn = sew_surface(result, scene_constraints(settings.constraints, lines), seams=seams, options=relax)
    if sewn is None:
        return result, None
    recorder.record_result(sewn.result)
    return sewn.result, sewn


def _takes_all(settings: SceneTable) -> bool:
    """Return whether every part of a file is a piece."""
    return getattr(settings.surface, "component", None) == "all"


def _opened(scene: Scene, parts: Sequence[Surface]) -> list[CutSequence]:
    """Return the pieces of a file, tubes among them cut open, with their seams as lines where they have no lines of their own."""
    from warpflat.garment.sew_pieces import name_seams
    from warpflat.scene.cuts import plan_cuts

    with errors_named(scene.where):
        sequences = [plan_cuts(part, []) for part in parts]
    return [
        replace(sequence, surface=surface, notes=tuple(f"{surface.name}: {note}" for note in sequence.notes))
        for sequence, surface in zip(sequences, name_seams([each.surface for each in sequences]), strict=True)
    ]


def _flatten_pieces(
    scene: Scene,
    surfaces: Sequence[Surface],
    film: Film,
    *,
    callback: Callable[[int, Progress], bool | None],
    device: str | None,
) -> tuple[tuple[Flattening, ...], SewnPieces | None]:
    """Flatten all pieces of a file, and sew borders that meet."""
    from warpflat.flattening.flatten_all import flatten_all
    from warpflat.garment.sew_pieces import sew_pieces
    from warpflat.seams.find import GRAIN

    settings, relax = scene.settings, scene_relax_options(scene)
    with errors_named(scene.where):
        pieces = tuple(
            flatten_all(
                surfaces,
                fabric=scene_fabric(scene),
                # Pieces of a garment whose seams were found know how their grain runs.
                datum=[GRAIN if GRAIN in surface.lines else None for surface in surfaces],
                grain_angle=settings.grain_angle,
                model=settings.model,
                wear=scene_wear(scene),
                relax=relax,
                callback=callback,
                device=device or settings.device,
            )
        )
        for piece in pieces:
            film.recorders[piece.surface.name].record_result(piece)
        sewn = sew_pieces(pieces, options=relax)
    if sewn is None:
        return pieces, None
    for piece in sewn.pieces:
        film.recorders[piece.surface.name].record_result(piece)
    return sewn.pieces, sewn


def _unsewn(pieces: Sequence[Flattening], seams: Sequence[NamedSeam]) -> list[str]:
    """Return notes on borders that run along each other and are not sewn; at most three, and how many more there are."""
    from warpflat.garment.sew_pieces import unsewn_borders

    surfaces = {piece.surface.name: piece.network.surface for piece in pieces}
    named = [surface.lines[side] for surface in surfaces.values() for seam in seams for side in seam.sides]
    without = {(min(edge), max(edge)) for line in named for edge in pairwise(line.tolist())}
    found = unsewn_borders(surfaces, without=without)
    more = [f"{len(found) - 3} more stretches of border run along others and are not sewn"] if len(found) > 3 else []
    return [*found[:3], *more]


def _check_edges(scene: Scene, sequences: Sequence[CutSequence], drawing: PatternOptions) -> None:
    """Check that the pattern's kinds and allowances name edges, and its names pieces, whichever of the automatic cuts are made.

    Raises:
        InputError: a name that no piece can have, or a cut that cannot be made.
    """
    from warpflat.cutting.separate_pieces import cut_surfaces
    from warpflat.garment.pattern_files import check_names
    from warpflat.garment.surface_to_pattern import check_edge_names

    rules = drawing.rules
    if not (rules.kinds or rules.allowances or drawing.names):
        return
    with errors_named(scene.where):
        surfaces = [
            piece
            for sequence in sequences
            for count in sequence.counts
            for piece in cut_surfaces(sequence.surface, list(sequence.plans[:count]))
        ]
    with errors_named(f"{scene.where}: pattern"):
        check_edge_names(surfaces, rules, cuts=[plan.name for sequence in sequences for plan in sequence.plans])
        check_names(drawing.names, {surface.name: None for surface in surfaces})


def _flatten(
    scene: Scene,
    surface: Surface,
    relax: RelaxOptions,
    *,
    callback: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
) -> Flattening:
    from warpflat.flattening.flatten_piece import flatten

    settings, start = scene.settings, None
    if settings.start is not None:
        from warpflat.surface.io.read_layout import read_layout

        with errors_named(f"{scene.where}: start"):
            start = read_layout(scene.folder / expand_variables(settings.start))
    return flatten(
        surface,
        fabric=scene_fabric(scene),
        datum=settings.datum,
        grain_angle=settings.grain_angle,
        model=settings.model,
        wear=scene_wear(scene),
        start=start,
        relax=relax,
        callback=callback,
        device=device or settings.device,
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
    from warpflat.scene.cuts import plan_automatic_cuts, plan_cuts

    settings = scene.settings
    surface = surface or scene_surface(scene)
    with errors_named(scene.where):
        sequence = plan_cuts(surface, settings.cuts)
        if settings.auto_cut is not None:
            sequence, _ = plan_automatic_cuts(
                sequence,
                settings.auto_cut,
                flatten=lambda piece, options: _flatten(scene, piece, options, device=device),
                relax=scene_relax_options(scene),
            )
    return sequence


def scene_ledger(scene: Scene, *, by: Literal["per_cm", "released"] = "per_cm", device: str | None = None) -> Ledger:
    """Try and rank candidates for the next cut of the scene's piece, after its own cuts and without its seams and constraints.

    Raises:
        InputError: as :func:`scene_cuts`, or there is no candidate.
    """
    from warpflat.cutting.ledger import make_ledger
    from warpflat.scene.cuts import flatten_and_cut

    if scene.settings.mannequin is not None:
        raise InputError(f"{scene.where}: is a form; warpflat.scene.form_ledger compares its cuts")
    relax = scene_relax_options(scene)
    sequence = scene_cuts(scene, device=device)
    with errors_named(scene.where):
        result = flatten_and_cut(
            sequence, flatten=lambda piece, options: _flatten(scene, piece, options, device=device), relax=relax
        )
        ledger = make_ledger(result, relax=relax, by=by)
    asked = [key for key in ("seams", "constraints") if getattr(scene.settings, key)]
    if not asked:
        return ledger
    return replace(
        ledger,
        notes=(f"candidates are compared without the scene's {' and '.join(asked)}; a run keeps them, --apply too",),
    )
