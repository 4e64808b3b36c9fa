"""A flattened piece is cut here: vertices on a path are doubled, and the relaxation goes on, so that the crack opens.

Cutting changes neither the number of faces nor their order, so that the layout is carried over corner by corner. No spring has to be
removed: those across the path belonged to the faces on both sides, and each side keeps its own share.
"""

from __future__ import annotations

from collections.abc import Callable

from warpflat.core.errors import InputError
from warpflat.flat.cutting.cut_plan import CutPlan, carry_layout, line_part, make_cuts
from warpflat.flat.flattening.edit import relax_cut
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening, require_unsewn
from warpflat.flat.solver.options import RelaxOptions, given_options

__all__ = ["cut"]


def cut(
    result: Flattening,
    plan: CutPlan | str,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
) -> Flattening:
    """Cut a flattened piece and relax it further from its present layout.

    Args:
        result: the piece, cut before or not.
        plan: the cut, or the name of a feature line to be cut along from end to end.
        relax: options of the relaxation.
        callback: called with a `Progress` before the first step (the crack still closed) and after every step.

    Returns:
        The piece with the crack open; what a cut from border to border leaves is still one object, see :func:`separate`.

    Raises:
        InputError: the path leaves the mesh, repeats a vertex, runs along the border or an earlier cut, or separates
            nothing; or a cut of that name has been made, or the piece has been sewn. The message names the vertex.
    """
    require_unsewn(result)
    if isinstance(plan, str):
        plan = CutPlan(name=plan, paths=(line_part(result.surface, plan),))
    if plan.name in [made.name for made in result.cuts]:
        raise InputError(f"piece {result.surface.name!r} has been cut along {plan.name!r} already")
    plans = [CutPlan.from_applied(made) for made in result.cuts]
    made = make_cuts(result.surface, [*plans, plan])
    positions = carry_layout(result.positions, result.faces, made.surface.faces, len(made.surface.vertices))
    return relax_cut(
        result,
        made.surface,
        positions,
        stage=f"cut:{plan.name}",
        cuts=made.cuts,
        options=given_options(relax),
        callback=callback,
    )
