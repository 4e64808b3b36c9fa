"""Files whose content is known, so that what is lost is seen: drawings, stages of several layers, and glTF with extensions.

The kinds: "drawn" (a DXF or SVG of some pieces, as programs draw them; each must be listed or named), "stage" (USD layers that refer to
others, some missing, outside, a device or a circle; what is missing must be refused) and "gltf extension" (required, sparse, quantised).
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from random import Random
from typing import Any

import numpy as np

from .foreign_files import tags
from .promise import Case, words
from .seeds import BARE, meshes

__all__ = ["drawn", "extension", "stage"]

_FOLDS = (0.0, 90.0, 33.0, 200.0)

Points = list[tuple[float, float]]


def _outline(random: Random, at: float) -> Points:
    """A piece of 5 to 9 corners [mm], whose first and last lie on a line of symmetry."""
    wide, high = random.uniform(120, 400), random.uniform(150, 700)
    corners = [(0.0, 0.0)]
    for k in range(1, random.randrange(4, 9)):
        turn = math.pi * (k / 9.0 - 0.5)
        corners.append((wide * math.cos(turn) * random.uniform(0.8, 1.0), high * (0.5 + 0.5 * math.sin(turn))))
    return [(at + x, y) for x, y in [*corners, (0.0, high)]]


def _runs(random: Random, points: Points) -> list[Points]:
    """The closed line as one line, or as several whose ends meet within .04 mm, in any order and direction."""
    ring = [*points, points[0]]
    if random.randrange(2):
        return [ring]
    cuts = sorted({0, len(points), *random.sample(range(1, len(points)), 2)})
    runs = [ring[a : b + 1] for a, b in pairwise(cuts)]
    runs = [[(x + random.uniform(-0.015, 0.015), y) if k in (0, len(run) - 1) else (x, y) for k, (x, y) in enumerate(run)]
            for run in runs]  # fmt: skip
    random.shuffle(runs)
    return [run[:: random.choice((1, -1))] for run in runs]


def _line(points: Sequence[tuple[float, float]], layer: str, *, closed: bool = False) -> str:
    rows = "".join(tags((0, "VERTEX"), (8, layer), (10, f"{x:.4f}"), (20, f"{y:.4f}")) for x, y in points)
    return tags((0, "POLYLINE"), (8, layer), (66, 1), (70, int(closed))) + rows + tags((0, "SEQEND"), (8, layer))


def _dxf(random: Random, names: Sequence[str]) -> bytes:
    blocks, inserts = "", ""
    for number, name in enumerate(names):
        outline = _outline(random, 800.0 * number)
        folded = random.randrange(3) == 0
        size = random.choice(("", "M"))
        block = tags((0, "BLOCK"), (8, 1), (2, f"B{number}"), (70, 0), (10, 0), (20, 0))
        for text in (f"Piece Name: {name}", f"Size: {size}"):
            block += tags((0, "TEXT"), (8, 1), (10, 0), (20, 0), (40, 5), (1, text))
        if folded:
            block += _line([outline[0], outline[-1]], "6")
        if folded and random.randrange(2):
            block += _line(outline, "1")
        else:
            block += "".join(_line(run, "1") for run in _runs(random, outline))
        blocks += block + tags((0, "ENDBLK"), (8, 1))
        inserts += tags((0, "INSERT"), (8, 1), (2, f"B{number}"), (10, 0), (20, 0))
    units = tags((0, "TEXT"), (8, 1), (10, 0), (20, 0), (40, 5), (1, "UNITS: METRIC"))
    head = tags(
        (0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009"), (0, "ENDSEC"), (0, "SECTION"), (2, "BLOCKS")
    )
    middle = tags((0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES"))
    return (head + blocks + middle + units + inserts + tags((0, "ENDSEC"), (0, "EOF"))).encode()


def _svg(random: Random, names: Sequence[str]) -> bytes:
    shapes = ""
    for number, name in enumerate(names):
        at, turn = 800.0 * number, random.choice(_FOLDS)
        placed = random.choice(
            ("", f'transform="rotate({turn} {at} 0)"', 'transform="skewX(10)"', 'transform="scale(1 -1)"')
        )
        what, label = random.randrange(5), f'id="{name}"'
        if what == 0:
            shapes += f'<circle {label} {placed} cx="{at + 200}" cy="300" r="150"/>'
        elif what == 1:
            shapes += f'<ellipse {label} {placed} cx="{at + 200}" cy="300" rx="150" ry="80"/>'
        elif what == 2:
            shapes += f'<rect {label} {placed} x="{at}" y="10" width="200" height="300" rx="{random.choice((0, 20))}"/>'
        elif what == 3:
            points = " ".join(f"{x:.3f},{y:.3f}" for x, y in _outline(random, at))
            shapes += f'<polygon {label} {placed} points="{points}"/>'
        else:
            runs = ("M" + " L".join(f"{x:.4f},{y:.4f}" for x, y in run) for run in _runs(random, _outline(random, at)))
            shapes += f"<g {label} {placed}>" + "".join(f'<path d="{run}"/>' for run in runs) + "</g>"
    frame = '<rect x="1" y="1" width="4998" height="1998"/>' if random.randrange(3) == 0 and len(names) > 1 else ""
    head = '<svg xmlns="http://www.w3.org/2000/svg" width="5000mm" height="2000mm" viewBox="0 0 5000 2000">'
    return f"{head}{frame}{shapes}</svg>".encode()


def drawn(random: Random) -> Case:
    names = random.sample(("FRONT", "BACK", "SLEEVE", "YOKE", "COLLAR", "POCKET"), random.randrange(1, 6))
    ending, made = random.choice((("dxf", _dxf), ("svg", _svg)))
    file = f"drawn.{ending}"
    arguments = random.choice((
        ("drape", file, "--edges"), ("export", file, "--format", "json", "--out", "made"),
        ("marker", file, "--seconds", "1", "--width", "300", "--out", "made"),
    ))  # fmt: skip
    listed = tuple(names) if arguments[0] == "drape" else ()
    return Case("drawn", {file: made(random, names)}, arguments, file, names=listed, refused=False, seconds=60.0)


def stage(random: Random) -> Case:
    """Layers in a row, each referring to the next in some way; the last is a mesh, or not there as it should be."""
    mesh = meshes("usda")[0]
    count = random.randrange(1, 4)
    wrong = random.choice(("", "", "missing", "outside", "device", "damaged", "link"))
    last = "../outside.usda" if wrong == "outside" else f"layer{count}.usda"
    files = {}
    for number in range(count):
        to = f"layer{number + 1}.usda" if number + 1 < count else last
        to = random.choice(("", "./")) + to if not to.startswith("..") else to
        arc = random.choice(("references", "payload", "prepend references"))
        root = f'def Xform "World" ({arc} = @{to}@)\n{{\n}}\n'.replace("(", "(\n    ").replace(")\n{", "\n)\n{")
        head = '(\n    defaultPrim = "World"\n    metersPerUnit = 0.01\n    upAxis = "Y"\n)\n'
        if random.randrange(3) == 0:
            head, root = (
                f'(\n    defaultPrim = "World"\n    metersPerUnit = 0.01\n    upAxis = "Y"\n    subLayers = [@{to}@]\n)\n',
                "",
            )
        files["in/stage.usda" if number == 0 else f"in/layer{number}.usda"] = f"#usda 1.0\n{head}{root}".encode()
    links = {}
    if wrong == "outside":
        files["outside.usda"] = mesh
    elif wrong == "device":
        links[f"in/{last}"] = "/dev/zero"
    elif wrong == "link":
        files["elsewhere/mesh.usda"] = mesh
        links[f"in/{last}"] = "../elsewhere/mesh.usda"
    elif wrong != "missing":
        files[f"in/{last}"] = mesh[: len(mesh) // 2] if wrong == "damaged" else mesh
    arguments = words(f"flatten in/stage.usda --out made {BARE}")
    return Case("stage", files, arguments, "in/stage.usda", links=links, refused=bool(wrong), seconds=60.0)


def _sparse(table: dict[str, Any], random: Random) -> None:
    position = table["accessors"][table["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    count = random.choice((1, 3, 10**9))
    rows = np.arange(min(count, position["count"]), dtype="<u2")
    data = rows.tobytes() + np.zeros((len(rows), 3), dtype="<f4").tobytes()
    buffer, view = len(table["buffers"]), len(table["bufferViews"])
    table["buffers"].append({"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()})
    table["bufferViews"] += [
        {"buffer": buffer, "byteLength": rows.nbytes},
        {"buffer": buffer, "byteOffset": rows.nbytes, "byteLength": len(data) - rows.nbytes},
    ]
    position["sparse"] = {
        "count": count, "indices": {"bufferView": view, "componentType": 5123}, "values": {"bufferView": view + 1},
    }  # fmt: skip


def _odd(key: str, value: object) -> Callable[[dict[str, Any], Random], None]:
    """A change of the accessor of positions."""

    def change(table: dict[str, Any], random: Random) -> None:
        table["accessors"][table["meshes"][0]["primitives"][0]["attributes"]["POSITION"]][key] = value

    return change


def extension(random: Random) -> Case:
    table = json.loads(meshes("gltf")[0])
    name = random.choice(
        ("KHR_unheard_of", "EXT_meshopt_compression", "KHR_draco_mesh_compression", "KHR_materials_unlit", "VRM")
    )
    refused: bool | None = None
    if random.randrange(2):
        table["extensionsUsed"] = table["extensionsRequired"] = [name]
        refused = True if name in ("KHR_unheard_of", "EXT_meshopt_compression", "KHR_draco_mesh_compression") else None
    changes = [
        _sparse, _odd("normalized", True), _odd("componentType", random.choice((5120, 5122, 5125, 7))), _odd("count", 10**12),
        _odd("sparse", {}), _odd("type", random.choice(("VEC2", "MAT4", ""))), _odd("bufferView", 99),
    ]  # fmt: skip
    for change in random.sample(changes, random.randrange(3)):
        change(table, random)
    if random.randrange(4) == 0:
        table["meshes"][0]["primitives"][0]["mode"] = random.choice((0, 1, 5, 6, 7))
    arguments = words(f"flatten odd.gltf --units m --out made {BARE}")
    return Case("gltf extension", {"odd.gltf": json.dumps(table).encode()}, arguments, "odd.gltf", refused=refused)
