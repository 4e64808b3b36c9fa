"""Forms: which bricks make a garment's pieces, and how far the garment stands off the body."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    IntArray,
    arc_lengths,
    check_file_name,
    is_number,
    nearest,
    quote_value,
    read_toml,
    same_file,
    short_repr,
)
from warpflat.garment.mannequin.blend import Adjustment, adjusted_vertices, is_tight
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.darts import (
    FormDart,
    PlacedDart,
    cloth_of,
    grid_line,
    lies_left,
    longest_run,
    place_darts,
    standard_darts,
)
from warpflat.garment.mannequin.ease import ease_from
from warpflat.garment.mannequin.form_seams import FormSeam, find_seams
from warpflat.garment.mannequin.layout import RING_LEVELS
from warpflat.garment.mannequin.neckline import Neckline, widen_neck
from warpflat.garment.mannequin.outside import push_outside
from warpflat.garment.mannequin.pieces import FormPiece, cut_pieces
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.sleeves import (
    RAGLAN_LINES,
    SET_IN,
    SLEEVE_CUTS,
    SleeveCut,
    drop_shoulders,
    recut_sleeves,
    slide_raglan,
    straighten_hems,
)

if TYPE_CHECKING:
    from warpflat.garment.mannequin.layout import Layout

__all__ = ["Form", "FormResult", "PieceRecipe", "form_from_mapping", "form_names", "realise", "shipped_form"]

# Cloth around a level that is this much [m] longer than asked for hangs from above.
_HANGS = 0.002


@dataclass(frozen=True, kw_only=True)
class PieceRecipe:
    """One piece of a form.

    Attributes:
        bricks: patterns as ``shoulder-waist/front-*``; the piece is their union.
        datum: the feature line from which the piece is first developed; it becomes the grain.
        open: feature lines along which the piece is cut although both sides belong to it, as a sleeve's underarm.
    """

    bricks: tuple[str, ...]
    datum: str = ""
    open: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Form:
    """A garment on the mannequin.

    Attributes:
        name: of the form.
        pieces: recipes by piece name.
        profiles: adjustments of the body's profiles, by level.
        ruled: pairs of levels (upper, lower) between which the cloth hangs in straight lines.
        bridged: pairs of levels of the trunk between which it bridges hollows, as the small of the back.
        blend: another form and its weight from 0 to 1: the surface between this form's and the other's.
        darts: slits in its pieces.
        ease: by level, how much more than around the body a tape reads around the garment [cm]; negative for knits.
        neckline: wider than the base of the neck; None lies on it.
        sleeve: how its sleeves are cut; the pieces are cut so already.

    Raises:
        InputError: a piece's name that cannot name a file, or two that would be one file on some system.
    """

    name: str
    pieces: Mapping[str, PieceRecipe]
    profiles: Mapping[str, Adjustment] = field(default_factory=dict)
    ruled: tuple[tuple[str, str], ...] = ()
    bridged: tuple[tuple[str, str], ...] = ()
    blend: tuple[Form, float] | None = None
    darts: tuple[FormDart, ...] = ()
    ease: Mapping[str, float] = field(default_factory=dict)
    neckline: Neckline | None = None
    sleeve: SleeveCut = SET_IN

    def __post_init__(self) -> None:
        files: dict[str, str] = {}
        for piece in self.pieces:
            try:
                check_file_name(piece)
            except InputError as error:
                raise InputError(f"form {self.name}: pieces: {error}") from None
            other = files.setdefault(same_file(piece), piece)
            if other != piece:
                raise InputError(
                    f"form {self.name}: pieces: {other!r} and {piece!r} would be one file on Windows and macOS; rename one"
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class FormResult:
    """A form on one body.

    Attributes:
        name: the form's.
        vertices: the mannequin's vertices moved to the form, #V by 3 [m]; its layout holds for them.
        pieces: by name; each is one disk.
        seams: between edges that are the same curve in space.
        darts: of the pieces on both sides of the body.
        ease: by level, what it asks for [cm]; without levels that have another one's outline or lie between ruled or bridged ones.
        recipe, body, half: what it was built from.
        notes: what was changed for this body, one sentence each.
        layout: the mannequin's.
        bricks: of the recipe's pieces by name, on both sides of the body.
    """

    __repr__ = short_repr

    name: str
    recipe: Form
    body: FloatArray
    half: bool
    vertices: FloatArray
    pieces: Mapping[str, FormPiece]
    seams: tuple[FormSeam, ...]
    darts: tuple[PlacedDart, ...] = ()
    ease: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    layout: Layout = field(repr=False)
    bricks: Mapping[str, Sequence[str]] = field(repr=False)

    def sewn_darts(self) -> list[tuple[PlacedDart, tuple[IntArray, IntArray]]]:
        """Return the darts that the pieces have, each with its legs; half pieces have those on the left."""
        legs = {name: piece.legs() for name, piece in self.pieces.items()}
        return [(dart, legs[dart.piece][dart.name]) for dart in self.darts if dart.name in legs.get(dart.piece, {})]

    def seam_of_edges(self) -> dict[tuple[str, str], str]:
        """Return the seams of the edges that are sewn, by piece and edge."""
        runs = [(seam, run.edges) for seam in self.seams for run in seam.runs]
        return {place: seam.name for seam, edges in runs for place in zip(seam.pieces, edges, strict=True)}

    def usual_darts(self) -> tuple[FormDart, ...]:
        """Return every dart that a book knows in the pieces, once a side: those of the block, and from the shoulders."""
        found = list(standard_darts(self.layout, self.bricks))
        for piece in self.bricks:
            for face in ("front", "back"):
                dart = FormDart(name="shoulder dart", piece=piece, line=f"princess {face} left", at="shoulder left")
                try:
                    self.dart_rows(dart)
                except InputError:
                    continue
                found.append(dart)
        return tuple(found)

    def dart_rows(self, dart: FormDart) -> list[tuple[str, IntArray]]:
        """Return the mannequin's vertices that a dart, or a cut along a whole line, slits on both sides of the body, and in which piece.

        Raises:
            InputError: it does not fit the piece.
        """
        if not dart.parts_piece:
            placed = place_darts(self.layout, self.vertices, self.bricks, [dart])
            return [(each.piece, each.row) for each in placed]
        run = longest_run(grid_line(self.layout, dart), cloth_of(self.layout, self.bricks[dart.piece]))
        row = np.array(run, dtype=np.int32)
        image = self.layout.mirror[row]
        return [(dart.piece, row), *([] if np.array_equal(np.sort(image), np.sort(row)) else [(dart.piece, image)])]

    def dart_along(self, piece: str, row: IntArray, name: str) -> FormDart | None:
        """Return the dart, or the cut along a whole line, of a name that slits a row of vertices of a piece; None if no line runs there.

        Args:
            piece: its name.
            row: the mannequin's vertices, from the border.
            name: for the dart.
        """
        cloth, ids, mirror = cloth_of(self.layout, self.bricks[piece]), row.tolist(), self.layout.mirror
        for wanted in (mirror[row].tolist(), ids) if not lies_left(self.layout, row) else (ids,):
            for line, vertices in self.layout.lines.items():
                run = longest_run(vertices.tolist(), cloth)
                for end, directed in ((0.0, run), (1.0, run[::-1])):
                    if directed[: len(wanted)] != wanted:
                        continue
                    if len(wanted) == len(directed):
                        return FormDart(name=name, piece=piece, line=line, part=(0.0, 1.0))
                    arc = arc_lengths(self.vertices[directed])
                    share = round(float(arc[len(wanted) - 1] / arc[-1]), 3)
                    return FormDart(name=name, piece=piece, line=line, part=(end, abs(end - share)))
        return None

    def dart_part(self, dart: PlacedDart) -> tuple[float, float]:
        """Return the shares of its line's length within the piece between which a dart lies; see `FormDart.part`."""
        line, row = grid_line(self.layout, dart.asked), dart.row.tolist()
        if row[0] not in line:  # the mirror image of what was asked for
            line = self.layout.mirror[line].tolist()
        run = longest_run(line, cloth_of(self.layout, self.bricks[dart.piece]))
        arc = arc_lengths(self.vertices[run])
        first, last = (float(arc[run.index(vertex)] / arc[-1]) for vertex in (row[0], row[-1]))
        return first, last

    def differs_by_darts(self, body: FloatArray, form: Form, half: bool) -> bool:
        """Return whether another form on a body is this one with other darts, if any."""
        return body is self.body and half == self.half and replace(form, darts=self.recipe.darts) == self.recipe

    def has_rows(self, piece: str, rows: Mapping[str, Mapping[str, IntArray]]) -> bool:
        """Return whether darts run along the same vertices of a piece here."""
        placed, other = _rows_of(self.darts).get(piece, {}), rows.get(piece, {})
        return placed.keys() == other.keys() and all(np.array_equal(placed[name], other[name]) for name in placed)


@functools.cache
def _shipped() -> dict[str, Any]:
    with resources.as_file(resources.files("warpflat.garment.mannequin") / "data/forms.toml") as path:
        return read_toml(path)


def form_names() -> list[str]:
    """Return the names of the forms that ship with the package."""
    return list(_shipped())


def shipped_form(name: str) -> Form:
    """Return a form of ``data/forms.toml``.

    Raises:
        InputError: if there is none of that name.
    """
    if name not in _shipped():
        raise InputError(f"form {quote_value(name)} is unknown: {nearest(name, form_names())}")
    return form_from_mapping(name, _shipped()[name])


def form_from_mapping(name: str, data: Mapping[str, Any]) -> Form:
    """Make a form from a scene file's table.

    Args:
        name: of the form.
        data: keys ``pieces`` (by name, which names a file, too: ``bricks``, ``datum``, ``open``), ``profiles`` (by level, see
            :class:`Adjustment`), ``ruled`` (pairs of levels), ``blend`` (``with``: a form's name, ``weight``), ``ease`` (see
            :func:`ease_from`), ``neckline`` (see :class:`Neckline`), ``sleeve`` (see :class:`SleeveCut`), ``like`` (a shipped
            form, taken over where this one gives nothing).

    Raises:
        InputError: for an unknown key, a value of the wrong kind, or a piece's name that cannot name a file.
    """
    where = f"form {name}"
    _check_keys(data, {"pieces", "profiles", "ruled", "blend", "like", "ease", "neckline", "sleeve"}, where)
    base = shipped_form(str(data["like"])) if "like" in data else None
    pieces = {}
    for piece, recipe in _table(data.get("pieces", {}), f"{where}: pieces").items():
        _check_keys(_table(recipe, f"{where}: piece {piece}"), {"bricks", "datum", "open"}, f"{where}: piece {piece}")
        bricks = _strings(recipe.get("bricks"), f"{where}: piece {piece}: bricks")
        if not bricks:
            raise InputError(f"{where}: piece {piece}: bricks is empty; name at least one, as waist-hip/front-*")
        pieces[piece] = PieceRecipe(
            bricks=bricks, datum=str(recipe.get("datum", "")),
            open=_strings(recipe.get("open", []), f"{where}: piece {piece}: open"),
        )  # fmt: skip
    if base and "pieces" not in data:
        pieces = dict(base.pieces)
    if not pieces:
        raise InputError(f"{where}: pieces is missing; give at least one [pieces.NAME] with its bricks")
    profiles = dict(base.profiles) if base else {}
    known = {f.name for f in fields(Adjustment)}
    for level, values in _table(data.get("profiles", {}), f"{where}: profiles").items():
        _check_keys(_table(values, f"{where}: profile {level}"), known, f"{where}: profile {level}")
        at, ranges = f"{where}: profile {level}", Adjustment.ranges()
        numbers = {k: _number(v, f"{at}: {k}", *ranges[k]) for k, v in values.items() if k in ranges}
        bridge = values.get("bridge", False)
        if not isinstance(bridge, bool):
            raise InputError(f"{at}: bridge = {quote_value(bridge)}: true or false is needed")
        like = str(values["like"]) if "like" in values else None
        profiles[level] = Adjustment(like=like, bridge=bridge, **numbers)
    pairs = data.get("ruled", [])
    if not isinstance(pairs, (list, tuple)):
        raise InputError(
            f"{where}: ruled = {quote_value(pairs)}: a list of pairs of levels is needed, as [['hip', 'knee']]"
        )
    ruled = list(base.ruled) if base else []
    for pair in pairs:
        levels = _strings(pair, f"{where}: ruled")
        if len(levels) != 2:
            raise InputError(f"{where}: ruled: each entry is a pair of levels, as ['hip', 'knee']; got {list(levels)}")
        ruled.append((levels[0], levels[1]))
    blend = base.blend if base else None
    if "blend" in data:
        mix = _table(data["blend"], f"{where}: blend")
        _check_keys(mix, {"with", "weight"}, f"{where}: blend")
        if "with" not in mix:
            raise InputError(f"{where}: blend: with is missing; name a form: {', '.join(form_names())}")
        weight = _number(mix.get("weight", 0.5), f"{where}: blend: weight", 0.0, 1.0)
        blend = (shipped_form(str(mix["with"])), weight)
    ease = ease_from(data.get("ease", {}), where, base=base.ease if base else {})
    neckline = base.neckline if base else None
    if "neckline" in data:
        values, ranges = _table(data["neckline"], f"{where}: neckline"), Neckline.ranges()
        _check_keys(values, set(ranges), f"{where}: neckline")
        neckline = Neckline(**{k: _number(v, f"{where}: neckline: {k}", *ranges[k]) for k, v in values.items()})
    sleeve = SET_IN if base is None else base.sleeve
    if "sleeve" in data:
        values = _table(data["sleeve"], f"{where}: sleeve")
        _check_keys(values, {"cut", "front_cm", "back_cm", "drop_cm"}, f"{where}: sleeve")
        if values.get("cut") not in SLEEVE_CUTS:
            cuts = ", ".join(SLEEVE_CUTS)
            raise InputError(f"{where}: sleeve: cut = {quote_value(values.get('cut'))}: one of {cuts} is needed")
        depths = {k: _number(v, f"{where}: sleeve: {k}", 0.5, 30.0) for k, v in values.items() if k != "cut"}
        for key in depths:
            if values["cut"] != ("dropped" if key == "drop_cm" else "raglan"):
                raise InputError(
                    f"{where}: sleeve: {key} belongs to a {'dropped' if key == 'drop_cm' else 'raglan'} sleeve"
                )
        sleeve = SleeveCut(cut=str(values["cut"]), **depths)
        try:
            cut = recut_sleeves({piece: (each.bricks, each.open) for piece, each in pieces.items()}, sleeve.cut)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        pieces = {piece: replace(pieces[piece], bricks=bricks, open=opened) for piece, (bricks, opened) in cut.items()}
    return Form(
        name=name, pieces=pieces, profiles=profiles, ruled=tuple(ruled), blend=blend, ease=ease, neckline=neckline,
        sleeve=sleeve,
    )  # fmt: skip


def realise(
    layout: Layout, vertices: FloatArray, form: Form, *, half: bool = False, before: FormResult | None = None
) -> FormResult:
    """Build a form's surface on a body and cut it into its pieces.

    Args:
        layout: the mannequin's.
        vertices: #V by 3, the mannequin's [m].
        form: the garment.
        half: symmetric pieces as their left half, on the fold.
        before: of the same layout; where it differs by darts only, its surface is taken, and its pieces whose darts are the same.

    Raises:
        InputError: for an unknown brick, line or level, or a piece that is not one disk.
    """
    body = vertices
    if before is not None and not before.differs_by_darts(body, form, half):
        before = None
    bricks = {name: select_bricks(layout, recipe.bricks) for name, recipe in form.pieces.items()}
    if before is None:
        faces = layout.faces_of([brick for chosen in bricks.values() for brick in chosen])
        vertices = _surface(layout, body, form, np.unique(layout.faces[faces]), form.neckline)
        if form.sleeve.cut == "raglan":
            vertices = slide_raglan(layout, vertices, form.sleeve)
        elif form.sleeve.cut == "dropped":
            vertices = drop_shoulders(layout, vertices, form.sleeve)
        vertices = straighten_hems(layout, vertices, {name: (bricks[name], r.open) for name, r in form.pieces.items()})
    else:
        vertices = before.vertices
    recipes = {name: (r.bricks, r.datum, r.open) for name, r in form.pieces.items()}
    placed: tuple[PlacedDart, ...] = ()
    if form.darts:
        opened = {name: recipe.open for name, recipe in form.pieces.items()}
        placed = place_darts(layout, vertices, bricks, form.darts, opened)
    rows = _rows_of(placed)
    known = (
        {} if before is None else {name: before.pieces[name] for name in before.pieces if before.has_rows(name, rows)}
    )
    continued = RAGLAN_LINES if form.sleeve.cut == "raglan" else {}
    pieces = cut_pieces(layout, vertices, recipes, darts=rows, half=half, known=known, continued=continued)
    # A level of the trunk with an outline of its own, neither ruled nor bridged, gets the ease that is asked of it; cloth that hangs
    # from a belly has more.
    spans = [
        sorted(map(RING_LEVELS.index, pair)) for pair in (*form.ruled, *_bridged(form)) if set(pair) <= set(RING_LEVELS)
    ]
    waist = RING_LEVELS.index("waist")
    alike = {level for level, change in form.profiles.items() if change.like is not None}
    ease: dict[str, float] = {}
    for level, cm in form.ease.items():
        at = RING_LEVELS.index(level) if level in RING_LEVELS and level not in alike else None
        if at is None or any(low < at < high for low, high in spans):
            continue
        row = layout.rings[layout.level_row[level]]
        may_hang = at < waist and any(low <= at and high < waist for low, high in spans)
        if not may_hang or convex_girth(vertices[row]) <= convex_girth(body[row]) + 0.01 * cm + _HANGS:
            ease[level] = cm
    return FormResult(
        name=form.name, recipe=form, body=body, half=half,
        vertices=vertices, pieces=pieces, seams=find_seams(pieces), darts=placed, ease=ease, layout=layout, bricks=bricks,
    )  # fmt: skip


def _rows_of(placed: Sequence[PlacedDart]) -> dict[str, dict[str, IntArray]]:
    """Return the vertices along each dart, by piece and dart."""
    rows: dict[str, dict[str, IntArray]] = {}
    for dart in placed:
        rows.setdefault(dart.piece, {})[dart.name] = dart.row
    return rows


def _bridged(form: Form) -> tuple[tuple[str, str], ...]:
    """Return the levels between which the form bridges hollows; one that is tighter than its body bridges none."""
    return () if is_tight(form.profiles, form.ease) else form.bridged


def _surface(
    layout: Layout, body: FloatArray, form: Form, used: IntArray, neckline: Neckline | None = None
) -> FloatArray:
    """Return the body's vertices moved to the form; the vertices `used` lie outside the body, unless the form is tighter than it."""
    vertices = adjusted_vertices(layout, body, form.profiles, form.ruled, form.ease, _bridged(form))
    tight = is_tight(form.profiles, form.ease)
    if form.blend is not None:
        other, weight = form.blend
        vertices = (1.0 - weight) * vertices + weight * _surface(layout, body, other, used)
        tight = tight or is_tight(other.profiles, other.ease)
    if neckline is not None:
        # It moves vertices within the form's faces, which are chords of the body's hollows.
        vertices = widen_neck(layout, vertices, neckline)
    return vertices if tight else push_outside(vertices, layout, body, used)


def _number(value: object, where: str, low: float, high: float) -> float:
    if not is_number(value) or not low <= value <= high:
        raise InputError(f"{where} = {quote_value(value)}: a number from {low:g} to {high:g} is needed")
    return float(value)


def _strings(value: object, where: str) -> tuple[str, ...]:
    if isinstance(value, str):
        return (value,)
    if not isinstance(value, (list, tuple)) or not all(isinstance(v, str) for v in value):
        raise InputError(f"{where} = {quote_value(value)}: a list of names is needed")
    return tuple(value)


def _table(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{where} = {quote_value(value)}: a table is needed")
    return value


def _check_keys(data: Mapping[str, Any], known: set[str], where: str) -> None:
    for key in data:
        if key not in known:
            raise InputError(f"{where}: key {quote_value(key)} is unknown: {nearest(key, known)}")
