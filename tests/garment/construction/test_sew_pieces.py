"""All pieces of a garment from one file: read apart, named, flattened, and sewn where their borders meet."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from obj_files import write_obj
from surface_meshes import quads_between

from warpflat.app.cli.summary import notes_line
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction import to_pattern
from warpflat.garment.construction.read_pieces import read_pieces
from warpflat.garment.construction.sew_pieces import meeting_borders, sew_pieces
from warpflat.garment.construction.sewing import SewingNetwork
from warpflat.garment.construction.to_pattern import LACKING, pattern_of_garment
from warpflat.pattern.drafting.edge_rules import EdgeRules
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.whole_pieces import whole_pieces
from warpflat.pattern.export.pattern_json import read_pattern_json
from warpflat.pattern.export.read_pattern import read_pattern

QUIET = {"output": {"frames": 0, "picture": False}}


def _barrel() -> dict[str, trimesh.Trimesh]:
    """Front and back of a barrel that is 60 mm wider at its middle, and a button."""
    v = np.linspace(0.0, 1.0, 13)
    parts = {}
    for name, start in (("front", 0.0), ("back", np.pi)):
        a = start + np.linspace(0.0, np.pi, 17)
        radius = 0.1 + 0.03 * np.sin(np.pi * v)[None, :]
        points = np.stack(
            [radius * np.cos(a)[:, None], np.broadcast_to(0.4 * v, (17, 13)), radius * np.sin(a)[:, None]], axis=-1
        )
        quads = quads_between((17, 13))
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        parts[name] = trimesh.Trimesh(points.reshape(-1, 3).round(9), triangles, process=False)
    parts["button"] = trimesh.creation.icosphere(1, 0.01)
    return parts


def _write_obj(path: Path, parts: dict[str, trimesh.Trimesh], *, named: bool = True, textured: bool = False) -> None:
    texture = [[(k / 1000, 0) for k in range(len(mesh.vertices))] for mesh in parts.values()] if textured else []
    write_obj(path, *parts.values(), names=list(parts) if named else (), texture=texture, digits="")


@pytest.mark.parametrize("kind", ["named.obj", "plain.obj", "textured.obj", "scene.glb", "stage.usda"])
def test_pieces_stay_apart_in_any_format(kind: str, tmp_path: Path):
    parts, path = _barrel(), tmp_path / kind
    if path.suffix == ".obj":
        _write_obj(path, parts, named=kind == "named.obj", textured=kind == "textured.obj")
    elif path.suffix == ".glb":
        scene = trimesh.Scene()
        for name, mesh in parts.items():
            scene.add_geometry(mesh, node_name=name, geom_name=name)
        scene.export(path)
    else:
        pxr = pytest.importorskip("pxr")
        from pxr import Usd, UsdGeom

        assert pxr
        stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        for name, mesh in parts.items():
            prim = UsdGeom.Mesh.Define(stage, f"/{name}")
            prim.GetPointsAttr().Set([tuple(point) for point in mesh.vertices.tolist()])
            prim.GetFaceVertexCountsAttr().Set([3] * len(mesh.faces))
            prim.GetFaceVertexIndicesAttr().Set(mesh.faces.ravel().tolist())
        stage.Save()
    pieces = read_pieces(path, units="m" if path.suffix == ".obj" else None)
    names = [f"{path.stem}_1", f"{path.stem}_2"] if kind in ("plain.obj", "textured.obj") else ["front", "back"]
    assert sorted(piece.name for piece in pieces) == sorted(names)
    assert any("1 closed part, such as a button, left out (" in note for note in pieces[0].notes)
    pairs = meeting_borders({piece.name: piece for piece in pieces})
    assert len(pairs) == 2
    for pair in pairs:
        one, other = (
            next(p for p in pieces if p.name == name).vertices[row]
            for name, row in zip(pair.pieces, pair.vertices, strict=True)
        )
        assert len(one) == 13
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_a_garment_is_flattened_and_its_seams_match(tmp_path: Path):
    _write_obj(tmp_path / "barrel.obj", _barrel())
    data = {"surface": {"file": str(tmp_path / "barrel.obj"), "units": "m", "component": "all"}, **QUIET}
    made = make_scene(data, name="barrel", folder=tmp_path, where="barrel.toml")
    result = run_scene(made, tmp_path / "out")
    assert set(result.metrics["pieces"]) == {"front", "back"}
    assert all(piece["converged"] and not piece["flipped_faces"] for piece in result.metrics["pieces"].values())
    assert [seam["name"] for seam in result.metrics["seams"]] == ["front to back", "front to back 2"]
    assert all(abs(seam["difference_mm"]) < 0.01 for seam in result.metrics["seams"])
    pattern = read_pattern_json(tmp_path / "out" / "pattern.json")
    assert {side for seam in pattern.seams for side in seam.sides} == {
        "front.to back",
        "front.to back 2",
        "back.to front",
        "back.to front 2",
    }
    assert all(seam.matches for seam in pattern.seams)


def test_pieces_whose_borders_do_not_meet_are_not_sewn(tmp_path: Path):
    parts = _barrel()
    parts["back"].vertices[:, 2] -= 0.02
    _write_obj(tmp_path / "barrel.obj", parts)
    data = {"surface": {"file": str(tmp_path / "barrel.obj"), "units": "m", "component": "all"}, **QUIET}
    made = make_scene(data, name="barrel", folder=tmp_path, where="barrel.toml")
    result = run_scene(made, tmp_path / "out")
    assert set(result.metrics["pieces"]) == {"front", "back"}
    assert "seams" not in result.metrics
    assert any("no borders meet in space" in note for note in result.notes)


def test_what_belongs_to_one_piece_is_refused(tmp_path: Path):
    surface = {"file": "barrel.obj", "units": "m", "component": "all"}
    with pytest.raises(InputError, match='datum belongs to one piece; with component = "all" leave it out'):
        make_scene({"surface": surface, "datum": "left"}, name="barrel", folder=tmp_path, where="barrel.toml")
    _write_obj(tmp_path / "ball.obj", {"ball": trimesh.creation.icosphere(2, 0.1)})
    with pytest.raises(
        InputError, match=r"ball\.obj: every part is closed .* or a crumb; give the layer of cloth alone"
    ):
        read_pieces(tmp_path / "ball.obj", units="m")


def test_a_piece_cut_turned_over_hangs_on_its_side_where_the_mesh_stands_aside_and_leans(tmp_path: Path):
    """A back and two fronts, flared, 30 cm off x = 0 and leaning by 4 degrees."""
    lean, parts = np.radians(4.0), {}
    turn = np.array([[np.cos(lean), -np.sin(lean), 0.0], [np.sin(lean), np.cos(lean), 0.0], [0.0, 0.0, 1.0]])
    v = np.linspace(0.0, 1.0, 9)
    for name, start, end in (("front_left", 0.0, 0.5), ("front_right", 0.5, 1.0), ("back", 1.0, 2.0)):
        count = int(12 * (end - start)) + 1
        a = np.pi * np.linspace(start, end, count)
        radius = 0.16 - 0.06 * v[None, :]
        points = np.stack(
            [radius * np.cos(a)[:, None], np.broadcast_to(0.4 * v, (count, 9)), radius * np.sin(a)[:, None]], axis=-1
        ).reshape(-1, 3)
        quads = quads_between((count, 9))
        # Diagonals are mirror images, too.
        left = points[quads].mean(axis=1)[:, 0] > 0.0
        first = np.where(left[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
        second = np.where(left[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
        parts[name] = trimesh.Trimesh(
            (points @ turn.T + [0.3, 0.1, 0.0]).round(9), np.concatenate([first, second]), process=False
        )
    _write_obj(tmp_path / "coat.obj", parts)
    data = {"surface": {"file": str(tmp_path / "coat.obj"), "units": "m", "component": "all"}, **QUIET}
    result = run_scene(make_scene(data, name="coat", folder=tmp_path, where="coat.toml"), tmp_path / "out")
    assert "front_left: cut twice, once mirrored, it serves for front_right too" in result.notes
    pattern = read_pattern(tmp_path / "out" / "pattern.json")
    pieces, _, _ = whole_pieces(pattern.pieces[pattern.sample], pattern.seams)
    hung = {
        name: np.column_stack([piece.outline, np.ones(len(piece.outline))]) @ piece.placement.T
        for name, piece in pieces.items()
        if piece.placement is not None
    }
    assert set(hung) == {"front_left", "front_left mirrored", "back"}
    assert hung["back"][:, 0].max() == pytest.approx(-hung["back"][:, 0].min(), abs=1e-4)
    assert hung["front_left"][:, 0].min() == pytest.approx(-hung["front_left mirrored"][:, 0].max(), abs=1e-9)
    # It hangs beside the back, not into it.
    assert hung["front_left"][:, 0].max() == pytest.approx(hung["back"][:, 0].max(), abs=0.06)


def _sewn_length(pattern: Pattern) -> float:
    return sum(pattern.piece(side.piece, "").edge(side.edge).length for seam in pattern.seams for side in seam.sides[0])


def test_a_seam_that_ends_within_an_edge_arrives_in_the_pattern(tmp_path: Path):
    """The back ends below the front's top: both sides of the front are one edge each, and the seams end in them."""
    parts = _barrel()
    rows = np.arange(17 * 13) % 13
    below = parts["back"].faces[(rows[parts["back"].faces] <= 8).all(axis=1)]
    parts["back"] = trimesh.Trimesh(parts["back"].vertices, below, process=True)
    _write_obj(tmp_path / "barrel.obj", parts)
    pieces = read_pieces(tmp_path / "barrel.obj", units="m")
    garment = sew_pieces([flatten(piece, fabric="woven") for piece in pieces], name="barrel")
    pattern, notes = pattern_of_garment({"": garment}, name="barrel")
    found = sum(seam.lengths[0] for seam in garment.seams)
    assert found > 0.5
    assert _sewn_length(pattern) == pytest.approx(found, abs=1e-6)
    assert not any(note.startswith(LACKING) for note in notes)


def test_a_seam_of_a_mesh_that_the_pattern_lacks_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    _write_obj(tmp_path / "barrel.obj", _barrel())
    pieces = read_pieces(tmp_path / "barrel.obj", units="m")
    garment = sew_pieces([flatten(piece, fabric="woven") for piece in pieces], name="barrel")
    whole, notes = pattern_of_garment({"": garment}, name="barrel")
    assert not any(note.startswith(LACKING) for note in notes)
    find = to_pattern._mesh_seams
    monkeypatch.setattr(to_pattern, "_mesh_seams", lambda *given: find(*given)[1:])
    pattern, notes = pattern_of_garment({"": garment}, name="barrel")
    told = [
        match
        for note in notes
        if (match := re.fullmatch(LACKING + r" (\d+) mm of the seam of front and back about .+", note))
    ]
    assert len(told) == 1
    assert _sewn_length(pattern) + 1e-3 * float(told[0][1]) == pytest.approx(_sewn_length(whole), abs=1e-3)
    assert notes_line(["something else", *notes]).startswith(f"note: {LACKING}")
    # An edge that is meant to be a hem has no seam.
    hems = {edge.name: "hem" for edge in pattern.piece("front", "").edges}
    _, notes = pattern_of_garment({"": garment}, name="barrel", rules=EdgeRules(kinds=hems))
    assert not any(note.startswith(LACKING) for note in notes)


def test_a_seam_around_a_hole_is_named_as_the_pattern_has_no_edge_there():
    """A disc in a ring: the ring's inner border is a hole of its piece."""
    radius, turn = np.linspace(0.0, 0.2, 9)[1:], np.linspace(0, 2 * np.pi, 33)[:-1]
    rings = np.stack(
        [radius[:, None] * np.cos(turn), radius[:, None] * np.sin(turn), 0 * radius[:, None] * turn], axis=-1
    )
    at = np.arange(8 * 32).reshape(8, 32)
    pieces = []
    for name, rows in (("disc", at[:4]), ("ring", at[3:])):
        quads = np.stack([rows[:-1], rows[1:], np.roll(rows[1:], -1, 1), np.roll(rows[:-1], -1, 1)], -1).reshape(-1, 4)
        faces = [*quads.tolist(), *([rows[0].tolist()] if name == "disc" else [])]
        pieces.append(flatten(make_surface(rings.reshape(-1, 3), faces, name=name), fabric="woven"))
    _, notes = pattern_of_garment({"": sew_pieces(pieces)}, name="target")
    assert any(note.startswith(f"{LACKING} 627 mm of the seam of disc and ring about (") for note in notes), notes


def test_a_seam_of_a_single_edge_is_sewn():
    """Two quads side by side, whose whole seam is one edge of either."""
    left = make_surface([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2, 3]], name="left")
    right = make_surface([[0.2, 0, 0], [0.5, 0, 0], [0.5, 0.1, 0], [0.2, 0.1, 0]], [[0, 1, 2, 3]], name="right")
    (pair,) = meeting_borders({"left": left, "right": right})
    one, other = (surface.vertices[row] for surface, row in zip((left, right), pair.vertices, strict=True))
    np.testing.assert_array_equal(one, other)
    pattern, notes = pattern_of_garment(
        {"": sew_pieces([flatten(each, fabric="woven") for each in (left, right)])}, name="two"
    )
    assert _sewn_length(pattern) == pytest.approx(0.1)
    assert not any(note.startswith(LACKING) for note in notes)


def test_pieces_that_their_seams_drive_apart_are_kept_as_they_lie_on_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Two halves of a barrel whose sewing ends many times as large as they are, as that of a closed thing may."""
    measured = SewingNetwork.blown_up
    monkeypatch.setattr(SewingNetwork, "blown_up", lambda network, layout: measured(network, 50.0 * layout))
    _write_obj(tmp_path / "barrel.obj", _barrel())
    data = {"surface": {"file": str(tmp_path / "barrel.obj"), "units": "m", "component": "all"}, **QUIET}
    result = run_scene(make_scene(data, name="barrel", folder=tmp_path, where="barrel.toml"), tmp_path / "out")
    assert any("the pieces are not sewn" in note and "front, back" in note for note in result.metrics["notes"])
    assert all(piece["stages"][-1]["name"] != "sew" for piece in result.metrics["pieces"].values())
    assert len(read_pattern_json(tmp_path / "out" / "pattern.json").pieces[""]) == 2
