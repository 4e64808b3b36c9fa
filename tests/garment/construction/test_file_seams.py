"""Seams that a file has, in its texture, its materials or its groups, are the seams of the garment."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import obj_files
import pytest
import trimesh
from real_files import DATA, needs_data
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from surface_meshes import quads_between

import warpflat
from warpflat.app.cli.main import main
from warpflat.app.scene.found_seams import found_seams
from warpflat.app.scene.load import make_scene
from warpflat.flat.surface.io.read import read_mesh_file
from warpflat.flat.surface.repair.layers import Layer
from warpflat.garment.construction.file_seams import file_seams, like_cut_pieces
from warpflat.garment.seams.layers import read_garment

ROWS, AROUND, PIECES = 9, 24, 4


def tube(spread: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A welded tube of four gores: vertices, quads, texture coordinates of each gore's own, and of the faces' corners."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    height = np.linspace(0.0, 0.4, ROWS)
    radius = 0.1 + 0.05 * height[:, None]
    ring = np.stack([np.cos(angle), np.zeros(AROUND), np.sin(angle)], axis=1)
    vertices = (radius[..., None] * ring + np.stack([0 * height, height, 0 * height], axis=1)[:, None]).reshape(-1, 3)
    at = np.arange(ROWS * AROUND).reshape(ROWS, AROUND)
    quads = np.stack([at[:-1], at[1:], np.roll(at, -1, 1)[1:], np.roll(at, -1, 1)[:-1]], axis=-1)
    each = AROUND // PIECES
    places, corners = [], np.empty((ROWS - 1, AROUND, 4), dtype=int)
    for piece in range(PIECES):
        u = np.arange(each + 1) * 2 * np.pi / AROUND
        gore = np.stack(np.broadcast_arrays(-radius * u + 0.5 * piece, height[:, None]), axis=-1) * spread**piece
        first = piece * ROWS * (each + 1)
        number = first + np.arange(ROWS * (each + 1)).reshape(ROWS, each + 1)
        own = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
        corners[:, piece * each : (piece + 1) * each] = own
        places.append(gore.reshape(-1, 2))
    return vertices, quads.reshape(-1, 4), np.concatenate(places), corners.reshape(-1, 4)


def gore_of_face() -> np.ndarray:
    return np.tile(np.repeat(np.arange(PIECES), AROUND // PIECES), ROWS - 1)


def write_obj(
    path: Path, *, spread: float = 1.0, texture: bool = True, each_corner: bool = False, kind: str = ""
) -> Path:
    vertices, quads, places, corners = tube(spread)
    if each_corner:  # an exporter that writes every corner's coordinates anew
        places, corners = places[corners.ravel()], np.arange(corners.size).reshape(-1, 4)
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    rows += [f"vt {u:.9g} {v:.9g}" for u, v in places] if texture else []
    gore, last = gore_of_face(), -1
    for face in np.argsort(gore, kind="stable").tolist():
        if kind and gore[face] != last:
            last = gore[face]
            rows.append(f"{kind} {('Front', 'Left side', 'Back', 'Right side')[last]}")
        both = zip(quads[face] + 1, corners[face] + 1, strict=True)
        rows.append("f " + " ".join(f"{v}/{t}" if texture else f"{v}" for v, t in both))
    path.write_text("\n".join([*rows, ""]))
    return path


def write_usd(path: Path, *, subsets: str = "") -> Path:
    from pxr import Sdf, Usd, UsdGeom

    vertices, quads, places, corners = tube()
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    mesh = UsdGeom.Mesh.Define(stage, "/Skirt")
    mesh.CreatePointsAttr(vertices.tolist())
    mesh.CreateFaceVertexCountsAttr([4] * len(quads))
    mesh.CreateFaceVertexIndicesAttr(quads.ravel().tolist())
    if not subsets:
        given = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
        given.Set((places * 1000.0).tolist())
        given.SetIndices(corners.ravel().tolist())
    for number in range(PIECES if subsets else 0):
        faces = np.flatnonzero(gore_of_face() == number).tolist()
        UsdGeom.Subset.CreateGeomSubset(mesh, f"gore_{number}", UsdGeom.Tokens.face, faces, subsets)
    stage.GetRootLayer().Save()
    return path


def write_glb(path: Path, *, normals: bool = False) -> Path:
    """The tube as GLB, with a vertex for each texture coordinate, or for each corner, as with hard edges."""
    vertices, quads, places, corners = tube()
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    of = np.empty(len(places), dtype=int)
    of[corners.ravel()] = quads.ravel()
    if normals:
        places, of, triangles = (
            places[triangles.ravel()],
            of[triangles.ravel()],
            np.arange(triangles.size).reshape(-1, 3),
        )
    material = trimesh.visual.material.PBRMaterial(name="cloth")
    visual = trimesh.visual.TextureVisuals(uv=places, material=material)
    trimesh.Trimesh(vertices[of], triangles, visual=visual, process=False).export(path)
    return path


def found(path: Path, **options: Any) -> Any:
    units = {"units": "m"} if path.suffix in (".obj", ".ply") else {}
    component = options.pop("component", None)
    table = {"file": str(path), **units, **({} if component is None else {"component": component})}
    tables: dict[str, Any] = {"surface": table, **({"find_seams": options} if options else {})}
    return found_seams(make_scene(tables, name="skirt", folder=path.parent, where="here"))


def check_gores(result: Any) -> None:
    assert len(result.pieces) == PIECES
    assert [seam.length for seam in result.seams] == pytest.approx([np.hypot(0.4, 0.02)] * 4, rel=1e-6)
    for piece in result.pieces:
        edges = [line for name, line in piece.lines.items() if name.startswith("to ")]
        assert len(edges) == 2
        assert all(np.ptp(piece.vertices[line][:, 1]) == pytest.approx(0.4, abs=1e-6) for line in edges)


@pytest.mark.parametrize("options", [{}, {"find": "uv"}, {"find": "file"}, {"find": "auto"}, {"component": "all"}])
def test_a_welded_tube_of_four_islands_is_four_pieces_in_every_format(tmp_path: Path, options: dict[str, Any]) -> None:
    paths = [write_obj(tmp_path / "skirt.obj")]
    if options in ({}, {"component": "all"}):
        # What is asked of islands does not depend on the file that they come from.
        paths += [
            write_obj(tmp_path / "corners.obj", each_corner=True),
            write_usd(tmp_path / "skirt.usda"),
            write_glb(tmp_path / "skirt.glb"),
            write_glb(tmp_path / "hard.glb", normals=True),
        ]
    for path in paths:
        if path.name == "skirt.glb" and options == {"component": "all"}:
            # Apart in the file, they are pieces anyway.
            assert found(path, **options) is None
            assert len(warpflat.read_pieces(path)) == PIECES
            continue
        result = found(path, **options)
        check_gores(result)
        assert result.along == "4 islands of the file's texture"
        assert ("look like cut pieces" in " ".join(result.notes)) == (options.get("find") not in ("uv", "file"))


@pytest.mark.parametrize(("kind", "way"), [("usemtl", "materials"), ("g", "groups"), ("o", "groups")])
def test_materials_and_groups_part_the_cloth_and_name_the_pieces(tmp_path: Path, kind: str, way: str) -> None:
    path = write_obj(tmp_path / "skirt.obj", texture=False, kind=kind)
    for find in (way, "file"):
        result = found(path, find=find)
        check_gores(result)
        assert [piece.name for piece in result.pieces] == ["Front", "Left side", "Back", "Right side"]
        assert {seam.name for seam in result.seams} >= {"Front to Left side"}
    assert found(path) is None  # nobody has asked


@pytest.mark.parametrize(("family", "way"), [("materialBind", "materials"), ("pieces", "groups")])
def test_subsets_of_usd_are_materials_or_groups(tmp_path: Path, family: str, way: str) -> None:
    result = found(write_usd(tmp_path / "skirt.usda", subsets=family), find=way)
    check_gores(result)
    assert {piece.name for piece in result.pieces} == {f"gore_{number}" for number in range(PIECES)}


def test_islands_that_are_not_as_large_as_the_cloth_are_taken_only_when_asked(tmp_path: Path) -> None:
    path = write_obj(tmp_path / "skirt.obj", spread=1.3)
    assert found(path) is None
    result = found(path, find="auto")
    assert "were not taken for cut pieces" in " ".join(result.notes)
    assert "times the area" in " ".join(result.notes)
    check_gores(found(path, find="uv"))


def test_the_texture_can_be_left_alone(tmp_path: Path) -> None:
    result = found(write_obj(tmp_path / "skirt.obj"), find="auto", no=["uv"])
    assert result.along == ""
    assert {seam.name for seam in result.seams} >= {"side left", "side right"}


def test_seams_that_are_left_out_of_a_file_are_told_to_be_its_own(tmp_path: Path) -> None:
    path = write_obj(tmp_path / "skirt.obj")
    for find, other in (("auto", "--no uv"), ("uv", "--seams auto")):
        (note,) = [note for note in found(path, find=find, no=["shoulder"]).notes if "shoulder" in note]
        assert note == f"no = 'shoulder' had no effect: the file's own seams were taken; {other} looks for others"


def test_islands_that_are_no_pattern_are_taken_only_when_asked(tmp_path: Path) -> None:
    # A ball in two halves, in a texture that keeps their area: as large as cut pieces, and far from flat.
    ball = trimesh.creation.icosphere(3, radius=0.15)
    front = ball.triangles_center[:, 2] > 0.0
    unit = ball.vertices / 0.15
    rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in ball.vertices]
    for side in (1.0, -1.0):
        places = 0.15 * np.sqrt(2.0 / (1.0 + np.maximum(side * unit[:, 2], -0.5)))[:, None] * unit[:, :2] * [side, 1.0]
        rows += [f"vt {u + 0.5 * side:.6f} {v:.6f}" for u, v in places]
    offset = np.where(front, 0, len(unit))[:, None]
    rows += [
        "f " + " ".join(f"{v}/{t}" for v, t in zip(face, corner, strict=True))
        for face, corner in zip((ball.faces + 1).tolist(), (ball.faces + 1 + offset).tolist(), strict=True)
    ]
    path = tmp_path / "ball.obj"
    path.write_text("\n".join([*rows, ""]))
    for options in ({}, {"find": "auto"}):
        result = found(path, **options)
        assert "2 islands of the file's texture were not taken, as" in " ".join(result.notes)
        assert "look like cut pieces" not in " ".join(result.notes)
        assert result.along == ""
        assert len(result.pieces) == 8
    assert len(found(path, find="uv").pieces) == 2


def test_what_the_file_does_not_have_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_obj(tmp_path / "skirt.obj", texture=False, kind="g")
    arguments = ["flatten", str(path), "--units", "m", "--out", str(tmp_path / "out")]
    assert main([*arguments, "--seams", "uv"]) == 2
    line = capsys.readouterr().err.strip()
    assert "\n" not in line
    assert "does not have texture coordinates" in line
    assert "groups" in line
    assert not (tmp_path / "out").exists()
    assert main([*arguments, "--seams", "velcro"]) == 2


def test_a_run_along_islands_sews_them_again(tmp_path: Path) -> None:
    path = write_obj(tmp_path / "skirt.obj")
    arguments = ["flatten", str(path), "--units", "m", "--seams", "uv", "--frames", "0", "--no-picture", "--quiet"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert len(metrics["pieces"]) == PIECES
    assert metrics["garment"]["outside"] < 0.01
    assert len(metrics["seams"]) == PIECES


def test_a_half_that_lies_mirrored_on_the_other_is_an_island_of_its_own(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 7), np.linspace(0.0, 0.4, 5))
    quads = quads_between((5, 7))
    x, y = x.ravel(), y.ravel()
    back = np.stack([x, y, 0.1 * x * x], axis=1), quads
    path = obj_files.write_obj(tmp_path / "back.obj", back, texture=[np.stack([abs(x), y], axis=1)], digits="g")
    _, raw, _, _ = read_mesh_file(path, units="m", prim=None, name=None)
    seams = file_seams(raw)["uv"]
    assert len(seams.names) == 2
    assert np.allclose(raw.vertices[seams.edges][..., 0], 0.0)
    assert like_cut_pieces(raw, seams) == ""


@pytest.mark.parametrize(("gap", "seams"), [(2, 1), (6, 2)])
def test_slits_in_line_are_one_seam(tmp_path: Path, gap: int, seams: int) -> None:
    """A texture that is slit along the middle but for a short stretch is parted there, too; a long one keeps it together."""
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, 9), np.linspace(0.0, 0.6, 21))
    grid = np.arange(x.size).reshape(x.shape)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1)
    # On the right of the middle the texture lies apart, but for the rows of the bridge.
    texture = np.stack([x.ravel(), y.ravel()], axis=1)
    slit = [row for row in range(21) if not 9 <= row <= 9 + gap]
    other = {int(grid[row, 4]): x.size + number for number, row in enumerate(slit)}
    places = np.concatenate([texture, texture[list(other)] + [0.01, 0.0]])
    rows = [f"v {a:g} {b:g} {0.1 * a * a:g}" for a, b in texture] + [f"vt {a:g} {b:g}" for a, b in places]
    for row in range(20):
        for column in range(8):
            corners = [int(corner) for corner in quads[row, column]]
            at = [other.get(corner, corner) if column == 4 else corner for corner in corners]
            rows.append("f " + " ".join(f"{a + 1}/{b + 1}" for a, b in zip(corners, at, strict=True)))
    (tmp_path / "back.obj").write_text("\n".join(rows))
    _, raw, _, _ = read_mesh_file(tmp_path / "back.obj", units="m", prim=None, name=None)
    edges = file_seams(raw)["uv"].edges
    joined = connected_components(coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(x.size, x.size)))[1]
    assert len(set(joined[edges].ravel().tolist())) == seams
    assert len(edges) == (20 if seams == 1 else 20 - gap)


def test_crumbs_of_a_texture_are_joined_to_their_neighbour(tmp_path: Path) -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 0.4, 41), np.linspace(0, 0.4, 41)))
    quads = quads_between((41, 41))
    rows = [f"v {a:g} {b:g} 0\nvt {a:g} {b:g}" for a, b in zip(x, y, strict=True)]
    rows += [f"vt {2 + a:g} {b:g}" for a, b in zip(x, y, strict=True)]
    for number, quad in enumerate(quads.tolist()):
        own = 1 + (41 * 41 if number == 800 else 0)
        rows.append("f " + " ".join(f"{k + 1}/{k + own}" for k in quad))
    (tmp_path / "sheet.obj").write_text("\n".join(rows))
    _, raw, _, _ = read_mesh_file(tmp_path / "sheet.obj", units="m", prim=None, name=None)
    seams = file_seams(raw)["uv"]
    assert seams.joined == 1
    assert len(seams.names) == 1
    assert len(seams.edges) == 0


def test_broken_texture_coordinates_are_left_out(tmp_path: Path) -> None:
    text = write_obj(tmp_path / "skirt.obj").read_text()
    for number, (old, new) in enumerate([("vt 0 0\n", "vt zero 0\n"), ("\nf 1/", "\nf 1/99999")]):
        path = tmp_path / f"odd_{number}.obj"
        path.write_text(text.replace(old, new, 1))
        _, raw, _, _ = read_mesh_file(path, units="m", prim=None, name=None)
        assert "texture coordinates" in raw.notes[0]
        assert (raw.texture is None) == (number == 0)


def test_seams_are_the_edges_between_islands(tmp_path: Path) -> None:
    _, raw, _, _ = read_mesh_file(write_obj(tmp_path / "skirt.obj"), units="m", prim=None, name=None)
    seams = file_seams(raw)["uv"]
    assert len(seams.edges) == 4 * (ROWS - 1)
    assert all(a != b for a, b in seams.beside.tolist())
    assert sorted(np.bincount(seams.island)) == [(ROWS - 1) * AROUND // PIECES] * PIECES
    assert all(abs(b - a) == AROUND for a, b in seams.edges.tolist())


@needs_data
def test_a_suit_is_cut_where_its_maker_unwrapped_it() -> None:
    path = DATA / "garments" / "male_casualsuit04.obj"
    # Cut from a sheet that no direction spares, its islands would be a tenth beyond the limit, and are no pattern.
    tables = {"surface": {"file": str(path), "units": "dm"}, "fabric": "woven"}
    result = found_seams(make_scene(tables, name="suit", folder=path.parent, where="here"))
    assert result is not None
    assert result.along == "6 islands of the file's texture"
    assert {"left_leg", "right_leg", "back", "front"} < {piece.name for piece in result.pieces}
    assert len(result.pieces) == 6
    # No cloth is lost, but the facings at three openings.
    area = sum(Layer(piece.vertices, piece.faces).area for piece in result.pieces)
    whole = sum(Layer(layer.vertices, layer.faces).area for layer in read_garment(path, units="dm").layers)
    assert whole - area == pytest.approx(0.0087, abs=2e-4)


@needs_data
def test_a_narrow_strip_along_the_waist_is_a_waistband() -> None:
    path = DATA / "garments" / "Women_Skirt.usd"
    result = found_seams(make_scene({"surface": {"file": str(path)}}, name="skirt", folder=path.parent, where="here"))
    assert result is not None
    assert {piece.name for piece in result.pieces} == {"front", "back", "front_waistband", "back_waistband"}
    front, back = (next(p for p in result.pieces if p.name == f"{side}_waistband") for side in ("front", "back"))
    assert front.vertices[:, 2].mean() > back.vertices[:, 2].mean()
