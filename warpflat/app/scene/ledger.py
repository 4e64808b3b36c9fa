"""The ledger of a scene's cuts: those that promise most, tried on a mesh, or on a form's piece and the mirror image of that."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from warpflat.app.scene.cuts import (
    CutSequence,
    asked_cuts,
    cut_of_dart,
    cuts_beside,
    flatten_and_cut,
    place_of,
    scene_with,
)
from warpflat.app.scene.form import scene_form, scene_recipe
from warpflat.app.scene.load import Scene, errors_named, scene_relax_options
from warpflat.app.scene.plan import FormScenePlan, flatten_surface, plan_form_scene, scene_cuts
from warpflat.core import InputError, without_side
from warpflat.flat import (
    CutPlan,
    LaidCloth,
    Ledger,
    LedgerEntry,
    Price,
    RankedBy,
    best_of_few,
    coarse_options,
    find_candidates,
    make_ledger,
    peaks_in_words,
)
from warpflat.garment import (
    FormDart,
    Garment,
    Mannequin,
    flatten_form,
    is_side,
    princess_seams,
)

__all__ = ["candidate_cuts", "cuts_of_entry", "scene_ledger", "trial_of_scene", "try_cuts", "with_cut"]


def scene_ledger(scene: Scene, *, by: RankedBy = "per_cm", device: str | None = None) -> Ledger:
    """Try and rank cuts that a scene's garment could have next.

    Of a mesh, after its own cuts and without its seams and constraints: those of
    :func:`warpflat.flat.cutting.candidates.find_candidates`. Of a form: those of :func:`candidate_cuts`.

    Raises:
        InputError: the scene is wrong, or there is nothing to cut for.
    """
    if scene.settings.mannequin is not None:
        plan, garment = trial_of_scene(scene, device=device)
        entries, refused = try_cuts(plan, garment, list(candidate_cuts(plan, garment)), by=by)
        if not entries:
            why = "; ".join(f"{name}: {reason}" for name, reason in refused[:1]) or "its pieces store no energy"
            raise InputError(f"{scene.where}: there is no cut to compare: {why}")
        peaks = [f"{name}: {words}" for name, piece in garment.pieces.items() for words in peaks_in_words(piece)]
        return Ledger(
            name=scene.name,
            pieces=tuple(garment.pieces.values()),
            peaks=tuple(peaks),
            entries=entries,
            refused=refused,
            notes=("cuts are tried piece by piece, their darts sewn; a run sews the whole garment",),
        )
    relax = scene_relax_options(scene)
    sequence = scene_cuts(scene, device=device)
    with errors_named(scene.where):
        result = flatten_and_cut(sequence, flatten=partial(flatten_surface, scene, device=device), relax=relax)
        ledger = make_ledger(result, relax=relax, by=by)
    asked = [key for key in ("seams", "constraints") if getattr(scene.settings, key)]
    if not asked:
        return ledger
    note = f"candidates are compared without the scene's {' and '.join(asked)}; a run keeps them, --apply too"
    return replace(ledger, notes=(note,))


def cuts_of_entry(ledger: Ledger, number: int) -> CutSequence:
    """Return the cuts of a mesh's piece, and after them the candidate of a number (from 1) in its ledger.

    Raises:
        InputError: there is no such number.
    """
    result = ledger.entry(number).result
    assert result is not None
    return CutSequence(surface=result.surface, plans=tuple(CutPlan.from_applied(made) for made in result.cuts))


def trial_of_scene(scene: Scene, *, device: str | None = None) -> tuple[FormScenePlan, Garment]:
    """Return a scene's garment, and its pieces, relaxed coarsely one by one, with the legs of their darts sewn.

    Raises:
        InputError: as :func:`warpflat.app.scene.plan.plan_form_scene`.
    """
    plan = plan_form_scene(scene, device=device)
    return plan, _flatten(plan, plan.form.pieces)


def _flatten(plan: FormScenePlan, names: Sequence[str] | Mapping[str, Any], scene: Scene | None = None) -> Garment:
    """Flatten some pieces of a plan's form, or of another scene's form on its body, without seams between them."""
    form = plan.form if scene is None else scene_form(scene, plan.mannequin)[1]
    alone = replace(form, pieces={name: form.pieces[name] for name in names}, seams=(), ease={})
    settings = {**plan.settings, "relax": coarse_options(plan.settings["relax"]), "curves_mm": 0.0}
    return flatten_form(plan.mannequin, alone, **settings)


def candidate_cuts(
    plan: FormScenePlan, garment: Garment, *, among: Collection[str] | None = None, usual_only: bool = False
) -> Iterator[tuple[dict[str, Any], Price]]:
    """Yield tables of cuts that the pieces do not have yet: once a side, as both sides are cut; and what they would do.

    Args:
        plan, garment: the pieces before them (see `trial_of_scene`).
        among: names of the pieces; all if not given.
        usual_only: the darts of a pattern book only.
    """
    form = plan.form
    present = {dart.place for dart in form.recipe.darts}
    names = {(dart.piece, dart.name) for dart in form.recipe.darts}
    unsewn = {name: piece.unsewn or piece for name, piece in garment.pieces.items() if among is None or name in among}
    laid = {name: LaidCloth(piece.network, piece.positions) for name, piece in unsewn.items()}

    def priced(dart: FormDart) -> Iterator[tuple[dict[str, Any], Price]]:
        grid = form.pieces[dart.piece].grid_vertices
        rows = [laid[dart.piece].row_of(grid, row) for piece, row in form.dart_rows(dart) if piece == dart.piece]
        if found := [row for row in rows if row is not None]:
            yield cut_of_dart(dart), laid[dart.piece].price(found)

    for dart in form.usual_darts():
        if dart.place not in present and dart.piece in unsewn:
            yield from priced(dart if (dart.piece, dart.like) in names else replace(dart, like=None))
    if usual_only:
        return
    found: set[tuple[Any, ...]] = set()
    for dart in (dart for name in unsewn for dart in princess_seams(form.layout, form.bricks[name], name)):
        found.add((dart.piece, dart.line, dart.part))
        yield from priced(dart)
    for name, piece in unsewn.items():
        if all(is_side(brick, "right") for brick in form.bricks[name]):
            continue
        # From the border along lines to the peaks of its energy, and along whole lines.
        try:
            candidates = find_candidates(piece)
        except InputError:
            continue
        for candidate in candidates:
            if len(candidate.paths) != 1:
                continue
            row = form.pieces[name].grid_vertices[candidate.paths[0]]
            words = without_side(candidate.name.replace(",", ""))
            along = form.dart_along(name, row, words)
            if along is not None and (key := (along.piece, along.line, along.part)) not in found:
                found.add(key)
                yield from priced(along)


def with_cut(scene: Scene, cut: Mapping[str, Any], mannequin: Mannequin | None = None) -> Scene:
    """Return a scene with one cut more; one that is left out in the scene is put back instead.

    A seam takes over darts of the scene.

    Args:
        scene: with a form.
        cut: a table of `[[cuts]]`.
        mannequin: the scene's, if it has been made.
    """
    own = asked_cuts(scene)
    kept = [table for table in own if not (table.get("omit") and place_of(table) == place_of(cut))]
    if len(kept) < len(own):
        return scene_with(scene, cuts=kept)
    if set(cut.get("part") or ()) == {0.0, 1.0}:
        own = cuts_beside(*scene_recipe(scene, mannequin), own, cut)
    return scene_with(scene, cuts=[*own, dict(cut)])


def try_cuts(
    plan: FormScenePlan,
    garment: Garment,
    cuts: Sequence[tuple[Mapping[str, Any], Price]],
    *,
    by: RankedBy,
    listed: bool = True,
) -> tuple[tuple[LedgerEntry, ...], tuple[tuple[str, str], ...]]:
    """Try the cuts of a form that promise most on their pieces, each on its own; see :func:`warpflat.flat.cutting.ledger.best_of_few`."""

    def evaluate(cut: Mapping[str, Any]) -> LedgerEntry:
        scene = with_cut(plan.scene, cut, plan.mannequin)
        try:
            form = scene_form(scene, plan.mannequin)[1]
            before = plan.form.pieces
            darts = [(dart, legs) for dart, legs in form.sewn_darts() if dart.asked.place == place_of(cut)]
            changed = {dart.piece for dart, _ in darts} or set(form.pieces) - set(before)
            made = _flatten(plan, [name for name in form.pieces if name in changed], scene)
        except InputError as reason:
            raise InputError(str(reason).removeprefix(f"{scene.where}: ")) from None
        paths = [form.vertices[dart.row] for dart, _ in darts]
        paths += [
            form.pieces[seam.pieces[0]].surface.vertices[run.vertices[0]]
            for seam in form.seams
            for run in seam.runs
            if not darts and changed.issuperset(seam.pieces)
        ]
        return LedgerEntry.measure(
            _name(cut),
            [garment.pieces[name] for name in before if name in changed or name not in form.pieces],
            list(made.pieces.values()),
            paths=paths,
            cracks=[(made.pieces[dart.piece], *legs) for dart, legs in darts],
            cut=cut,
        )

    return best_of_few([(_name(cut), cost, cut) for cut, cost in cuts], evaluate, by=by, listed=listed)


def _name(cut: Mapping[str, Any]) -> str:
    return f"{cut['piece']}.{cut['name']}"
