"""The ledger of a form's cuts: what each dart or seam would release, tried on its piece and the mirror image of that."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.cutting.candidates import find_candidates, find_peaks
from warpflat.cutting.ledger import Ledger, RankedBy, coarse_options, make_ledger
from warpflat.flattening.result import Flattening
from warpflat.garment.garment import Garment, flatten_form
from warpflat.mannequin.bricks import select_bricks
from warpflat.mannequin.darts import FormDart, PlacedDart, dart_along, usual_darts
from warpflat.mannequin.forms import Form
from warpflat.mannequin.halves import is_side
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.part_pieces import princess_seams
from warpflat.scene.cuts import flatten_and_cut
from warpflat.scene.form import scene_form, scene_recipe
from warpflat.scene.form_cuts import cut_of_dart, cuts_beside, place_of, scene_with
from warpflat.scene.load import Scene, errors_named, scene_relax_options
from warpflat.scene.plan import GarmentPlan, flatten_surface, plan_garment, scene_cuts

__all__ = [
    "FormEntry",
    "FormLedger",
    "FormTrial",
    "candidate_cuts",
    "form_ledger",
    "scene_ledger",
    "trial_of_scene",
    "try_cuts",
    "with_cut",
]

# A dart that takes in less is not sewn but eased in [m].
_LEAST_MOUTH = 5e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class FormEntry:
    """A cut of a form that has been tried.

    Attributes:
        cut: its table in `[[cuts]]`.
        pieces: that it changes, before it.
        length: of the cut, and of its mirror image, in the cloth [m].
        mouth: of its widest dart [m], negative where the legs overlap; None of a seam.
        model_energy_before, model_energy_after: of these pieces [J].
        outside_before, outside_after: share of their cloth that is strained beyond the cloth's limit.
        flipped_faces: after the cut.
    """

    cut: Mapping[str, Any]
    pieces: tuple[str, ...]
    length: float
    mouth: float | None
    model_energy_before: float
    model_energy_after: float
    outside_before: float
    outside_after: float
    flipped_faces: int

    @property
    def released(self) -> float:
        """The model energy released [J]."""
        return self.model_energy_before - self.model_energy_after

    @property
    def per_cm(self) -> float:
        """The model energy released per centimetre cut [J/cm]."""
        return self.released / max(100.0 * self.length, np.finfo(float).tiny)

    @property
    def can_be_sewn(self) -> bool:
        """Whether it opens by 5 mm or more, and leaves no flipped face."""
        return not self.flipped_faces and (self.mouth is None or self.mouth > _LEAST_MOUTH)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data in SI units, but for `released_j_per_cm`."""
        return {
            "cut": dict(self.cut),
            "pieces": list(self.pieces),
            "length_m": self.length,
            "mouth_m": self.mouth,
            "model_energy_before_j": self.model_energy_before,
            "model_energy_after_j": self.model_energy_after,
            "released_j": self.released,
            "released_j_per_cm": self.per_cm,
            "outside_before": self.outside_before,
            "outside_after": self.outside_after,
            "flipped_faces": self.flipped_faces,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class FormLedger:
    """Cuts of a form, the best first.

    Attributes:
        entries: what each would do.
        refused: cuts that could not be made, and why.
        notes: what the comparison leaves out.
    """

    entries: tuple[FormEntry, ...]
    refused: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ("cuts are tried piece by piece, their darts sewn; a run sews the whole garment",)

    def cut(self, number: int) -> Mapping[str, Any]:
        """Return the table of the cut of a number (from 1).

        Raises:
            InputError: there is no such number.
        """
        if not 1 <= number <= len(self.entries):
            raise InputError(f"there is no candidate {number}; valid: 1 to {len(self.entries)}")
        return self.entries[number - 1].cut

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "entries": [entry.as_dict() for entry in self.entries],
            "refused": [{"name": name, "reason": reason} for name, reason in self.refused],
            "notes": list(self.notes),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class FormTrial:
    """A scene's pieces, relaxed coarsely one by one, with the legs of their darts sewn.

    Attributes:
        plan: the scene's garment.
        recipe: its form.
        garment: the pieces.
    """

    plan: GarmentPlan
    recipe: Form
    garment: Garment

    @property
    def mannequin(self) -> Mannequin:
        """The body."""
        return self.plan.mannequin

    @property
    def bricks(self) -> dict[str, list[str]]:
        """The bricks of every piece, on both sides of the body."""
        layout = self.mannequin.layout
        return {name: select_bricks(layout, recipe.bricks) for name, recipe in self.recipe.pieces.items()}


def trial_of_scene(scene: Scene, *, device: str | None = None) -> FormTrial:
    """Flatten a scene's pieces one by one.

    Raises:
        InputError: as :func:`warpflat.scene.plan.plan_garment`.
    """
    plan = plan_garment(scene, device=device)
    _, recipe = scene_recipe(scene, plan.mannequin)
    return FormTrial(plan=plan, recipe=recipe, garment=_flatten(plan, plan.form.pieces))


def _flatten(plan: GarmentPlan, names: Sequence[str] | Mapping[str, Any], scene: Scene | None = None) -> Garment:
    """Flatten some pieces of a plan's form, or of another scene's form on its body, without seams between them."""
    form = plan.form if scene is None else scene_form(scene, plan.mannequin)[1]
    alone = replace(form, pieces={name: form.pieces[name] for name in names}, seams=(), ease={})
    settings = {**plan.settings, "relax": coarse_options(plan.settings["relax"]), "curves_mm": 0.0}
    return flatten_form(plan.mannequin, alone, **settings)


def form_ledger(scene: Scene, *, by: RankedBy = "per_cm", device: str | None = None) -> FormLedger:
    """Try and rank cuts for the pieces of a scene's form: a book's darts, and cuts along lines near the peaks of the energy.

    Raises:
        InputError: the scene is wrong, or there is nothing to cut for.
    """
    base = trial_of_scene(scene, device=device)
    cuts = list(candidate_cuts(base))
    ledger = try_cuts(base, cuts, by=by)
    if not ledger.entries:
        why = "; ".join(f"{name}: {reason}" for name, reason in ledger.refused[:1]) or "its pieces store no energy"
        raise InputError(f"{scene.where}: there is no cut to compare: {why}")
    return ledger


def candidate_cuts(base: FormTrial, *, usual_only: bool = False) -> Iterator[dict[str, Any]]:
    """Yield tables of cuts that the pieces do not have yet: once a side, as both sides are cut.

    Args:
        base: the pieces before them.
        usual_only: the darts of a pattern book only.
    """
    layout, bricks = base.mannequin.layout, base.bricks
    present = {dart.place for dart in base.recipe.darts}
    names = {(dart.piece, dart.name) for dart in base.recipe.darts}
    for dart in usual_darts(layout, base.plan.form.vertices, bricks):
        if dart.place not in present:
            yield cut_of_dart(dart if (dart.piece, dart.like) in names else replace(dart, like=None))
    if usual_only:
        return
    found: set[tuple[Any, ...]] = set()
    for dart in (dart for name, own in bricks.items() for dart in princess_seams(layout, own, name)):
        found.add((dart.piece, dart.line, dart.part))
        yield cut_of_dart(dart)
    for name, piece in base.garment.pieces.items():
        if all(is_side(brick, "right") for brick in bricks[name]):
            continue
        for dart in _cuts_along_lines(base, name, piece, bricks[name]):
            key = (dart.piece, dart.line, dart.part)
            if key not in found:
                found.add(key)
                yield cut_of_dart(dart)


def _cuts_along_lines(base: FormTrial, name: str, piece: Flattening, bricks: Sequence[str]) -> Iterator[FormDart]:
    """Yield cuts of one piece from its border along lines to the peaks of its energy, and along whole lines."""
    form = base.plan.form
    try:
        candidates = find_candidates(piece, find_peaks(piece))
    except InputError:
        return
    for candidate in candidates:
        if len(candidate.paths) != 1:
            continue
        row = form.pieces[name].grid_vertices[candidate.paths[0]]
        words = candidate.name.replace(",", "").replace(" left", "").replace(" right", "")
        dart = dart_along(base.mannequin.layout, form.vertices, bricks, row, piece=name, name=words)
        if dart is not None:
            yield dart


def with_cut(scene: Scene, cut: Mapping[str, Any], mannequin: Mannequin | None = None) -> Scene:
    """Return a scene with one cut more; one that is left out in the scene is put back instead.

    A seam takes over darts of the scene.

    Args:
        scene: with a form.
        cut: a table of `[[cuts]]`.
        mannequin: the scene's, if it has been made.
    """
    own = [table.model_dump(exclude_unset=True, by_alias=True) for table in scene.settings.cuts]
    kept = [table for table in own if not (table.get("omit") and place_of(table) == place_of(cut))]
    if len(kept) < len(own):
        return scene_with(scene, cuts=kept)
    if set(cut.get("part") or ()) == {0.0, 1.0}:
        own = cuts_beside(*scene_recipe(scene, mannequin), own, cut)
    return scene_with(scene, cuts=[*own, dict(cut)])


def try_cuts(base: FormTrial, cuts: Sequence[Mapping[str, Any]], *, by: RankedBy) -> FormLedger:
    """Try cuts on their pieces, each on its own, and rank them."""
    entries, refused = [], []
    for number, cut in enumerate(cuts, 1):
        words = f"{cut['piece']}.{cut['name']}"
        report_activity(f"cut {number} of {len(cuts)}, {words}")
        try:
            entries.append(_try(base, cut))
        except InputError as reason:
            refused.append((words, str(reason).removeprefix(f"{base.plan.scene.where}: ")))
    entries.sort(key=lambda entry: (not entry.can_be_sewn, -getattr(entry, by)))
    return FormLedger(entries=tuple(entries), refused=tuple(refused))


def _try(base: FormTrial, cut: Mapping[str, Any]) -> FormEntry:
    scene = with_cut(base.plan.scene, cut, base.mannequin)
    form = scene_form(scene, base.mannequin)[1]
    before = base.plan.form.pieces
    darts = [dart for dart in form.darts if dart.asked.place == place_of(cut) and dart.piece in form.pieces]
    changed = {dart.piece for dart in darts} or set(form.pieces) - set(before)
    replaced = [name for name in before if name in changed or name not in form.pieces]
    garment = _flatten(base.plan, [name for name in form.pieces if name in changed], scene)
    old, now = [base.garment.pieces[name] for name in replaced], list(garment.pieces.values())
    rows = [form.vertices[dart.row] for dart in darts]
    rows += [
        form.pieces[seam.pieces[0]].surface.vertices[run.vertices[0]]
        for seam in form.seams
        for run in seam.runs
        if not darts and changed.issuperset(seam.pieces)
    ]
    return FormEntry(
        cut=cut,
        pieces=tuple(replaced),
        length=sum(polyline_length(row) for row in rows),
        mouth=max((_mouth(garment, dart) for dart in darts), default=None),
        model_energy_before=sum(piece.stages[-1].model_energy_j for piece in old),
        model_energy_after=sum(piece.stages[-1].model_energy_j for piece in now),
        outside_before=_outside(old),
        outside_after=_outside(now),
        flipped_faces=sum(piece.flipped_faces for piece in now),
    )


def _mouth(garment: Garment, dart: PlacedDart) -> float:
    """Return how wide a dart opens at most [m], negative where its legs overlap."""
    assert garment.form is not None
    piece, positions = garment.form.pieces[dart.piece], garment.pieces[dart.piece].positions
    left, right = (positions[leg] for leg in piece.legs()[dart.name])
    widest = int(np.linalg.norm(left - right, axis=1).argmax())
    inwards, across = left[-1] - left[0], right[widest] - left[widest]
    # Along the border, counter-clockwise, the gap lies on the right of the left leg.
    open_ = inwards[0] * across[1] - inwards[1] * across[0] < 0.0
    return float(np.linalg.norm(across)) * (1.0 if open_ else -1.0)


def _outside(pieces: Sequence[Flattening]) -> float:
    """Return the share of the cloth of some pieces that is strained beyond its limit."""
    areas = [float(piece.network.cell_arrays.area.sum()) for piece in pieces]
    return sum(piece.fit.outside * area for piece, area in zip(pieces, areas, strict=True)) / sum(areas)


def scene_ledger(scene: Scene, *, by: RankedBy = "per_cm", device: str | None = None) -> Ledger:
    """Try and rank candidates for the next cut of the scene's piece, after its own cuts and without its seams and constraints.

    Raises:
        InputError: as :func:`warpflat.scene.plan.scene_cuts`, or there is no candidate.
    """
    if scene.settings.mannequin is not None:
        raise InputError(f"{scene.where}: is a form; warpflat.scene.form_ledger compares its cuts")
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
