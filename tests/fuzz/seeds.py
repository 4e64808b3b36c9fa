"""Small valid files of every format that is ours or that meshes have, and command lines."""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

from surface_meshes import quads_between

from warpflat.app.cli.main import main
from warpflat.pattern.files.output import seal_of

from .promise import CLOTH, words

__all__ = [
    "BARE", "COMMANDS", "FABRIC", "MESHES", "METRICS", "SCENES", "SEWN", "SKIRT", "beside_commands", "bodies", "meshes", "pattern",
    "record",
]  # fmt: skip

BARE = "--frames 0 --no-picture --quiet"
# A tube of 7 by 12 faces around the hip of a body that stands at the origin.
SKIRT = b"".join(
    [
        *(
            b"v %.4f %.4f %.4f\n"
            % (0.22 * math.sin(k * math.pi / 6), 0.6 + 0.06 * row, 0.16 * math.cos(k * math.pi / 6))
            for row in range(8)
            for k in range(12)
        ),
        *(
            b"f %d %d %d %d\n"
            % (12 * row + k + 1, 12 * row + (k + 1) % 12 + 1, 12 * row + (k + 1) % 12 + 13, 12 * row + k + 13)
            for row in range(7)
            for k in range(12)
        ),
    ]
)
# Two panels of 30 by 20 cm that are worn at right angles and sewn along one edge, with their pattern as texture, in centimetres.
SEWN = b"".join(
    [
        *(
            b"v %.2f %.2f %.2f\n" % ((0.1 * k, 0.1 * j, 0.0) if k < 4 else (0.3, 0.1 * j, 0.1 * (k - 3)))
            for j in range(3)
            for k in range(7)
        ),
        *(b"vt %d %d\n" % (10 * k + 5 * (k > 3), 10 * j) for j in range(3) for k in (0, 1, 2, 3, 3.5, 4.5, 5.5, 6.5)),
        *(
            b"f %s\n"
            % b" ".join(
                b"%d/%d" % (7 * (j + b) + k + a + 1, 8 * (j + b) + k + a + (k > 2) + 1)
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))
            )
            for j in range(2)
            for k in range(6)
        ),
    ]
)
QUIET = "[output]\nframes = 0\npicture = false\n"
SHORT = "[relax]\nmax_steps = 30\n" + QUIET
SCENES = {
    "shape": "fabric = 'woven'\ndatum = 'centre'\nname = 'cap'\n[surface]\nshape = 'dome'\nresolution = 5\n" + SHORT,
    "file": "fabric = 'own'\nfabric_files = ['own.toml']\ngrain_angle = 45\ndatum = 'axis'\nmodel = 'membrane'\n[surface]\n"
    "file = 'cloth.obj'\nunits = 'm'\ncomponent = 'largest'\n[lines]\naxis = {from = 0, to = 3}\nside = {vertices = [1, 2]}\n"
    "[wear]\nstretch_warp = 0.05\n" + SHORT,
    "cut": "fabric = 'denim'\ndatum = 'centre'\n[surface]\nshape = 'bodice'\nresolution = 7\n[lines]\n"
    "dart = {plane = {point = [0.05, 0.0, 0.0], normal = [1.0, 0.0, 0.0]}}\n[[cuts]]\nline = 'dart'\n" + SHORT,
    "constraints": "fabric = 'woven'\ndatum = 'centre'\n[surface]\nshape = 'bodice'\nresolution = 7\n[[constraints]]\n"
    "line = 'bottom'\nstraight = 'weft'\n[[constraints]]\nline = 'top'\nlength_mm = 'body'\n[pattern]\nallowance_mm = 7\n"
    "hem_mm = 25\nkinds = {top = 'hem'}\nallowances_mm = {left = 20}\n" + SHORT,
    "seam": "[surface]\nshape = 'cone'\nresolution = 7\n[[seams]]\nname = 'back'\nsides = ['left', 'right']\n"
    "[pattern]\nformats = ['dxf', 'svg', 'json']\n" + SHORT,
    "drawn": "[surface]\nfile = 'cloth.obj'\nunits = 'm'\n[seams]\nfind = 'none'\nkeep = ['waist']\n[[seams_cut]]\nname = 'middle'\n"
    "points = [[0.5, 0.0, 0.0], [0.5, 1.0, 0.0]]\n[[seams_cut]]\nline = [[0.0, 0.25, 0.1], [1.0, 0.25, 0.1]]\nclosed = false\n"
    "[[seams_cut]]\nplane = {point = [0.2, 0.6, 0.0], normal = [0.1, 1.0, 0.0], towards = [1.0, 0.0, 0.0], nearest = true}\n"
    "[[seams_cut]]\nedges = [[1, 2]]\n" + SHORT,
}
FORM_SCENE = (
    "fabric = 'interlock'\nform = {like = 'skirt'}\n[mannequin]\nsize = 'EU 40'\nresolution_mm = 40\n"
    "measurements = {waist = 0.76}\n[[seams]]\nname = 'side left'\nease = 0.01\n" + QUIET
)
FABRIC = """[sources]
own = "measured"
[own]
description = "a cloth"
aliases = ["mine"]
areal_density = { value = 0.168, unit = "kg/m2", source = "own", grade = "C" }
stiffness_warp = { value = 411.0, unit = "N/m", test_load = "low strain", source = "own", grade = "A" }
stiffness_weft = 2028.0
shear_stiffness = { value = 26.2, unit = "N/m per rad", test_load = "FAST EB5", source = "own", grade = "C" }
curve_warp = { secants = [[0.0, 411.0], [0.167, 464.0]], unit = "N/m", source = "own", grade = "A" }
strain_limit = { value = 0.05, unit = "1", source = "own", grade = "C" }
[stiff]
areal_density = 0.3
stiffness_warp = 4000
stiffness_weft = 4000
shear_stiffness = 60
"""
METRICS = {
    "schema": 1,
    "pieces": {"cloth": {"vertices": 6}},
    "files": {"cloth": {"cloth.obj": "0" * 64, "old.svg": "1" * 64}},
}
MESHES = ("obj", "ply", "stl", "off", "glb", "gltf", "usda", "usdc", "usdz")
COMMANDS = [
    words(each)
    for each in (
        f"flatten cloth.obj --units cm --fabric denim --out out {BARE}",
        f"flatten cloth.obj --units m --name front --datum 0,3 --model membrane {BARE}",
        f"flatten cloth.obj --units m --solver paper --max-steps 50 --stretch-warp 0.1 {BARE}",
        f"flatten cloth.obj --units m --fabric own --fabric-file own.toml --grain-angle 45 {BARE}",
        f"flatten cloth.obj --units m --seams none --cut-seam 'plane:0.5,0,0 1,0,0' --keep waist {BARE}",
        f"fit skirt.obj --units m --from 'EU 38' --to 'EU 40' --ease hip=4cm --out out {BARE}",
        "run cap.scene.toml --out out --quiet",
        "fabrics --file own.toml own --json",
        "export done --format svg --format dxf --dialect astm --paper A4",
        "export done --format json --size 'EU 38'",
        "mannequin --measure waist=0.76 --size 'EU 38' --resolution 40 --out out",
        "cuts cap.scene.toml --by per_cm --out out",
        "compare cap.scene.toml --fabric denim --fabric jersey --out out",
    )
]


def record(files: dict[str, bytes]) -> bytes:
    """A `metrics.json` by which files are known to be of warpflat, so that they may be replaced."""
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    data = {"warpflat": "0", "files": {"cloth": digests}}
    return json.dumps({**data, "sha256": seal_of(data)}).encode()


def beside_commands() -> dict[str, bytes]:
    """What COMMANDS need."""
    return {
        "cloth.obj": CLOTH,
        "skirt.obj": SKIRT,
        "own.toml": FABRIC.encode(),
        "cap.scene.toml": SCENES["shape"].encode(),
        "done/pattern.json": json.dumps(pattern()).encode(),
    }


@functools.cache
def meshes(kind: str) -> tuple[bytes, ...]:
    """Valid meshes of a format, some with what a file may have besides: lines, colours, textures, a second part."""
    import numpy as np
    import trimesh

    columns = 4
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, columns)))
    points = np.stack([u, v, 0.3 * u * (1 - u) + 0.2 * v * (1 - v)], axis=1).round(6)
    quads = quads_between((columns, columns))
    if kind.startswith("usd"):
        return _usd(kind, points, quads)
    mesh = trimesh.Trimesh(points, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]), process=False)
    if kind == "obj":
        rows = ["mtllib odd.mtl", "o front", *(f"v {x} {y} {z}" for x, y, z in points), "vt 0 0", "vn 0 0 1", "g all"]
        rows += [*(" ".join(["f", *(f"{k + 1}/1/1" for k in quad)]) for quad in quads), "g axis", "l 1 5 9 13"]
        return CLOTH, "\n".join([*rows, ""]).encode()
    if kind == "ply":
        vertex = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
        head = f"ply\nformat ascii 1.0\ncomment c\n{vertex}element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        rows = "0 0 0 1\n1 0 0 2\n1 1 0.1 3\n0 1 0 4\n4 0 1 2 3\n"
        return (head + rows).encode(), mesh.export(file_type="ply"), mesh.export(file_type="ply", encoding="ascii")
    if kind == "stl":
        return mesh.export(file_type="stl"), mesh.export(file_type="stl_ascii").encode()
    if kind == "off":
        rows = [f"{x} {y} {z}" for x, y, z in points] + [" ".join(map(str, [4, *quad])) for quad in quads]
        return f"OFF\n{len(points)} {len(quads)} 0\n# c\n".encode() + "\n".join([*rows, ""]).encode(), mesh.export(
            file_type="off"
        ).encode()
    if kind == "glb":
        two = trimesh.Scene([mesh, mesh.copy().apply_translation([3, 0, 0])])
        return mesh.export(file_type="glb"), two.export(file_type="glb")
    if kind == "gltf":
        return (_gltf(mesh),)
    raise ValueError(kind)


def _gltf(mesh: Any) -> bytes:
    """One file: its buffers as data in it."""
    import base64

    files = mesh.export(file_type="gltf")
    model = json.loads(files.pop("model.gltf"))
    for buffer in model["buffers"]:
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(files[buffer["uri"]]).decode()
    return json.dumps(model).encode()


def _usd(kind: str, points: Any, quads: Any) -> tuple[bytes, ...]:
    """A mesh of quads with a curve, in centimetres; and one by a reference, as text."""
    from pxr import Usd, UsdGeom, UsdUtils

    with tempfile.TemporaryDirectory() as folder:
        layer = Path(folder) / f"a.{'usdc' if kind == 'usdz' else kind}"
        stage = Usd.Stage.CreateNew(str(layer))
        UsdGeom.SetStageMetersPerUnit(stage, 0.01)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        world = UsdGeom.Xform.Define(stage, "/World")
        world.AddTranslateOp().Set((1.0, 2.0, 3.0))
        stage.SetDefaultPrim(world.GetPrim())
        mesh = UsdGeom.Mesh.Define(stage, "/World/front")
        mesh.CreatePointsAttr((100 * points).tolist())
        mesh.CreateFaceVertexCountsAttr([4] * len(quads))
        mesh.CreateFaceVertexIndicesAttr(quads.ravel().tolist())
        curve = UsdGeom.BasisCurves.Define(stage, "/World/axis")
        curve.CreatePointsAttr((100 * points[::4]).tolist())
        curve.CreateCurveVertexCountsAttr([len(points[::4])])
        curve.CreateTypeAttr("linear")
        stage.GetRootLayer().Save()
        if kind == "usdz":
            package = Path(folder) / "a.usdz"
            UsdUtils.CreateNewUsdzPackage(str(layer), str(package))
            return (package.read_bytes(),)
        whole = layer.read_bytes()
    if kind == "usda":
        moved = whole.replace(b"point3f[] points = [", b"point3f[] points.timeSamples = { 1: [", 1)
        return whole, moved.replace(b")]\n", b")]}\n", 1)
    return (whole,)


def bodies() -> tuple[bytes, ...]:
    """Standing bodies: real ones where their folder is known, and one of boxes that is none."""
    import trimesh

    boxes = [((0.3, 0.6, 0.2), (0, 1.2, 0)), ((0.2, 0.25, 0.2), (0, 1.65, 0))]
    boxes += [((0.12, 0.9, 0.12), (side * 0.09, 0.45, 0)) for side in (-1, 1)]
    parts = [trimesh.creation.box(size).apply_translation(place) for size, place in boxes]
    rough = trimesh.util.concatenate(parts).subdivide().subdivide().export(file_type="obj").encode()
    real = Path(os.environ.get("WARPFLAT_DATA", "")) / "body_female.obj"
    return (rough, real.read_bytes()) if real.is_file() else (rough,)


@functools.cache
def pattern() -> dict[str, Any]:
    """The content of a pattern.json with a dart, notches, a hem and an internal line."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cut.toml").write_text(
            SCENES["cut"].replace("[output]", "[pattern]\nformats = ['json']\n[output]")
        )
        main(["run", f"{folder}/cut.toml", "--out", f"{folder}/out", "--quiet"])
        found: dict[str, Any] = json.loads((Path(folder) / "out" / "pattern.json").read_text())
    return found
