"""Every command and snippet of the README and of docs/*.md: run in a copy, or, where a comment in the page says so, parsed.

These comments steer what is done with the block that follows:

    <!-- only parsed -->               its commands take too long, or need what a test has not; options and names are checked
    <!-- only parsed: auto; studio --> the same for the lines that hold one of these words
    <!-- file: skirt.toml -->          the block is a file of that name, for the commands after it
    <!-- not a scene -->               a TOML block of another kind

Meshes and scans that a page names are made here, in the unit that its command gives. Scenes and mannequins are coarser than those
shipped: `tests/app/scene/test_scene.py` runs these.
"""

from __future__ import annotations

import ast
import functools
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
import pytest
import trimesh

import warpflat
from warpflat.app.cli.main import cli, main
from warpflat.app.scene.as_toml import document_as_toml
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import files_of_run
from warpflat.core.errors import InputError
from warpflat.core.toml_file import read_toml
from warpflat.flat.surface.io.read import METRES_PER_UNIT
from warpflat.garment.draping.write import files_of_drape
from warpflat.garment.mannequin.body_model import BodyModel

ROOT = Path(__file__).resolve().parents[3]
SAVES = r"\.save(_piece)?\("
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
RESOLUTION_MM = 40.0
# What completes a part of a scene: a form, a surface by formula, a file.
BASES: tuple[dict[str, Any], ...] = (
    {"form": "basic_block", "mannequin": {"size": "EU 38"}},
    {"surface": {"shape": "bodice"}},
    {"surface": {"file": "garment.obj", "units": "m"}},
)
EXTRAS = read_toml(ROOT / "pyproject.toml")["project"]["optional-dependencies"]
# What a page installs beside the package: programs of others.
OTHERS = {"rerun-sdk", "usd-core"}


class Block(NamedTuple):
    """A block of code: the line of its fence, its language, its text, and the comment before it."""

    line: int
    language: str
    text: str
    comment: str

    def is_only_parsed(self, text: str) -> bool:
        """Return whether a line of it is not run."""
        kind, _, words = self.comment.partition(":")
        if kind == "test command":  # of continuous integration
            return True
        return kind == "only parsed" and (not words or any(word.strip() in text for word in words.split(";")))


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page."""
    text = page.read_text(encoding="utf-8")
    pattern = r"^(?:<!-- (?P<comment>[^\n]*) -->\n)?```(?P<language>\S*)[^\n]*\n(?P<text>.*?)^```$"
    for found in re.finditer(pattern, text, flags=re.DOTALL | re.MULTILINE):
        line = text[: found.start("language")].count("\n") + 1
        yield Block(line, found["language"], found["text"], found["comment"] or "")


def commands(line: str) -> Iterator[list[str]]:
    """Yield the words of each command of a line, without the variables that are set before it."""
    for part in line.split(" && "):
        words = shlex.split(part, comments=True)
        while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
            words = words[1:]
        if words:
            yield [words[0].removeprefix(".venv/bin/"), *words[1:]]


def parse(words: list[str]) -> None:
    """Check the options, files and packages of a command without running it."""
    program, *arguments = words
    if program == "warpflat" and arguments and arguments[0] in cli.commands:
        command = cli.commands[arguments[0]]
        command.make_context(arguments[0], list(arguments[1:]), parent=click.Context(cli))
        for name in arguments[1:]:
            if name.startswith("scenes/"):
                assert (ROOT / name).is_file(), name
    elif program == "warpflat":
        assert arguments in (["--version"], ["COMMAND", "--help"]), words
    elif program in ("python", "python3"):
        if arguments[0] == "-m":
            assert arguments[1] in ("venv", "pip", "pytest", "sphinx", "tests.fuzz"), words
        elif arguments[0] != "-c":
            assert (ROOT / arguments[0]).is_file(), words
    elif program == "pip":
        named = [word for word in arguments[1:] if not word.startswith("-")]
        assert arguments[0] == "install", words
        assert named, words
        for name in named:
            package = re.fullmatch(r"\.(?:\[([a-z,]+)\])?", name)
            # The package is on no index: from a checkout alone.
            assert package or name in OTHERS, f"pip install {name}: not on the index"
            assert set(((package and package[1]) or "").split(",")) <= {"", *EXTRAS}, name
    else:
        assert program in ("rerun", "dask", "sbatch"), words


def make_inputs(words: list[str], folder: Path) -> None:
    """Make the meshes and scans that a command reads, in the unit that it gives."""
    unit = words[words.index("--units") + 1] if "--units" in words else "m"
    for name in words:
        path = folder / name
        if path.suffix == ".obj":
            write_mesh(path, METRES_PER_UNIT[unit])


def write_mesh(path: Path, unit: float) -> None:
    """Write a body, a garment of two pieces, or one piece, by its name."""
    if path.stem in ("body", "scan"):
        body = BodyModel.load()
        points, faces = 1.68 * body.mean[: body.count], body.triangles
    else:
        half = warpflat.make_shape("bodice", resolution=9, triangles=True)
        points, faces = half.vertices, half.faces[:, :3]
        if path.stem in ("garment", "suit", "dress"):
            # The back is the front turned round: both meet at the sides.
            back = points * [-1.0, 1.0, -1.0] + [0.0, 0.0, 2.0 * points[half.lines["left"]][:, 2].mean()]
            text = "".join(
                f"o {name}\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in these / unit) + _face_lines(faces + start)
                for name, these, start in (("front", points, 1), ("back", back, 1 + len(points)))
            )
            path.write_text(text)
            return
    trimesh.Trimesh(points / unit, faces, process=False).export(path)


def _face_lines(faces: np.ndarray) -> str:
    return "".join(f"f {a} {b} {c}\n" for a, b, c in faces)


def coarse(tables: dict[str, Any]) -> dict[str, Any]:
    """Return a scene with a coarser mesh, a short film, and its pattern on few sheets."""
    changed = dict(tables)
    if "mannequin" in tables:
        changed["mannequin"] = {**tables["mannequin"], "resolution_mm": RESOLUTION_MM}
    elif "shape" in tables.get("surface", {}):
        changed["surface"] = {**tables["surface"], "resolution": 9}
    if tables.keys() & {"surface", "form"}:
        changed["pattern"] = {"paper": "A0", **tables.get("pattern", {})}
    if "scenes" not in tables:
        changed["output"] = {"frames": 4 if "surface" in tables else 0, "picture": False, **tables.get("output", {})}
    return changed


def with_coarse_meshes(script: str) -> str:
    """Return a script whose mannequins and shapes are coarser."""
    script = re.sub(r"(Mannequin\.from_\w+\([^()]*)\)", rf"\1, resolution_mm={RESOLUTION_MM})", script)
    script = re.sub(r"(make_shape\(\"\w+\")(, resolution=\d+)?", r"\1, resolution=9", script)
    return script.replace("spacing=0.02", "spacing=0.06")


def run_commands(block: Block, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Run or parse the commands of a block."""
    for line in re.sub(r"\$\([^\n]*\)", "VALUE", block.text.replace("\\\n", " ")).splitlines():
        for words in commands(line):
            parse(words)
            make_inputs(words, folder)
            if block.is_only_parsed(line):
                continue
            program, *arguments = words
            assert program in ("warpflat", "python"), f"{words} is neither run nor marked"
            if program == "warpflat":
                code = main(arguments)
                said = capfd.readouterr()
                # A coarse mesh may not fit; a mistake in the page is 2 or more.
                assert code in (0, 1), (words, said.err)
            else:
                exec(compile((ROOT / arguments[0]).read_text(), arguments[0], "exec"), {"__name__": "__main__"})


def check_names(script: str) -> None:
    """Check that all names `warpflat.NAME` of a script are there."""
    for node in ast.walk(ast.parse(script)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "warpflat":
            assert hasattr(warpflat, node.attr), f"warpflat.{node.attr}"


@functools.cache
def coarse_scenes() -> dict[str, str]:
    """The shipped scenes, coarser, by their file's name."""
    return {path.name: document_as_toml(coarse(read_toml(path))) for path in (ROOT / "scenes").glob("*.toml")}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder of a page: the scenes, coarser."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").mkdir()
    for name, text in coarse_scenes().items():
        (tmp_path / "scenes" / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_commands_and_snippets_of_a_page_run(page: Path, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page):
        place = f"{page.name}:{block.line}"
        try:
            if block.language == "sh":
                run_commands(block, folder, capfd)
            elif block.language == "python":
                check_names(block.text)
                # Those of the page on Python that write files have a test of their own.
                if not block.is_only_parsed(block.text) and (page.stem != "python" or not re.search(SAVES, block.text)):
                    for name, unit in re.findall(r'"(\w+\.obj)", units="(\w+)"', block.text):
                        make_inputs([name, "--units", unit], folder)
                    exec(compile(with_coarse_meshes(block.text), place, "exec"), names)
            elif block.language == "toml":
                check_toml(block, folder)
        except (Exception, SystemExit) as error:
            raise AssertionError(f"{place}: {error!r}") from error


def check_toml(block: Block, folder: Path) -> None:
    """Check that a block is a scene or part of one, and write it where it is a file."""
    kind, _, name = block.comment.partition(": ")
    path = folder / (name if kind == "file" else "snippet.toml")
    path.write_text(block.text, encoding="utf-8")
    tables = read_toml(path)
    path.write_text(document_as_toml(coarse(tables)), encoding="utf-8")
    if kind != "not a scene":
        bases = [base for base in BASES if tables.keys() & {"form", "surface"} <= base.keys()]
        refused = []
        for base in bases:
            try:
                make_scene({**base, **tables}, name=path.stem, folder=folder, where=path.name)
            except InputError as error:
                refused.append(error)
        assert len(refused) < len(bases), refused


def test_the_scripts_of_the_page_on_python_write_what_they_say(folder: Path) -> None:
    page = ROOT / "docs" / "python.md"
    piece, garment = (block.text for block in blocks(page) if re.search(SAVES, block.text))
    (of_piece,) = re.findall(r"`(warpflat\.surface_files\(.*?\))`", page.read_text(encoding="utf-8"))
    for script in (f"{piece}\n{of_piece}", garment):
        exec(with_coarse_meshes(script), {})
    for name, objects in (("bodice", {"bodice.obj"}), ("dress", {"front_centre.obj", "back_centre.obj"})):
        files = {path.name for path in (folder / "out" / name).iterdir()}
        assert {"metrics.json", "picture.png", f"{name}.dxf", f"{name}.svg", "pattern.pdf", "pattern.json"} <= files
        assert objects < files


def test_every_row_of_the_equations_is_held_by_a_test_and_names_what_there_is() -> None:
    rows = [line for line in (ROOT / "docs" / "how.md").read_text(encoding="utf-8").splitlines() if "`tests/" in line]
    assert len(rows) >= 12
    for row in rows:
        for path, names in re.findall(r"`((?:kernels|flat/\w+|garment/\w+)/\w+\.py)`((?:, `[\w.]+`)*)", row):
            code = next(file for file in (ROOT / path, ROOT / "warpflat" / path) if file.is_file()).read_text()
            for name in re.findall(r"`([\w.]+)`", names):
                assert f"def {name.rpartition('.')[2]}(" in code, (path, name)
        path, test = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", row)[0]
        assert f"def {test}(" in (ROOT / path).read_text(encoding="utf-8"), test


def test_the_help_and_the_page_on_runs_name_each_file_that_a_run_writes() -> None:
    page = (ROOT / "docs" / "run.md").read_text(encoding="utf-8")
    wished = {"picture": True, "frames": 9}
    of_mesh = {"surface": {"shape": "dome"}, "wear": {}, "marker": {"width": 1.4}, "output": wished}
    of_form = {"form": "skirt", "mannequin": {"size": "EU 38"}, "wear": {}, "output": wished}
    draped = {**of_form, "drape": {"usd": True, "correct": True}}
    for tables, command in ((of_mesh, "run"), (of_form, "run"), (draped, "drape")):
        told = re.split(r"[\s,;]+", cli.commands[command].epilog or "")
        for file in files_of_run(make_scene(tables, name="NAME", folder=Path(), where="trial")):
            assert file in told, file
            assert command == "drape" or f"`{file}`" in page, file
    for file in ("mannequin.usdc", "NAME.rul", "NAME.CLOTH.marker."):
        assert file in (cli.commands["run"].epilog or "")
        assert file in page


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_no_command_of_a_page_escapes_the_test_above(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)
    assert not re.findall(r"^    +(?:warpflat|pip|python|dask) .*", prose, flags=re.MULTILINE), (
        "a fence with sh, please"
    )
    for command in re.findall(r"`((?:warpflat|python|pip) [^`\n]*)`", prose):
        if "..." not in command:
            words = shlex.split(command)
            if words[0] != "warpflat" or {"MESH", "SCENE", "FILE", "DIR"} & set(words) or len(words) > 3:
                parse(words)
    languages = {block.language for block in blocks(page)}
    assert languages <= {"sh", "python", "toml", "", "{eval-rst}", "{literalinclude}", "{toctree}"}


def test_the_page_and_the_help_of_a_drape_name_all_its_files():
    page, told = (ROOT / "docs/drape.md").read_text(encoding="utf-8"), cli.commands["drape"].epilog or ""
    for file in files_of_drape(["NAME"], picture=True, frames=True, usd=True):
        assert f"`{file}`" in page
        assert file in told
