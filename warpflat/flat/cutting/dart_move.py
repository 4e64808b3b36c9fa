"""A dart is rotated here: another one opens, and the old one is sewn shut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpflat.core.errors import InputError, nearest
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan, carry_layout, make_cuts
from warpflat.flat.flattening.applied_cut import seam_kind
from warpflat.flat.flattening.develop import develop
from warpflat.flat.flattening.edit import relax_cut
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions, given_options
from warpflat.flat.surface.cells import LEAST_AREA
from warpflat.flat.surface.cut.dart import dart_measure
from warpflat.flat.surface.falloff import harmonic_values
from warpflat.flat.surface.untangle import untangle

__all__ = ["DartMove", "move_dart"]


@dataclass(frozen=True, kw_only=True, eq=False)
class DartMove:
    """A dart closed and another opened in its place.

    Attributes:
        result: the piece afterwards.
        closed, opened: names of the cuts.
        energy_before, energy_both, energy_after: model energy (springs and guard) with the old dart, with both open, with the new
            one [J].
        angle_before, angle_after: of the old dart and of the new one, all their seams together [rad].
    """

    result: Flattening
    closed: str
    opened: str
    energy_before: float
    energy_both: float
    energy_after: float
    angle_before: float
    angle_after: float


def move_dart(
    result: Flattening,
    close: str,
    plan: CutPlan,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
) -> DartMove:
    """Rotate a dart to another line: open the new one, then sew the old one shut and relax.

    Args:
        result: with the old dart.
        close: the name of its cut.
        plan: the new dart, in the numbering of the uncut surface.
        relax: options of both relaxations.
        callback: called as by :func:`cut`.

    Raises:
        InputError: there is no such cut, or the new path is refused as by :func:`cut`.
    """
    if close not in [made.name for made in result.cuts]:
        raise InputError(
            f"piece {result.surface.name!r} has no cut {close!r} to close; {nearest(close, [c.name for c in result.cuts])}"
        )
    both = cut(result, plan, relax=relax, callback=callback)
    others = [CutPlan.from_applied(made) for made in both.cuts if made.name != close]
    made = make_cuts(both.surface, others)
    closing = [seam for one in both.cuts if one.name == close for seam in one.seams]
    # Both sides of its cracks move to the middle between them, and all else harmonically with them; pieces without a crack stay.
    shift = np.zeros_like(both.positions)
    fixed = np.zeros(len(shift), dtype=bool)
    for seam in closing:
        middle = 0.5 * (both.positions[seam.left] + both.positions[seam.right])
        for side in (seam.left, seam.right):
            shift[side] = middle - both.positions[side]
            fixed[side] = True
    drawn = both.positions + harmonic_values(both.network.surface.faces, shift, fixed)
    positions = carry_layout(drawn, both.faces, made.surface.faces, len(made.surface.vertices))
    # Faces that this has folded are untangled before the relaxation; if they cannot be, the piece is developed anew.
    positions, folded = untangle(made.surface, positions, least_area=LEAST_AREA)
    if folded:
        positions = develop(made.surface, both.datum).positions
    after = relax_cut(
        both,
        made.surface,
        positions,
        stage=f"close:{close}",
        cuts=made.cuts,
        options=given_options(relax),
        callback=callback,
    )
    return DartMove(
        result=after,
        closed=close,
        opened=plan.name,
        energy_before=result.stages[-1].model_energy_j,
        energy_both=both.stages[-1].model_energy_j,
        energy_after=after.stages[-1].model_energy_j,
        angle_before=_angle_of(result, close),
        angle_after=_angle_of(after, plan.name),
    )


def _angle_of(result: Flattening, name: str) -> float:
    """Return the sum of the angles of a cut's darts [rad]."""
    seams = next(made.seams for made in result.cuts if made.name == name)
    darts = [seam for seam in seams if seam_kind(seam) == "dart"]
    return sum(dart_measure(result.positions, seam.left, seam.right).angle for seam in darts)
