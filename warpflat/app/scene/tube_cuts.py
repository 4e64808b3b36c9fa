"""Cuts of a tube: what runs along another one is left out, and the tube is opened along the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from warpflat.core import InputError
from warpflat.flat import CutPlan, Surface, draw_openings, lines_after_cut, make_cuts, tube_borders
from warpflat.pattern import runs_without

__all__ = ["open_with_cuts", "without_overlaps"]


def without_overlaps(plans: Sequence[CutPlan]) -> tuple[list[CutPlan], list[str]]:
    """Leave out of each cut what one before it cuts already: a plane cuts all around a tube, wherever its point lies.

    Returns:
        The cuts, without those of which nothing is left; the names of those of which something is left out.
    """
    taken: set[tuple[int, ...]] = set()
    left, shorter = list[CutPlan](), list[str]()
    for plan in plans:
        edges = [tuple(sorted(edge)) for path in plan.paths for edge in pairwise(path.tolist())]
        if taken.isdisjoint(edges):
            left.append(plan)
        else:
            shorter.append(plan.name)
            if paths := [run for path in plan.paths for run in runs_without(path, taken)]:
                left.append(replace(plan, paths=tuple(paths)))
        taken.update(edges)
    return left, shorter


def open_with_cuts(surface: Surface, plans: Sequence[CutPlan]) -> tuple[Surface, list[CutPlan], list[CutPlan], Surface]:
    """Make all cuts of a tube, open what is still a tube then, and make as few of them beforehand as it takes to lie flat in one piece.

    Cuts and openings part each other into stretches. Each stretch of a cut is closed again, from the last to the first, unless this
    makes a tube: what stays cut leaves one piece, whatever the order of the cuts.

    Args:
        surface: a tube, with the paths of all cuts along its edges.
        plans: the cuts.

    Returns:
        The surface, cut so far that it is no tube; the cuts that are left to be made on it; the openings, on the fourth: the surface
        uncut.

    Raises:
        InputError: a cut cannot be made.
    """
    drawn, openings = draw_openings(surface, plans)
    made = make_cuts(drawn, [*plans, *openings]).cuts
    stretches = [(number, seam.path) for number, cut in enumerate(made) for seam in cut.seams]
    apart = list(range(len(stretches)))
    for stretch in reversed(range(len(stretches))):
        if stretches[stretch][0] >= len(plans):
            continue
        fewer = [other for other in apart if other != stretch]
        still_cut = tuple(stretches[other][1] for other in fewer)
        try:
            surface = make_cuts(drawn, [CutPlan(name="cut", paths=still_cut)]).surface if still_cut else drawn
        except InputError:  # one edge with both ends inside separates nothing
            continue
        if not tube_borders(surface):
            apart = fewer
    before = [
        CutPlan(
            name=cut.name, paths=tuple(stretches[stretch][1] for stretch in apart if stretches[stretch][0] == number)
        )
        for number, cut in enumerate(made)
    ]
    opened = make_cuts(drawn, [plan for plan in before if plan.paths])
    if opened.cut is None:
        return drawn, list(plans), openings, drawn
    edges = {tuple(sorted(edge)) for plan in before for path in plan.paths for edge in pairwise(path.tolist())}
    left = []
    for plan in plans:
        rest = [run for path in plan.paths for run in runs_without(path, edges)]
        paths = lines_after_cut({str(number): run for number, run in enumerate(rest)}, drawn.faces, opened.cut)
        if paths:
            left.append(replace(plan, paths=tuple(paths.values())))
    return opened.surface, left, openings, drawn
