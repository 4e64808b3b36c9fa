"""A garment that comes from a form on a mannequin: its pieces are flattened, sewn to each other, and their borders drawn as by hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import IntArray, expect, expect_callback, expect_each
from warpflat.flat import DEFAULT_FABRIC, TOUCHING, Fabric, Flattening, Progress, RelaxOptions, flatten_all
from warpflat.garment.construction.constraints import (
    Constraint,
    DartMouth,
    FixedLength,
    Straight,
    Symmetric,
    straight_hems,
)
from warpflat.garment.construction.darts import dart_constraints, dart_pairs, measure_darts
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.drawn_curves import CURVES_MM, Curves, measure_curves, plan_curves
from warpflat.garment.construction.ease import SeamRatios, seam_ratios
from warpflat.garment.construction.fullness import give_fullness
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.girths import girth_constraints, loose_armholes, pattern_girths
from warpflat.garment.construction.mirror import match_images
from warpflat.garment.construction.openings import opened_rings
from warpflat.garment.construction.rings import GarmentRing, measure_rings
from warpflat.garment.construction.sewing import sew
from warpflat.garment.construction.wearer import WearerFit, assess_wearer
from warpflat.garment.mannequin.forms import FormResult
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern import optional_file

if TYPE_CHECKING:
    from warpflat.pattern import Body

__all__ = ["FormGarment", "flatten_form"]


@dataclass(frozen=True, kw_only=True, eq=False)
class FormGarment(Garment):
    """A garment with its body.

    Attributes:
        mannequin, form: the body and the form on it: pieces in space with their edges and seams.
        wished: the ease of the form's seams; None if it was not sewn.
        curves: its borders as they are drawn; None if they are as the cloth rests.
    """

    mannequin: Mannequin
    form: FormResult
    wished: SeamRatios | None = None
    curves: Curves | None = None

    @cached_property
    def images(self) -> dict[str, tuple[str, IntArray]]:
        """By piece its mirror image, as the grid tells it: a body's two sides lie only nearly alike."""
        grid = np.concatenate([piece.grid_vertices for piece in self.form.pieces.values()])
        surfaces = {name: piece.surface for name, piece in self.form.pieces.items()}
        return match_images(surfaces, grid, self.mannequin.layout.mirror[grid])

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on completions, repairs and choices, one sentence each."""
        of_pieces = (f"{name}: {note}" for name, piece in self.pieces.items() for note in piece.messages)
        return (*self.mannequin.notes, *self.form.notes, *self.remarks, *of_pieces)

    @property
    def sources(self) -> tuple[Path, ...]:
        """The files that it was read from."""
        return (*super().sources, *self.mannequin.sources)

    @property
    def rings(self) -> list[GarmentRing]:
        """Every closed way around the garment, and what must pass through it."""
        first, positions = next(iter(self.pieces.values())), self.positions
        return measure_rings(
            self.mannequin, self.form, positions, strain_limit=first.fabric.strain_limit,
            girths=self.girths,
            opened=opened_rings(self.mannequin, self.form, positions, self.openings, self.finishing),
        )  # fmt: skip

    @cached_property
    def wearer(self) -> WearerFit | None:
        """How the garment fits its mannequin itself; None if its pieces go around nothing."""
        first = next(iter(self.pieces.values()))
        return assess_wearer(self.mannequin, self.form, self.positions, first.fabric, grain_angle=first.grain_angle)

    @cached_property
    def girths(self) -> Mapping[str, Mapping[str, float]]:
        """What its pieces measure around the body, by level, as :func:`pattern_girths` gives them."""
        return pattern_girths(self.mannequin, self.form, self.positions)

    @property
    def body_girths(self) -> Mapping[str, float]:
        """Girths of the body by level, and of the "head" where that is known [m]."""
        head = self.mannequin.extremity("head")
        levels = {name: level.girth for name, level in self.mannequin.levels().items()}
        return levels if head is None else {**levels, "head": head}

    @property
    def drawn_body(self) -> Body:
        """The body on which a picture shows it first."""
        from warpflat.pattern import Body

        return Body(vertices=self.mannequin.vertices, faces=np.asarray(self.mannequin.layout.faces, dtype=np.int32))

    def write_wear(self, folder: Path) -> list[str]:
        """Draw how its pieces are strained on the form and on the body, on one sheet, and return its name."""
        from warpflat.pattern import write_wear_sheet

        files: list[str] = []
        with optional_file(folder / "wear.png", files) as path:
            on_body = [] if self.wearer is None else [self.wearer.pieces[name].as_dict() for name in self.pieces]
            write_wear_sheet(path, list(self.pieces.values()), title=self.name, on_body=on_body)
        return files

    def piece_measures(self) -> dict[str, dict[str, Any]]:
        """Return the entries of the pieces in `metrics.json`, with the strain energy brick by brick, and the darts."""
        found = {}
        for name, piece in self.parts.items():
            brick = np.array(self.form.pieces[name].face_brick)
            measured = piece.measure(regions={each: brick == each for each in dict.fromkeys(brick.tolist())})
            darts = measure_darts(self.form, name, piece.positions)
            found[name] = {**measured, **({"darts": darts} if darts else {})}
        return found

    def further_metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` beside pieces and seams: the fit, the body, pairs, girths, rings, curves."""
        return {
            "wear": {} if self.wearer is None else {"against": "form", "wearer": self.wearer.as_dict()},
            "mannequin": self.mannequin.metrics(),
            "pairs": [list(pair) for pair in self.pairs],
            "girths": self.girths,
            "rings": [ring.as_dict() for ring in self.rings],
            **({} if self.curves is None else {"curves": self.curves.as_dict()}),
            **super().further_metrics(),
        }

    def sewing_metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` about seams and constraints."""
        return {"seams": [], **super().sewing_metrics()}


def flatten_form(
    mannequin: Mannequin,
    form: FormResult,
    *,
    fabric: Fabric | str = DEFAULT_FABRIC,
    grain_angle: float = 0.0,
    relax: RelaxOptions | None = None,
    callback: Callable[[str, Progress], bool | None] | None = None,
    device: str | None = None,
    sewn: bool = True,
    wishes: Sequence[SeamTable] = (),
    constraints: Sequence[Constraint] = (),
    curves_mm: float = CURVES_MM,
    known: Mapping[str, Flattening] | None = None,
    **options: Any,
) -> FormGarment:
    """Flatten every piece of a form from its own datum line, then relax all together so that their seams match.

    Args:
        mannequin: whose form it is.
        form: what `Mannequin.form` gives.
        fabric, grain_angle, relax, device, options: as :func:`warpflat.flatten` takes them.
        callback: called with the piece's name and its `Progress` after every step of its own.
        sewn: relax the pieces together, both sides of every seam equally long, and folds straight; otherwise each piece
            keeps its own minimum.
        wishes: fullness and gathers of seams; those of sleeves' caps by cloth are :func:`warpflat.garment.construction.ease.cap_wishes`.
        constraints: on edges and lines of pieces.
        curves_mm: how far borders may move to be drawn as by hand; 0 leaves them as the cloth rests.
        known: pieces that were flattened with these settings before, by name, not sewn; those of the same surface are not flattened again.

    Raises:
        InputError: a piece cannot be flattened, or a wish or constraint names what does not exist; one line says which
            and why.
    """
    expect(form, FormResult, "form", "what Mannequin.form gives")
    expect(mannequin, Mannequin, "mannequin", "a Mannequin")
    expect_callback(callback)
    expect_each(wishes, SeamTable, "wishes", "a SeamTable")
    kinds = (DartMouth, FixedLength, Straight, Symmetric)
    expect_each(constraints, kinds, "constraints", "a Straight, FixedLength, Symmetric or DartMouth")
    wished = seam_ratios(form, wishes)
    pieces = {name: flat for name, flat in (known or {}).items() if flat.surface is form.pieces[name].surface}
    names = [name for name in form.pieces if name not in pieces]
    flat = flatten_all(
        [form.pieces[name].surface for name in names],
        fabric=fabric,
        datum=[form.pieces[name].datum or None for name in names],
        grain_angle=grain_angle,
        relax=relax,
        callback=None if callback is None else lambda number, progress: callback(names[number], progress),
        device=device,
        **options,
    )
    pieces |= dict(zip(names, flat, strict=True))
    near = np.linalg.norm(form.vertices - mannequin.vertices, axis=1) <= TOUCHING
    full = dict[str, Flattening]()
    for name, piece in form.pieces.items():
        faces = piece.surface.faces
        close = np.asarray((near[piece.grid_vertices[faces]] | (faces < 0)).all(axis=1))
        full[name] = replace(pieces[name], close=close)
    pairs = wished.stitching(form)
    stitching = [*pairs, *dart_pairs(form)]
    garment = FormGarment(name=form.name, mannequin=mannequin, form=form, pieces=dict(full), stitching=stitching)
    if not sewn:
        return garment
    for name, edges in wished.full.items():
        rows = [row for pair in pairs for piece, row in zip(pair.pieces, pair.vertices, strict=True) if piece == name]
        full[name] = give_fullness(full[name], edges, rows, options=relax)
    folds = {name: piece.edges[piece.fold] for name, piece in form.pieces.items() if piece.fold}
    held = (*constraints, *straight_hems(form, constraints), *dart_constraints(form))
    girths = girth_constraints(mannequin, form, {name: piece.positions for name, piece in full.items()})

    def sewn_under(held: Sequence[Constraint]) -> FormGarment:
        result = sew(full, garment.stitching, constraints=held, folds=folds, options=relax)
        if loose := loose_armholes(mannequin, form, {name: piece.positions for name, piece in result.pieces.items()}):
            held = [*held, *loose]
            result = sew(full, garment.stitching, constraints=held, folds=folds, options=relax)
        found = replace(garment, pieces=result.pieces, sewn=result, wished=wished)
        return _with_curves(found, 1e-3 * curves_mm, held, folds, relax) if curves_mm else found

    if not girths:
        return sewn_under(held)
    kept = sewn_under([*held, *girths])
    at_rest = kept.sewn is not None and kept.sewn.converged
    if at_rest and all(each.fit.within_limits or not each.fabric.is_knit for each in kept.pieces.values()):
        return kept
    free = sewn_under(held)
    if not at_rest:
        words = (
            "the girths are as the cloth has them: seams and constraints leave no room for the ease that is asked for"
        )
    elif strained := _strained(free, kept):
        words = f"girths are as the cloth has them: as asked for they would strain {', '.join(strained)} beyond the cloth's limit"
    else:
        return kept
    return replace(free, remarks=(*free.remarks, words))


def _with_curves(
    garment: FormGarment,
    bound: float,
    held: Sequence[Constraint],
    folds: Mapping[str, IntArray],
    options: RelaxOptions | None,
) -> FormGarment:
    """Return a sewn garment with its borders drawn as by hand, within a bound [m].

    Pieces that fit as the cloth rests, and are strained beyond its limit as they are drawn, get half the bound, then none.

    Args:
        garment: at rest, or not.
        bound: how far its borders may move [m].
        held, folds, options: under which it was sewn, as :func:`warpflat.garment.construction.sewing.sew` takes them.
    """
    bounds, before = dict.fromkeys(garment.pieces, bound), garment.sewn
    for share in (0.5, 0.0, None):
        plans = plan_curves(garment.mannequin.layout, garment.form, garment.positions, bounds, held)
        if before is None or not before.converged or (not plans and any(bounds.values())):
            return garment
        if not plans:
            # However little they are drawn, all pieces would be strained.
            drawn = garment
            break
        outcome = sew(
            garment.pieces, garment.stitching, constraints=[*held, *(plan.line for plan in plans)], folds=folds,
            options=options, offsets=before.offsets,
        )  # fmt: skip
        if not outcome.converged:
            words = "the borders stay as the cloth rests: drawn by hand, seams or constraints could not be kept"
            return replace(garment, remarks=(*garment.remarks, words))
        drawn, sewn = replace(garment, pieces=outcome.pieces), before.followed_by(outcome)
        results = [each for each in outcome.results if each.kind == "curve"]
        lines = measure_curves(garment.form, plans, drawn.positions, results)
        curves = Curves(bound_mm=1e3 * max(bounds.values()), price_j=sewn.drawing_cost, lines=lines)
        drawn = replace(drawn, sewn=sewn, curves=curves)
        strained = _strained(garment, drawn)
        if share is None or not strained:
            break
        bounds |= {name: share * bounds[name] for name in strained}
    less = [f"{name} {1e3 * reach:.3g} mm" for name, reach in bounds.items() if reach < bound]
    if not less:
        return drawn
    words = f"borders are drawn within less, or the cloth would be strained beyond its limit: {', '.join(less)}"
    return replace(drawn, remarks=(*drawn.remarks, words))


def _strained(before: Garment, after: Garment) -> list[str]:
    """Return the pieces that fit before and do not after."""
    return [
        name
        for name, piece in after.pieces.items()
        if not piece.fit.within_limits and before.pieces[name].fit.within_limits
    ]
