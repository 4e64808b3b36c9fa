"""Patterns of other programs, and folders of runs that others have changed: their seeds, damages and cases.

The kinds: "dxf" and "svg" (their edges are listed), "sewing" (a TOML file of seams beside a DXF), "garmentcode" (JSON of another
program), "rul" (grade rules, which are no pattern), and the members of a run's folder, "frames", "lift", "runmetrics" and
"runpattern", each read by the commands that read it. "worn" is a pattern with all by which a drape chooses what is worn in one layer:
buttons, folds, facings, strips, collars and pockets.
"""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from warpflat.app.cli.main import main
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.export.pattern_json import pattern_json

from .damage import damaged_bytes, damaged_json, damaged_toml

__all__ = ["MEMBERS", "damaged_foreign", "drawing", "in_out", "tags"]

MEMBERS = {
    "frames": "frames.usdc",
    "lift": "bodice.obj",
    "runmetrics": "metrics.json",
    "runpattern": "pattern.json",
}
_SCENE = """fabric = 'denim'
datum = 'centre'
name = 'bodice'
[surface]
shape = 'bodice'
resolution = 5
[relax]
max_steps = 30
[output]
frames = 6
picture = false
review = false
[pattern]
formats = ['json', 'dxf', 'svg']
"""
_SEWING = """spacing_mm = 20
allowance_mm = 5
fabric = 'woven'
[[seams]]
name = 'side'
sides = ['PIECE.edge_1', 'PIECE.edge_3']
[[pieces]]
name = 'PIECE'
quantity = 2
at = 'front'
[mannequin]
size = 'EU 38'
"""
_GARMENTCODE = {
    "pattern": {
        "panels": {
            "front": {
                "translation": [0, 100, 20],
                "rotation": [0, 0, 0],
                "vertices": [[0, 0], [40, 0], [40, 60], [24, 60], [20, 45], [16, 60], [0, 60]],
                "edges": [
                    {"endpoints": [0, 1], "curvature": {"type": "circle", "params": [50, 0, 1]}, "label": "hem"},
                    {"endpoints": [1, 2], "curvature": {"type": "quadratic", "params": [[0.5, 0.1]]}},
                    {"endpoints": [2, 3], "label": "lower_interface"},
                    {"endpoints": [3, 4]},
                    {"endpoints": [4, 5]},
                    {"endpoints": [5, 6], "label": "lower_interface"},
                    {"endpoints": [6, 0], "curvature": [0.5, 0.1]},
                ],
            },
            "left_sleeve": {
                "translation": [50, 110, -5],
                "rotation": [0, 0, -50],
                "label": "arm",
                "vertices": [[0, 0], [0, 30], [20, 30], [20, 0]],
                "edges": [
                    {"endpoints": [0, 1]},
                    {"endpoints": [1, 2], "curvature": {"type": "cubic", "params": [[0.3, 0.1], [0.7, -0.1]]}},
                    {"endpoints": [2, 3]},
                    {"endpoints": [3, 0]},
                ],
            },
        },
        "stitches": [
            [{"panel": "front", "edge": 1}, {"panel": "front", "edge": 6}],
            [{"panel": "front", "edge": 3}, {"panel": "front", "edge": 4}],
            [{"panel": "left_sleeve", "edge": 0}, {"panel": "left_sleeve", "edge": 2}, "right_wrong"],
        ],
        "panel_order": ["front", "left_sleeve"],
        "open": [{"at": 1, "stitch": [{"panel": "left_sleeve", "edge": 1}, {"panel": "left_sleeve", "edge": 3}]}],
    },
    "parameters": {},
    "parameter_order": [],
    "properties": {"curvature_coords": "relative", "units_in_meter": 100, "normalize_panel_translation": False},
}
_RUL = b"ASTM/D13Proposal 1 Version: D 6673-04\nUNITS: METRIC\nGRADE RULE TABLE: a\nSIZE LIST: 36 38\nRULE: DELTA 1\n0.0,0.0 1.0,2.0\nEND\n"
_FREESEWING = b"""<svg xmlns="http://www.w3.org/2000/svg" width="452mm" height="330mm" viewBox="0 0 452 330"><g id="fs-container">
<g id="fs-stack-aaron.front" transform="translate(12,12)"><g id="fs-stack-aaron.front-part-aaron.front">
<path d="M 0,0 L 200,0 C 200,100 190,200 180,300 L 0,300 z" class="fabric"/>
<path d="M -10,-10 L 210,-10 L 190,310 L -10,310 z" class="fabric sa"/>
<path d="M 100,40 L 100,260" class="note" marker-end="url(#grainlineTo)"/></g></g></g></svg>
"""
_SVG = b"""<?xml version="1.0"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "svg11.dtd" [<!ENTITY ns "http://www.w3.org/2000/svg">]>
<svg xmlns="http://www.w3.org/2000/svg" width="400mm" height="300mm" viewBox="0 0 400 300">
<g transform="translate(5,5) rotate(3) scale(1.0)" id="layer"><path id="A" d="M0,0 h100 v80 q-50,20 -100,0 z"/>
<path id="B" d="M150,0 C200,10 240,0 260,60 A30,20 10 0 1 200,120 L150,100 Z"/></g>
<rect id="C" x="300" y="10" width="60" height="90"/><polygon points="10,200 60,200 60,250"/>
<polyline points="100,200 160,200 160,260 100,260 100,200"/></svg>
"""


def tags(*pairs: tuple[int, object]) -> str:
    return "".join(f"{code}\n{value}\n" for code, value in pairs)


def drawing() -> bytes:
    """A block of a polyline with a bulge, and lines, an arc, a circle, an ellipse and a spline beside it."""
    ring = tags((0, "POLYLINE"), (8, 1), (66, 1), (70, 1))
    for x, y, bulge in ((0, 0, 0), (400, 0, 0.2), (400, 300, 0), (0, 300, -0.1)):
        ring += tags((0, "VERTEX"), (8, 1), (10, x), (20, y), (42, bulge))
    ring += tags((0, "SEQEND"))
    texts = "".join(
        tags((0, "TEXT"), (8, 1), (10, 5), (20, 5), (40, 5), (1, text))
        for text in ("PIECE NAME: B", "SIZE: M", "QUANTITY: 2", "UNITS: METRIC")
    )
    grain = tags((0, "LINE"), (8, 7), (10, 50), (20, 50), (11, 50), (21, 250))
    others = tags((0, "CIRCLE"), (8, 2), (10, 700), (20, 0), (40, 60))
    others += tags((0, "ARC"), (8, 2), (10, 900), (20, 0), (40, 60), (50, 10), (51, 200))
    others += tags(
        (0, "ELLIPSE"),
        (100, "AcDbEntity"),
        (8, 2),
        (100, "AcDbEllipse"),
        (10, 900),
        (20, 300),
        (11, 50),
        (21, 0),
        (40, 0.5),
        (41, 0),
        (42, 6.283185307),
    )
    others += tags((0, "LWPOLYLINE"), (100, "AcDbEntity"), (8, 2), (100, "AcDbPolyline"), (90, 3), (70, 1))
    others += tags((10, 0), (20, 600), (42, 0.3), (10, 100), (20, 600), (10, 100), (20, 700))
    others += tags(
        (0, "SPLINE"), (100, "AcDbEntity"), (8, 2), (100, "AcDbSpline"), (70, 8), (71, 3), (72, 8), (73, 4), (74, 0)
    )
    others += tags(*((40, knot) for knot in (0, 0, 0, 0, 1, 1, 1, 1)))
    others += "".join(tags((10, x), (20, y), (30, 0)) for x, y in ((300, 600), (350, 700), (400, 500), (450, 600)))
    others += tags(
        (0, "MTEXT"), (100, "AcDbEntity"), (8, 2), (100, "AcDbMText"), (10, 0), (20, 0), (1, "STYLE NAME: a")
    ) + tags((0, "POINT"), (8, 2), (10, 0), (20, 0))
    insert = tags((0, "INSERT"), (8, 1), (2, "B"), (10, 0), (20, 0))
    block = (
        tags((0, "BLOCK"), (8, 1), (2, "B"), (70, 0), (10, 0), (20, 0))
        + ring
        + texts
        + grain
        + tags((0, "ENDBLK"), (8, 1))
    )
    header = tags(
        (0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1015"), (9, "$INSUNITS"), (70, 4), (0, "ENDSEC")
    )
    blocks = tags((0, "SECTION"), (2, "BLOCKS")) + block + tags((0, "ENDSEC"))
    entities = tags((0, "SECTION"), (2, "ENTITIES")) + insert + others + tags((0, "ENDSEC"), (0, "EOF"))
    return (header + blocks + entities).encode()


@functools.cache
def in_out() -> dict[str, bytes]:
    """The files of a small run in the folder `out`."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "bodice.toml").write_text(_SCENE)
        main(["run", f"{folder}/bodice.toml", "--out", f"{folder}/out", "--quiet"])
        return {f"out/{file.name}": file.read_bytes() for file in (Path(folder) / "out").iterdir()}


@functools.cache
def _worn() -> bytes:
    """A tube with a button stand and a facing grown on, a collar and its stand, a pocket, a binding and a facing."""
    height, half = 0.09, 0.475

    def piece(name: str, ring: Sequence[tuple[float, float]], names: Sequence[str], **more: Any) -> Piece:
        closed = np.array([*ring, ring[0]])
        edges = [Edge(name=each, points=closed[k : k + 2]) for k, each in enumerate(names)]
        return Piece(name=name, edges=edges, **more)

    def strip(name: str, long: float, high: float, **more: Any) -> Piece:
        return piece(name, [(0, 0), (long, 0), (long, high), (0, high)], ("low", "right", "high", "left"), **more)

    def seam(name: str, *rows: str) -> Seam:
        """Edges as "piece.edge", those that run against the first side's with a "-", those of a turned piece with a "~"."""
        sides = [
            tuple(
                SeamSide(piece=p.strip("-~"), edge=e, reversed="-" in p, mirrored="~" in p)
                for p, e in (one.split(".") for one in row.split(" + "))
            )
            for row in rows
        ]
        return Seam(name=name, sides=(sides[0], sides[1]))

    quarter, fold, facing = 0.5 * half, 0.5 * half + 0.018, 0.5 * half + 0.05
    marks = {"button": np.array([quarter, 0.03]), "button 2": np.array([quarter, 0.07]), "notch": np.array([0.1, 0.05])}
    lines = {
        f"buttonhole{ending}": np.array([[quarter + 0.003, y], [quarter - 0.012, y]])
        for ending, y in (("", 0.03), (" 2", 0.07))
    }
    lines |= {"fold line": np.array([[fold, 0.0], [fold, height]]), "waist": np.array([[0.0, 0.04], [fold, 0.04]])}
    ring = [(0.0, 0.0), (fold, 0.0), (facing, 0.0), (facing, height), (fold, height), (0.0, height)]
    names = ("low", "facing low", "stand", "facing high", "high", "side")
    hole = Hole(name="eye", points=np.array([[0.1, 0.02], [0.105, 0.045], [0.1, 0.07], [0.095, 0.045]]), kind="dart")
    binding = strip("binding", half, 0.02, role="strip")
    low, right, high, left = binding.edges
    binding = replace(binding, edges=[low, right, replace(high, kind="cut", allowance=0.0), left])
    pieces = [
        piece("front", ring, names, quantity=2, marks=marks, internal_lines=lines),
        strip("back", half, height, holes=[hole]),
        strip("collar_stand", 2 * fold + half, 0.03, role="collar", marks={"button": np.array([0.01, 0.015])},
              internal_lines={"buttonhole": np.array([[2 * fold + half - 0.015, 0.015], [2 * fold + half - 0.005, 0.015]])}),
        strip("collar", 2 * fold + half, 0.05, role="collar", quantity=2),
        binding, strip("bag", 0.1, 0.05, role="pocket"),
        strip("neck facing", half, 0.04, role="facing"),
    ]  # fmt: skip
    seams = [
        seam("side left", "back.left", "~front.side"), seam("side right", "-front.side", "back.right"),
        seam("stand", "collar_stand.low", "~front.high + -back.high + -front.high"),
        seam("collar", "collar.low", "-collar_stand.high"), seam("collar edge", "collar.high", "~collar.high"),
        seam("binding", "binding.low", "-back.low"), seam("bag", "bag.left", "-bag.right"),
    ]  # fmt: skip
    pattern = Pattern(name="worn", pieces={"": pieces}, seams=seams)
    return json.dumps(pattern_json(draft_garment(pattern))).encode()


def _moved_marks(random: Random, pattern: Any) -> Any:
    """What a drape reads of the pieces, moved, renamed, swapped or of another kind, each still a value that its key may have."""
    for _ in range(random.choice((1, 1, 2, 4))):
        piece = random.choice(list(pattern["sizes"][""].values()))
        lines, drills = piece["internal_lines"], piece["drill_holes"]
        title = random.choice(
            ("button", "buttonhole", "button 2", "button mirrored", "fold line", "buttonhole end 1", " ", "waist")
        )
        place = [random.choice((0.0, 0.03, 1e-7, random.uniform(-0.3, 0.5))) for _ in range(2)]
        what = random.randrange(8)
        if what == 0 and drills:
            random.choice(drills)["at"] = place
        elif what == 1 and drills:
            old = random.choice(drills)
            piece["marks"] = [title if mark == old["name"] else mark for mark in piece["marks"]]
            old["name"] = title
        elif what == 2:
            drills.append({"name": title, "at": place})
            piece["marks"].append(title)
        elif what == 3 and lines:
            random.choice(random.choice(list(lines.values())))[:] = place
        elif what == 4:
            lines[title] = [place, [random.uniform(-0.3, 0.5), random.choice((place[1], 0.02))]] * random.choice(
                (1, 1, 3)
            )
        elif what == 5 and lines:
            lines[title] = lines.pop(random.choice(list(lines)))
        elif what == 6:
            piece["role"] = random.choice(("shell", "facing", "interfacing", "strip", "collar", "pocket", "cuff"))
            piece["quantity"] = random.choice((1, 2, 3, 4))
            piece["paired"] = random.choice((True, False))
        else:
            edge = random.choice(piece["edges"])
            edge["allowance"], edge["kind"] = random.choice((0.0, 0.01)), random.choice(("seam", "cut", "hem", "fold"))
    return pattern


def _seeds(kind: str) -> tuple[bytes, ...]:
    if kind in MEMBERS:
        return (in_out()[f"out/{MEMBERS[kind]}"],)
    if kind in ("dxf", "svg"):
        return in_out()[f"out/bodice.{kind}"], *((drawing(), drawing()) if kind == "dxf" else (_SVG, _FREESEWING))
    if kind == "worn":
        return (_worn(),)
    return {"sewing": (_SEWING.encode(),), "garmentcode": (json.dumps(_GARMENTCODE).encode(),), "rul": (_RUL,)}[kind]


def damaged_foreign(kind: str, random: Random) -> bytes:
    """A damaged seed of one of these kinds."""
    seed = random.choice(_seeds(kind))
    if kind == "sewing":
        return damaged_toml(random, seed.decode())
    if kind == "worn" and random.randrange(4):
        return json.dumps(_moved_marks(random, json.loads(seed))).encode()
    if kind in ("garmentcode", "runmetrics", "runpattern", "worn"):
        return damaged_json(random, json.loads(seed))
    return damaged_bytes(random, seed)
