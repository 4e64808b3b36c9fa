"""Write the scene reference `docs/scene.md` and the JSON schemas in `schemas/` from the package's own models.

python docs/make_reference.py
python docs/make_reference.py --check METRICS.json ...    check metrics files against their schema
"""

from __future__ import annotations

import ast
import inspect
import json
import sys
import textwrap
import types
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Union, get_args, get_origin

from metrics_models import Metrics
from pydantic import BaseModel, create_model
from pydantic.fields import FieldInfo

import warpflat
from warpflat.app.scene.first_shapes import PIECES
from warpflat.app.scene.schema import SceneTable
from warpflat.core.toml_file import Table, read_toml
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.shapes import SHAPES
from warpflat.garment.mannequin.blend import Adjustment
from warpflat.garment.mannequin.ease import EASE_PRESETS
from warpflat.pattern.export.pattern_json import PatternEntry

DOCS = Path(__file__).resolve().parent
SCHEMAS = DOCS.parent / "schemas"

# How the tables are headed, in the order of the page.
HEADINGS = {
    "SceneTable": "Top level",
    "FileSurface": "`[surface]` from a file",
    "ShapeSurface": "`[surface]` by formula",
    "LineTable": "`[lines.NAME]`",
    "PlaneTable": "`plane` of a line",
    "BorderTable": "`border` of a line",
    "MannequinTable": "`[mannequin]`",
    "CutTable": "`[[cuts]]`",
    "CutPlane": "`plane` of a cut or a seam",
    "AutoCutTable": "`[auto_cut]`",
    "PieceTable": "`[pieces.NAME]`",
    "SeamTable": "`[[seams]]`",
    "FindSeamsTable": "`[seams]`",
    "SeamCutTable": "`[[seams_cut]]`",
    "ConstraintTable": "`[[constraints]]`",
    "WearTable": "`[wear]`",
    "DrapeTable": "`[drape]`",
    "RelaxTable": "`[relax]`",
    "OutputTable": "`[output]`",
    "PatternTable": "`[pattern]`",
    "MarkerTable": "`[marker]`",
    "PocketTable": "`[[pockets]]`",
    "ClothTable": "`[cloth]`",
    "OpeningTable": "`[[openings]]`",
    "FinishingTable": "`[[finishing]]`",
    "FabricTable": "`[fabric]`",
    "ValueTable": "A fabric's value as a table",
    "CurveTable": "`[fabric.curve_warp]`, `[fabric.curve_weft]`",
    "KesTable": "`[fabric.kes]`",
    "FastTable": "`[fabric.fast]`",
}


@cache
def key_notes() -> dict[str, dict[str, dict[str, Any]]]:
    """Return example, unit and meaning by table and key, as `scene_keys.toml` has them."""
    return read_toml(DOCS / "scene_keys.toml")


def find_tables(model: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """Return a model and all models below it, by name."""
    found: dict[str, type[BaseModel]] = {}
    todo: list[Any] = [model]
    while todo:
        annotation = todo.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            if annotation.__name__ not in found:
                found[annotation.__name__] = annotation
                todo += [field.annotation for field in annotation.model_fields.values()]
        else:
            todo += get_args(annotation)
    return found


def docstrings_of_keys(model: type[BaseModel]) -> dict[str, str]:
    """Return the strings below the fields of a model's source, by field."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        if not issubclass(each, Table) or each is Table:
            continue
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(each))).body[0].body  # type: ignore[attr-defined]
        except OSError:  # made by create_model
            continue
        for field, text in pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                found[ast.unparse(field.target)] = " ".join(str(text.value.value).split())
    return found


def key_of(name: str, field: FieldInfo) -> str:
    """Return a field's key in the file."""
    return field.alias or name


def default_of(model: type[BaseModel], name: str, field: FieldInfo) -> Any:
    """Return a key's default, or None where it has none."""
    if model.__name__ == "RelaxTable":
        return getattr(RelaxOptions(), name)
    return None if field.is_required() else field.get_default(call_default_factory=True, validated_data={})


def validate_example(model: type[BaseModel], name: str, example: Any) -> None:
    """Check an example against its field alone.

    Raises:
        pydantic.ValidationError: it is not valid.
    """
    field = model.model_fields[name]
    alone: Any = create_model("Example", __base__=Table, **{name: (field.annotation, field)})
    alone.model_validate({key_of(name, field): example})


def describe_type(schema: dict[str, Any]) -> str:
    """Return the words for a JSON schema's type and bounds."""
    if "$ref" in schema:
        return "table"
    if "enum" in schema or "const" in schema:
        return " or ".join(f'`"{value}"`' for value in schema.get("enum", [schema.get("const")]))
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(describe_type(each) for each in schema[several]))
    kind = schema.get("type")
    if kind == "array":
        least, most = schema.get("minItems"), schema.get("maxItems")
        count = f" of {least}" if least is not None and least == most else ""
        return f"list{count}: {describe_type(schema['items'])}"
    if kind == "object":
        inner = schema.get("additionalProperties")
        return f"table of {describe_type(inner)}" if isinstance(inner, dict) else "table"
    words = {"number": "number", "integer": "whole number", "boolean": "true or false", "string": "text"}
    return f"{words.get(str(kind), 'any')}{_bounds(schema)}"


def _bounds(schema: dict[str, Any]) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    if "exclusiveMinimum" in schema:
        low = f"above {schema['exclusiveMinimum']:g}"
        return f", {low}" + ("" if high is None else f" to {high:g}")
    if low is None:
        return ""
    return f", from {low:g}" if high is None else f", {low:g} to {high:g}"


def toml_value(value: Any) -> str:
    """Return a value as TOML, in one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, dict):
        inner = ", ".join(f"{k if k.isidentifier() else json.dumps(k)} = {toml_value(v)}" for k, v in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)


def scene_schema() -> dict[str, Any]:
    """Return the JSON schema of a scene, with the meaning, unit and example of every key.

    Raises:
        KeyError: a key has no entry in `scene_keys.toml`.
    """
    schema = plain_schema(SceneTable, "warpflat scene", "A scene file of warpflat, in TOML.")
    tables = find_tables(SceneTable)
    for table, model in tables.items():
        properties = (schema if table == "SceneTable" else schema["$defs"][table])["properties"]
        about = docstrings_of_keys(model)
        for name, field in model.model_fields.items():
            key = key_of(name, field)
            notes = key_notes()[table][key]
            entry = properties[key]
            unit = f" [{notes['unit']}]" if "unit" in notes and f"[{notes['unit']}]" not in about.get(name, "") else ""
            text = about.get(name) or notes["about"]
            entry["description"] = f"{text.rstrip('.')}{unit}." if unit else text
            entry["examples"] = [notes["example"]]
            default = default_of(model, name, field)
            if default is not None and not isinstance(default, BaseModel):
                entry["default"] = default
    return schema


def plain_schema(model: type[BaseModel], title: str, description: str) -> dict[str, Any]:
    """Return a model's JSON schema without the titles and nulls that pydantic adds."""
    schema = _without_noise(model.model_json_schema(by_alias=True))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        **schema,
        "description": description,
    }


def _without_noise(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_without_noise(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {
        key: {name: _without_noise(each) for name, each in value.items()}
        if key in ("properties", "$defs")
        else _without_noise(value)
        for key, value in schema.items()
        if not (key == "title" or (key == "default" and value is None))
    }
    if "default" in schema and schema["default"] is None and "anyOf" in kept:
        # A key that is left out. TOML has no null.
        some = [each for each in kept["anyOf"] if each != {"type": "null"}]
        kept = {**{k: v for k, v in kept.items() if k != "anyOf"}, **(some[0] if len(some) == 1 else {"anyOf": some})}
    return kept


def schemas() -> dict[str, dict[str, Any]]:
    """Return the published JSON schemas by file name."""
    metrics = plain_schema(
        Metrics, "warpflat metrics", "metrics.json, as `run`, `flatten` and `drape` leave it. Later versions add keys."
    )
    pattern = plain_schema(PatternEntry, "warpflat pattern", "pattern.json; lengths in metres, angles in radians.")
    return {
        "scene.schema.json": scene_schema(),
        "metrics.schema.json": metrics,
        "pattern.schema.json": pattern,
    }


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def _table_section(table: str, model: type[BaseModel], schema: dict[str, Any]) -> list[str]:
    lines = [f"## {HEADINGS[table]}", ""]
    if table != "RelaxTable":  # its docstring is that of its base
        lines += [inspect.cleandoc(model.__doc__ or ""), ""]
    lines += [_row("key", "meaning", "type", "default", "example"), "|---|---|---|---|---|"]
    for name, field in model.model_fields.items():
        key = key_of(name, field)
        entry = schema["properties"][key]
        default = "required" if field.is_required() else ""
        if "default" in entry:
            default = f"`{toml_value(entry['default'])}`"
        lines.append(
            _row(
                f"`{key}`",
                entry["description"],
                describe_type(entry),
                default,
                f"`{key} = {toml_value(entry['examples'][0])}`",
            )
        )
    return [*lines, ""]


def _form_section() -> list[str]:
    ranges = Adjustment.ranges()
    lines = [
        "## `[form]` of your own", "",
        inspect.cleandoc(warpflat.form_from_mapping.__doc__ or "").split("\n\n")[0], "",
        _row("key", "meaning", "example"), "|---|---|---|",
        _row("`like`", "A shipped form whose pieces and profiles are taken over.", '`like = "basic_block"`'),
        _row("`pieces.NAME.bricks`", "Patterns of bricks; the piece is their union.", '`bricks = ["waist-knee/front-*"]`'),
        _row("`pieces.NAME.datum`", "The line that becomes the grain.", '`datum = "centre front"`'),
        _row("`pieces.NAME.open`", "Lines along which the piece is cut although both sides belong to it.", '`open = ["underarm left"]`'),
        _row("`profiles.LEVEL`", "What is done to a level, see below.", '`knee = { like = "hip", scale = 1.35 }`'),
        _row("`ruled`", "Pairs of levels between which the cloth hangs straight.", '`ruled = [["hip", "knee"]]`'),
        _row("`blend`", "Another form and its weight.", '`blend = { with = "dress", weight = 0.5 }`'),
        _row("`ease`", "A preset, or ease by level [cm].", "`ease = { bust = 5.0 }`"),
        _row(
            "`neckline`",
            "How far the edge lies from the base of the neck, along shoulder seams and centre lines [cm]; `front_power` is 2 for a round "
            "neckline, 1 for a V, 6 for one that is nearly square. `side_share`, `front_share` and `back_share` add a share of the "
            "shoulder seam, or of the centre line down to the bust, so that it suits every wearer.",
            "`neckline = { side_cm = 2.0, front_cm = 5.0, back_cm = 1.5 }`",
        ),
        _row(
            "`sleeve`",
            "How sleeves are cut: `set-in`, `dropped` (the armhole lies `drop_cm` down the arm), `raglan` (to the neck; `front_cm` and "
            "`back_cm` from the shoulder its seam meets the armhole) or `kimono` (in one with front and back).",
            '`sleeve = { cut = "raglan", front_cm = 9.0, back_cm = 10.0 }`',
        ),
        "", inspect.cleandoc(Adjustment.__doc__ or "").split("\n\n")[0], "",
        _row("key", "meaning", "range", "default"), "|---|---|---|---|",
    ]  # fmt: skip
    defaults = Adjustment()
    about = inspect.cleandoc(Adjustment.__doc__ or "").split("Attributes:\n")[1]
    for line in about.splitlines():
        key, words = line.strip().split(": ", 1)
        default = getattr(defaults, key)
        span = f"{ranges[key][0]:g} to {ranges[key][1]:g}" if key in ranges else ""
        lines.append(_row(f"`{key}`", words, span, "" if default is None else f"`{toml_value(default)}`"))
    return [*lines, ""]


def _lists() -> list[str]:
    lines = ["## Forms", "", _row("form", "pieces", "ease [cm]"), "|---|---|---|"]
    for name in warpflat.form_names():
        form = warpflat.shipped_form(name)
        ease = ", ".join(f"{level} {value:g}" for level, value in form.ease.items())
        lines.append(_row(f"`{name}`", ", ".join(form.pieces), ease))
    levels = list(next(iter(EASE_PRESETS.values())))
    lines += ["", "## Presets of ease", "", _row("preset [cm]", *levels), "|---|" + "---|" * len(levels)]
    lines += [_row(f"`{name}`", *(f"{preset[level]:g}" for level in levels)) for name, preset in EASE_PRESETS.items()]
    lines += ["", "## Shapes", "", _row("shape", "surface", "parameters and defaults"), "|---|---|---|"]
    for name, make in {**SHAPES, **PIECES}.items():
        about = inspect.cleandoc(make.__doc__ or "").split("\n\n")[0]
        parameters = inspect.signature(make).parameters.values()
        lines.append(_row(f"`{name}`", about, ", ".join(f"`{p.name} = {toml_value(p.default)}`" for p in parameters)))
    lines += ["", "## Fabrics", "", _row("fabric", "cloth", "warp [N/m]", "weft [N/m]", "shear [N/m per rad]", "kg/m2"),
              "|---|---|---|---|---|---|"]  # fmt: skip
    for name, fabric in warpflat.load_library().items():
        lines.append(
            _row(
                f"`{name}`",
                fabric.description,
                f"{fabric.stiffness_warp:.4g}",
                f"{fabric.stiffness_weft:.4g}",
                f"{fabric.shear_stiffness:.4g}",
                f"{fabric.areal_density:.3g}",
            )
        )
    lines += ["", "## Sizes", "", ", ".join(f"`{name}`" for name in warpflat.size_names()) + "."]
    return [*lines, ""]


def reference_page() -> str:
    """Return the scene reference as Markdown."""
    schema = scene_schema()
    tables = find_tables(SceneTable)
    lines = [
        "# Scene reference", "",
        "Every table and key of a scene file. Unknown keys are errors. `python docs/make_reference.py` makes this page from the",
        "schema that reads scenes.", "",
        "`schemas/scene.schema.json` holds the same for editors. Put `#:schema ../schemas/scene.schema.json` into the first line of a",
        "scene: an editor with TOML support then completes and checks keys. `metrics.schema.json` and `pattern.schema.json` in the same",
        "folder describe `metrics.json` and `pattern.json`.",
        "",
    ]  # fmt: skip
    for table in HEADINGS:
        lines += _table_section(table, tables[table], schema if table == "SceneTable" else schema["$defs"][table])
        if table == "MannequinTable":
            lines += _form_section()
    return "\n".join([*lines, *_lists()]).rstrip() + "\n"


def files() -> dict[Path, str]:
    """Return the text of every file that this script writes."""
    made = {
        SCHEMAS / name: json.dumps(schema, indent=1, ensure_ascii=False) + "\n" for name, schema in schemas().items()
    }
    return {DOCS / "scene.md": reference_page(), **made}


def unknown_keys(model: Any, data: Any, where: str = "metrics") -> list[str]:
    """Return the keys of data that a model does not name, with their places."""
    while get_origin(model) in (Union, types.UnionType):
        model = next(each for each in get_args(model) if each is not type(None))
    found: list[str] = []
    if isinstance(model, type) and issubclass(model, BaseModel) and isinstance(data, dict):
        known = {key_of(name, field): field.annotation for name, field in model.model_fields.items()}
        for key, value in data.items():
            found += unknown_keys(known[key], value, f"{where}.{key}") if key in known else [f"{where}.{key}"]
    elif get_origin(model) is dict and isinstance(data, dict):
        for key, value in data.items():
            found += unknown_keys(get_args(model)[1], value, f"{where}.{key}")
    elif get_origin(model) is list and isinstance(data, list):
        for number, value in enumerate(data):
            found += unknown_keys(get_args(model)[0], value, f"{where}[{number}]")
    return found


def check_metrics(path: Path) -> list[str]:
    """Check a metrics file against its model; return the keys that the model does not name.

    Raises:
        pydantic.ValidationError: a value is of the wrong kind.
    """
    data = json.loads(path.read_text(encoding="utf-8"))
    Metrics.model_validate(data)
    return unknown_keys(Metrics, data)


def main(arguments: list[str]) -> None:
    """Write the files, or check metrics."""
    if arguments[:1] == ["--check"]:
        unknown = [f"{path}: {key}" for path in arguments[1:] for key in check_metrics(Path(path))]
        sys.exit("\n".join(unknown) or 0)
    SCHEMAS.mkdir(exist_ok=True)
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
