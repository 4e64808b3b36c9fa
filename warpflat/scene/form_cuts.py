"""Cuts of a scene's form: from tables `[[cuts]]` to darts and seams of its pieces, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from warpflat.core.errors import InputError
from warpflat.mannequin.darts import FormDart
from warpflat.mannequin.forms import Form
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.part_pieces import part_pieces, taken_over
from warpflat.scene.cut_tables import CutTable
from warpflat.scene.load import Scene, make_scene

__all__ = ["cut_form", "cut_of_dart", "cuts_beside", "place_of", "scene_with"]


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
    if not whole.parts_piece:
        return [dict(cut) for cut in cuts]
    gone = {dart.place for dart in taken_over(mannequin.layout, mannequin.vertices, form, [whole])}
    return [dict(cut) for cut in cuts if cut.get("omit") or place_of(cut) not in gone]


def place_of(cut: Mapping[str, Any]) -> tuple[str | None, ...]:
    """Return where a table puts its dart; see `FormDart.place`."""
    return tuple(cut.get(key) for key in ("piece", "line", "towards", "at"))


def _dart(table: CutTable) -> FormDart:
    return FormDart(
        name=table.name or f"{table.line}".removesuffix(" left").removesuffix(" right"),
        piece=table.piece or "",
        line=table.line or "",
        at=table.at,
        towards=table.towards,
        between=table.between,
        part=None if table.part is None else (table.part[0], table.part[1]),
        tip_mm=table.tip_mm,
        mirrored=table.mirrored,
        mouth_mm=table.mouth_mm,
        like=table.like,
        pleat_mm=table.pleat_mm,
    )


def cut_of_dart(dart: FormDart) -> dict[str, Any]:
    """Return the table of `[[cuts]]` that asks for a dart; what is the default anyway is left out."""
    keys: dict[str, Any] = {"name": dart.name, "piece": dart.piece, "line": dart.line}
    for key in ("at", "towards", "tip_mm", "mouth_mm", "like", "pleat_mm"):
        if getattr(dart, key) is not None:
            keys[key] = getattr(dart, key)
    if dart.towards is not None:
        keys["between"] = dart.between
    if dart.part is not None:
        keys["part"] = list(dart.part)
    if not dart.mirrored:
        keys["mirrored"] = False
    return keys


def scene_with(scene: Scene, **tables: Any) -> Scene:
    """Return a scene with some of its tables replaced; None leaves one out.

    Raises:
        InputError: as :func:`warpflat.scene.load.make_scene`.
    """
    data = scene.settings.model_dump(exclude_unset=True, by_alias=True) | tables
    kept = {key: value for key, value in data.items() if value is not None}
    made = make_scene(kept, name=scene.name, folder=scene.folder, where=scene.where)
    return replace(made, name=scene.name, sources=scene.sources)
