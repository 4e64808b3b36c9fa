"""The tables `[[cuts]]` and `[auto_cut]` of a scene: paths of cuts on a mesh, darts and seams of a form, and back to tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from warpflat.app.scene.load import Scene, errors_named, make_scene
from warpflat.app.scene.schema import CutTable
from warpflat.core import InputError, IntArray, find_unused_name, quote_value, without_side
from warpflat.garment import Form, FormDart, Mannequin, part_pieces, taken_over

if TYPE_CHECKING:
    from warpflat.app.scene.auto_cut import AutoCutTable
    from warpflat.flat import CutPlan, Flattening, RelaxOptions, Surface

__all__ = [
    "CutSequence",
    "asked_cuts",
    "cut_form",
    "cut_of_dart",
    "cuts_beside",
    "flatten_and_cut",
    "omitted",
    "place_of",
    "plan_automatic_cuts",
    "plan_cuts",
    "scene_with",
]


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
    auto: AutoCutTable | None = None
    first_auto: int = 0
    notes: tuple[str, ...] = ()

    @property
    def counts(self) -> range:
        """The numbers of cuts that may be made in the end."""
        return range(len(self.plans) if self.auto is None else self.first_auto, len(self.plans) + 1)

    def is_needed(self, result: Flattening, number: int) -> bool:
        """Return whether the cut of a number (from 0) is made on the piece with all cuts before it."""
        return self.auto is None or number < self.first_auto or not self.auto.is_enough(result)


def plan_cuts(surface: Surface, tables: Sequence[CutTable]) -> CutSequence:
    """Work the paths of all cuts into the edges of the surface, and cut a tube open.

    A tube is opened along its cuts and, where these leave a tube, where borders are nearest to each other.

    Raises:
        InputError: a line that does not exist, a path that leaves the surface or crosses itself; begins with the table.
    """
    from warpflat.app.scene.tube_cuts import open_with_cuts, without_overlaps
    from warpflat.flat import (
        CutPlan,
        as_vertex,
        border_of,
        check_tip_back,
        line_part,
        path_length,
        polyline_path,
        split_faces_along,
        tube_borders,
    )
    from warpflat.garment import plane_path, plane_section

    names = [table.name or table.line or f"cut {number + 1}" for number, table in enumerate(tables)]
    drawn: dict[int, str] = {}
    for number, table in enumerate(tables):
        if table.line is None:
            line = find_unused_name(names[number], surface.lines)
            with errors_named(f"cuts[{number}]"):
                if table.plane is None:
                    stops: list[int | list[float]] = []
                    for place in (table.from_, *table.through, table.to):
                        assert place is not None  # the schema sees to it
                        vertex = as_vertex(surface, place, as_read=True)
                        stops.append(place if isinstance(place, list) else vertex)
                    path = polyline_path(surface, stops)
                elif table.plane.towards is None:
                    path = plane_section(surface, table.plane.point, table.plane.normal)
                else:
                    as_vertex(surface, table.plane.point)  # says so if the point is off the piece
                    path = plane_path(surface, table.plane.point, table.plane.normal, towards=table.plane.towards)
                split = split_faces_along(surface, path)
                surface = replace(split.surface, lines={**split.surface.lines, line: split.path})
            drawn[number] = line
    border = set(border_of(surface).tolist())
    paths: dict[str, list[IntArray]] = {}
    tip_back: dict[str, float] = {}
    for number, (name, table) in enumerate(zip(names, tables, strict=True)):
        with errors_named(f"cuts[{number}]"):
            part = (0.0, 1.0) if table.part is None else (table.part[0], table.part[1])
            row = line_part(surface, table.line or drawn[number], part)
            inside = sum(vertex not in border for vertex in row[[0, -1]].tolist())
            if inside and table.tip_back > 0.0:
                what = "cut's length" if inside == 1 else "cut's half"
                check_tip_back(table.tip_back, path_length(surface, [row]) / inside, what)
        paths.setdefault(name, []).append(row)
        tip_back[name] = max(tip_back.get(name, 0.0), table.tip_back)
    plans = [CutPlan(name=name, paths=tuple(rows), tip_back=tip_back[name]) for name, rows in paths.items()]
    if not tube_borders(surface):
        return CutSequence(surface=surface, plans=tuple(plans), first_auto=len(plans))
    distinct, shorter = without_overlaps(plans)
    surface, plans, openings, uncut = open_with_cuts(surface, distinct)
    notes = [f"cut {quote_value(name)} is left out where it runs along another cut" for name in shorter]
    if openings:
        lines = [plan.paths[0] for plan in openings]
        places = [
            [f"({', '.join(f'{100 * x:.0f}' for x in uncut.vertices[vertex])})" for vertex in line[[0, -1]]]
            for line in lines
        ]
        ends = " and ".join(f"from {start} to {end} cm" for start, end in places)
        length = 100 * path_length(uncut, lines)
        notes.append(
            f"it is a tube, cut open where its borders are nearest, {length:.1f} cm, {ends}; [[cuts]] or --open choose another line"
        )
    return CutSequence(surface=surface, plans=tuple(plans), first_auto=len(plans), notes=tuple(notes))


def plan_automatic_cuts(
    sequence: CutSequence,
    auto: AutoCutTable,
    *,
    flatten: Callable[[Surface, RelaxOptions], Flattening],
    relax: RelaxOptions,
) -> CutSequence:
    """Find the best cuts with coarse relaxations; full ones decide later which of them are needed.

    Args:
        sequence: what is cut before.
        auto: the settings.
        flatten: flattens a surface with the scene's other settings.
        relax: the scene's options.

    Returns:
        The cuts, none where there is nothing to cut for or no line to cut along, as a note then says.

    Raises:
        InputError: a cut that is made before is refused.
    """
    from warpflat.app.scene.auto_cut import cut_automatically
    from warpflat.core import InputError
    from warpflat.flat import CutPlan, coarse_options

    # Energies are a little higher while the relaxation is coarse: whether a cut is needed is for the full one to say.
    search = auto.model_copy(update={"stop_below": 0.0, "stop_below_strain": 0.0})
    result = flatten_and_cut(sequence, flatten=flatten, relax=coarse_options(relax))
    why = "none would release energy without overlapping"
    try:
        result, _ = cut_automatically(result, search, relax=relax)
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
    from warpflat.flat import cut

    result = flatten(sequence.surface, relax)
    for plan in sequence.plans:
        result = cut(result, plan, relax=relax)
    return result


def cut_form(mannequin: Mannequin, form: Form, tables: Sequence[CutTable]) -> Form:
    """Return a form with the darts and seams that a scene asks for; its own dart at the same place is replaced.

    Raises:
        InputError: a seam that does not part its piece, a dart that no part of it holds, or nothing to leave out.
    """
    darts, asked = list(form.darts), [_dart(table) for table in tables]
    for table, dart in zip(tables, asked, strict=True):
        at = next((number for number, other in enumerate(darts) if other.place == dart.place), None)
        if table.omit and at is None:
            raise InputError(
                f"dart {dart.name!r}: the form has none along {dart.line!r} in piece {dart.piece!r} to omit"
            )
        if table.omit and at is not None:
            del darts[at]
        elif dart.parts_piece:
            continue
        elif at is None:
            darts.append(dart)
        else:
            darts[at] = replace(dart, name=table.name or darts[at].name)
    # A dart that was to be as wide as one left out has no mouth of its own to keep.
    names = {(dart.piece, dart.name) for dart in darts}
    standard = {dart.place for dart in form.darts}
    darts = [
        replace(dart, like=None) if dart.place in standard and (dart.piece, dart.like) not in names else dart
        for dart in darts
    ]
    form = replace(form, darts=tuple(darts))
    seams = [dart for dart, table in zip(asked, tables, strict=True) if dart.parts_piece and not table.omit]
    if not seams:
        return form
    for dart in taken_over(mannequin.layout, mannequin.vertices, form, seams):
        if dart in asked:
            raise InputError(
                f"dart {dart.name!r}: a seam through piece {dart.piece!r} takes in what it would; leave the dart or the seam out"
            )
    return part_pieces(mannequin.layout, mannequin.vertices, form, seams)


def cuts_beside(
    mannequin: Mannequin, form: Form, cuts: Sequence[Mapping[str, Any]], seam: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return the tables of cuts that a seam leaves: it takes over the darts along it, and those that point to it.

    Args:
        mannequin: the body.
        form: with the darts of the cuts.
        cuts: tables of `[[cuts]]`.
        seam: the table of a cut along a whole line of a piece.
    """
    whole = _dart(CutTable.model_validate(dict(seam)))
    gone = {dart.place for dart in taken_over(mannequin.layout, mannequin.vertices, form, [whole])}
    return [dict(cut) for cut in cuts if cut.get("omit") or place_of(cut) not in gone]


def place_of(cut: Mapping[str, Any]) -> tuple[str | None, ...]:
    """Return where a table puts its dart; see `FormDart.place`."""
    return tuple(cut.get(key) for key in ("piece", "line", "towards", "at"))


def _dart(table: CutTable) -> FormDart:
    keys: dict[str, Any] = {field.name: getattr(table, field.name) for field in fields(FormDart)}
    keys["name"] = table.name or without_side(f"{table.line}")
    return FormDart(**keys | {"part": table.part and (table.part[0], table.part[1])})


def omitted(dart: FormDart, **more: str) -> dict[str, Any]:
    """Return the table of `[[cuts]]` that leaves out the form's own dart at the place of a dart."""
    place = zip(("piece", "line", "towards", "at"), dart.place, strict=True)
    return {**more, **{key: value for key, value in place if value is not None}, "omit": True}


def asked_cuts(scene: Scene) -> list[dict[str, Any]]:
    """Return the tables `[[cuts]]` of a scene."""
    return [table.given() for table in scene.settings.cuts]


def cut_of_dart(dart: FormDart) -> dict[str, Any]:
    """Return the table of `[[cuts]]` that asks for a dart; what is the default anyway is left out."""
    usual = {"mirrored": True} | ({"between": dart.between} if dart.towards is None else {})
    keys = {key: value for key, value in asdict(dart).items() if value is not None and value != usual.get(key)}
    return keys if dart.part is None else {**keys, "part": list(dart.part)}


def scene_with(scene: Scene, **tables: Any) -> Scene:
    """Return a scene with some of its tables replaced; None leaves one out.

    Raises:
        InputError: as :func:`warpflat.app.scene.load.make_scene`.
    """
    data = scene.settings.given() | tables
    kept = {key: value for key, value in data.items() if value is not None}
    made = make_scene(kept, name=scene.name, folder=scene.folder, where=scene.where)
    return replace(made, name=scene.name, sources=scene.sources)
