"""What standard output gets, in a process of its own: JSON and nothing else, or nothing where it is closed or full."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import click
import pytest
import trimesh
from bodies import mean_person

from warpflat.app.cli.main import cli
from warpflat.garment.mannequin.body_model import BodyModel

QUICK = "[relax]\nmax_steps = 30\n[output]\nframes = 0\npicture = false\n[pattern]\nformats = ['json']\n"
CAP = "datum = 'centre'\n[surface]\nshape = 'bodice'\nresolution = 5\n"
#: A command line for every command that prints JSON.
SQUARE = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="400mm" height="300mm" viewBox="0 0 400 300">'
    '<path id="front" d="M10 10H310V210H10Z"/></svg>'
)
PRINTING = {
    "run": ["run", "cap.toml"],
    "flatten": ["flatten", "cap.obj", "--units", "m", "--frames", "0", "--no-picture"],
    "fabrics": ["fabrics"],
    "mannequin": ["mannequin", "--scan", "body.obj", "--units", "m", "--resolution", "40"],
    "compare": ["compare", "cap.toml", "--fabric", "denim", "--fabric", "jersey"],
    "cuts": ["cuts", "cap.toml"],
    "drape": ["drape", "cap.toml"],
    "marker": ["marker", "square.svg"],
    "fit": ["fit", "skirt.obj", "--units", "m", "--from", "EU 38", "--to", "EU 40", "--frames", "0", "--no-picture"],
}


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the commands need."""
    from fuzz.promise import CLOTH
    from fuzz.seeds import SKIRT

    folder = tmp_path_factory.mktemp("streams")
    (folder / "cap.toml").write_text(CAP + QUICK)
    (folder / "cap.obj").write_bytes(CLOTH)
    (folder / "skirt.obj").write_bytes(SKIRT)
    (folder / "square.svg").write_text(SQUARE)
    model = BodyModel.load()
    trimesh.Trimesh(model.vertices(mean_person(model)), model.triangles, process=False).export(folder / "body.obj")
    return folder


def test_every_command_that_prints_json_is_tried():
    assert PRINTING.keys() == {
        name
        for name, command in cli.commands.items()
        if any(isinstance(option, click.Option) and "--json" in option.opts for option in command.params)
    }


#: The program, once for each of the command lines on standard input; a page ends with its exit code.
IN_TURN = """
import json, sys
from warpflat.__main__ import program
for words in json.load(sys.stdin):
    sys.argv[1:] = words
    print(program(), end="\\f", flush=True)
"""


def test_json_is_all_that_is_printed(here: Path):
    asked = json.dumps([[*command, "--json"] for command in PRINTING.values()])
    done = subprocess.run(
        [sys.executable, "-c", IN_TURN], cwd=here, input=asked, capture_output=True, text=True, check=True
    )
    *pages, rest = done.stdout.split("\f")
    assert rest == ""
    for command, page in zip(PRINTING, pages, strict=True):
        printed, code = page[:-1], page[-1]
        assert code in "01", (command, done.stderr)
        assert isinstance(json.loads(printed), dict), command


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
@pytest.mark.parametrize(("stdout", "code", "told"), [("&-", 0, ""), ("/dev/full", 1, "the files are written")])
def test_a_run_whose_output_cannot_be_written_has_its_files(here: Path, stdout: str, code: int, told: str):
    out = f"out{code}"
    line = f"{sys.executable} -m warpflat run cap.toml --out {out} > {stdout}".replace("> &-", ">&-")
    done = subprocess.run(["/bin/sh", "-c", line], cwd=here, stderr=subprocess.PIPE, text=True, check=False)
    converged = json.loads((here / out / "metrics.json").read_text())["pieces"]["cap"]["converged"]
    assert done.returncode == (code if converged else 1)
    assert told in done.stderr
