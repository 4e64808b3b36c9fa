"""A garment: flat pieces, the seams between them, and the form on a mannequin that they come from, if there is one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import expect, expect_callback, expect_each
from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.cutting.separate_pieces import separate
from warpflat.export.piece_files import write_pieces
from warpflat.fabric.fabric import DEFAULT_FABRIC, Fabric
from warpflat.flattening.as_cut import CutPattern
from warpflat.flattening.flatten_all import flatten_all
from warpflat.flattening.progress import Progress
from warpflat.flattening.result import Flattening, run_metrics
from warpflat.garment.constraints import Constraint, DartMouth, FixedLength, Straight, Symmetric, straight_hems
from warpflat.garment.darts import dart_constraints, dart_pairs, measure_darts
from warpflat.garment.drawn_curves import CURVES_MM, Curves, measure_curves, plan_curves
from warpflat.garment.ease import SeamRatios, SeamWish, seam_ratios
from warpflat.garment.finishing import Finishing, with_plackets
from warpflat.garment.fullness import give_fullness
from warpflat.garment.girths import girth_constraints, pattern_girths
from warpflat.garment.openings import Opening, opened_rings
from warpflat.garment.pockets import Pocket
from warpflat.garment.rings import GarmentRing, measure_rings
from warpflat.garment.sewing import sew
from warpflat.garment.sewn import MeasuredSeam, Sewn, Stitching
from warpflat.garment.wearer import WearerFit, assess_wearer
from warpflat.mannequin.forms import FormResult
from warpflat.mannequin.mannequin import Mannequin
from warpflat.model.fit import TOUCHING
from warpflat.solver.options import RelaxOptions
from warpflat.surface.border_seams import BorderSeam
from warpflat.surface.mirror import mirror_images

if TYPE_CHECKING:
    from warpflat.export.picture_drafted import DraftedOutline

__all__ = ["Garment", "flatten_form"]

# Largest distance [m] of a piece from the mirror image of its partner at which one pattern serves for both.
_SAME_PIECE = 5e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Garment:
    """Pieces, flattened, and sewn to each other or to themselves; a single piece without a seam is a garment, too.

    Attributes:
        name: the garment's.
        pieces: the flat pieces by name, in order; each whole, even where cuts have parted it.
        stitching: what is sewn to each other.
        sewn: outcome of relaxing them together under their seams and constraints; None if they were not sewn.
        border_seams: seams of a mesh that were named by lines along its border.
        mannequin, form: the body and the form on it, of a garment that comes from one: pieces in space with their edges and seams.
        wished: the ease of a form's seams; None if it was not sewn.
        openings: along its seams.
        finishing: of its free edges, in the pattern.
        pockets: in the pattern.
        curves: its borders as they are drawn; None if they are as the cloth rests.
        remarks: what could not be had of girths and curves, one sentence each.
        as_cut: how a pattern that was taken as it is compares with what flattening gives; None if it was not.
        drape: the entry `drape` of `metrics.json`, by which the garment is judged then; None if it was not draped.
    """

    name: str
    pieces: Mapping[str, Flattening]
    stitching: Sequence[Stitching] = ()
    sewn: Sewn | None = None
    border_seams: Sequence[BorderSeam] = ()
    mannequin: Mannequin | None = None
    form: FormResult | None = None
    wished: SeamRatios | None = None
    openings: Sequence[Opening] = ()
    finishing: Sequence[Finishing] = ()
    pockets: Sequence[Pocket] = ()
    curves: Curves | None = None
    remarks: tuple[str, ...] = ()
    as_cut: CutPattern | None = None
    drape: Mapping[str, Any] | None = None

    def __repr__(self) -> str:
        energy = sum(piece.stages[-1].strain_energy_j for piece in self.pieces.values())
        return (
            f"<Garment {self.name!r}: {', '.join(self.pieces)}; {len(self.seams)} seams, strain energy {energy:.4g} J>"
        )

    @property
    def positions(self) -> dict[str, FloatArray]:
        """The layouts by piece, each #P by 2 [m]."""
        return {name: piece.positions for name, piece in self.pieces.items()}

    @cached_property
    def parts(self) -> dict[str, Flattening]:
        """What is cut from cloth, by name: the pieces, and the parts of those that cuts have parted."""
        return {part.surface.name: part for piece in self.pieces.values() for part in separate(piece)}

    def advised(self, advise: Callable[[Flattening], Flattening]) -> Garment:
        """Return the garment with what `advise` adds to each of its parts."""
        parts = {name: advise(part) for name, part in self.parts.items()}
        made = replace(self, pieces={name: parts.get(name, piece) for name, piece in self.pieces.items()})
        made.__dict__["parts"] = parts
        return made

    @property
    def seams(self) -> tuple[MeasuredSeam, ...]:
        """Every seam with the lengths of its two sides."""
        costs = {} if self.sewn is None else {made.name: made.cost for made in self.sewn.results if made.kind == "seam"}
        runs: dict[str, list[Stitching]] = {}
        for pair in self.stitching:
            if pair.sides is not None:
                runs.setdefault(pair.name, []).append(pair)
        found = []
        for name, pairs in runs.items():
            first, second = (self.pieces[piece] for piece in pairs[0].pieces)
            edges = [np.diff(arc_lengths(first.positions[pair.vertices[0]])) for pair in pairs]
            length = float(sum(edge.sum() for edge in edges))
            wished = sum(float((edge / pair.ratio).sum()) for edge, pair in zip(edges, pairs, strict=True))
            even = all(np.array_equal(pair.ratio, 1.0) for pair in pairs)
            assert pairs[0].sides is not None
            found.append(
                MeasuredSeam(
                    name=name,
                    sides=pairs[0].sides,
                    length_3d=sum(polyline_length(first.network.surface.vertices[pair.vertices[0]]) for pair in pairs),
                    lengths=(length, sum(polyline_length(second.positions[pair.vertices[1]]) for pair in pairs)),
                    ease=0.0 if even else wished / length - 1.0,
                    cost=costs.get(name),
                )
            )
        return tuple(found)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Pieces that are each other's mirror images, in space and, within 0.5 mm, in the pattern.

        One of the two is enough for the table: cut it twice, the second time turned over.
        """
        found = []
        names = list(self.pieces)
        for number, first in enumerate(names):
            for second in names[number + 1 :]:
                partners = self.mirror_vertices(first, second)
                if partners is None:
                    continue
                a, b = self.pieces[first].positions * [-1.0, 1.0], self.pieces[second].positions[partners]
                if np.abs((a - a.mean(axis=0)) - (b - b.mean(axis=0))).max() < _SAME_PIECE:
                    found.append((first, second))
        return tuple(found)

    def mirror_vertices(self, first: str, second: str) -> IntArray | None:
        """Return for each vertex of one piece its mirror image in the other, in space; None if they are no pair.

        Matched face by face: along a line at which a piece is cut open, a vertex of the mannequin is two of the piece.
        """
        if self.form is None or self.mannequin is None:
            mate, partners = self._images.get(first, (None, None))
            return partners if mate == second else None
        one, two, image = self.form.pieces[first], self.form.pieces[second], self.mannequin.layout.mirror
        if len(one.grid_vertices) != len(two.grid_vertices) or len(one.face_brick) != len(two.face_brick):
            return None
        rows = two.grid_vertices[two.surface.faces].tolist()
        faces = {
            frozenset(row): dict(zip(row, face, strict=True))
            for row, face in zip(rows, two.surface.faces.tolist(), strict=True)
        }
        partners = np.full(len(one.grid_vertices), -1, dtype=np.int32)
        for row, face in zip(image[one.grid_vertices[one.surface.faces]].tolist(), one.surface.faces, strict=True):
            other = faces.get(frozenset(row))
            if other is None:
                return None
            partners[face] = [other[vertex] for vertex in row]
        return partners

    @cached_property
    def _images(self) -> dict[str, tuple[str, IntArray]]:
        return mirror_images({name: piece.network.surface for name, piece in self.pieces.items()})

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on completions, repairs and choices, one sentence each."""
        alone = self.form is None and len(self.pieces) == 1
        of_pieces = (
            note if alone else f"{name}: {note}" for name, piece in self.pieces.items() for note in piece.messages
        )
        of_body = () if self.mannequin is None else self.mannequin.notes
        return (*of_body, *(() if self.form is None else self.form.notes), *self.remarks, *of_pieces)

    @property
    def rings(self) -> list[GarmentRing]:
        """Every closed way around a garment on its mannequin, and what must pass through it."""
        if self.form is None or self.mannequin is None:
            return []
        first, positions = next(iter(self.pieces.values())), self.positions
        return measure_rings(
            self.mannequin, self.form, positions, strain_limit=first.fabric.strain_limit,
            girths=pattern_girths(self.mannequin, self.form, positions),
            opened=with_plackets(
                opened_rings(self.mannequin, self.form, positions, self.openings), self.finishing
            ),
        )  # fmt: skip

    @cached_property
    def wearer(self) -> WearerFit | None:
        """How the garment fits its mannequin itself; None if it has none, or its pieces go around nothing."""
        if self.form is None or self.mannequin is None:
            return None
        first = next(iter(self.pieces.values()))
        return assess_wearer(self.mannequin, self.form, self.positions, first.fabric, grain_angle=first.grain_angle)

    def metrics(self) -> dict[str, Any]:
        """Return the content of `metrics.json`."""
        pieces, more = dict[str, dict[str, Any]](), dict[str, Any]()
        for name, piece in self.parts.items():
            if self.form is None:
                pieces[name] = piece.measures
                continue
            # Of a form's piece with its strain energy brick by brick, and its darts.
            brick = np.array(self.form.pieces[name].face_brick)
            measured = piece.measure(regions={each: brick == each for each in dict.fromkeys(brick.tolist())})
            darts = measure_darts(self.form, name, piece.positions)
            pieces[name] = {**measured, **({"darts": darts} if darts else {})}
        if self.form is not None and self.mannequin is not None:
            wearer = {} if self.wearer is None else {"against": "form", "wearer": self.wearer.as_dict()}
            more = {
                "wear": wearer,
                "mannequin": self.mannequin.metrics(),
                "pairs": [list(pair) for pair in self.pairs],
                "girths": pattern_girths(self.mannequin, self.form, self.positions),
                "rings": [ring.as_dict() for ring in self.rings],
                **({} if self.curves is None else {"curves": self.curves.as_dict()}),
            }
        if self.as_cut is not None:
            more = {"pattern_of_file": self.as_cut.as_dict()}
        if self.drape is not None:
            more["drape"] = self.drape
        device = next(iter(self.pieces.values())).network.device
        return run_metrics(pieces, device, {**more, **self.sewing_metrics()})

    def summary(self) -> dict[str, Any]:
        """Return the entry of another size in `metrics.json`: convergence, flips, stages and seams."""
        pieces = {
            name: {
                "converged": piece.converged,
                "flipped_faces": piece.flipped_faces,
                "stages": [stage.as_dict() for stage in piece.stages],
            }
            for name, piece in self.pieces.items()
        }
        return {"pieces": pieces, **self.sewing_metrics()}

    def sewing_metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` about seams and constraints; none of a mesh that has none."""
        found: dict[str, Any] = {}
        if self.sewn is not None:
            held = [result.as_dict() for result in self.sewn.constraints]
            found = {"constraints": held, "sewing": self.sewn.as_dict()}
        sewn = self.form is not None or self.stitching
        return {"seams": [seam.as_dict() for seam in self.seams], **found} if found or sewn else {}

    def save(self, folder: str | Path, *, picture: bool = True) -> list[str]:
        """Write `metrics.json`, an OBJ per piece and `picture.png`, all of them or none, and return their names.

        Raises:
            InputError: the folder cannot be written, or the body was read from a file there that would be replaced.
        """
        from warpflat.core.output import output_folder, require_own_metrics, write_report

        others = [*(["picture.png"] if picture else []), "metrics.json"]
        sources = [source for piece in self.pieces.values() for source in piece.surface.sources]
        sources += [] if self.mannequin is None else self.mannequin.sources
        with output_folder(folder, others, sources=sources, guard=True) as to:
            require_own_metrics(to)
            files = self.write_files(to, picture=picture)
            write_report(to / "metrics.json", self.metrics(), name=self.name, files=files)
        return [*files, "metrics.json"]

    def write_files(self, folder: Path, *, picture: bool, drafted: Sequence[DraftedOutline] = ()) -> list[str]:
        """Write an OBJ per piece and `picture.png`, but not `metrics.json`, and return their names.

        Args:
            folder: an existing one.
            picture: whether to draw one.
            drafted: pieces without a surface that it shows, too, as collars and pockets.

        Raises:
            InputError: the folder cannot be written.
        """
        from warpflat.export.picture_garment import Body

        body = None
        if self.mannequin is not None:
            body = Body(vertices=self.mannequin.vertices, faces=np.asarray(self.mannequin.layout.faces, dtype=np.int32))
        return write_pieces(
            list(self.parts.values()), folder, picture=picture, frames=False, body=body, drafted=drafted
        )


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
    wishes: Sequence[SeamWish] = (),
    constraints: Sequence[Constraint] = (),
    curves_mm: float = CURVES_MM,
    known: Mapping[str, Flattening] | None = None,
    **options: Any,
) -> Garment:
    """Flatten every piece of a form from its own datum line, then relax all together so that their seams match.

    Args:
        mannequin: whose form it is.
        form: what `Mannequin.form` gives.
        fabric, grain_angle, relax, device, options: as :func:`warpflat.flatten` takes them.
        callback: called with the piece's name and its `Progress` after every step of its own.
        sewn: relax the pieces together, both sides of every seam equally long, and folds straight; otherwise each piece
            keeps its own minimum.
        wishes: fullness and gathers of seams; those of sleeves' caps by cloth are :func:`warpflat.garment.ease.cap_wishes`.
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
    expect_each(wishes, SeamWish, "wishes", "a SeamWish")
    expect_each(
        constraints,
        (DartMouth, FixedLength, Straight, Symmetric),
        "constraints",
        "a Straight, FixedLength, Symmetric or DartMouth",
    )
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
    pairs = [
        Stitching(
            name=seam.name, pieces=seam.pieces, vertices=run.vertices,
            ratio=wished.edge_ratios[number][i] if number in wished.edge_ratios else wished.ratios[number],
            sides=(f"{seam.pieces[0]}.{seam.edges[0]}", f"{seam.pieces[1]}.{seam.edges[1]}"),
        )
        for number, seam in enumerate(form.seams)
        for i, run in enumerate(seam.runs)
    ]  # fmt: skip
    near = np.linalg.norm(form.vertices - mannequin.vertices, axis=1) <= TOUCHING
    for name, piece in form.pieces.items():
        faces = piece.surface.faces
        close = np.asarray((near[piece.grid_vertices[faces]] | (faces < 0)).all(axis=1))
        pieces[name] = replace(pieces[name], close=close)
    garment = Garment(
        name=form.name,
        mannequin=mannequin,
        form=form,
        pieces={name: pieces[name] for name in form.pieces},
        stitching=[*pairs, *dart_pairs(form)],
    )
    if not sewn:
        return garment
    full = dict(garment.pieces)
    for name, edges in wished.full.items():
        sides = [row for pair in pairs for piece, row in zip(pair.pieces, pair.vertices, strict=True) if piece == name]
        plain = [row for row in sides if not any(row is edge.vertices for edge in edges)]
        full[name] = give_fullness(full[name], edges, plain, options=relax)
    folds = {name: piece.edges[piece.fold] for name, piece in form.pieces.items() if piece.fold}
    held = (*constraints, *straight_hems(form, constraints), *dart_constraints(form))
    knit = next(iter(pieces.values())).fabric.is_knit
    girths = girth_constraints(mannequin, form, {name: piece.positions for name, piece in full.items()})

    def sewn_under(held: Sequence[Constraint]) -> Garment:
        result = sew(full, garment.stitching, constraints=held, folds=folds, options=relax)
        found = replace(garment, pieces=result.pieces, sewn=result, wished=wished)
        return _with_curves(found, 1e-3 * curves_mm, held, folds, relax) if curves_mm else found

    if not girths:
        return sewn_under(held)
    kept = sewn_under([*held, *girths])
    if (
        kept.sewn is not None
        and kept.sewn.converged
        and not (knit and any(not each.fit.fits for each in kept.pieces.values()))
    ):
        return kept
    free = sewn_under(held)
    if kept.sewn is None or not kept.sewn.converged:
        words = (
            "the girths are as the cloth has them: seams and constraints leave no room for the ease that is asked for"
        )
    elif strained := _strained(free, kept):
        words = f"girths are as the cloth has them: as asked for they would strain {', '.join(strained)} beyond the cloth's limit"
    else:
        return kept
    return replace(free, remarks=(*free.remarks, words))


def _with_curves(
    garment: Garment,
    bound: float,
    held: Sequence[Constraint],
    folds: Mapping[str, IntArray],
    options: RelaxOptions | None,
) -> Garment:
    """Return a sewn garment with its borders drawn as by hand, within a bound [m].

    Pieces that fit as the cloth rests, and are strained beyond its limit as they are drawn, get half the bound, then none.

    Args:
        garment: at rest, or not.
        bound: how far its borders may move [m].
        held, folds, options: under which it was sewn, as :func:`warpflat.garment.sewing.sew` takes them.
    """
    bounds, before = dict.fromkeys(garment.pieces, bound), garment.sewn
    assert garment.form is not None
    assert garment.mannequin is not None
    for share in (0.5, 0.0, None):
        plans = plan_curves(garment.mannequin.layout, garment.form, garment.positions, bounds, held)
        if not plans or before is None or not before.converged:
            return garment
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
    return [name for name, piece in after.pieces.items() if not piece.fit.fits and before.pieces[name].fit.fits]
