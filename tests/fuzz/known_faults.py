"""Faults once found, one case each: what `python -m tests.fuzz --list` runs, with the files in tests/regressions."""

from __future__ import annotations

import json
import math
import resource
import signal
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from obj_files import obj_text
from surface_meshes import grid

from .damage import DIGITS, NAMES
from .foreign_files import tags
from .kinds import cases_of_file
from .promise import CLOTH, Case, Environment, words
from .regressions import cases_of, regression_files
from .seeds import BARE, FABRIC, METRICS, SCENES, SHORT, bodies, meshes, pattern

__all__ = ["GROUPS", "known_faults"]

LONG = "a" * 3000
NESTED = b"[" * 100_000 + b"]" * 100_000
KILOBYTE = 1024


def known_faults() -> Iterator[Case]:
    """All of them; those with an environment come last, need a process each and take seconds."""
    for faults in GROUPS.values():
        yield from faults()
    for path in regression_files():
        yield from (replace(case, name=f"{path.name}: {case.arguments[0]}") for case in cases_of(path))
    yield from _environments()


def _grid(columns: int) -> bytes:
    """A gently curved square sheet as OBJ."""
    sheet = grid(columns, columns, lambda x, y: np.stack([x, y, 0.1 * x * (1 - x) * y], axis=-1))
    return obj_text(sheet, digits=".6f").encode()


def _named(kind: str, content: bytes | str, name: str, **more: Any) -> Iterator[Case]:
    """The cases of a file, under the name of the fault."""
    data = content.encode() if isinstance(content, str) else content
    for case in cases_of_file(kind, data, **more):
        yield replace(case, name=name if case.arguments[0] != "fabrics" else f"{name} (listed)")


def _inputs_replaced() -> Iterator[Case]:
    """Runs whose files would have the name of what they read."""
    obj, usd = {"front.obj": CLOTH}, {"frames.usdc": meshes("usdc")[0]}
    scene = SCENES["file"].replace("fabric_files = ['own.toml']\n", "").replace("'own'", "'woven'").encode()
    flatten = f"flatten front.obj --units cm {BARE} --out"
    yield Case("obj", obj, words(f"{flatten} ."), name="flatten --out . beside its OBJ")
    yield Case("usdc", usd, words("flatten frames.usdc --out ."), name="flatten --out . of a frames.usdc", seconds=60)
    named = {"cloth.obj": CLOTH, "cloth.toml": scene}
    yield Case("scene", named, words("run cloth.toml --out ."), name="run --out . beside its mesh")
    linked, there = {"store/front.obj": CLOTH}, {"front.obj": "store/front.obj"}
    yield Case("obj", linked, words(f"{flatten} store"), links=there, name="input is a link into --out")
    for links, name in (
        ({"out/front.obj": "../front.obj"}, "--out holds a link to the input"),
        ({"out": "."}, "--out is a link to the input's folder"),
    ):
        yield Case("obj", obj, words(f"{flatten} out"), links=links, name=name)


def _patterns() -> Iterator[Case]:
    """Damaged pattern.json files in `export`."""
    text = json.dumps(pattern())

    def changed(name: str, *steps: tuple[str, Any]) -> Iterator[Case]:
        data = json.loads(text)
        pieces = next(iter(data["sizes"].values()))
        for key, value in steps:
            piece = pieces[next(iter(pieces))]
            if key == "name":
                pieces[value] = pieces.pop(next(iter(pieces)))
            elif key == "edge name":
                piece["edges"][0]["name"] = value
            elif key in piece["edges"][0]:
                piece["edges"][0][key] = value
            elif key in piece["label"]:
                piece["label"][key] = value
            else:
                piece[key] = value
        yield from _named("pattern", json.dumps(data), f"pattern.json: {name}")

    edge = next(iter(next(iter(pattern()["sizes"].values())).values()))["edges"][0]
    yield from _named("pattern", NESTED, "pattern.json: 100,000 nested lists")
    yield from _named(
        "pattern", text.replace('"schema": 1', f'"schema": {DIGITS}'), "pattern.json: a number of 5,000 digits"
    )
    yield from changed("`straight` one entry short", ("straight", edge["straight"][:-1]))
    yield from changed("`cut_line` empty", ("cut_line", []))
    yield from changed("inf", ("length", float("inf")))
    yield from changed("inf in a line", ("line", [[0.0, 0.0], [float("inf"), 0.0]]))
    yield from changed("an edge name that is a number", ("edge name", 3))
    for key, value in (("at", "here"), ("lines", 3.0), ("lines", [3]), ("heights", []), ("angle", "up"), ("leader", 1)):
        yield from changed(f"label {key} = {value!r}", (key, value))
    yield from changed("a piece named U+202E", ("name", "\u202e"))
    yield from changed("a piece named with 3,000 letters", ("name", LONG))


def _tables() -> Iterator[Case]:
    """Scenes, fabrics and what lies in the folder of results."""
    yield from _named("metrics", NESTED, "metrics.json deeply nested in the folder")
    yield from _named(
        "metrics", json.dumps(METRICS).replace('"schema": 1', f'"schema": {DIGITS}'), "metrics.json: 5,000 digits"
    )
    mannequin = "[mannequin]\nsize = 'EU 40'\nresolution_mm = 40\n"
    ruled = "form = {like = 'skirt', ruled = 3}\n" + mannequin
    yield from _named("scene", ruled, "form = {like = 'skirt', ruled = 3}", refused=True)
    for key in ("grain_angle", "seed", "name"):
        yield from _named(
            "scene", f"{key} = {DIGITS}\n" + SCENES["shape"], f"scene: {key} of 5,000 digits", refused=True
        )
    yield from _named("scene", f"a = {'[' * 100_000}{']' * 100_000}", "scene: 100,000 nested lists", refused=True)
    yield from _named("fabric", FABRIC.replace("2028.0", DIGITS), "fabric: a number of 5,000 digits", refused=True)
    yield from _named(
        "fabric", FABRIC.replace("2028.0", '"' + LONG + '"'), "fabric: a value of 3,000 letters", refused=True
    )


def _names() -> Iterator[Case]:
    """Lines and pieces with odd names."""
    odd = [*(name for name in NAMES if name.strip() and len(name) < 20), LONG]
    plain = [name for name in odd if name.isascii() and name.isprintable() and name is not LONG]
    for names in (plain, *([name] for name in odd if name not in plain)):
        lines = "".join(f"{json.dumps(name)} = {{from = 0, to = 3}}\n" for name in names).replace("\x7f", "\\u007f")
        scene = f"[surface]\nfile = 'cloth.obj'\nunits = 'm'\n[lines]\n{lines}{SHORT}"
        words = f"a line named {names[0][:20]!r}" if len(names) == 1 else "lines with odd names of plain letters"
        yield from _named("scene", scene, f"scene: {words}", refused=False if names is plain else None)
    for name in ("a\x07b", "\x1b[31m", LONG):
        yield from _named("obj", CLOTH + f"g {name}\nl 1 4\n".encode(), f"obj: a line named {name[:20]!r}")


def _meshes() -> Iterator[Case]:
    """Meshes of text and bytes."""
    ply, binary, letters = meshes("ply")
    commented, off = meshes("off")
    for kind, text in (("ply", letters), ("off", off), ("off", commented)):
        rows = text.rstrip().split(b"\n")
        for rest in (1, 3):
            yield from _named(
                kind, b"\n".join([*rows[:-rest], b""]), f"{kind}: {rest} of its faces cut off", refused=True
            )
        yield from _named(kind, text.rstrip()[:-3], f"{kind}: cut within a face", refused=True)
    yield from _named("ply", binary[:-20], "ply: binary, cut short", refused=True)
    yield from _named("off", commented, "off: a comment below the counts", refused=False)
    yield from _named(
        "off", b"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1\n2 3\n", "off: a face over several lines", refused=False
    )
    for corners in (800, 20_000):
        yield from _named("obj", _disc(corners), f"obj: a face with {corners:,} corners")
    far = bodies()[-1].replace(b"v ", b"v 999999999 0 0\nv ", 1)
    yield from _named("scan", far, "scan: one vertex at 999999999")
    texture = ply.replace(b"comment c", b"comment TextureFile gone.png")
    yield from _named("ply", texture, "ply: a missing texture")
    model = json.loads(meshes("gltf")[0])
    model |= {"images": [{"uri": "gone.png"}], "textures": [{"source": 0}]}
    model["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    for mesh in model["meshes"]:
        mesh["primitives"][0]["material"] = 0
    yield from _named("gltf", json.dumps(model), "gltf: a missing texture")
    for power in (-160, -30, 30, 100, 154, 200, 307):
        big = CLOTH.replace(b"v 2 1 0.2", f"v 2e{power} 1e{power} 0.2e{power}".encode())
        yield from _named("obj", big, f"obj: a vertex at 1e{power}")
    ball = _nearly_closed()
    # In one piece: cut at seams it is not nearly closed any more.
    command = words("flatten odd.obj --units m --out out --seams none --frames 10 --no-picture -q --max-steps 50")
    name = "obj: nearly closed, with frames"
    yield Case("obj", {"odd.obj": ball}, command, leaves="out/metrics.json", name=name, seconds=60)


def _disc(corners: int) -> bytes:
    angle = 2 * np.pi * np.arange(corners) / corners
    points = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    return obj_text((points, [range(corners)])).encode()


def _nearly_closed() -> bytes:
    """A ball without one of its triangles."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
    return obj_text((ball.vertices, ball.faces[1:])).encode()


def _usd_files() -> Iterator[Case]:
    """Stages whose reader has more to say than a line."""
    text = meshes("usda")[0]
    yield from _named(
        "usda",
        text.replace(b"metersPerUnit = 0.01", b"metersPerUnit = -0.01"),
        "usda: metersPerUnit = -0.01",
        refused=True,
    )
    cycle = '#usda 1.0\n(\n    subLayers = [@odd.usda@]\n    metersPerUnit = 1\n)\ndef "a" (references = </a>) {}\n'
    yield from _named("usda", cycle, "usda: a cycle of layers and references")
    missing = (
        '#usda 1.0\n(\n    subLayers = [@gone.usda@]\n    metersPerUnit = 1\n)\ndef "a" (references = @gone.usdc@) {}\n'
    )
    yield from _named("usda", missing, "usda: missing assets")
    # A mesh beside what is missing: there is something to do.
    beside = text + b'\ndef "b" (payload = @gone.usdc@) {}\n'
    yield from _named("usda", beside, "usda: missing assets beside a mesh")


def _command_lines() -> Iterator[Case]:
    """Options."""

    def flatten(name: str, *options: str, **more: Any) -> Case:
        arguments = ("flatten", "cloth.obj", "--units", "m", *BARE.split(), *options)
        return Case("arguments", {"cloth.obj": CLOTH}, arguments, name=name, **more)

    yield flatten("--out of 300 letters", "--out", "a" * 300, refused=True)
    yield flatten("--out of undecodable bytes", "--out", "\udcff\udcfe")
    yield flatten("--fabric of 3,000 letters", "--fabric", LONG, refused=True)
    yield flatten("--datum of 3,000 letters", "--datum", LONG, refused=True)
    yield flatten("--name of 3,000 letters", "--name", LONG, refused=True)
    yield flatten("--datum of 5,000 digits", "--datum", f"0,{DIGITS}", refused=True)
    yield flatten("--component of 5,000 digits", "--component", DIGITS, refused=True)
    yield Case("arguments", {}, ("flatten", "--help"), name="flatten --help names OFF", says="OFF")


def _bounds() -> Iterator[Case]:
    """Drawings that are too much, a second of the processor for each thousand of their entities; devices in the place of files."""
    head = tags((0, "SECTION"), (2, "ENTITIES"))
    star = [
        tags((0, "LINE"), (8, 1), (10, 0), (20, 0), (11, f"{1e3 * math.cos(k):.3f}"), (21, f"{1e3 * math.sin(k):.3f}"))
        for k in range(10_000)
    ]
    circles = [tags((0, "CIRCLE"), (8, 1), (10, k % 100 * 30), (20, k // 100 * 30), (40, 40)) for k in range(10_000)]
    rings = [tags((0, "CIRCLE"), (8, 1), (10, 0), (20, 0), (40, 1 + 0.01 * k)) for k in range(10_000)]
    for name, entities in (("star of lines", star), ("chain of circles", circles), ("concentric circles", rings)):
        content = (head + "".join(entities) + tags((0, "ENDSEC"), (0, "EOF"))).encode()
        yield from _too_much("dxf", content, f"dxf: a {name}", len(entities) / 1000)
    page = '<svg xmlns="http://www.w3.org/2000/svg" width="1000mm" viewBox="0 0 1000 1000"><path d="M{} Z"/></svg>'
    for turn, name in ((2e-5 * math.pi, "circle"), (1.0, "star")):
        points = (f"{500 + 400 * math.cos(turn * k):.4f},{500 + 400 * math.sin(turn * k):.4f}" for k in range(100_000))
        yield from _too_much(
            "svg",
            page.format(" L".join(points)).encode(),
            f"svg: a {name} of 100,000 points",
            100,
            read=name == "circle",
        )
    for file, arguments in (
        ("odd.dxf", ("drape", "odd.dxf", "--edges")),
        ("odd.svg", ("drape", "odd.svg", "--edges")),
        ("odd.toml", ("run", "odd.toml")),
        ("odd.toml", ("batch", "odd.toml")),
        ("odd.obj", ("flatten", "odd.obj", "--units", "m")),
        ("odd.usda", ("flatten", "odd.usda")),
        ("out/metrics.json", ("review", "out")),
        ("out/pattern.json", ("export", "out", "--format", "svg")),
        ("out/pattern.json", ("drape", "out", "--edges")),
    ):
        words = f"{arguments[0]}: {file} is a link to /dev/zero"
        yield Case("device", {"out/empty": b""}, arguments, links={file: "/dev/zero"}, name=words, refused=True)


def _too_much(kind: str, content: bytes, name: str, seconds: float, *, read: bool = False) -> Iterator[Case]:
    """All commands read a drawing alike, so that one shows that it is too much; what is read all commands get."""
    cases = {case.arguments: case for case in cases_of_file(kind, content)}
    for case in list(cases.values())[: None if read else 1]:
        yield replace(case, name=name, seconds=max(seconds, 10.0))


def _environments() -> Iterator[Case]:
    """What surrounds the process."""
    nowhere = str(Path(tempfile.gettempdir()) / "warpflat-fuzz-kernels")
    flatten = ("flatten", "cloth.obj", "--units", "m", "--out", "out", "--quiet")
    small = Case("environment", {"cloth.obj": CLOTH}, (*flatten, *BARE.split()), leaves="out/metrics.json", seconds=120)

    def around(name: str, of: Case = small, **more: Any) -> Case:
        return replace(of, name=name, environment=Environment(**more))

    yield around("WARP_CACHE_PATH=/dev/null/x", variables={"WARP_CACHE_PATH": "/dev/null/x"})
    yield around("HOME=/dev/null", variables={"HOME": "/dev/null", "XDG_CACHE_HOME": None, "WARP_CACHE_PATH": None})
    full = {"limits": {resource.RLIMIT_FSIZE: 20_000}, "variables": {"WARP_CACHE_PATH": nowhere}}
    yield around("the cache's disk is full", **full)
    yield around("--device cuda", replace(small, arguments=(*small.arguments, "--device", "cuda")))
    # Its files have 3, 4, 6, 12, 70, 170 and 370 kB, and 680 with frames, which are written first.
    framed = Case(
        "environment", {"cloth.obj": _grid(40)}, (*flatten, "--max-steps", "50"), leaves="out/metrics.json", seconds=120
    )
    still = replace(framed, arguments=(*framed.arguments, "--frames", "0"))
    old = {f"out/{name}": b"old" for name in ("cloth.obj", "frames.usdc", "picture.png", "pattern.json")}
    old["out/metrics.json"] = json.dumps(METRICS).encode()
    for limit, run in ((5, still), (8, still), (50, still), (120, still), (300, still), (520, framed)):
        refused = replace(run, refused=True)
        within = {resource.RLIMIT_FSIZE: limit * KILOBYTE}
        yield around(f"ulimit -f {limit}, a fresh folder", refused, limits=within)
        yield around(f"ulimit -f {limit}, an earlier run's folder", _over(refused, old), limits=within)
    big = replace(
        framed, files={"cloth.obj": _grid(316)}, arguments=(*flatten, *BARE.split(), "--max-steps", "2"), seconds=300
    )
    for megabytes in (300, 500, 700, 900, 1100, 1200, 1300, 1500, 1750, 2000):
        yield around(f"ulimit -v {megabytes}000", big, limits={resource.RLIMIT_AS: 1000 * megabytes * KILOBYTE})
    for number in (signal.SIGINT, signal.SIGTERM):
        for seconds in (0.1, 0.2, 0.4, 0.8, 1.6, 2.4, 3.2):
            yield around(f"{number.name} after {seconds} s", _over(framed, old), stop=(number, seconds))


def _over(case: Case, old: dict[str, bytes]) -> Case:
    """A case whose folder holds the files of an earlier run, which it may replace."""
    return replace(case, files={**case.files, **old}, replaces="*")


GROUPS = {
    "inputs replaced": _inputs_replaced,
    "patterns": _patterns,
    "tables": _tables,
    "names": _names,
    "meshes": _meshes,
    "usd": _usd_files,
    "command lines": _command_lines,
    "bounds": _bounds,
}
"""The faults that need no process of their own."""
