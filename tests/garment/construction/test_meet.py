"""Borders that nearly meet are made to meet, vertex by vertex, and nothing else is changed."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from obj_files import write_obj
from surface_meshes import quads_between

import warpflat
from warpflat.app.cli.main import main
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.plan import plan_scene
from warpflat.flat.surface.connectivity import border_loops, euler_characteristic
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction.meet import meet_borders
from warpflat.garment.construction.sew_pieces import meeting_borders, unsewn_borders


def sheet(columns: np.ndarray, rows: np.ndarray, *, name: str, triangles: bool = False) -> Surface:
    """A curved sheet over the places of its columns and rows [m]."""
    u, v = (axis.ravel() for axis in np.meshgrid(columns, rows))
    quads = quads_between((len(rows), len(columns)))
    faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]) if triangles else quads
    return make_surface(np.stack([u, v, 0.1 * np.sin(3 * v)], axis=-1), faces, name=name)


def moved(surface: Surface, by: object) -> Surface:
    return make_surface(surface.vertices + np.asarray(by), surface.faces, name=surface.name)


def area(surface: Surface) -> float:
    return float(flat_areas(surface.vertices, surface.faces).sum())


def sewn(surfaces: list[Surface]) -> list[tuple[int, int]]:
    """The numbers of vertices along both sides of each seam; no border is left that runs along another."""
    named = {surface.name: surface for surface in surfaces}
    assert unsewn_borders(named) == []
    for surface in surfaces:
        assert euler_characteristic(surface.faces) == 1
        assert len(border_loops(surface.faces)) == 1
    return [(len(seam.vertices[0]), len(seam.vertices[1])) for seam in meeting_borders(named)]


LEFT, RIGHT, UP = np.linspace(0, 0.2, 6), np.linspace(0.2, 0.4, 6), np.linspace(0, 0.3, 11)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("gap", [2e-5, 5e-5, 9e-4])
def test_a_gap_below_the_tolerance_is_closed(gap: float, triangles: bool) -> None:
    left = sheet(LEFT, UP, name="left", triangles=triangles)
    right = moved(sheet(RIGHT, UP, name="right", triangles=triangles), [gap, 0, 0])
    surfaces, notes = meet_borders([left, right])
    assert sewn(surfaces) == [(11, 11)]
    assert "11 added" not in notes[0]
    assert f"moved by at most {1e3 * gap / 2:.2g} mm, 0 added" in notes[0]
    for before, after in zip((left, right), surfaces, strict=True):
        assert np.array_equal(before.faces, after.faces)
        assert np.linalg.norm(after.vertices - before.vertices, axis=1).max() == pytest.approx(gap / 2)
    untouched, notes = meet_borders([left, right], 0.5 * gap)
    assert untouched[0] is left
    assert notes == []


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("count", [2, 7, 12, 14, 23, 31])
def test_sides_of_other_vertices_get_the_same_ones(count: int, triangles: bool) -> None:
    left = sheet(LEFT, UP, name="left", triangles=triangles)
    other = sheet(RIGHT, np.linspace(0, 0.3, count), name="right", triangles=triangles)
    # Chords of a curve lie off each other by their sagitta.
    surfaces, notes = meet_borders([left, other], 0.02 if count < 10 else 1e-3)
    ((one, two),) = sewn(surfaces)
    assert one == two >= max(11, count)
    assert "added" in notes[0]
    for before, after in zip((left, other), surfaces, strict=True):
        assert area(after) == pytest.approx(area(before), rel=0.01 if count > 10 else 0.05)
        new = after.input_index >= len(before.vertices)
        assert np.array_equal(after.input_vertices[after.input_index[new]], after.vertices[new])


def test_two_panels_meet_a_yoke_and_each_other() -> None:
    yoke = sheet(np.linspace(0, 0.4, 8), np.linspace(0.3, 0.4, 4), name="yoke")
    left, right = sheet(LEFT, UP, name="left"), sheet(RIGHT, UP, name="right")
    surfaces, _ = meet_borders([left, moved(right, [2e-4, 0, 0]), moved(yoke, [0, 3e-4, 0])])
    seams = sewn(surfaces)
    assert len(seams) == 3
    assert all(one == two for one, two in seams)


def test_what_meets_already_stays_as_it_is() -> None:
    pieces = [sheet(LEFT, UP, name="left"), sheet(RIGHT, UP, name="right")]
    surfaces, notes = meet_borders(pieces)
    assert notes == []
    assert all(after is before for before, after in zip(pieces, surfaces, strict=True))


def test_an_open_wedge_stays_open_and_a_slit_is_closed() -> None:
    columns, rows = np.linspace(-0.1, 0.1, 9), np.linspace(0, 0.3, 13)
    for opening, closed in ((4e-5, True), (0.01, False), (0.003, False)):
        whole = sheet(columns, rows, name="front")
        slit = np.arange(6) * 9 + 4
        twin = {int(v): len(whole.vertices) + k for k, v in enumerate(slit)}
        faces = [
            [twin.get(int(v), int(v)) if whole.vertices[face].mean(axis=0)[0] > 0 else int(v) for v in face]
            for face in whole.faces
        ]
        wide = opening * (np.ones(6) if closed else np.linspace(1, 1 / 6, 6))
        vertices = np.vstack([whole.vertices, whole.vertices[slit] + np.outer(wide, [1, 0, 0])])
        piece = make_surface(vertices, faces, name="front")
        ((surface,), _) = meet_borders([piece])
        assert bool(meeting_borders({"front": surface})) == closed
        if not closed:
            assert surface is piece


def test_three_borders_at_one_place_are_named() -> None:
    left, right = sheet(LEFT, UP, name="left"), sheet(RIGHT, UP, name="right")
    third = make_surface(
        right.vertices @ np.diag([0, 1, 1]) + np.outer(right.vertices[:, 0] - 0.2, [0, 0, 1]) + [0.2, 0, 0],
        right.faces,
        name="third",
    )
    surfaces, _ = meet_borders([left, right, third])
    told = unsewn_borders({surface.name: surface for surface in surfaces})
    assert any("left and right" in words for words in told)
    assert any("third" in words for words in told)


def test_seams_that_nearly_meet_are_sewn_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right = moved(sheet(RIGHT, np.linspace(0, 0.3, 14), name="right"), [4e-4, 0, 0])
    path = write_obj(tmp_path / "two.obj", sheet(LEFT, UP, name="left"), right, names=("left", "right"))
    bare = ["flatten", str(path), "--units", "m", "--component", "all", "--frames", "0", "--no-picture", "-v"]
    assert main([*bare, "--out", str(tmp_path / "out")]) == 0
    assert "were made to meet" in capsys.readouterr().err
    (seam,) = json.loads((tmp_path / "out" / "metrics.json").read_text())["seams"]
    assert seam["difference_mm"] == pytest.approx(0.0, abs=0.05)
    assert main([*bare, "--meet", "0.1", "--out", str(tmp_path / "apart")]) == 0
    assert "0.40 mm apart" in capsys.readouterr().err
    assert "seams" not in json.loads((tmp_path / "apart" / "metrics.json").read_text())
    assert main([*bare, "--meet", "-1", "--out", str(tmp_path / "odd")]) == 2
    alone = [word for word in bare if word not in ("--component", "all")]
    assert main([*alone, "--meet", "1", "--component", "largest", "--out", str(tmp_path / "odd")]) == 2
    pieces = warpflat.read_pieces(path, units="m")
    assert all(
        len(set(pairwise(loop.tolist()))) == len(loop) - 1 for piece in pieces for loop in border_loops(piece.faces)
    )


def tube(x: float) -> Surface:
    turn, height = 2 * np.pi * np.arange(16) / 16, np.linspace(0, 0.3, 9)
    points = np.array([[x + 0.08 * np.cos(a), y, 0.08 * np.sin(a)] for y in height for a in turn])
    at = np.arange(9 * 16).reshape(9, 16)
    quads = np.stack([at[:-1], at[1:], np.roll(at, -1, 1)[1:], np.roll(at, -1, 1)[:-1]], -1).reshape(-1, 4)
    return make_surface(points, quads, name="sleeve")


def test_datum_grain_cuts_and_opening_are_given_by_piece(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = [sheet(LEFT, UP, name="left"), sheet(RIGHT, UP, name="right"), tube(1.0)]
    path = write_obj(tmp_path / "three.obj", *parts, names=[part.name for part in parts])
    bare = ["flatten", str(path), "--units", "m", "--component", "all", "--frames", "0", "--no-picture", "--quiet"]
    given = ["--datum", "left:bottom", "--datum", "right:0,60", "--grain-angle", "right:45", "--open", "sleeve:5,133"]
    assert main([*bare, *given, "--out", str(tmp_path / "out")]) == 0
    pieces = json.loads((tmp_path / "out" / "metrics.json").read_text())["pieces"]
    assert {name: piece["datum"] for name, piece in pieces.items()}["left"] == "bottom"
    assert pieces["right"]["datum"] == "datum"
    tables = {
        "surface": {"file": str(path), "units": "m", "component": "all"},
        "pieces": {"right": {"grain_angle": 45.0}},
        "grain_angle": 10.0,
    }
    garment = plan_scene(make_scene(tables, name="three", folder=tmp_path, where="here")).flatten()
    assert {name: piece.grain_angle for name, piece in garment.pieces.items()} == {
        "left": 10,
        "right": 45,
        "sleeve": 10,
    }
    text = (tmp_path / "out" / "sleeve.obj").read_text()
    corners = {
        tuple(word.split("/")[:2]) for row in text.splitlines() if row.startswith("f ") for word in row.split()[1:]
    }
    vertices = [vertex for vertex, _ in corners]
    # Along the column of vertex 5, each of which has two places in the pattern.
    assert {int(v) - 1 for v in vertices if vertices.count(v) == 2} == {5 + 16 * row for row in range(9)}
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[surface]\nfile = "three.obj"\nunits = "m"\ncomponent = "all"\n[output]\nframes = 0\npicture = false\n'
        '[pieces.left]\ndatum = "to right"\ncuts = [{ from = 2, to = 20 }]\n'
    )
    assert main(["run", str(scene), "--out", str(tmp_path / "run"), "--quiet"]) == 0
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert metrics["pieces"]["left"]["datum"] == "to right"
    assert len(metrics["pieces"]["left"]["cuts"]) == 1
    capsys.readouterr()
    for odd, words in (
        (["--datum", "middle:bottom"], "there is no such piece"),
        (["--datum", "left:nowhere"], "unknown line 'nowhere'"),
        (["--grain-angle", "left:slanted"], "grain_angle"),
        (["--open", "sleeve:5,13300"], "pieces.sleeve: cuts[0]"),
        (["--datum", "left:top", "--datum", "left:bottom"], "given twice"),
        (["--datum", "bottom"], "give it to a piece"),
    ):
        assert main([*bare, *odd, "--out", str(tmp_path / "odd")]) == 2
        line = capsys.readouterr().err.strip()
        assert words in line
        assert "\n" not in line
        assert not (tmp_path / "odd").exists()
