"""Whole commands, part by part: `run` of scenes, with and without what a scene can leave out, and `flatten` of large meshes.

    OMP_NUM_THREADS=1 python benchmarks/whole.py [--only paper_block tshirt 40000] [--variants] [--repeats 3] [--json FILE]

Each command is a process of its own, with compiled kernels and modules. Of each part it prints wall time, then processor time of the main
thread: what its functions take less what others take that they call. `waiting` is for processes that write files beside it, `rest` is time
in no part, `beside` processor time of other threads and of those processes. The command with the least processor time of all repeats is
shown. Memory is the largest sum of all its processes, shared pages counted once, looked at ten times a second. `--variants` runs each
scene without its picture, film and pattern files, and with a marker and a drape.
"""

from __future__ import annotations

import argparse
import importlib._bootstrap as bootstrap  # type: ignore[import-not-found,import-untyped,unused-ignore]
import importlib.util
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

SCENES = Path(__file__).parents[1] / "scenes"
NAMES = ("paper_block", "tshirt", "basic_block", "princess_dress")
SIZES = (40_000, 400_000, 1_000_000)
# Seconds that the issue allows, of a run without marker and drape.
BOUNDS = {"paper_block": 2.5, "tshirt": 2.5, "40000": 2.0, "400000": 8.0, "1000000": 22.0}
MOST_MEMORY = {"1000000": 2.5}  # [GB]

# A part is the time in these functions, MODULE:NAME, less that in other parts which they call.
PARTS = {
    "reading": ("flat.surface.io.read:read_surface", "app.scene.load:load_scene", "app.scene.load:make_scene"),
    "reading, repair": ("flat.surface.repair.validate:make_surface",),
    "start of Warp": ("core.compile:start_warp", "app.cli.run:start_warp_silently"),
    "mannequin and form": ("app.scene.form:scene_form", "app.scene.form_shaping:settle_shape"),
    "checks before": ("app.scene.plan:plan_scene",),
    "datum": ("flat.flattening.datum:resolve_datum",),
    "development": ("flat.flattening.flatten_piece:develop_piece",),
    "relaxation": ("flat.flattening.flatten_piece:relax_developed", "garment.construction.form_garment:flatten_form"),
    "sewing": ("garment.construction.sewing:sew",),
    "checks after": (
        "flat.cutting.remedies:advise",
        "garment.construction.garment:Garment.advised",
        "garment.construction.girths:pattern_girths",
        "flat.surface.injective:overlap_area",
        "flat.model.strain:layout_errors",
        "flat.model.fit:assess_fit",
        "flat.surface.energy_map:energy_report",
        "flat.flattening.fit_report:wear_measures",
    ),
    "film": ("app.scene.frames:Film.__enter__", "app.scene.frames:Film.__exit__", "app.scene.frames:FrameRecorder.__call__",
             "app.scene.frames:FrameRecorder.record_result"),
    "OBJ": ("pattern.export.obj:write_obj",),
    "picture.png": ("pattern.export.picture:write_picture",),
    "wear.png": ("pattern.export.fit_picture:write_wear_sheet",),
    "walked.png": ("pattern.export.walked_picture:write_walked_picture",),
    "pattern, drafting": (
        "garment.construction.to_pattern:pattern_of_garment",
        "garment.construction.to_pattern:pattern_of_surface",
        "pattern.drafting.draft:draft_garment",
        "pattern.drafting.walked:walk_seams",
    ),
    "pattern, DXF": ("pattern.export.dxf:write_dxf",),
    "pattern, SVG": ("pattern.export.svg:write_svg",),
    "pattern, PDF": ("pattern.export.pdf:write_pdf",),
    "pattern, JSON": ("pattern.export.pattern_json:write_pattern_json",),
    "marker": ("pattern.export.pattern_files:_marker",),
    "drape": ("app.scene.drape:write_drape",),
    "film for the page": ("app.review.page:pack_frames",),
    "review": ("app.review.page:write_review", "app.review.page:pack_pictures"),
    "metrics, hashes": ("pattern.files.output:remove_stale",),
    "waiting": ("pattern.files.beside:Beside.result",),
    "report": ("app.cli.run:report_run",),
}  # fmt: skip
# The parts in order, with those that are measured by themselves.
ORDER = ("start of Python", "imports", *PARTS, "rest", "end of process")


class Clock:
    """Seconds by part of the main thread: what a part's functions call in other parts counts there."""

    def __init__(self) -> None:
        self.wall: dict[str, float] = defaultdict(float)
        self.cpu: dict[str, float] = defaultdict(float)
        self._stack = ["rest"]
        self._since = time.perf_counter(), time.thread_time()

    def enter(self, part: str) -> None:
        self._count()
        self._stack.append(part)

    def leave(self) -> None:
        self._count()
        self._stack.pop()

    def _count(self) -> None:
        now = time.perf_counter(), time.thread_time()
        self.wall[self._stack[-1]] += now[0] - self._since[0]
        self.cpu[self._stack[-1]] += now[1] - self._since[1]
        self._since = now


def watch(clock: Clock) -> None:
    """Count the time of imports, and that of each part's functions, which are wrapped when their module has been loaded."""
    import threading
    from functools import wraps

    main, find = threading.current_thread(), bootstrap._find_and_load
    wanted: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for part, functions in PARTS.items():
        for function in functions:
            module, _, name = function.partition(":")
            wanted[f"warpflat.{module}"].append((name, part))

    def counted(function: Callable[..., Any], part: str) -> Callable[..., Any]:
        @wraps(function)
        def run(*args: Any, **options: Any) -> Any:
            if threading.current_thread() is not main:
                return function(*args, **options)
            clock.enter(part)
            try:
                return function(*args, **options)
            finally:
                clock.leave()

        return run

    def load(name: str, import_: Any) -> Any:
        if threading.current_thread() is not main:
            return find(name, import_)
        clock.enter("imports")
        try:
            module = find(name, import_)
        finally:
            clock.leave()
        for path, part in wanted.pop(name, ()):
            *owners, last = path.split(".")
            owner = module
            for each in owners:
                owner = getattr(owner, each)
            setattr(owner, last, counted(getattr(owner, last), part))
        return module

    bootstrap._find_and_load = load


def child(report: str, begun: float, arguments: list[str]) -> None:
    """Run the program in this process, and write what it took to `report`."""
    clock = Clock()
    clock.wall["start of Python"], clock.cpu["start of Python"] = time.perf_counter() - begun, time.thread_time()
    watch(clock)
    sys.argv[1:] = arguments
    from warpflat.__main__ import program

    code = program()
    clock.enter("end")
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    found = {
        "code": code,
        "wall": clock.wall,
        "part_cpu": clock.cpu,
        "main_cpu": time.thread_time(),
        "cpu": own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime,
        "ended": time.perf_counter(),
    }
    Path(report).write_text(json.dumps(found))


def environment() -> dict[str, str]:
    """Return the environment of a command: modules are kept compiled, as those of an installed package are."""
    given = {**os.environ, "PYTHONPYCACHEPREFIX": os.path.join(tempfile.gettempdir(), "warpflat-modules")}
    given.pop("PYTHONDONTWRITEBYTECODE", None)
    return given


def measured(arguments: list[str], repeats: int) -> dict[str, Any]:
    """Run a command some times; return what the one with the least processor time took."""
    best: dict[str, Any] = {}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.json"
            command = [sys.executable, __file__, "--child", str(report), repr(time.perf_counter()), *arguments]
            before = os.times()
            begun = time.perf_counter()
            command += ["--out", f"{folder}/out", "--quiet"]
            memory = 0.0
            with subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment()) as process:
                while process.poll() is None:
                    memory = max(memory, memory_of(process.pid))
                    time.sleep(0.1)
            ended, after = time.perf_counter(), os.times()
            found = json.loads(report.read_text())
        if found["code"] not in (0, 1):
            sys.exit(f"{' '.join(arguments)} ended with {found['code']}")
        found["seconds"], found["memory_gb"] = ended - begun, memory
        found["cpu"] = after.children_user + after.children_system - before.children_user - before.children_system
        found["wall"]["end of process"] = ended - found.pop("ended")
        if not best or found["cpu"] < best["cpu"]:
            best = found
    return best


def memory_of(pid: int) -> float:
    """Return the memory of a process and its children [GB]: a page that several share is counted once."""
    total = 0.0
    with suppress(psutil.Error):
        process = psutil.Process(pid)
        for each in (process, *process.children(recursive=True)):
            total += each.memory_full_info().pss / 1e9
    return total


def show(name: str, found: dict[str, Any]) -> None:
    """Print a command's table."""
    key = name.split(",")[0]
    bound = f", {BOUNDS[key]:g} s allowed" if key in BOUNDS else ""
    most = f", {MOST_MEMORY[key]:g} allowed" if key in MOST_MEMORY else ""
    print(f"{name}: {found['seconds']:.2f} s{bound}; cpu {found['cpu']:.2f} s; peak {found['memory_gb']:.2f} GB{most}")
    for part in ORDER:
        if found["wall"].get(part, 0.0) >= 0.005:
            print(f"    {part:20} {found['wall'][part]:7.2f} {found['part_cpu'].get(part, 0.0):7.2f}")
    print(f"    {'beside':20} {'':7} {found['cpu'] - found['main_cpu']:7.2f}", flush=True)


def variants(name: str, folder: Path) -> dict[str, Path]:
    """Write variants of a scene, and return them by what they are."""
    text = (SCENES / f"{name}.toml").read_text()

    def without(text: str, table: str) -> str:
        return re.sub(rf"^\[{table}\]\n(?:(?!\[).*\n?)*", "", text, flags=re.MULTILINE)

    plain = without(without(text, "marker"), "drape").rstrip() + "\n"
    bare = without(plain, "output")
    texts = {
        "": plain,
        "no picture": bare + "\n[output]\npicture = false\n",
        "no film": bare + "\n[output]\nframes = 0\n",
        "no pattern files": without(plain, "pattern") + "\n[pattern]\nformats = []\n",
        "marker": plain + "\n[marker]\nwidth = 1.5\nseconds = 2\n",
        "drape": plain + "\n[drape]\n",
    }
    found = {}
    for what, content in texts.items():
        path = folder / what.replace(" ", "_") / f"{name}.toml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(content)
        found[f"{name}, {what}" if what else name] = path
    return found


def write_mesh(path: Path, size: int) -> None:
    """Write the irregular bodice of `meshes.py`, split into triangles, with about `size` vertices [m]."""
    from meshes import KINDS

    import warpflat  # noqa: F401

    surface = KINDS["irregular"]("bodice", size).surface
    with path.open("w") as file:
        file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in surface.vertices.tolist())
        corners = surface.faces + 1
        file.writelines("f " + " ".join(str(v) for v in row if v > 0) + "\n" for row in corners.tolist())


def main() -> None:
    """Print the tables."""
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], float(sys.argv[3]), sys.argv[4:])
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="scenes and numbers of vertices")
    parser.add_argument("--variants", action="store_true", help="each scene without and with its parts")
    parser.add_argument("--repeats", type=int, default=2, help="the one with the least processor time counts")
    parser.add_argument("--meshes", type=Path, metavar="FOLDER", help="keeps the written meshes for the next time")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same figures as data")
    given = parser.parse_args()
    known = {function.partition(":")[0] for functions in PARTS.values() for function in functions}
    if gone := [module for module in known if importlib.util.find_spec(f"warpflat.{module}") is None]:
        raise SystemExit(f"PARTS names modules that there are no more: {', '.join(sorted(gone))}")
    wanted = given.only or [*NAMES, *map(str, SIZES)]
    results = {}
    with tempfile.TemporaryDirectory() as scratch:
        meshes = given.meshes or Path(scratch)
        for name in wanted:
            if name.isdigit():
                mesh = meshes / f"bodice_{name}.obj"
                if not mesh.exists():
                    write_mesh(mesh, int(name))
                commands = {name: ["flatten", str(mesh), "--units", "m"]}
            else:
                scenes = variants(name, Path(scratch))
                chosen = scenes if given.variants else {name: scenes[name]}
                commands = {what: ["run", str(path)] for what, path in chosen.items()}
            for what, command in commands.items():
                results[what] = measured(command, given.repeats)
                show(what, results[what])
    if given.json:
        given.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
