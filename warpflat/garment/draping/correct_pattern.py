"""The pattern corrected: the flat pieces are changed until the worn cloth lies where it should.

A round compares the metric of the worn cloth with that of the shape that is wanted. Where the worn cloth is longer along a thread, the
pattern is too long there by as much. All cells together are flat, so the pattern moves by the displacement u that is nearest to what
the cells ask for, in the cloth's own stiffness: the minimum over u of

    sum of area * (K_warp (e_warp - t_warp)^2 + K_weft (e_weft - t_weft)^2 + G (gamma - t_gamma)^2),

where e and gamma are the strains of u and t is half the difference of the squared lengths. Both sides of a seam change their lengths
equally. Cloth is stiff: its worn lengths follow those of the pattern nearly one to one, so that a round leaves a small share of
what the plane allows (the fixed point has t = 0, or a t that no flat piece can follow).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array

from warpflat.core import (
    FloatArray,
    IntArray,
    StepError,
    factor_symmetric,
    format_count,
    polyline_length,
    short_repr,
    turned_left,
    unit,
)
from warpflat.flat import Fabric, Flattening, border_edges, corner_triangles
from warpflat.garment.construction.garment import Garment
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.drape_garment import held_vertices
from warpflat.garment.draping.moved_pattern import (
    cell_matrix,
    hold_seams,
    largest_share,
    moved_outlines,
    seam_differences,
    seam_edges,
    with_pattern,
)
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.result import Drape, spread
from warpflat.garment.draping.sewn_cloth import SewnCloth, pieces_of
from warpflat.pattern import Pattern

__all__ = ["Correction", "Round", "correct_pattern", "relieve_pattern"]

# Shear counts at least as this share of the threads' stiffness: a pattern that shears freely gets a ragged outline.
_LEAST_SHEAR = 0.05
# A round that lowers the misfit by less than this share is the last; a step that does not lower it is halved so often.
_LEAST_GAIN, _HALVINGS = 0.02, 2
# Cloth that is stretched too far is let out to this share of its limit.
_EASED = 0.7
# So much more of the area may be strained beyond the cloth's limit.
_MORE_STRAINED = 0.01


@dataclass(frozen=True, kw_only=True)
class Round:
    """Misfit after a round: mean and 95th percentile over the area [m], the share of the area that is strained beyond the limit, and
    the share of the step that was taken."""

    misfit: float
    misfit_p95: float
    strained: float
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Correction:
    """A pattern before and after its correction.

    Attributes:
        before, after: the drapes of both patterns.
        rounds: the misfit before the first round, and after each.
        reason: why it ended.
    """

    __repr__ = short_repr

    before: Drape
    after: Drape
    rounds: tuple[Round, ...]
    reason: str

    def moved(self) -> dict[str, FloatArray]:
        """Return how far each vertex of each piece (#P) has moved across the old outline, outwards [m]; 0 inside."""
        old, new = self.before.cloth, self.after.cloth
        edges = border_edges(old.flat_faces)
        along = old.flat[edges[:, 1]] - old.flat[edges[:, 0]]
        outwards = np.zeros_like(old.flat)
        for end in range(2):
            np.add.at(outwards, edges[:, end], -turned_left(along))
        across = np.einsum("ij,ij->i", new.flat - old.flat, unit(outwards))
        return {name: across[rows] for name, rows in old.piece_vertices.items()}

    def edges(self, garment: Garment | Flattening) -> dict[str, dict[str, float]]:
        """Return by "piece.edge" how far the outline moves outwards [m], on the mean and at most, and how much longer it becomes [m]."""
        old, new, moved = self.before.cloth, self.after.cloth, self.moved()
        found = {}
        for name, piece in pieces_of(garment).items():
            begin = old.piece_vertices[name].start
            on_outline = set(np.unique(border_edges(piece.faces)).tolist())
            for edge, ids in piece.network.surface.lines.items():
                if len(ids) < 2 or not on_outline.issuperset(ids.tolist()):
                    continue
                across = moved[name][ids]
                longer = polyline_length(new.flat[ids + begin]) - polyline_length(old.flat[ids + begin])
                found[f"{name}.{edge}"] = {
                    "mean_m": float(across.mean()), "max_m": float(across[np.abs(across).argmax()]), "longer_m": longer,
                }  # fmt: skip
        return found

    def seam_difference(self) -> float:
        """Return by how much the two sides of any edge of a seam differ more in length than before [m]."""
        old, new = self.before.cloth, self.after.cloth
        seams = seam_edges(old)
        if not len(seams):
            return 0.0
        return float(np.abs(seam_differences(new.flat, seams) - seam_differences(old.flat, seams)).max())

    def apply(self, garment: Garment | Flattening) -> Garment | Flattening:
        """Return the garment, or the piece, with the corrected pattern."""
        return with_pattern(garment, self.after.cloth)

    def drawn(self, pattern: Pattern, size: str) -> Pattern:
        """Return a pattern from outside in the size that was draped, corrected; see :func:`moved_outlines`."""
        return moved_outlines(pattern, size, self.before.cloth, self.after.cloth)

    def describe(self) -> str:
        """Return in a sentence what letting a pattern out has come to."""
        first, last = self.rounds[0].strained, self.rounds[-1].strained
        return (
            f"corrected in {format_count(len(self.rounds) - 1, 'round')}: {100 * first:.1f} % of the cloth was stretched beyond its "
            f"limit, now {100 * last:.1f} % ({self.reason})"
        )

    def measures(self, garment: Garment | Flattening | None = None) -> dict[str, object]:
        """Return the entry `correction` of `metrics.json`; with the edges of the garment whose pattern it is, if it is given."""
        rows = [
            {
                "misfit_m": each.misfit,
                "misfit_p95_m": each.misfit_p95,
                "beyond_limit": each.strained,
                "share": each.share,
            }
            for each in self.rounds
        ]
        return {
            "reason": self.reason, "fabric": self.after.cloth.fabric.name, "rounds": rows,
            "seam_difference_m": self.seam_difference(), "edges": {} if garment is None else self.edges(garment),
        }  # fmt: skip


def correct_pattern(
    drape: Drape,
    *,
    hold: Sequence[str] = (),
    fabric: Fabric | None = None,
    worn_shape: bool = False,
    rounds: int = 6,
    wanted: float = 0.0,
    callback: Callable[[int, Round], None] | None = None,
) -> Correction:
    """Change the flat pieces until the worn garment lies on the designed surface, or no nearer.

    Cloth that bridges a hollow is not asked to follow it, unless the shape that is wanted is one that cloth has taken.

    Args:
        drape: of the pattern as it is.
        hold: lines that stay where they are, as in :func:`warpflat.drape`, beside those that an elastic holds.
        fabric: another cloth for the corrected pattern; that of the drape if not given.
        worn_shape: whether the shape as it is worn in `drape` is wanted, rather than the designed one.
        rounds: the most.
        wanted: misfit on the mean at which it ends [m].
        callback: called with the number of each round and its misfit.

    Raises:
        InputError: an unknown line.
        StepError: the drape is not at rest, or that of another cloth or shape, or another cloth falls off.
    """
    _check_rest(drape)
    bridging, device = not worn_shape, drape.body.device
    held = held_vertices(drape.cloth, [*hold, *drape.threaded])
    shape = drape.positions if worn_shape else drape.cloth.designed
    cloth = replace(drape.cloth, designed=shape, fabric=fabric or drape.cloth.fabric)
    designed = Body(shape, cloth.faces, device=device) if worn_shape else drape.designed

    def wear(pattern: SewnCloth) -> Drape:
        worn = relax_drape(pattern, drape.body, options=drape.options, held=held)
        return replace(drape, cloth=pattern, worn=worn, designed=designed)

    if worn_shape or fabric is not None:
        drape = wear(cloth)
        _check_rest(drape)
    before = drape
    seams = seam_edges(cloth)
    difference = seam_differences(cloth.flat, seams)
    history, reason = [_round(drape, 0.0, bridging)], f"{rounds} rounds"
    for number in range(1, rounds + 1):
        if history[-1].misfit <= wanted:
            reason = "the misfit is as wanted"
            break
        # What the cells ask for, by Gauss and Newton's method.
        asked = _lengths(drape.cloth, shape) - _lengths(drape.cloth, drape.positions)
        if bridging:
            unexplained = drape.misfit / np.maximum(drape.distance, 1e-9)
            asked *= unexplained[drape.cloth.cells()[0]].mean(axis=1)[:, None]
        mend, step = _follow(drape.cloth, asked, seams, difference)
        share = largest_share(drape.cloth, mend + step)
        for _ in range(_HALVINGS + 1):
            trial = wear(replace(drape.cloth, flat=drape.cloth.flat + mend + share * step))
            now = _round(trial, share, bridging)
            if (
                trial.converged
                and now.misfit < history[-1].misfit
                and now.strained <= history[0].strained + _MORE_STRAINED
            ):
                break
            share *= 0.5
        else:
            reason = "no step lowers the misfit"
            break
        drape, gain = trial, 1.0 - now.misfit / history[-1].misfit
        history.append(now)
        if callback is not None:
            callback(number, now)
        if gain < _LEAST_GAIN:
            reason = "the misfit hardly falls any more"
            break
    return Correction(before=before, after=drape, rounds=tuple(history), reason=reason)


def _check_rest(drape: Drape) -> None:
    drape.worn.check_held()
    if not drape.converged:
        raise StepError(f"correct: the drape in {drape.cloth.fabric.name} is not at rest; raise max_steps in [drape]")


def _round(drape: Drape, share: float, bridging: bool) -> Round:
    strained = float(drape.face_areas[drape.demand.held].sum() / drape.face_areas.sum())
    off = spread(drape.misfit if bridging else drape.distance, drape.areas)
    return Round(misfit=off["mean"], misfit_p95=off["p95"], strained=strained, share=share)


def relieve_pattern(drape: Drape, *, hold: Sequence[str] = (), rounds: int = 6) -> Correction:
    """Let the flat pieces out where the worn cloth is stretched beyond its limit, until it is not, or no less of it.

    That is what can be asked of a pattern without a designed surface: a garment may hang as far off the body as its maker wants, but
    not be stretched more than its cloth allows. The rounds tell the share of the cloth that is stretched beyond the limit as `strained`.

    Args:
        drape: of the pattern as it is, on a body.
        hold: as :func:`correct_pattern` takes it.
        rounds: the most.

    Raises:
        InputError: an unknown line.
        StepError: the drape is not at rest.
    """
    _check_rest(drape)
    held, limit = held_vertices(drape.cloth, [*hold, *drape.threaded]), drape.cloth.fabric.strain_limit
    seams = seam_edges(drape.cloth)
    difference = seam_differences(drape.cloth.flat, seams)

    def told(worn: Drape, share: float) -> Round:
        strained = worn.demand.held_by_way[:, :2].any(axis=1)
        stretched = float(worn.face_areas[strained].sum() / worn.face_areas.sum())
        return replace(_round(worn, share, True), strained=stretched)

    before, history, reason = drape, [told(drape, 0.0)], f"{rounds} rounds"
    for _ in range(rounds):
        if history[-1].strained == 0.0:
            reason = "no cloth is stretched beyond its limit"
            break
        # Half the squared length of a thread over that of one at its limit.
        over = _lengths(drape.cloth, drape.positions)
        over -= 0.5 * (1.0 + _EASED * limit) ** 2
        mend, step = _follow(drape.cloth, np.maximum(over, 0.0) * [1.0, 1.0, 0.0], seams, difference)
        share = largest_share(drape.cloth, mend + step)
        cloth = replace(drape.cloth, flat=drape.cloth.flat + mend + share * step, designed=drape.positions)
        worn = relax_drape(cloth, drape.body, options=drape.options, held=held)
        cloth = replace(cloth, designed=drape.body.nearest(worn.positions)[0])
        trial = replace(drape, cloth=cloth, worn=worn)
        now = told(trial, share)
        if not trial.converged or now.strained >= (1.0 - _LEAST_GAIN) * history[-1].strained:
            reason = "no step leaves less of it stretched"
            break
        drape = trial
        history.append(now)
    return Correction(before=before, after=drape, rounds=tuple(history), reason=reason)


def _follow(
    cloth: SewnCloth, wanted: FloatArray, seams: IntArray, difference: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return two displacements of the flat vertices, #P by 2 [m] each.

    The first gives the sides of seams their wanted difference; whatever share of the second is taken, it is taken in full. The second
    is nearest to what cells want to be longer along warp and weft, and sheared, and leaves the seams alone.

    Args:
        cloth: with the present pattern.
        wanted: #C by 3, strains.
        seams: #S by 2 by 2, the edges of the outline that are sewn together.
        difference: #S, the wanted difference of their lengths [m].
    """
    _, face, gradient, area = cloth.cells()
    corner_flat, _, _ = corner_triangles(cloth.flat_faces)
    fabric = cloth.fabric
    threads = 0.5 * (fabric.stiffness_warp + fabric.stiffness_weft)
    shear = max(fabric.shear_stiffness, _LEAST_SHEAR * threads)
    warp, weft = cloth.warp[face][:, None, :], cloth.weft[face][:, None, :]
    by_warp, by_weft = gradient[:, :, :1], gradient[:, :, 1:]
    # How the strain along warp, along weft and in shear follows the corners of each cell: 3 by #C by 3 corners by 2 coordinates.
    rows = np.stack([warp * by_warp, weft * by_weft, warp * by_weft + weft * by_warp])
    stiff = (
        np.array([fabric.stiffness_warp, fabric.stiffness_weft, shear])[:, None, None, None]
        * area[:, None, None]
        * rows
    )
    count, columns = 2 * len(cloth.flat), 2 * corner_flat[:, :, None] + np.arange(2)
    matrix, mending = hold_seams(cloth, seams, difference)
    matrix = matrix + cell_matrix(np.einsum("scia,scjb->ciajb", stiff, rows), columns, columns, (count, count))
    right = np.zeros(count)
    np.add.at(right, columns, np.einsum("scia,cs->cia", stiff, wanted))
    solve = factor_symmetric(csc_array(matrix))
    return solve(mending).reshape(-1, 2), solve(right).reshape(-1, 2)


def _lengths(cloth: SewnCloth, positions: FloatArray) -> FloatArray:
    """Return half the squared lengths of the threads in each cell and the product of both, #C by 3, at #V by 3 places [m]."""
    warp, weft = cloth.threads(positions)
    products = [0.5 * (warp * warp).sum(axis=1), 0.5 * (weft * weft).sum(axis=1), (warp * weft).sum(axis=1)]
    return np.stack(products, axis=1)
