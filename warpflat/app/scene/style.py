"""Style edits: the same keys on every garment of the wardrobe, as a length at a level, ease, a neckline, flare or a closure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from warpflat.app.scene.as_toml import laid_over
from warpflat.core import InputError, nearest
from warpflat.garment import (
    ARM_LEVELS,
    LEG_LEVELS,
    RING_LEVELS,
    TRUNK_LEVELS,
    Form,
    Neckline,
    form_from_mapping,
    shipped_form,
)

__all__ = ["STYLE_KEYS", "covered_bands", "style_options", "with_style"]

#: By key what it sets, in words.
STYLE_KEYS: Mapping[str, str] = {
    "length": "where the hem lies, with how many centimetres lower or higher it is: knee, knee+5, hip-3",
    "sleeve-length": "where a sleeve ends, the same way",
    "sleeve-width": "ease of a sleeve from the biceps to its end [cm]",
    "flare": "how much wider its hem is than without [cm]; negative for narrower",
    "neck-depth": "how deep the neckline is in front, below the base of the neck [cm]",
    "neck-width": "how far it lies outside of the base of the neck, along the shoulders [cm]",
    "closure": "how it opens: none, or zip or buttons at the front, back or side, as zip-back",
    "hem-LINE": "how much higher the hem lies where a line meets it than elsewhere, as hem-side-left 20 [cm]",
    "ease-LEVEL": "ease at a level of its own, as ease-bust 12 [cm]",
}
_PARTS = {"trunk": TRUNK_LEVELS, "arm": ARM_LEVELS, "leg": LEG_LEVELS}
# A part that is sewn below the body's pieces and is wider than this [mm] is their skirt: its width is the length of the garment.
_SKIRT = 300.0
# Length of a zip in a neck, or below a waist, that need not open all of it [mm].
_LONG_ZIP, _SHORT_ZIP = 560, 180
_LINES = {
    "trunk": {"front": "centre front", "back": "centre back", "side": "side left"},
    "leg": {"front": "crotch front", "back": "crotch back", "side": "outseam left"},
}
# Lines that meet a hem, by the part of the body.
_HEM_LINES = {"trunk": ("side left", "side right", "centre front", "centre back"), "leg": ("outseam", "inseam")}


def covered_bands(tables: Mapping[str, Any]) -> set[tuple[str, str]]:
    """Return the upper and the lower level of each part of the body that a garment covers."""
    form = _form(tables)
    return {(upper, lower) for part in _PARTS for _, upper, lower in _bands(form, part)}


def style_options(tables: Mapping[str, Any]) -> dict[str, str]:
    """Return the style keys that make sense on a garment, each with what can be given, in words.

    Args:
        tables: of its scene.
    """
    form, found = _form(tables), dict[str, str]()
    # Edges to which a skirt of its own is sewn.
    skirted = {
        wish.get("edge")
        for wish in tables.get("finishing", ())
        if wish["kind"] in ("flounce", "ruffle") and wish.get("width_mm", 0.0) > _SKIRT
    }
    for key, part in (("length", _body_part(form)), ("sleeve-length", "arm")):
        hem = _hem(form, part)
        if hem and not (key == "length" and _line_of(hem, part) in skirted):
            found[key] = ", ".join(_line_of(level, part) for level in _lengths(form, part))
    if _hem(form, "arm"):
        found["sleeve-width"] = "cm"
    if "length" in found:
        found["flare"] = "cm"
        found["hem-LINE"] = "cm, at " + ", ".join(_HEM_LINES[_body_part(form)])
    if _has_neck(form):
        found |= {f"neck-{what}": "cm" for what in ("depth", "width")}
    names = " ".join(form.pieces)
    places = [where for where in ("front", "back") if where in names]
    places += [] if "leg_left" in form.pieces else ["side"]
    kinds = [f"{kind}-{where}" for kind in ("zip", "buttons") for where in places]
    found["closure"] = ", ".join(
        [kind for kind in kinds if kind.endswith("front")] if _opens_in_front(tables) else ["none", *kinds]
    )
    found["ease-LEVEL"] = "cm, at " + ", ".join(_line_of(level, _part_of(level)) for level in _eased(form))
    return found


def with_style(tables: Mapping[str, Any], style: Mapping[str, str], garment: str) -> dict[str, Any]:
    """Return the tables of a scene with style edits.

    Args:
        tables: of a garment's scene.
        style: texts by key, see `STYLE_KEYS`.
        garment: its name, for messages.

    Raises:
        InputError: an unknown key or value (gives the nearest), or one that makes no sense on this garment.
    """
    found = dict(tables)
    try:
        _form(found)
    except InputError as error:
        raise InputError(f"{garment}: these choices do not go together: {error}") from None
    # Other edits are of the lowest edge, which a length moves.
    for key, text in sorted(style.items(), key=lambda edit: edit[0] not in ("length", "sleeve-length")):
        known = style_options(found)
        if key.startswith("ease-"):
            eased = {_line_of(level, _part_of(level)): level for level in _eased(_form(found))}
            name = key.removeprefix("ease-")
            if name not in eased:
                raise InputError(f"--{key} makes no sense on a {garment}: {nearest(name, eased)}")
            found = laid_over(found, {"ease": {eased[name]: _number(key, text, -30.0, 100.0)}})
            continue
        if key.startswith("hem-"):
            if "hem-LINE" not in known:
                raise InputError(f"--{key} makes no sense on a {garment}: {_why_not(found, key)}")
            part = _body_part(_form(found))
            line, edge = key.removeprefix("hem-").replace("-", " "), _line_of(_hem(_form(found), part), part)
            if line not in _HEM_LINES[part]:
                raise InputError(f"--{key} makes no sense on a {garment}: {nearest(line, _HEM_LINES[part])}")
            wishes = [*found.get("finishing", ())]
            risen = next((wish for wish in wishes if wish["kind"] == "hem" and wish["edge"] == edge), None)
            # The other lines stay where they are, until they are named.
            rises = dict.fromkeys(_HEM_LINES[part], 0.0) if risen is None else dict(risen["shorten_mm"])
            rises[line] = 10.0 * _number(key, text, 0.0, 80.0)
            kept = [wish for wish in wishes if wish is not risen]
            found = {**found, "finishing": [*kept, {"kind": "hem", "edge": edge, "shorten_mm": rises}]}
            continue
        if key not in STYLE_KEYS:
            raise InputError(f"a {garment} has no choice {key!r}: {nearest(key, known)}")
        if key not in known:
            raise InputError(f"--{key} makes no sense on a {garment}: {_why_not(found, key)}")
        if key in ("length", "sleeve-length"):
            found = _with_length(found, key, text)
        elif key in ("neck-depth", "neck-width"):
            which = "front_cm" if key == "neck-depth" else "side_cm"
            # What is given takes the place of a share, too; those that nobody has given are left out.
            own = {**asdict(_form(found).neckline or Neckline()), which: _number(key, text, *Neckline.ranges()[which])}
            replaced = which.replace("cm", "share")
            values = {
                each: 0.0 if each == replaced else value for each, value in own.items() if value or each[-5:] != "share"
            }
            found = _with_form(found, {"neckline": values})
        elif key == "closure":
            found = _with_closure(found, text, garment)
        else:
            form = _form(found)
            part = "arm" if key == "sleeve-width" else _body_part(form)
            cm = _number(key, text, -30.0, 200.0)
            if key == "flare":
                level = _hem(form, part)
                found = laid_over(found, {"ease": {level: _ease(found).get(level, 0.0) + cm}})
            else:
                levels = ARM_LEVELS[1 : ARM_LEVELS.index(_hem(form, part)) + 1]
                found = laid_over(found, {"ease": dict.fromkeys(levels, cm)})
    return found


def _form(tables: Mapping[str, Any]) -> Form:
    form = tables["form"]
    return shipped_form(form) if isinstance(form, str) else form_from_mapping("own", form)


def _with_form(tables: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables whose form has some keys more; a form that is just named becomes one that is like it."""
    form = tables["form"]
    return {**tables, "form": laid_over({"like": form} if isinstance(form, str) else form, values)}


def _ease(tables: Mapping[str, Any]) -> dict[str, float]:
    own = tables.get("ease", {})
    return {**_form(tables).ease, **(own if isinstance(own, Mapping) else {})}


def _bands(form: Form, part: str) -> Iterator[tuple[str, str, str]]:
    """Yield piece, upper and lower level of its bricks that lie on a part of the body."""
    for name, recipe in form.pieces.items():
        for pattern in recipe.bricks:
            upper, _, lower = pattern.partition("/")[0].partition("-")
            if upper in _PARTS[part] and lower in _PARTS[part]:
                yield name, upper, lower


def _body_part(form: Form) -> str:
    return "leg" if any(_bands(form, "leg")) else "trunk"


def _hem(form: Form, part: str) -> str:
    """Return the lowest level of a part of a form, "" where it has none of it."""
    lowest = [_PARTS[part].index(lower) for _, _, lower in _bands(form, part)]
    return _PARTS[part][max(lowest)] if lowest else ""


def _lengths(form: Form, part: str) -> list[str]:
    """Return the levels at which a part may end."""
    # Above the last seam across nothing can end.
    last = max(_PARTS[part].index(upper) for _, upper, lower in _bands(form, part) if lower == _hem(form, part))
    if part == "trunk":
        last = max(last, TRUNK_LEVELS.index("bust"))
    return list(_PARTS[part][last + 1 :])


def _line_of(level: str, part: str) -> str:
    return level.removeprefix("leg_") if part == "leg" else level


def _part_of(level: str) -> str:
    return next(part for part, levels in _PARTS.items() if level in levels)


def _has_neck(form: Form) -> bool:
    return any(upper in ("shoulder", "neck") for _, upper, _ in _bands(form, "trunk")) or any(
        pattern.startswith("neck-") for recipe in form.pieces.values() for pattern in recipe.bricks
    )


def _eased(form: Form) -> list[str]:
    """Return the levels that a form covers and that can have ease."""
    can = {"trunk": RING_LEVELS, "arm": ARM_LEVELS[1:], "leg": LEG_LEVELS[1:]}
    found = list[str]()
    for part, levels in _PARTS.items():
        if uppers := [levels.index(upper) for _, upper, _ in _bands(form, part)]:
            covered = levels[min(uppers) : levels.index(_hem(form, part)) + 1]
            found += [level for level in covered if level in can[part]]
    return found


def _opens_in_front(tables: Mapping[str, Any]) -> bool:
    """Return whether a garment has a collar that needs an opening in front."""
    return any(
        wish["kind"] == "collar"
        and wish.get("style", "stand") in ("stand", "shirt", "convertible")
        and not wish.get("placket_mm")
        for wish in tables.get("finishing", ())
    )


def _why_not(tables: Mapping[str, Any], key: str) -> str:
    if key.startswith("sleeve"):
        return "it has no sleeves"
    if key.startswith("neck"):
        return "it has no neckline"
    return "its length is that of the part sewn to its lower edge, width_mm in [[finishing]] of the scene"


def _number(key: str, text: str, low: float, high: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise InputError(f"--{key} {text}: a number from {low:g} to {high:g} [cm] is needed")
    return value


def _with_length(tables: dict[str, Any], key: str, text: str) -> dict[str, Any]:
    form = _form(tables)
    part = "arm" if key == "sleeve-length" else _body_part(form)
    old, levels = _hem(form, part), {_line_of(level, part): level for level in _lengths(form, part)}
    sign = "+" if "+" in text else "-"
    name, _, more = text.partition(sign)
    if name not in levels:
        raise InputError(f"--{key} {text}: {name!r} is no level at which it can end: {nearest(name, levels)}")
    new, longer = levels[name], (_number(key, more, 0.0, 30.0) if more else 0.0) * (1.0 if sign == "+" else -1.0)
    pieces: dict[str, Any] = {}
    for piece, recipe in form.pieces.items():
        bricks = []
        for pattern in recipe.bricks:
            band, _, column = pattern.partition("/")
            upper, _, lower = band.partition("-")
            bricks.append(f"{upper}-{new}/{column}" if upper in _PARTS[part] and lower == old else pattern)
        pieces[piece] = {"bricks": bricks, "datum": recipe.datum} | ({"open": list(recipe.open)} if recipe.open else {})
    values: dict[str, Any] = {"pieces": pieces}
    levels_of = _PARTS[part]
    if (
        part == "trunk"
        and levels_of.index(new) > levels_of.index("hip")
        and levels_of.index(new) > levels_of.index(old)
    ):
        # Below the hip it hangs, as wide as it was at its hem.
        scale = form.profiles[old].scale if old in form.profiles else 1.0
        values |= {"ruled": [*(list(pair) for pair in form.ruled), ["hip", new]]}
        values["profiles"] = {new: {"like": "hip", "scale": scale}}
        tables = laid_over(tables, {"ease": {new: _ease(tables).get("hip", 0.0)}} if scale == 1.0 else {})
    elif part == "leg" and new != old:
        values["ruled"] = [["leg_thigh", new] if pair[-1] == old else list(pair) for pair in form.ruled]
        if levels_of.index(new) < levels_of.index(old) or new not in form.ease:
            tables = laid_over(tables, {"ease": {new: _ease(tables).get("leg_thigh", 0.0)}})
    elif part == "arm":
        # Down to its new hem it is nowhere narrower than between levels that have ease.
        covered = [level for level in ARM_LEVELS[1 : ARM_LEVELS.index(new)] if level not in _ease(tables)]
        covered += [new] if new not in form.ease else []
        tables = laid_over(tables, {"ease": dict.fromkeys(covered, _ease(tables).get("biceps", 0.0))})
    if longer:
        values["profiles"] = laid_over(values.get("profiles", {}), {new: {"raise_cm": -longer}})
    found = _with_form(tables, values)
    if "ruled" in values and "like" in found["form"]:
        # What the form is like brings its own.
        own = shipped_form(found["form"]["like"]).ruled
        found["form"]["ruled"] = [pair for pair in values["ruled"] if tuple(pair) not in own]
    ends = {_line_of(old, part): _line_of(new, part)}
    wishes = [{**wish, "edge": ends.get(wish["edge"], wish["edge"])} for wish in tables.get("finishing", ())]
    return {**found, "finishing": wishes} if wishes else found


def _with_closure(tables: dict[str, Any], text: str, garment: str) -> dict[str, Any]:
    form = _form(tables)
    kind, _, where = text.partition("-")
    known = style_options(tables)["closure"].split(", ")
    if text not in known:
        if _opens_in_front(tables) and (text == "none" or where in ("back", "side")):
            raise InputError(f"--closure {text} makes no sense on a {garment} with this collar, which opens in front")
        raise InputError(f"--closure {text} is unknown on a {garment}: {nearest(text, known)}")
    kept = [each for each in tables.get("openings", ()) if each["kind"] not in ("zip", "buttons")]
    if text != "none":
        opening: dict[str, Any] = {"kind": kind, "seam": _LINES[_body_part(form)][where]}
        neck = _has_neck(form)
        # In front, and where a garment ends above the hip, it opens all along; not down to the crotch of a suit.
        above = where == "front" or _hem(form, "trunk") in ("waist", "abdomen", "hip")
        if _body_part(form) == "leg" or (kind == "zip" and not (neck and above)):
            opening["length_mm"] = _LONG_ZIP if neck and where != "side" else _SHORT_ZIP
        in_seam = [each for each in tables.get("pockets", ()) if each.get("seam") == opening["seam"]]
        if any(each["kind"] == "hip" or each.get("below_mm", 0.0) < opening["length_mm"] for each in in_seam):
            raise InputError(
                f"--closure {text} lies where a {garment} with these choices has its pockets; take another side"
            )
        kept.append(opening)
        if kind == "zip" and "length_mm" not in opening and where != "side":
            straight = {"line": opening["seam"], "straight": "warp"}
            others = [each for each in tables.get("constraints", ()) if each != straight]
            tables = {**tables, "constraints": [*others, straight]}
    found = {**tables, "openings": kept}
    if not kept:
        found.pop("openings")
    return found
