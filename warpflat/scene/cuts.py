"""Cuts in scene files: `[[cuts]]` along lines, between points, along planes, and `[auto_cut]`, which looks for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from warpflat.core.arrays import IntArray
from warpflat.scene.cut_tables import AutoCutTable, CutTable

if TYPE_CHECKING:
    from warpflat.cutting.cut_plan import CutPlan
    from warpflat.cutting.ledger import AutoCut, Ledger
    from warpflat.flattening.result import Flattening
    from warpflat.solver.options import RelaxOptions
    from warpflat.surface.mesh import Surface
    from warpflat.surface.paths.trace import SurfacePath

__all__ = ["CutSequence", "cuts_of_entry", "plan_automatic_cuts", "plan_cuts"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CutSequence:
    """The cuts of a scene, in their order, and the surface with their paths along its edges.

    Attributes:
        surface: with every path along its edges.
        plans: the cuts.
        auto: the settings of automatic cutting; the cuts that it has found begin at plan `first_auto`.
        notes: what was chosen, one sentence each.
    """

    surface: Surface
    plans: tuple[CutPlan, ...] = ()
    auto: AutoCut | None = None
    first_auto: int = 0
    notes: tuple[str, ...] = ()

    @property
    def counts(self) -> range:
        """The numbers of cuts that may be made in the end."""
        return range(len(self.plans) if self.auto is None else self.first_auto, len(self.plans) + 1)

    def is_needed(self, result: Flattening, number: int) -> bool:
        """Return whether the cut of a number (from 0) is made on the piece with all cuts before it."""
        return self.auto is None or number < self.first_auto or not self.auto.is_enough(result)


def plan_cuts(surface: Surface, tables: list[CutTable]) -> CutSequence:
    """Cut a tube open and work the paths of all other cuts into the edges of the surface.

    Raises:
        InputError: a line that does not exist, a path that leaves the surface or crosses itself; begins with the table.
    """
    from warpflat.surface.tubes import tube_borders

    sequence = _plan_paths(surface, dict(enumerate(tables)))
    return _open_tubes(sequence) if tube_borders(surface) else sequence


def _plan_paths(surface: Surface, tables: dict[int, CutTable]) -> CutSequence:
    from warpflat.core.text import find_unused_name
    from warpflat.cutting.cut_plan import CutPlan, draw_line, line_part
    from warpflat.scene.load import errors_named

    names = {number: table.name or table.line or f"cut {number + 1}" for number, table in tables.items()}
    drawn: dict[int, str] = {}
    for number, table in tables.items():
        if table.line is None:
            line = find_unused_name(names[number], surface.lines)
            with errors_named(f"cuts[{number}]"):
                surface = draw_line(surface, line, _path(surface, table))
            drawn[number] = line
    paths: dict[str, list[IntArray]] = {}
    tip_back: dict[str, float] = {}
    for number, table in tables.items():
        name = names[number]
        with errors_named(f"cuts[{number}]"):
            part = (0.0, 1.0) if table.part is None else (table.part[0], table.part[1])
            row = line_part(surface, table.line or drawn[number], part)
            _check_tip_back(surface, row, table.tip_back)
        paths.setdefault(name, []).append(row)
        tip_back[name] = max(tip_back.get(name, 0.0), table.tip_back)
    plans = tuple(CutPlan(name=name, paths=tuple(rows), tip_back=tip_back[name]) for name, rows in paths.items())
    return CutSequence(surface=surface, plans=plans, first_auto=len(plans))


def _open_tubes(sequence: CutSequence) -> CutSequence:
    """Cut a tube open along its cuts, and where these leave a tube, where borders are nearest to each other."""
    from warpflat.core.text import quote_value
    from warpflat.cutting.open_tube import open_with_cuts, without_overlaps
    from warpflat.surface.paths.edge_paths import path_length

    distinct, shorter = without_overlaps(sequence.plans)
    surface, plans, openings, uncut = open_with_cuts(sequence.surface, distinct)
    notes = tuple(f"cut {quote_value(name)} is left out where it runs along another cut" for name in shorter)
    if openings:
        lines = [plan.paths[0] for plan in openings]
        ends = " and ".join(f"from {_centimetres(uncut, line[0])} to {_centimetres(uncut, line[-1])}" for line in lines)
        notes = (
            *notes,
            f"it is a tube, cut open where its borders are nearest, {100 * path_length(uncut, lines):.1f} cm, {ends} cm; "
            "[[cuts]] or --open choose another line",
        )
    return CutSequence(surface=surface, plans=tuple(plans), first_auto=len(plans), notes=notes)


def _centimetres(surface: Surface, vertex: int) -> str:
    return f"({', '.join(f'{100 * x:.0f}' for x in surface.vertices[vertex])})"


def _check_tip_back(surface: Surface, path: IntArray, tip_back: float) -> None:
    """Check that drawing back the tips leaves something of the dart or the fish-eye dart."""
    from warpflat.surface.connectivity import border_loops
    from warpflat.surface.cut.dart_legs import check_tip_back
    from warpflat.surface.paths.edge_paths import path_length

    border = {vertex for loop in border_loops(surface.faces) for vertex in loop.tolist()}
    inside = sum(vertex not in border for vertex in path[[0, -1]].tolist())
    if inside and tip_back > 0.0:
        check_tip_back(tip_back, path_length(surface, [path]) / inside, "cut's length" if inside == 1 else "cut's half")


def _path(surface: Surface, table: CutTable) -> SurfacePath:
    from warpflat.surface.paths.edge_paths import as_vertex
    from warpflat.surface.paths.section import plane_path, plane_section
    from warpflat.surface.paths.trace import polyline_path

    if table.plane is not None and table.plane.towards is None:
        return plane_section(surface, table.plane.point, table.plane.normal)
    if table.plane is not None:
        as_vertex(surface, table.plane.point)  # says so if the point is off the piece
        return plane_path(surface, table.plane.point, table.plane.normal, towards=table.plane.towards)
    stops: list[int | list[float]] = []
    for place in (table.from_, *table.through, table.to):
        assert place is not None  # the schema sees to it
        vertex = as_vertex(surface, place, as_read=True)
        stops.append(place if isinstance(place, list) else vertex)
    return polyline_path(surface, stops)


def plan_automatic_cuts(
    sequence: CutSequence,
    table: AutoCutTable,
    *,
    flatten: Callable[[Surface, RelaxOptions], Flattening],
    relax: RelaxOptions,
) -> CutSequence:
    """Find the best cuts with coarse relaxations; full ones decide later which of them are needed.

    Args:
        sequence: what is cut before.
        table: the settings.
        flatten: flattens a surface with the scene's other settings.
        relax: the scene's options.

    Returns:
        The cuts, none where there is nothing to cut for or no line to cut along, as a note then says.

    Raises:
        InputError: a cut that is made before is refused.
    """
    from warpflat.core.errors import InputError
    from warpflat.cutting.cut_plan import CutPlan
    from warpflat.cutting.ledger import AutoCut, coarse_options, cut_automatically

    auto = AutoCut(**table.model_dump())
    # Energies are a little higher while the relaxation is coarse: whether a cut is needed is for the full one to say.
    search = replace(auto, stop_below=0.0, stop_below_strain=0.0)
    result = flatten_and_cut(sequence, flatten=flatten, relax=coarse_options(relax))
    why = "none would release energy without overlapping"
    try:
        result, _ = cut_automatically(result, search, relax=relax, fully=False)
    except InputError as nowhere:
        why = str(nowhere)
    plans = tuple(CutPlan.from_applied(made) for made in result.cuts)
    found = [plan.name for plan in plans[len(sequence.plans) :]]
    note = f"cuts found: {'; '.join(found)}" if found else f"no cut was found: {why}"
    return CutSequence(
        surface=result.surface, plans=plans, auto=auto, first_auto=len(sequence.plans), notes=(*sequence.notes, note)
    )


def flatten_and_cut(
    sequence: CutSequence, *, flatten: Callable[[Surface, RelaxOptions], Flattening], relax: RelaxOptions
) -> Flattening:
    """Flatten a piece and make all cuts of a sequence."""
    from warpflat.cutting.cut_piece import cut

    result = flatten(sequence.surface, relax)
    for plan in sequence.plans:
        result = cut(result, plan, relax=relax)
    return result


def cuts_of_entry(ledger: Ledger, number: int) -> CutSequence:
    """Return the cuts of a ledger's piece, and after them the candidate of a number (from 1).

    Raises:
        InputError: there is no such number.
    """
    from warpflat.core.errors import InputError
    from warpflat.cutting.cut_plan import CutPlan

    if not 1 <= number <= len(ledger.entries):
        raise InputError(f"there is no candidate {number}; valid: 1 to {len(ledger.entries)}")
    result = ledger.entries[number - 1].result
    return CutSequence(surface=result.surface, plans=tuple(CutPlan.from_applied(made) for made in result.cuts))
