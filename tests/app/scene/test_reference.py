from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from types import ModuleType

import jsonschema
import pytest
import trimesh

import warpflat
from warpflat.app.scene.schema import SceneTable
from warpflat.core.toml_file import read_toml

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def reference() -> ModuleType:
    """The script that makes the scene reference."""
    sys.path.insert(0, str(ROOT / "docs"))
    return importlib.import_module("make_reference")


def test_files_on_disk_are_what_the_schema_gives(reference: ModuleType) -> None:
    for path, text in reference.files().items():
        if path.suffix == ".json":
            assert json.loads(path.read_text(encoding="utf-8")) == json.loads(text), path
        else:
            assert path.read_text(encoding="utf-8") == text, f"{path}: run python docs/make_reference.py"


def test_every_table_and_key_is_described_and_every_example_is_valid(reference: ModuleType) -> None:
    tables = reference.find_tables(SceneTable)
    assert set(tables) == set(reference.HEADINGS) == set(reference.key_notes())
    for table, model in tables.items():
        notes = reference.key_notes()[table]
        assert set(notes) == {reference.key_of(*each) for each in model.model_fields.items()}, table
        described = {
            reference.key_of(name, model.model_fields[name])
            for name in reference.docstrings_of_keys(model)
            if name in model.model_fields
        }
        assert not described & {key for key, note in notes.items() if "about" in note}, table
        for name, field in model.model_fields.items():
            reference.validate_example(model, name, notes[reference.key_of(name, field)]["example"])


def test_scenes_are_valid_by_the_published_schema() -> None:
    schema = json.loads((ROOT / "schemas" / "scene.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    scenes = [path for path in sorted((ROOT / "scenes").glob("*.toml")) if not path.name.startswith("batch")]
    assert len(scenes) > 20
    for path in scenes:
        data = read_toml(path)
        validator.validate(data)
        assert not validator.is_valid({**data, "fabrik": "woven"})
        assert not validator.is_valid({**data, "grain_angle": 400})


def test_metrics_of_a_run_are_as_published(reference: ModuleType, tmp_path: Path) -> None:
    surface = warpflat.make_shape("dome", resolution=9)
    warpflat.save_piece(warpflat.flatten(surface, datum="centre", fabric="woven"), tmp_path, picture=False)
    assert reference.check_metrics(tmp_path / "metrics.json") == []
    schema = json.loads((ROOT / "schemas" / "metrics.schema.json").read_text(encoding="utf-8"))
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    jsonschema.validate(metrics, schema)
    metrics["pieces"]["dome"]["flipped_faces"] = "none"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(metrics, schema)


def test_metrics_of_a_garment_whose_seams_were_found_are_as_published(reference: ModuleType, tmp_path: Path) -> None:
    trimesh.creation.icosphere(1, 0.1).export(tmp_path / "ball.obj")
    ball = {
        "surface": {"file": "ball.obj", "units": "m"},
        "find_seams": {"find": "none"},
        "seams_cut": [{"plane": {"point": [0.0, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}}],
        "output": {"frames": 0, "picture": False},
        "pattern": {"formats": []},
    }
    warpflat.run_scene(warpflat.make_scene(ball, name="ball", folder=tmp_path, where="ball"), tmp_path / "out")
    assert "garment" in json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert reference.check_metrics(tmp_path / "out" / "metrics.json") == []


@pytest.mark.parametrize(
    ("script", "make", "page"), [("make_api", "api_page", "api"), ("make_gallery", "gallery_page", "gallery")]
)
def test_pages_on_disk_are_what_their_scripts_make(reference: ModuleType, script: str, make: str, page: str) -> None:
    made = getattr(importlib.import_module(script), make)()
    assert (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8") == made, f"run python docs/{script}.py"


def test_every_scene_has_a_picture_in_the_gallery() -> None:
    scenes = {path.stem for path in (ROOT / "scenes").glob("*.toml") if not path.name.startswith("batch")}
    pictures = {path.stem: path.stat().st_size for path in (ROOT / "docs" / "gallery").glob("*.webp")}
    assert set(pictures) == scenes
    assert sum(pictures.values()) < 3e6
