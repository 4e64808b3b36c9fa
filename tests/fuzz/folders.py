"""Batch files, folders of batches and of runs: with damaged members, links, and files that are not of warpflat."""

from __future__ import annotations

import base64
import functools
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from random import Random
from typing import Any

from warpflat.pattern.files.output import seal_of

from .damage import WORDS, damaged_bytes, damaged_json, damaged_toml
from .promise import Case

__all__ = ["packed", "random_folder", "unpacked"]

SCENE = "[surface]\nshape = 'dome'\nresolution = 5\n[relax]\nmax_steps = 30\n[output]\nframes = 3\n[pattern]\nformats = ['svg', 'json']\n"
PLAIN = SCENE.replace("frames = 3", "frames = 0\npicture = false").replace("['svg', 'json']", "[]")
BATCHES = (
    "scenes = ['cap.toml']\nfabrics = ['woven', 'denim']\n[[overrides]]\ngrain_angle = 5.0\n",
    "[[tasks]]\nscene = 'cap.toml'\nfabric = 'jersey'\n[tasks.override]\ngrain_angle = 3.0\n[[tasks]]\nform = 'no such form'\n"
    "body = {size = 'EU 38', resolution_mm = 40.0}\n",
    "forms = ['none']\nfabrics = ['woven']\n[[bodies]]\nname = 'Ada'\nmeasurements = {bust = 0.9, waist = 0.7, hip = 0.95}\n",
)
TARGETS = ("../secret.txt", "/dev/zero", "/dev/null", "/etc/hostname", "..", "gone", "picture.png")
BATCH = ("batch", "b.toml", "--out", "out", "--quiet")


@functools.cache
def _folder(kind: str) -> Mapping[str, bytes]:
    """The files that a run, or a batch, leaves in `out`."""
    command = BATCH if kind == "result" else ("run", "cap.toml", "--out", "out", "--quiet")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in _beside(kind).items():
            (folder / file).write_bytes(content)
        subprocess.run([sys.executable, "-m", "warpflat", *command], cwd=folder, check=False, capture_output=True)
        return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("out/**/*") if path.is_file()}


def _beside(kind: str) -> dict[str, bytes]:
    scene = SCENE if kind == "folder" else PLAIN
    batch = BATCHES[1] if kind == "result" else BATCHES[0]
    return {"cap.toml": scene.encode(), "b.toml": batch.encode(), "secret.txt": b"secret"}


def random_folder(kind: str, random: Random) -> Case:
    """A damaged batch file, or a folder of results one of whose members is not as warpflat has left it; and a command."""
    files = _beside(kind)
    if kind == "batch":
        content = damaged_toml(random, random.choice(BATCHES))
        return Case(kind, {**files, "b.toml": content}, BATCH, subject="b.toml", seconds=60.0)
    files |= _folder(kind)
    member = random.choice(sorted(file for file in files if file.startswith("out/")))
    links: dict[str, str] = {}
    how = random.randrange(4)
    if how == 0:
        links[member] = random.choice(TARGETS)
        del files[member]
    elif how == 1 and member.endswith(".json"):
        data = damaged_json(random, json.loads(files[member]))
        files[member] = _sealed(data) if random.randrange(2) else data
    elif how == 2:
        files[member] = random.choice((b"", b"mine", b"\x00\xff", random.choice(WORDS).encode(errors="replace")))
    else:
        files[member] = damaged_bytes(random, files[member])
    if kind == "result" and random.randrange(4) == 0:
        key = (
            next(file for file in files if file.endswith("task.json")).split("/")[1]
            if "task.json" in str(files)
            else "0"
        )
        links[f"out/{key}.started"] = random.choice(TARGETS)
    command: tuple[str, ...] = BATCH
    if kind == "folder":
        review, formats = ("review", "out", "--quiet"), ("--format", "svg", "--format", "dxf", "--format", "json")
        again = ("run", "cap.toml", "--out", "out", "--quiet")
        command = random.choice((review, (*review, "--film", "--sheet"), ("export", "out", *formats, "--quiet"), again))
    # A report is amended where a command adds a file to it, and what has a seal that fits is of warpflat.
    keeps = "" if member.endswith(".json") else member
    is_ours = files.get(member) == _folder(kind)[member]
    return Case(kind, files, command, replaces="*", keeps="" if is_ours else keeps, links=links, seconds=60.0)


def _sealed(content: bytes) -> bytes:
    """The content of a report with a seal that fits, if it is one."""
    try:
        data = json.loads(content)
        return json.dumps({**data, "sha256": seal_of(data)}).encode()
    except (ValueError, TypeError, RecursionError):
        return content


def packed(case: Case) -> bytes:
    """A case as a file for tests/regressions."""
    data: dict[str, Any] = {
        "kind": case.kind,
        "arguments": case.arguments,
        "files": {name: base64.b64encode(content).decode() for name, content in case.files.items()},
        "links": dict(case.links),
        "replaces": case.replaces,
        "keeps": case.keeps,
    }
    return json.dumps(data, indent=1).encode()


def unpacked(content: bytes) -> Case:
    """The case of such a file."""
    data = json.loads(content)
    files = {name: base64.b64decode(text) for name, text in data["files"].items()}
    more = {key: data[key] for key in ("links", "replaces", "keeps")}
    return Case(data["kind"], files, tuple(data["arguments"]), seconds=60.0, **more)
