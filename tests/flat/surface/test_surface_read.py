from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from obj_files import write_obj
from pxr import Gf, Sdf, Usd, UsdGeom
from surface_meshes import broken_invariants, cylinder, grid

from warpflat.app.cli.main import main
from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import chain_lines
from warpflat.flat.surface.io.read import METRES_PER_UNIT, read_scan, read_surface
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.construction.read_pieces import read_pieces

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def write(path, text):
    path.write_text(text)
    return path


def refusal(path, **options):
    """The line that refuses a file and begins with it; "" if there is none."""
    try:
        read_surface(path, **options)
    except InputError as error:
        message = str(error)
        return message if message.startswith(f"{path}: ") and "\n" not in message else ""
    return ""


# OBJ


def test_obj_keeps_quads_order_and_every_digit(tmp_path):
    vertices, quads = grid(4, 3, cylinder)
    surface = read_surface(write_obj(tmp_path / "half.obj", (vertices, quads), digits=""), units="m")
    assert broken_invariants(surface) == []
    assert np.array_equal(surface.vertices, vertices)
    assert np.array_equal(surface.faces, quads)
    assert surface.name == "half"
    assert surface.notes == ()


def test_obj_may_begin_with_a_byte_order_mark(tmp_path):
    surface = read_surface(write(tmp_path / "mark.obj", "\ufeff" + SQUARE + "f 1 2 3 4\n"), units="m")
    assert len(surface.vertices) == 4


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 2 3 4",
        "f -4 -3 -2 -1",
        "vn 0 0 1\nf 1//1 2//1 3//1 4//1",
        "vt 0 0\nvt 1 0\nf 1/1 2/2 3/1 4/2",
        "vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1",
        "f 1 2 \\\n  3 4",
        "f\t1\t2\t3\t4\r",
        "g a b\no name\ns off\nusemtl cloth\nf 1 2 3 4 # a face",
        "fo 1 2 3 4",
    ],
)
def test_every_way_to_write_a_face(tmp_path, faces):
    surface = read_surface(write(tmp_path / "a.obj", "# comment\nmtllib x.mtl\n" + SQUARE + faces + "\n"), units="m")
    assert surface.faces.tolist() == [[0, 1, 2, 3]]


def test_negative_indices_count_from_where_they_stand(tmp_path):
    text = SQUARE + "f -4 -3 -2 -1\nv 2 0 0\nv 2 1 0\nf 2 -2 -1 3\n"
    assert read_surface(write(tmp_path / "a.obj", text), units="m").faces.tolist() == [[0, 1, 2, 3], [1, 4, 5, 2]]


def test_colours_and_weights_after_a_position_are_left_out(tmp_path):
    text = "v 0 0 0 1\nv 1 0 0 .5 .5 .5\nv 1 1 0 .1 .2 .3\nf 1 2 3"
    surface = read_surface(write(tmp_path / "a.obj", text), units="cm")
    assert surface.vertices.max() == 0.01


def test_corners_split_per_texture_coordinate_are_whole_again(tmp_path):
    vertices, quads = grid(4, 3)
    texture = "".join(f"vt {i} 0\n" for i in range(quads.size))
    per_corner = iter(range(1, quads.size + 1))
    faces = "\n".join("f " + " ".join(f"{v + 1}/{next(per_corner)}" for v in face) for face in quads.tolist())
    rows = "".join(f"v {x} {y} {z}\n" for x, y, z in vertices.tolist())
    surface = read_surface(write(tmp_path / "a.obj", rows + texture + faces), units="m")
    assert len(surface.vertices) == 12
    assert surface.notes == ()


def test_exporter_that_writes_a_vertex_per_texture_coordinate_is_welded(tmp_path):
    vertices, quads = grid(5, 4)
    # Split along the column in the middle, not to the top: one part with a slit.
    split = np.vstack([vertices, vertices[[2, 7]]])
    faces = quads.copy()
    right = vertices[quads].mean(axis=1)[:, 0] > 0.5
    for old, new in ((2, 20), (7, 21)):
        faces[right] = np.where(faces[right] == old, new, faces[right])
    body = "".join(f"v {x} {y} {z}\nvt {x + 0.1 * (i > 19)} {y}\n" for i, (x, y, z) in enumerate(split.tolist()))
    with_texture = body + "\n".join("f " + " ".join(f"{v + 1}/{v + 1}" for v in face) for face in faces.tolist())
    assert len(read_surface(write(tmp_path / "a.obj", with_texture), units="m").vertices) == 20
    assert len(read_surface(write_obj(tmp_path / "b.obj", (split, faces), digits=""), units="m").vertices) == 22
    assert len(read_surface(tmp_path / "b.obj", units="m", weld=True).vertices) == 20


def test_line_elements_become_feature_lines(tmp_path):
    vertices, quads = grid(4, 4)
    single = ["g front\nl 3 7\nl 11 7\nl 11 15\ng hem\nl 1 2 3 4\ng two\nl 1 5\nl 4 8"]
    surface = read_surface(write_obj(tmp_path / "a.obj", (vertices, quads), digits="", more=single), units="m")
    assert broken_invariants(surface) == []
    lines = {name: line.tolist() for name, line in surface.lines.items()}
    assert lines == {"front": [2, 6, 10, 14], "hem": [0, 1, 2, 3], "two_1": [0, 4], "two_2": [3, 7]}


def test_free_line_elements_are_drawn_along_the_edges_or_left_out_with_a_note(tmp_path):
    vertices, quads = grid(5, 5)
    extra = ["v 0.51 0 0\nv 0.49 1 0\nv 9 9 9\nv 9 9 8\ng near\nl 26 27\ng far\nl 28 29"]
    surface = read_surface(write_obj(tmp_path / "a.obj", (vertices, quads), digits="", more=extra), units="m")
    assert surface.lines["near"].tolist() == [2, 7, 12, 17, 22]
    assert "far" not in surface.lines
    assert any("'near' was drawn along" in note for note in surface.notes)
    assert any("line left out" in note and "'far'" in note for note in surface.notes)


def test_chains_join_only_where_two_ends_meet():
    assert chain_lines([[0, 1], [2, 1], [2, 3]]) == [[0, 1, 2, 3]]
    assert chain_lines([[1, 2], [0, 1]]) == [[0, 1, 2]] or chain_lines([[1, 2], [0, 1]]) == [[2, 1, 0]]
    assert chain_lines([[0, 1], [1, 2], [1, 3]]) == [[0, 1], [1, 2], [1, 3]]
    (loop,) = chain_lines([[0, 1], [1, 2], [2, 0]])
    assert loop[0] == loop[-1]
    assert len(loop) == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("hello\nworld\n", "not an OBJ file: no line of it is a vertex"),
        (SQUARE, "has no faces, only 4 points"),
        (SQUARE + "f 1 2\n", "line 5: 'f 1 2' has 2 corners"),
        (SQUARE + "f 1 2 5\n", "line 5: 'f 1 2 5' refers to vertex 5, but the file has 4 (1 to 4)"),
        (SQUARE + "\nf 0 1 2\n", "line 6: 'f 0 1 2' refers to vertex 0"),
        (SQUARE + "f -5 1 2\n", "refers to vertex -5"),
        (SQUARE + "f 1 2 x\n", "line 5: 'f 1 2 x' is not a face"),
        (SQUARE + "f 1 2 99999999999999999999999\n", "is not a face"),
        ("v 0 0 \\\n 0\nv 1 zero 0\n" + SQUARE + "f 1 2 3\n", "line 3: 'v 1 zero 0' is not a position"),
        ("v 0 0\n" + SQUARE + "f 1 2 3\n", "line 1: 'v 0 0' is not a position"),
        (SQUARE + "f 1 2 3\nl 1\n", "line 6: 'l 1' needs two or more vertices"),
        (SQUARE + "f 1 2 3\nl 1 9\n", "line 6: 'l 1 9' needs"),
        (SQUARE + "f 1 2 3\nl a b\n", "line 6: 'l a b' is not a line"),
        (SQUARE.replace("1 1 0", "nan 1 0") + "f 1 2 3\n", "vertex 2 (counted from 0) is not finite"),
        (SQUARE + "v 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3 4\nf 5 6 7\n", "2 components"),
    ],
)
def test_bad_obj_is_refused_in_one_line(tmp_path, text, words):
    assert words in refusal(write(tmp_path / "bad.obj", text), units="m")


# Every format


def test_path_that_is_no_mesh_file(tmp_path):
    assert "does not exist" in refusal(tmp_path / "none.obj", units="m")
    write(tmp_path / "sleeve.obj", SQUARE)
    assert "did you mean 'sleeve.obj'?" in refusal(tmp_path / "sleve.obj", units="m")
    folder = tmp_path / "folder.obj"
    folder.mkdir()
    assert "is a directory" in refusal(folder, units="m")
    assert "unknown kind of file '.objj'; did you mean '.obj'?" in refusal(write(tmp_path / "a.objj", "x"), units="m")
    assert "unknown kind of file ''" in refusal(write(tmp_path / "noname", "x"), units="m")
    assert "unknown units 'metre'; " in refusal(tmp_path / "sleeve.obj", units="metre")


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb", ".gltf", ".off", ".usd", ".usda", ".usdc", ".usdz"])
def test_noise_emptiness_and_text_are_refused_in_one_line(tmp_path, suffix, capfd):
    noise = tmp_path / f"noise{suffix}"
    noise.write_bytes(np.random.default_rng(1).integers(0, 256, 4000, dtype=np.uint8).tobytes())
    assert refusal(noise, units="m")
    assert refusal(write(tmp_path / f"text{suffix}", "this is not a mesh\n" * 20), units="m")
    assert "is empty" in refusal(write(tmp_path / f"empty{suffix}", ""), units="m")
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".off"])
def test_missing_unit_is_asked_for_with_sizes(tmp_path, suffix):
    vertices, quads = grid(4, 3)
    trimesh.Trimesh(vertices * [40, 60, 1], triangulate(quads)[0], process=False).export(tmp_path / f"a{suffix}")
    message = refusal(tmp_path / f"a{suffix}")
    assert 'units = "m"' in message
    assert "--units m" in message
    assert '"cm": 0.4 x 0.6 x 0 m' in message
    assert '"in": 1.02 x 1.52 x 0 m' in message


@pytest.mark.parametrize(("unit", "metres"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048)])
def test_units_scale(tmp_path, unit, metres):
    path = write(tmp_path / "a.obj", SQUARE.replace("1", "5") + "f 1 2 3 4")
    assert np.ptp(read_surface(path, units=unit).vertices[:, 0]) == pytest.approx(5 * metres, rel=1e-12)


@pytest.mark.parametrize(
    ("drawn", "read", "right", "way"),
    [
        ("mm", "m", "mm", ["--component", "all"]),
        ("mm", "m", "mm", ["--seams", "auto"]),
        ("m", "mm", "m", ["--component", "0"]),
        ("cm", "ft", "cm", ["--seams", "auto"]),
        ("m", "cm", "m", ["--component", "all"]),
        ("dm", "m", "dm", ["--component", "0"]),
    ],
)
def test_wrong_units_are_named_whatever_is_read(tmp_path, capsys, drawn, read, right, way):
    """A skirt of two panels, .6 m tall."""
    panel = [(x, y, z) for z in (0.1, -0.1) for y in np.linspace(0, 0.6, 5) for x in np.linspace(-0.2, 0.2, 4)]
    rows = [
        f"v {x / METRES_PER_UNIT[drawn]:g} {y / METRES_PER_UNIT[drawn]:g} {z / METRES_PER_UNIT[drawn]:g}"
        for x, y, z in panel
    ]
    for first in (1, 21):
        rows.append(f"o panel_{first}")
        rows += [f"f {a} {a + 1} {a + 5} {a + 4}" for k in range(16) if k % 4 < 3 for a in [first + k]]
    path = write(tmp_path / "skirt.obj", "\n".join(rows))
    code = main(
        ["flatten", str(path), "--units", read, *way, "--frames", "0", "--no-picture", "--out", str(tmp_path / "out")]
    )
    told = capsys.readouterr()
    height = 0.6 / METRES_PER_UNIT[drawn] * METRES_PER_UNIT[read]
    if 3e-3 <= height <= 20.0:
        assert code in (0, 1)
        assert f"reads as {height:.3g} m tall" in told.out
        assert f"; in {right} it would be 0.6 m" in told.out
    else:
        assert code == 2
        assert f'units = "{right}" (0.6 m)' in told.err
        assert "\n" not in told.err.strip()


def test_implausible_size_suggests_the_unit(tmp_path):
    large = write(tmp_path / "large.obj", SQUARE.replace("1", "600") + "f 1 2 3 4")
    message = refusal(large, units="m")
    assert "600 m long, larger than any garment" in message
    assert 'units = "mm" (0.6 m)' in message
    small = write(tmp_path / "small.obj", SQUARE + "f 1 2 3 4")
    message = refusal(small, units="mm")
    assert "smaller" in message
    assert 'units = "m" (1 m)' in message
    assert "no usual unit" in refusal(write(tmp_path / "c.obj", SQUARE.replace("1", "1e9") + "f 1 2 3 4"), units="m")


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".glb", ".off"])
def test_trimesh_formats_come_welded_and_in_metres(tmp_path, suffix):
    vertices, quads = grid(6, 5, cylinder)
    path = tmp_path / f"half{suffix}"
    trimesh.Trimesh(vertices, triangulate(quads)[0], process=False).export(path)
    surface = read_surface(path, units=None if suffix == ".glb" else "m")
    assert broken_invariants(surface) == []
    assert len(surface.vertices) == 30
    assert len(surface.faces) == 40
    assert surface.name == "half"
    near = np.linalg.norm(surface.vertices[:, None] - vertices[None], axis=2).min(axis=1)
    assert near.max() < 1e-7
    if suffix == ".stl":
        assert len(surface.input_vertices) == 120


def test_ply_with_texture_seams_is_welded(tmp_path):
    vertices, quads = grid(5, 4)
    split = np.vstack([vertices, vertices[[2, 7]]])
    faces = triangulate(quads)[0]
    right = vertices[faces].mean(axis=1)[:, 0] > 0.5
    for old, new in ((2, 20), (7, 21)):
        faces[right] = np.where(faces[right] == old, new, faces[right])
    rows = [f"{x} {y} {z} {x + (i > 19)} {y}" for i, (x, y, z) in enumerate(split.tolist())]
    head = ["ply", "format ascii 1.0", f"element vertex {len(split)}"]
    head += [f"property float {key}" for key in ("x", "y", "z", "s", "t")]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    path = write(
        tmp_path / "a.ply", "\n".join([*head, *rows, *(f"3 {a} {b} {c}" for a, b, c in faces.tolist())]) + "\n"
    )
    surface = read_surface(path, units="m")
    assert len(surface.input_vertices) == 22
    assert len(surface.vertices) == 20


def test_glb_transforms_are_applied_and_nodes_can_be_chosen(tmp_path):
    vertices, quads = grid(3, 3)
    scene = trimesh.Scene()
    mesh = trimesh.Trimesh(vertices, triangulate(quads)[0], process=False)
    move = np.diag([2.0, 2.0, 2.0, 1.0])
    move[:3, 3] = [0, 5, 0]
    scene.add_geometry(mesh, node_name="front", transform=move)
    scene.add_geometry(mesh.copy(), node_name="back", transform=np.diag([1.0, 1, -1, 1]))
    path = tmp_path / "a.glb"
    scene.export(path)
    front = read_surface(path, prim="front")
    assert front.vertices.min(axis=0) == pytest.approx([0, 5, 0])
    assert front.vertices.max(axis=0) == pytest.approx([2, 7, 0])
    p = read_surface(path, prim="back").vertices[read_surface(path, prim="back").faces[0, :3]]
    assert np.cross(p[1] - p[0], p[2] - p[0])[2] < 0
    assert "2 components" in refusal(path)
    assert "did you mean 'front'" in refusal(path, prim="frnt")
    assert "only means something in a USD or GLB" in refusal(write(tmp_path / "a.obj", SQUARE), units="m", prim="front")


def test_point_cloud_has_no_faces(tmp_path):
    trimesh.PointCloud(np.random.default_rng(0).random((20, 3))).export(tmp_path / "points.ply")
    assert "has no faces" in refusal(tmp_path / "points.ply", units="m")


# USD


def usd_mesh(stage, path, vertices, faces, counts=None):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in vertices])
    mesh.CreateFaceVertexCountsAttr(counts or [len(faces[0])] * len(faces))
    mesh.CreateFaceVertexIndicesAttr(np.asarray(faces).ravel().tolist())
    return mesh


def new_stage(path, unit=0.01, up=UsdGeom.Tokens.y):
    stage = Usd.Stage.CreateNew(str(path))
    if unit:
        UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, up)
    return stage


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
def test_usd_unit_transform_and_quads(tmp_path, suffix):
    vertices, quads = grid(4, 3)
    stage = new_stage(tmp_path / f"a{suffix}")
    root = UsdGeom.Xform.Define(stage, "/World")
    root.AddTranslateOp().Set(Gf.Vec3d(0, 10, 0))
    mesh = usd_mesh(stage, "/World/Front", vertices * 30, quads)
    mesh.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    stage.Save()
    surface = read_surface(tmp_path / f"a{suffix}")
    assert broken_invariants(surface) == []
    assert surface.name == "Front"
    assert np.array_equal(surface.faces, quads)
    assert surface.vertices == pytest.approx(vertices * 0.6 + [0, 0.1, 0], abs=1e-7)
    assert read_surface(tmp_path / f"a{suffix}", units="mm").vertices[:, 0].max() == pytest.approx(0.06)
    assert read_surface(tmp_path / f"a{suffix}", name="piece").name == "piece"


def test_usd_without_unit_takes_the_default_with_a_note(tmp_path):
    vertices, quads = grid(3, 3)
    stage = new_stage(tmp_path / "a.usda", unit=None)
    usd_mesh(stage, "/Front", vertices * 30, quads)
    stage.Save()
    surface = read_surface(tmp_path / "a.usda")
    assert surface.vertices.max() == pytest.approx(0.3)
    assert "metersPerUnit" in surface.notes[0]


def test_z_up_is_turned_and_handedness_honoured(tmp_path):
    vertices, quads = grid(3, 3)
    stage = new_stage(tmp_path / "a.usda", unit=1, up=UsdGeom.Tokens.z)
    mesh = usd_mesh(stage, "/Front", vertices @ [[1, 0, 0], [0, 0, 1], [0, 1, 0]], quads)
    stage.Save()
    surface = read_surface(tmp_path / "a.usda")
    assert surface.vertices == pytest.approx(vertices, abs=1e-7)
    assert np.array_equal(surface.faces, quads)
    mesh.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    stage.Save()
    assert np.array_equal(read_surface(tmp_path / "a.usda").faces, quads[:, [0, 3, 2, 1]])
    mesh.AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
    stage.Save()
    assert np.array_equal(read_surface(tmp_path / "a.usda").faces, quads)


def test_time_sampled_points_holes_and_triangles(tmp_path):
    vertices, _ = grid(3, 3)
    stage = new_stage(tmp_path / "a.usda", unit=1)
    mesh = usd_mesh(stage, "/Front", vertices, [0, 1, 4, 3, 1, 2, 4, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7], [4, 3, 3, 4, 4])
    mesh.GetPointsAttr().Clear()
    mesh.GetPointsAttr().Set([Gf.Vec3f(*map(float, 2 * p)) for p in vertices], 5)
    mesh.GetPointsAttr().Set([Gf.Vec3f(*map(float, 3 * p)) for p in vertices], 9)
    mesh.CreateHoleIndicesAttr([4])
    stage.Save()
    surface = read_surface(tmp_path / "a.usda")
    assert surface.vertices.max() == pytest.approx(2)
    assert (surface.faces >= 0).sum(axis=1).tolist() == [4, 3, 3, 4]


def test_one_of_several_mesh_prims_is_chosen_by_path_or_name(tmp_path):
    vertices, quads = grid(3, 3)
    stage = new_stage(tmp_path / "a.usda", unit=1)
    for name in ("front", "back"):
        usd_mesh(stage, f"/World/{name}/surface", vertices, quads)
    usd_mesh(stage, "/World/hood", vertices * 2, quads)
    stage.Save()
    message = refusal(tmp_path / "a.usda")
    assert "holds 3 mesh prims" in message
    assert "/World/front/surface" in message
    assert read_surface(tmp_path / "a.usda", prim="/World/back/surface").name == "surface"
    assert len(read_pieces(tmp_path / "a.usda")) > 1
    assert len(read_pieces(tmp_path / "a.usda", prim="/World/back/surface")) == 1
    # A scan is all of them: an avatar's skin, eyes and hair.
    vertices_of_all, faces = read_scan(tmp_path / "a.usda")
    assert (len(vertices_of_all), len(faces)) == (3 * len(vertices), 3 * len(quads))
    assert read_surface(tmp_path / "a.usda", prim="hood").vertices.max() == pytest.approx(2)
    assert "names several" in refusal(tmp_path / "a.usda", prim="surface")
    assert "did you mean '/World/hood'" in refusal(tmp_path / "a.usda", prim="/World/hod")


def test_curves_beside_and_below_become_feature_lines(tmp_path):
    vertices, quads = grid(5, 5)
    stage = new_stage(tmp_path / "a.usda", unit=0.1)
    UsdGeom.Xform.Define(stage, "/World")
    usd_mesh(stage, "/World/front", vertices, quads)

    def curve(path, points, counts, kind=UsdGeom.Tokens.linear):
        curves = UsdGeom.BasisCurves.Define(stage, path)
        curves.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in points])
        curves.CreateCurveVertexCountsAttr(counts)
        curves.CreateTypeAttr(kind)
        return curves

    curve("/World/centre", vertices[[2, 7, 12, 17, 22]], [5])
    curve("/World/front/hems", vertices[[0, 4, 20, 24]], [2, 2])
    curve("/World/dart", vertices[[6, 8, 18, 16]], [4]).CreateWrapAttr(UsdGeom.Tokens.periodic)
    curve("/World/smooth", vertices[[0, 1, 2, 3]], [4], UsdGeom.Tokens.cubic)
    curve("/World/elsewhere", vertices[:2] + np.array([0, 0, 50.0]), [2])
    stage.Save()
    surface = read_surface(tmp_path / "a.usda")
    assert broken_invariants(surface) == []
    lines = {name: line.tolist() for name, line in surface.lines.items()}
    assert set(lines) == {"centre", "hems_1", "hems_2", "dart"}
    assert lines["centre"] == [2, 7, 12, 17, 22]
    assert lines["hems_1"] == [0, 1, 2, 3, 4]
    assert lines["dart"] == [6, 7, 8, 13, 18, 17, 16, 11, 6]
    assert any("'smooth' are not linear" in note for note in surface.notes)
    assert any("'elsewhere'" in note for note in surface.notes)


def test_a_film_is_read_with_the_lines_of_the_mesh_that_is_chosen(tmp_path):
    from warpflat.flat.surface.shapes import make_shape
    from warpflat.pattern.export.usd import FrameWriter

    shape = make_shape("bodice", resolution=9)
    with FrameWriter(tmp_path / "frames.usdc", scale=1.0) as film:
        film.add_piece("front", shape)
        # The pattern lies so near to the surface that its lines could be drawn on either.
        flat = shape.vertices[:, :2] * [1.0, 1.01]
        film.write("front", positions=flat, face_energy_density=np.zeros(len(shape.faces)))
    surface = read_surface(tmp_path / "frames.usdc", prim="/World/front/front_surface")
    assert {name: line.tolist() for name, line in surface.lines.items()} == {
        name: line.tolist() for name, line in shape.lines.items()
    }
    assert surface.notes == ()
    pattern = read_surface(tmp_path / "frames.usdc", prim="/World/front/front_pattern")
    assert set(pattern.lines) == set(shape.lines)


def test_broken_usd_meshes_are_refused(tmp_path):
    vertices, quads = grid(3, 3)
    for number, (faces, counts, words) in enumerate(
        (
            (quads, [4, 4, 4], "broken: its face sizes add up to 12, but it lists 16 corners"),
            (quads + 7, None, "beyond its 9 points"),
            ([0, 1, 2, 3], [2, 2], "face 0 has 2 corners"),
        )
    ):
        stage = new_stage(tmp_path / f"{number}.usda")
        usd_mesh(stage, "/m", vertices, faces, counts)
        stage.Save()
        assert words in refusal(tmp_path / f"{number}.usda")
    stage = new_stage(tmp_path / "none.usda")
    stage.DefinePrim(Sdf.Path("/World"), "Xform")
    stage.Save()
    assert "holds no mesh prim" in refusal(tmp_path / "none.usda")
    UsdGeom.Mesh.Define(stage, "/World/m")
    stage.Save()
    assert "has no faces" in refusal(tmp_path / "none.usda")


def test_package_import_stays_light():
    import subprocess

    heavy = "scipy trimesh pxr potpourri3d matplotlib pydantic"
    code = f"import sys, warpflat.flat.surface; print([m for m in '{heavy}'.split() if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
