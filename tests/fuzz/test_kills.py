"""Runs that are killed at times spread over them, and while their files change places with those of the run before: the folder is as it
was, or complete, and the next run leaves nothing of them.

`WARPFLAT_KILLS=60 python -m pytest -s tests/fuzz/test_kills.py` kills so many instead of a few, and prints what it has found.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.shapes import make_shape
from warpflat.pattern.export.piece_files import save_piece

KILLS = int(os.environ.get("WARPFLAT_KILLS", "3"))

# The other formats are written by the other two commands.
SCENE = "[surface]\nshape = 'dome'\nresolution = 21\n[output]\nframes = 10\n[pattern]\nformats = ['json']\n"
COMMANDS = {
    "run": ("run", "cap.toml", "--out", "out", "-q"),
    "flatten": ("flatten", "mesh.obj", "--units", "m", "--name", "cap", "--out", "out", "-q"),
    "export": ("export", "out", "--format", "svg", "--format", "dxf", "--format", "pdf", "-q"),
}
# Files change places for about so long [s].
ENDS = 0.15
SIGNALS = ("SIGKILL", "SIGTERM", "SIGINT")

pytestmark = pytest.mark.skipif(os.name != "posix", reason="only POSIX has these signals")


def start(command: str, folder: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "warpflat", *COMMANDS[command]],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def digests(folder: Path) -> dict[str, str]:
    """The files that can be seen."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.iterdir()
        if not path.name.startswith(".")
    }


def is_complete(folder: Path) -> bool:
    """Whether all files are those that `metrics.json` lists, each as it was written: those of one run."""
    (listed,) = json.loads((folder / "metrics.json").read_text())["files"].values()
    found = digests(folder)
    del found["metrics.json"]
    return found == listed


def hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


def changes_places(process: subprocess.Popen[bytes], folder: Path) -> None:
    """Wait until a run begins to put the files of the run before aside, or has ended."""
    while process.poll() is None and not list(folder.glob(".run-warpflat-*/aside")):
        time.sleep(0.001)


def test_a_killed_run_leaves_no_half_result(tmp_path: Path):
    out = tmp_path / "out"
    (tmp_path / "cap.toml").write_text(SCENE)
    # Compiles what the commands need, too.
    save_piece(flatten(make_shape("dome", resolution=21)), tmp_path / "mesh", picture=False, frames=False)
    (tmp_path / "mesh" / "dome.obj").rename(tmp_path / "mesh.obj")
    seconds = {}
    for command in ("run", "export"):
        began = time.perf_counter()
        assert start(command, tmp_path).wait() == 0
        seconds[command] = time.perf_counter() - began
        assert is_complete(out)
    seconds["flatten"] = seconds["run"]
    found: Counter[str] = Counter()
    for number in range(KILLS):
        command = list(COMMANDS)[number % 3]
        name = SIGNALS[(number + number // 3) % 3]
        before = digests(out)
        process = start(command, tmp_path)
        # Shares of the usual time from early to late, all of them different; and each third kill at the end, which comes when it comes.
        if (number + number // 9) % 3 == 2:
            changes_places(process, out)
            time.sleep(ENDS * number / KILLS)
        else:
            time.sleep(seconds[command] * 1.05 * (0.5 + number) / KILLS)
        ended = process.poll() is not None
        if not ended:
            process.send_signal(getattr(signal, name))
        process.wait()
        is_before = digests(out) == before
        left = hidden(out)
        found["killed"] += not ended
        found["as before"] += is_before
        found["complete"] += not is_before and is_complete(out)
        found["hidden until the next run"] += bool(left)
        assert is_before or is_complete(out), (command, name)
        assert name == "SIGKILL" or not left, (command, name, left)
        if left:
            assert start("export", tmp_path).wait() == 0
            assert hidden(out) == []
            assert is_complete(out)
    print({"seconds": seconds, "kills": KILLS, **found})
    assert found["killed"]
