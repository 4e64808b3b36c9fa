"""A scene is solved for the studio; what an edit leaves as it was is kept from the solution before it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from warpflat.app.scene.cuts import CutSequence
from warpflat.app.scene.form import scene_form, scene_mannequin
from warpflat.app.scene.form_shaping import require_open_darts, settle_shape, with_open_darts
from warpflat.app.scene.load import Scene, errors_named, scene_relax_options
from warpflat.app.scene.plan import FormScenePlan, plan_form_scene, plan_mesh, scene_cuts
from warpflat.app.scene.surface import scene_surface
from warpflat.flat import CutPlan, Flattening, Progress, Surface, Verdict, cut, judge
from warpflat.garment import FormGarment, Garment, measure_darts

__all__ = ["Solution", "solve"]

# What the surface, the body and the form of a scene are made from.
_OF_SURFACE = ("name", "surface", "lines", "datum", "constraints", "seams")
_OF_BODY = ("mannequin",)
_OF_FORM = (
    "form", "half", "shape", "ease", "cuts", "auto_cut", "openings", "finishing", "pulled_on", "fabric", "fabric_files"
)  # fmt: skip
# What may differ while one cut more is made in a piece that lies there already.
_CUTS_ONLY = ("cuts", "output", "pattern", "marker")


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """A scene that has been flattened, cut and sewn.

    Attributes:
        scene: as it was asked for.
        garment: its pieces, and their seams.
        bare: the surface of the scene before its cuts; None of a form.
        plan: of a form; None of a surface.
        notes: what was chosen or left out on the way, without what is known of the body.
    """

    scene: Scene
    garment: Garment
    bare: Surface | None = None
    plan: FormScenePlan | None = None
    notes: tuple[str, ...] = field(default=())

    @property
    def pieces(self) -> Mapping[str, Flattening]:
        """The pieces by name."""
        return self.garment.pieces

    @property
    def strain_energy(self) -> float:
        """The strain energy of all pieces [J]."""
        return sum(piece.stages[-1].strain_energy_j for piece in self.pieces.values())

    @cached_property
    def verdict(self) -> Verdict | None:
        """Whether it fits, and why not; None where no cloth is judged."""
        return judge(self.garment.metrics())

    @property
    def at_rest(self) -> bool:
        """Whether every piece is."""
        return all(piece.converged for piece in self.pieces.values())

    @property
    def openings(self) -> dict[str, float]:
        """How wide each cut or dart opens, by "piece.name" [m]."""
        if isinstance(self.garment, FormGarment):
            return {
                f"{name}.{dart['name']}": float(dart["intake_m"])
                for name, piece in self.pieces.items()
                for dart in measure_darts(self.garment.form, name, piece.positions)
            }
        return {
            f"{name}.{made['name']}": max((float(seam["opening_m"]) for seam in made["seams"]), default=0.0)
            for name, piece in self.pieces.items()
            for made in piece.measures["cuts"]
        }


def solve(
    scene: Scene, before: Solution | None = None, *, callback: Callable[[str, Progress], bool | None] | None = None
) -> Solution:
    """Flatten, cut and sew a scene.

    Args:
        scene: what to solve.
        before: the solution of a scene that may have much in common with it.
        callback: called with a piece's name and its progress; True stops the relaxation, and the result is kept.

    Raises:
        InputError: as :func:`warpflat.run_scene`.
    """
    if scene.settings.mannequin is None:
        known = before is not None and before.bare is not None and _alike(scene, before.scene, _OF_SURFACE)
        bare = before.bare if known and before is not None and before.bare is not None else scene_surface(scene)
        sequence = scene_cuts(scene, surface=bare)
        slit = None if before is None else _one_more_cut(scene, before, sequence)
        if before is not None and slit is not None:
            with errors_named(scene.where):
                step = None if callback is None else partial(callback, scene.name)
                result = cut(before.pieces[scene.name], slit, relax=scene_relax_options(scene), callback=step)
            garment = replace(before.garment, pieces={scene.name: result})
        else:
            garment = plan_mesh(scene, cuts=sequence).flatten(callback=callback)
        told = garment.pieces[scene.name].messages
        return Solution(scene=scene, garment=garment, bare=bare, notes=(*sequence.notes, *told))
    settled, notes = settle_shape(scene)
    last = None if before is None else before.plan
    same_body = last is not None and _alike(scene, last.scene, _OF_BODY)
    mannequin = last.mannequin if last is not None and same_body else scene_mannequin(scene)

    def made(one: Scene) -> tuple[FormScenePlan, FormGarment]:
        nonlocal last
        if last is not None and same_body and _alike(one, last.scene, _OF_FORM):
            form = last.form
        else:
            form = scene_form(one, mannequin, before=None if last is None else last.form)[1]
        plan = last = plan_form_scene(one, built=(mannequin, form))
        # Pieces that were flattened as the plan asks are known as they lay at rest before they were sewn.
        at_rest = dict[str, Flattening]()
        if before is not None and before.plan is not None and before.plan.settings == plan.settings:
            unsewn = {name: piece.unsewn for name, piece in before.pieces.items() if name in plan.form.pieces}
            at_rest = {name: piece for name, piece in unsewn.items() if piece is not None and piece.converged}
        garment = plan.flatten(callback=callback, known=at_rest)
        require_open_darts(one, [garment])
        return plan, garment

    _, (plan, garment), closed = with_open_darts(settled, made)
    notes = (*notes, *closed, *garment.form.notes, *garment.remarks)
    return Solution(scene=scene, garment=garment, plan=plan, notes=notes)


def _one_more_cut(scene: Scene, before: Solution, sequence: CutSequence) -> CutPlan | None:
    """Return the one cut by which a scene differs from another, if it can be made in the other's piece as that lies there."""
    piece = before.pieces.get(scene.name)
    if piece is None or before.garment.stitching or piece.unsewn is not None or sequence.auto is not None:
        return None
    others = [key for key in type(scene.settings).model_fields if key not in _CUTS_ONLY]
    made, faces = len(piece.cuts), piece.surface.faces
    if (
        not _alike(scene, before.scene, others)
        or scene.settings.cuts[:-1] != before.scene.settings.cuts
        or len(sequence.plans) != made + 1
        # A path between points has divided faces, and all cuts are made again.
        or not np.array_equal(sequence.surface.faces, faces)
    ):
        return None
    return sequence.plans[-1]


def _alike(one: Scene, other: Scene, keys: tuple[str, ...] | list[str]) -> bool:
    """Return whether some tables of two scenes are the same."""
    return all(getattr(one.settings, key) == getattr(other.settings, key) for key in keys)
