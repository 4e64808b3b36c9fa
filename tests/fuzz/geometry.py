"""Kinds of the fuzz for geometry: scenes of garments with all tables, seams, and files of several pieces, layers and tubes."""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from obj_files import obj_text
from surface_meshes import quads_between

from . import seeds
from .damage import damaged_bytes, damaged_json, damaged_toml, little_work
from .promise import Case, words
from .seeds import BARE

__all__ = ["geometry_case"]

_QUIET = "[output]\nframes = 0\npicture = false\nreview = false\n"
_BODY = "[mannequin]\nsize = 'EU 40'\nresolution_mm = 40\n[relax]\nmax_steps = 30\n"
_FORMS = (
    "fabric = 'woven'\nform = 'a_line_skirt'\nshape = 'darts'\n"
    + _BODY
    + "[[openings]]\nkind = 'zip'\nseam = 'side left'\nlength_mm = 180\n[ease]\nwaist = 1.0\nhip = 4.0\n"
    "[[cuts]]\npiece = 'front'\nline = 'princess front left'\nomit = true\n" + _QUIET,
    "fabric = 'woven'\nform = {like = 'dress'}\n"
    + _BODY
    + "[[openings]]\nkind = 'buttons'\nseam = 'centre front'\nwidth_mm = 20\nbutton_mm = 18\nspacing_mm = 90\n"
    "[[pockets]]\nkind = 'patch'\npiece = 'front_left'\nline = 'hip'\nbelow_mm = 20\nfrom_centre_mm = 70\n"
    "[cloth]\ninterfacing = 'interfacing'\n" + _QUIET,
)
_FINISHED = (
    "fabric = 'woven'\nform = 'skirt'\nshape = 'darts'\n"
    + _BODY
    + "[[openings]]\nkind = 'zip'\nseam = 'side left'\nlength_mm = 180\n"
    "[[finishing]]\nkind = 'waistband'\nedge = 'waist'\nwidth_mm = 35\noverlap_mm = 40\nshaped = true\n"
    "[[finishing]]\nkind = 'flounce'\nedge = 'hip'\nwidth_mm = 200\nturns = 0.5\n"
    "[[pockets]]\nkind = 'patch'\npiece = 'front_left'\nline = 'hip'\nbelow_mm = 20\nfrom_centre_mm = 70\n" + _QUIET,
    "fabric = 'woven'\nform = {like = 'dress'}\n"
    + _BODY
    + "[[finishing]]\nkind = 'facing'\nedge = 'neck'\nwidth_mm = 60\n[[finishing]]\nkind = 'binding'\nedge = 'armhole'\n"
    "[[finishing]]\nkind = 'band'\nedge = 'hip'\nwidth_mm = 60\nshare = 0.85\nshorten_mm = 60\nelastic = 0.9\n"
    "[cloth]\nlining = 'lining'\ninterfacing = 'interfacing'\n" + _QUIET,
)
_SURFACES = (
    "[surface]\nshape = 'cone'\nresolution = 7\n[[seams]]\nname = 'back'\nsides = ['left', 'right']\nfullness = 0.02\nlonger = 'left'\n"
    "[[constraints]]\nline = 'bottom'\nlength_mm = 'body'\n" + _QUIET,
    "[surface]\nfile = 'tube.obj'\nunits = 'm'\n[[cuts]]\nname = 'side'\nfrom = [0.1, 0.0, 0.0]\nto = [0.1, 0.3, 0.0]\n"
    "[[cuts]]\nname = 'dart'\nfrom = [-0.1, 0.0, 0.0]\nto = [-0.1, 0.1, 0.0]\ntip_back = 0.01\n[relax]\nmax_steps = 30\n"
    + _QUIET,
    "[surface]\nfile = 'tube.obj'\nunits = 'm'\n[[cuts]]\nname = 'across'\nplane = {point = [0.1, 0.16, 0.0], normal = [0.0, 1.0, 0.0]}\n"
    "[[cuts]]\nname = 'half'\nplane = {point = [0.0, 0.1, 0.1], normal = [1.0, 0.0, 0.0]}\n[relax]\nmax_steps = 30\n"
    + _QUIET,
    "fabric = 'woven'\n[surface]\nfile = 'nearly.obj'\nunits = 'm'\ncomponent = 'all'\nmeet_mm = 0.7\n[relax]\nmax_steps = 30\n"
    "[pieces.front]\ndatum = 'to back'\ncuts = [{ from = 2, to = 14 }]\n[pieces.back]\ngrain_angle = 45\n"
    "lines = { middle = { vertices = [3, 9] } }\n" + _QUIET,
    "[surface]\nshape = 'dome'\nresolution = 5\n[drape]\nmax_steps = 20\nfriction = 0.2\n" + _QUIET,
)


def _obj(*parts: tuple[str, Any, Any]) -> bytes:
    """The OBJ file of parts: name, vertices and faces of each."""
    return obj_text(*(part[1:] for part in parts), names=[part[0] for part in parts], digits=".6f").encode()


@functools.cache
def garment_meshes() -> dict[str, bytes]:
    """Meshes by name: a tube; two pieces that meet, or nearly; doubled layers; a doublet; a folded quad; a thick sheet; one with a fin."""
    rows, around = 7, 12
    angle, height = 2 * np.pi * np.arange(around) / around, np.linspace(0, 0.3, rows)
    wide = 0.1 + 0.02 * np.cos(angle)[None, :] * (height / 0.3)[:, None]
    tube = np.stack([wide * np.cos(angle), np.repeat(height[:, None], around, 1), wide * np.sin(angle)], -1).reshape(
        -1, 3
    )
    at = np.arange(rows * around).reshape(rows, around)
    belt = np.stack([at[:-1], np.roll(at, -1, 1)[:-1], np.roll(at, -1, 1)[1:], at[1:]], -1).reshape(-1, 4)
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 0.3, 6), np.linspace(0, 0.4, 7)))
    front = np.stack([u, v, 0.05 * np.sin(np.pi * u / 0.3)], -1)
    grid = np.arange(42).reshape(7, 6)
    sheet = quads_between(grid)
    back = front * [1, 1, -1]
    slipped = front + 1e-6
    cap = np.array([[-0.1, 0, 0], [0, -0.1, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.09]])
    doublet = [[0, 1, 2, 4], [0, 4, 2, 3]]
    folded = np.array([[0, 0, 0], [0.5, 0, 0.4], [0.1, 0.5, 0.1], [0.1, 0, 0], [0.4, 0.8, 1.2], [0, 1.2, 0.9]])
    rim = np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])
    wall = np.stack([np.roll(rim, -1), rim, rim + 42, np.roll(rim, -1) + 42], -1)
    thick = np.vstack([sheet, sheet[:, ::-1] + 42, wall])
    bent = front * [1, 1, 3]
    fin = np.stack([grid[1:-1, 2][:-1], grid[1:-1, 2][1:], np.arange(43, 47), np.arange(42, 46)], -1)
    return {
        "thick.obj": _obj(("thick", np.vstack([bent, bent - [0, 0, 0.003]]), thick)),
        "fin.obj": _obj(("fin", np.vstack([front, front[grid[1:-1, 2]] + [0, 0, 0.02]]), np.vstack([sheet, fin]))),
        "tube.obj": _obj(("tube", tube, belt)),
        "pieces.obj": _obj(("front", front, sheet), ("back", back, sheet[:, ::-1])),
        "nearly.obj": _obj(("front", front, sheet), ("back", back[:36] * [1, 1.2, 1] - [0, 0, 4e-4], sheet[:25, ::-1])),
        "double.obj": _obj(("outer", front, sheet), ("inner", slipped, sheet[:, ::-1])),
        "doublet.obj": _obj(("cap", cap, doublet)),
        "folded.obj": _obj(("sheet", folded, [[0, 1, 2, 3], [2, 1, 4, 5]])),
    }


@functools.cache
def whole_garments() -> dict[str, bytes]:
    """Meshes of whole garments by name: trousers, a ball, and a tube."""
    import trimesh

    # Two legs share three places between them; the outer halves of both are the waist.
    turn = np.linspace(0.5 * np.pi, -0.5 * np.pi, 7)
    half = np.stack([0.08 + 0.1 * np.cos(turn), np.zeros(7), 0.11 * np.sin(turn)], -1)[1:-1]
    middle = np.array([[0, 0, 0.11], [0, -0.04, 0], [0, 0, -0.11]])
    points, faces = [*middle.tolist()], list[list[int]]()
    outer = {}
    for side in (1, -1):
        outer[side] = list(range(len(points), len(points) + 5))
        points += (half * [side, 1, 1]).tolist()
    waist = [0, *outer[1], 2, *outer[-1][::-1]]
    for ring, x, way in (
        (waist, 0.0, 1),
        ([0, 1, 2, *outer[1][::-1]], 0.09, -1),
        ([0, *outer[-1], 2, 1], -0.09, -1),
    ):
        for level in range(1, 6):
            new = list(range(len(points), len(points) + len(ring)))
            for k in ring:
                y, share = (0.05, 1.0) if way > 0 else (-0.12, 0.94)
                points.append(
                    [
                        x + (points[k][0] - x) * share,
                        points[k][1] + y if level > 1 or way > 0 else -0.12,
                        points[k][2] * share,
                    ]
                )
            count = len(ring)
            faces += [[ring[k], ring[(k + 1) % count], new[(k + 1) % count], new[k]][::way] for k in range(count)]
            ring = new
    ball = trimesh.creation.icosphere(2, radius=0.1)
    return {
        "trousers.obj": _obj(("trousers", points, faces)),
        "ball.obj": _obj(("ball", ball.vertices, ball.faces)),
        "tube.obj": garment_meshes()["tube.obj"],
    }


@functools.cache
def meshes_with_seams() -> dict[str, bytes]:
    """A skirt of two islands of texture, materials and groups, as OBJ, and as GLB and USD where their libraries write it."""
    import trimesh
    from pxr import Sdf, Usd, UsdGeom

    rows, around = 5, 12
    turn, height = 2 * np.pi * np.arange(around) / around, np.linspace(0, 0.4, rows)
    points = np.array([[0.15 * np.cos(a), y, 0.15 * np.sin(a)] for y in height for a in turn])
    at = np.arange(rows * around).reshape(rows, around)
    faces = np.stack([at[:-1], at[1:], np.roll(at, -1, 1)[1:], np.roll(at, -1, 1)[:-1]], -1)
    wide = around // 2 + 1
    own = np.arange(2 * rows * wide).reshape(2, rows, wide)
    corners = np.concatenate(
        [np.stack([one[:-1, :-1], one[1:, :-1], one[1:, 1:], one[:-1, 1:]], -1) for one in own], axis=1
    )
    step = 0.15 * 2 * np.pi / around
    places = np.array([[k + step * u, y] for k in (0, 1) for y in height for u in range(wide)])
    text = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points] + [f"vt {u:.6f} {v:.6f}" for u, v in places]
    for half, name in enumerate(("front", "back")):
        text += [f"g {name}", f"usemtl {name}"]
        part = (slice(None), slice(half * around // 2, (half + 1) * around // 2))
        text += [
            "f " + " ".join(f"{v + 1}/{t + 1}" for v, t in zip(quad, corner, strict=True))
            for quad, corner in zip(
                faces[part].reshape(-1, 4).tolist(), corners[part].reshape(-1, 4).tolist(), strict=True
            )
        ]
    quads, corners = faces.reshape(-1, 4), corners.reshape(-1, 4)
    of = np.empty(len(places), dtype=int)
    of[corners.ravel()] = quads.ravel()
    triangles = np.concatenate([corners[:, :3], corners[:, [0, 2, 3]]])
    visual = trimesh.visual.TextureVisuals(uv=places, material=trimesh.visual.material.PBRMaterial(name="cloth"))
    scene = trimesh.Scene(trimesh.Trimesh(points[of], triangles, visual=visual, process=False))
    gltf = scene.export(file_type="gltf", embed_buffers=True)
    (main,) = (data for file, data in gltf.items() if file.endswith(".gltf"))
    files = {
        "obj": "\n".join([*text, ""]).encode(),
        "glb": scene.export(file_type="glb"),
        "gltf": json.dumps(json.loads(main)).encode(),
    }
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("usda", "usdc"):
            stage = Usd.Stage.CreateNew(f"{folder}/skirt.{kind}")
            UsdGeom.SetStageMetersPerUnit(stage, 1.0)
            mesh = UsdGeom.Mesh.Define(stage, "/Skirt")
            mesh.CreatePointsAttr(points.tolist())
            mesh.CreateFaceVertexCountsAttr([4] * len(quads))
            mesh.CreateFaceVertexIndicesAttr(quads.ravel().tolist())
            texture = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
            texture.Set(places.tolist())
            texture.SetIndices(corners.ravel().tolist())
            for name, first in (("front", 0), ("back", 6)):
                chosen = [face for face in range(len(quads)) if face % around // 6 * 6 == first]
                UsdGeom.Subset.CreateGeomSubset(mesh, name, UsdGeom.Tokens.face, chosen, "pieces")
                UsdGeom.Subset.CreateGeomSubset(mesh, f"{name}_cloth", UsdGeom.Tokens.face, chosen, "materialBind")
            stage.GetRootLayer().Save()
            files[kind] = Path(f"{folder}/skirt.{kind}").read_bytes()
    return files


def wrong_shape(random: Random, content: bytes) -> bytes:
    """A mesh (OBJ) of which something is no number, far away, without area, twice there, or gone."""
    rows = [row for row in content.decode().splitlines() if row[:2] in ("v ", "f ")]
    points = np.array([row.split()[1:4] for row in rows if row[0] == "v"], dtype=float)
    faces = [[int(word.split("/")[0]) - 1 for word in row.split()[1:]] for row in rows if row[0] == "f"]
    for _ in range(random.choice((1, 1, 2))):
        what, some = random.randrange(8), random.randrange(len(points))
        if what == 0:
            points[some, random.randrange(3)] = random.choice((np.nan, np.inf))
        elif what == 1:
            points[some] = random.choice((1e7, -1e7, 1e30)) * np.eye(3)[random.randrange(3)]
        elif what == 2:
            points = points * random.choice((1e7, 1e-7, 0.0)) + random.choice((0.0, 1e7))
        elif what == 3:  # flat, or a line
            points[:, random.randrange(3)] = 0.0
        elif what == 4:
            for face in faces[:: random.choice((1, 2, 50))]:
                face[1] = face[0]
        elif what == 5:  # two of them, perhaps in one place
            faces += [[k + len(points) for k in face] for face in faces]
            points = np.vstack([points, points + random.choice((0.0, 0.5, 3.0)) * np.eye(3)[0]])
        elif what == 6:  # a half
            axis = random.randrange(3)
            middle = np.nanmedian(points[:, axis])
            faces = [face for face in faces if points[face, axis].max() <= middle] or faces[:1]
        else:
            points[:, random.randrange(3)] *= -1.0
    text = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    return "\n".join([*text, *("f " + " ".join(str(k + 1) for k in face) for face in faces), ""]).encode()


def geometry_case(kind: str, random: Random) -> Case:
    """A damaged scene or mesh of a kind, and the command that reads it."""
    if kind in ("body", "worn body"):
        return _on_a_body(kind, random)
    if kind in ("form", "finishing", "tables"):
        texts = {"form": _FORMS, "finishing": _FINISHED, "tables": _SURFACES}[kind]
        content = little_work(damaged_toml(random, random.choice(texts)))
        seconds = 120.0 if b"mannequin" in content else 40.0
        return _read(kind, "run FILE --out out --quiet", "odd.scene.toml", content, garment_meshes(), seconds=seconds)
    if kind == "islands":
        ending, seed = random.choice(list(meshes_with_seams().items()))
        units = "--units m" if ending == "obj" else ""
        how = random.choice(("uv", "materials", "groups", "file", "auto"))
        if ending == "gltf" and random.randrange(2):
            content = damaged_json(random, json.loads(seed))
        else:
            content = damaged_bytes(random, seed)
        command = f"flatten FILE {units} --seams {how} --max-steps 30 --out out {BARE}"
        return _read(kind, command, f"odd.{ending}", content)
    meshes = whole_garments() if kind == "garment" else garment_meshes()
    name = random.choice(list(garment_meshes()))
    command = f"flatten FILE --units {random.choice(('m', 'm', 'cm'))} --out out {BARE} "
    if kind == "garment":
        name = random.choice(list(meshes))
        command += "--seams auto --fabric woven --max-steps 30 "
        command += random.choice(("", "--front -z", "--up +z", "--no dart", "--limit 1"))
    elif kind == "pieces":
        command += "--component all " + random.choice(("", "", "--meet 0", "--meet 10"))
    else:
        name = random.choice(("tube.obj", name))
        ends = [random.choice((random.randrange(84), 0, 72, 10**6)) for _ in range(2)]
        command += f"--open {ends[0]},{ends[1]}"
    # A wrong vertex of --open is a fault of the command line.
    return _read(kind, command, "odd.obj", damaged_bytes(random, meshes[name]), is_named=kind != "open")


def _read(
    kind: str,
    command: str,
    file: str,
    content: bytes,
    beside: Mapping[str, bytes] | None = None,
    *,
    seconds: float = 40.0,
    is_named: bool = True,
) -> Case:
    """The case of a command that reads a FILE of a content."""
    files, subject = {**(beside or {}), file: content}, file if is_named else ""
    return Case(
        kind, files, words(command.replace("FILE", file)), subject=subject, leaves="out/metrics.json", seconds=seconds
    )


def _on_a_body(kind: str, random: Random) -> Case:
    """A body that is scanned, or one with a skirt on it; one of both is of a wrong shape."""
    skirt, body = seeds.SKIRT, random.choice(seeds.bodies())
    if kind == "body" or random.randrange(2):
        body = wrong_shape(random, body)
    else:
        skirt = wrong_shape(random, skirt)
    if kind == "body":
        return _read(
            kind, "mannequin --scan FILE --units m --resolution 40 --out out -q", "odd.obj", body, seconds=90.0
        )
    command = f"fit skirt.obj --units m --to 'EU 38' --out out {BARE} "
    command += random.choice(("", "--from body.obj", "--from 'EU 40'"))
    files = {"skirt.obj": skirt, "body.obj": body}
    return Case(kind, files, words(command), subject="skirt.obj", leaves="out/fit.json", seconds=90.0)
