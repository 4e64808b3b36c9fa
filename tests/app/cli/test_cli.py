from __future__ import annotations

import io
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from command import Command, Ended

from warpflat._version import __version__
from warpflat.app.cli.progress_bar import ProgressBar
from warpflat.app.review.faults import faults_of
from warpflat.app.scene import schema
from warpflat.app.scene.options import SCENE_OPTIONS
from warpflat.core.text import energy_words, format_count
from warpflat.core.toml_file import read_toml
from warpflat.flat.solver.options import RelaxOptions

SCENES = Path(__file__).parents[3] / "scenes"
PATTERN_FILES = ("cloth.dxf", "cloth.svg", "pattern.pdf", "pattern.json")
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.2\nv 2 1 0.2\nf 1 2 3 4\nf 2 5 6 3\n"
RING = "".join(
    [f"v {x} {y} {z}\n" for z in (0, 1) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    + [f"f {i + 1} {(i + 1) % 4 + 1} {(i + 1) % 4 + 5} {i + 5}\n" for i in range(4)]
)
BARE = "[output]\nframes = 0\npicture = false\n"
FAR = "v 9 0 0\nv 9 1 0\nv 8 1 0\nf 7 8 9\n"


# --- a run


def test_flatten_writes_its_files_and_a_summary(command: Command):
    Path("cloth.obj").write_text(SQUARE)
    code, out, err, _ = command("flatten", "cloth.obj", "--units", "m", "--fabric", "denim")
    assert code == 0
    assert len(out.splitlines()) <= 5
    assert out.startswith("fits by its strain\n1 pattern piece, 2.02 m2 laid out in denim, strain energy ")
    assert "; reads as 1 m tall (2 x 1 x 0.2 m)\nprint out/cloth/pattern.pdf\nout/cloth: review.html, " in out
    assert "it/s" not in err
    assert {path.name for path in Path("out/cloth").iterdir()} == {
        "metrics.json", "cloth.obj", "frames.usdc", "picture.png", "review.html", *PATTERN_FILES
    }  # fmt: skip
    assert json.loads(Path("out/cloth/metrics.json").read_text())["pieces"]["cloth"]["fabric"] == "denim"


@pytest.mark.parametrize(("bent", "told"), [(3.0, True), (0.3, False)])
def test_a_panel_that_is_no_pattern_in_one_piece_says_how_to_part_it(command: Command, bent: float, told: bool):
    # A saddle, more or less.
    across = np.linspace(-0.5, 0.5, 13)
    points = "".join(f"v {x:.4f} {y:.4f} {bent * x * y:.4f}\n" for x in across for y in across)
    faces = "".join(
        f"f {i} {i + 13} {i + 14} {i + 1}\n" for row in range(12) for i in range(13 * row + 1, 13 * row + 13)
    )
    Path("saddle.obj").write_text(points + faces)
    _, out, *_ = command("flatten", "saddle.obj", "--units", "m", "--fabric", "woven")
    assert ("beyond its limit" in out) is told
    assert ("--seams auto" in out) is told


def test_run_prints_its_metrics_as_json_and_nothing_else(command: Command):
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 7\n" + BARE)
    code, out, err, _ = command("run", "cap.toml", "--out", "there", "--json")
    assert code == 0
    assert json.loads(out) == json.loads(Path("there/metrics.json").read_text())
    assert err == ""


@pytest.mark.parametrize("solver", ["auto", "paper"])
def test_it_tells_the_steps_and_the_iterations_and_what_each_released(command: Command, solver: str):
    Path("cap.toml").write_text(f"[surface]\nshape = 'dome'\nresolution = 9\n[relax]\nsolver = '{solver}'\n{BARE}")
    _, out, *_ = command("run", "cap.toml", "--out", "there", "-v")
    stages = json.loads(Path("there/metrics.json").read_text())["pieces"]["cap"]["stages"]
    released = [a["model_energy_j"] - b["model_energy_j"] for a, b in pairwise(stages)]
    units = ["step", "iteration"] if solver == "auto" else ["step"]
    assert len(released) == len(units)
    told = [
        f"{format_count(stage['steps'], unit)} released {energy_words(joules)}"
        for stage, unit, joules in zip(stages[1:], units, released, strict=True)
    ]
    assert f"relaxed: {', '.join(told)}\n" in out
    assert all(joules > 0.0 for joules in released)


def test_quiet_prints_nothing(command: Command):
    Path("cloth.obj").write_text(SQUARE)
    assert command("flatten", "cloth.obj", "--units", "m", "--frames", "0", "--no-picture", "-q")[:3] == (0, "", "")
    assert {path.name for path in Path("out/cloth").iterdir()} == {"metrics.json", "cloth.obj", *PATTERN_FILES}


def test_a_run_that_does_not_converge_exits_with_1_and_says_so(command: Command):
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 9\n[relax]\nmax_steps = 2\n" + BARE)
    code, out, err, _ = command("run", "cap.toml", "--quiet")
    assert (code, out) == (1, "")
    assert re.fullmatch(r"warpflat: cap did not converge within 4 work units .*max_steps\n", err)
    code, out, err, _ = command("run", "cap.toml")
    assert out.startswith("NOT at rest: cap\n")
    code, out, err, _ = command("run", "cap.toml", "-v")
    assert re.search(r"^cap +81 .* NO$", out, re.MULTILINE)


def test_with_levels_it_says_how_much_work_the_limit_was_reached_with(command: Command):
    """Of which the steps on the piece's own mesh, less than max_steps, are a part."""
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 33\n[relax]\nmax_steps = 10\n" + BARE)
    code, out, err, _ = command("run", "cap.toml", "--json")
    last = json.loads(out)["pieces"]["cap"]["stages"][-1]
    assert code == 1
    assert last["steps"] < 10 <= last["work_units"]
    assert f"cap did not converge within {last['work_units']:.0f} work units (residual " in err


def test_a_residual_that_is_no_number_is_not_printed():
    last = {"steps": 9, "work_units": 9.0, "residual": math.inf, "strain_energy_j": 2e-3, "converged": False}
    for residual in (math.inf, None):
        lines = faults_of({"pieces": {"front": {"stages": [{**last, "residual": residual}], "flipped_faces": 0}}})
        assert lines == [
            "front did not converge within 9 steps (strain energy 2 mJ); the pattern is not final: raise max_steps"
        ]


def test_mended_input_is_noted(command: Command):
    turned = SQUARE.replace("f 2 5 6 3", "f 3 6 5 2")
    repeated = SQUARE + "f 1 2 2 1\n"
    for text, note in ((turned, "winding"), (repeated, "repeated vertices")):
        Path("cloth.obj").write_text(text)
        code, _, err, _ = command("flatten", "cloth.obj", "--units", "m", "--frames", "0", "--no-picture")
        assert code == 0
        assert note in err


@pytest.mark.parametrize("datum", ["0,3", "1,2", "0,1,4"])
def test_a_datum_by_vertices(command: Command, datum: str):
    Path("cloth.obj").write_text(SQUARE)
    assert command("flatten", "cloth.obj", "--units", "m", "--datum", datum, "--frames", "0", "--no-picture")[0] == 0


def test_interrupting_is_one_line_and_leaves_no_half_file(command: Command, monkeypatch: pytest.MonkeyPatch):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("warpflat.app.cli.progress_bar.ProgressBar.__call__", interrupt)
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 9\n")
    assert command("run", "cap.toml")[:3] == (130, "", "warpflat: interrupted\n")
    assert not Path("out").exists()


@pytest.mark.skipif(os.name != "posix", reason="only POSIX has signals that can be handled")
@pytest.mark.parametrize(
    ("name", "code", "told"),
    [("SIGTERM", 143, "warpflat: terminated\n"), ("SIGHUP", 129, "")],
    ids=["terminated", "terminal closed"],
)
def test_a_signal_that_ends_a_run_leaves_no_half_file(
    command: Command, monkeypatch: pytest.MonkeyPatch, name: str, code: int, told: str
):
    number = getattr(signal, name)
    monkeypatch.setattr("warpflat.app.cli.progress_bar.ProgressBar.__call__", lambda *_: os.kill(os.getpid(), number))
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 9\n")
    # Whatever it was before is what it is again.
    before = signal.signal(number, signal.SIG_DFL)
    try:
        assert command("run", "cap.toml")[:3] == (code, "", told)
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)
    assert not Path("out").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
@pytest.mark.parametrize("command", [["fabrics"], ["fabrics", "--json"], ["--help"]])
def test_output_that_cannot_be_written_is_one_line(command: list[str]):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "warpflat", *command], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (
        2,
        "warpflat: cannot write to standard output: no space left on device\n",
    )


@pytest.mark.skipif(os.name != "posix", reason="a shell closes standard error")
@pytest.mark.parametrize("closed", ["2>&-", "2</dev/null"], ids=["closed", "read only"])
def test_a_good_run_is_one_with_standard_error_closed_too(tmp_path: Path, closed: str):
    (tmp_path / "cap.toml").write_text(
        "[surface]\nshape = 'dome'\nresolution = 5\n" + BARE + "[pattern]\nformats = []\n"
    )
    command = f"{sys.executable} -m warpflat run {tmp_path / 'cap.toml'} --out {tmp_path / 'out'}"
    assert subprocess.run(["/bin/sh", "-c", f"{command} > {tmp_path / 'told'} {closed}"], check=False).returncode == 0
    assert "fits by its strain" in (tmp_path / "told").read_text()


# --- bad input


def test_components_are_chosen_by_the_option(command: Command):
    Path("two.obj").write_text(SQUARE + FAR)
    told = command("flatten", "two.obj", "--units", "m").refusal
    assert "choose it with --component largest or a number from 0 to 1" in told
    for wrong in ("big", "-1"):
        told = command("flatten", "two.obj", "--units", "m", "--component", wrong).refusal
        assert 'component: should be "largest", "all" or a number from 0' in told


def test_parts_that_meet_without_common_vertices_are_told_so(command: Command):
    """Two quads, the second half as high as the first and beside it: a T-junction."""
    Path("tee.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 0\nv 2 0 0\nv 2 .5 0\nv 1 .5 0\nf 1 2 3 4\nf 5 6 7 8\n"
    )
    told = command("flatten", "tee.obj", "--units", "m").refusal
    assert (
        "though they meet: vertices of one lie on edges of another (a T-junction: vertex 7 on the edge between 1 and 2"
        in told
    )
    Path("apart.obj").write_text(SQUARE + FAR)
    assert "though they meet" not in command("flatten", "apart.obj", "--units", "m").refusal


def test_a_mesh_that_its_reader_trips_over_is_told_in_words(command: Command):
    Path("short.ply").write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        b"property list uchar float tags\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        + b"\0"
        * 9
    )
    told = command("flatten", "short.ply", "--units", "m").refusal
    assert re.search(
        r"short.ply: not a readable PLY file: damaged, cut short, .*; save it again with vertices and", told
    )


def test_a_pattern_is_exported_from_its_folder_or_its_file(command: Command):
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 5\n" + BARE)
    assert command("run", "cap.toml", "--out", "my out")[0] == 0
    Path("my out/cap.svg").unlink()
    # The folder is told as a shell takes it, by every command.
    assert command("export", "my out/pattern.json", "--format", "svg")[:2] == (0, "'my out': cap.svg\n")
    assert Path("my out/cap.svg").exists()
    told = command("export", "my out/cap.obj", "--format", "svg").refusal
    assert told == "my out/cap.obj: is a mesh, not a pattern: warpflat flatten reads it"


def test_a_tube_is_cut_open_with_a_note_and_a_line_of_ones_own_is_checked(command: Command):
    Path("ring.obj").write_text(RING)
    code, _, told, _ = command("flatten", "ring.obj", "--units", "ft", "--no-picture")
    assert code == 0
    assert "it is a tube, cut open where its borders are nearest, 30.5 cm" in told
    assert command("flatten", "ring.obj", "--units", "ft", "--no-picture", "--open", "1,5")[0] == 0
    assert "no line 'back'" in command("flatten", "ring.obj", "--units", "ft", "--open", "back").refusal


def test_paths_that_are_no_mesh(command: Command):
    Path("folder.obj").mkdir()
    Path("cloth.obj").write_text(SQUARE)
    Path("cloth.shape").write_text(SQUARE)
    assert "folder" in command("flatten", "folder.obj", "--units", "m").refusal
    told = command("flatten", "absent.obj", "--units", "m").refusal
    assert "absent.obj: does not exist" in told
    assert command("flatten", "absent.obj", "--units", "m", "--seams", "auto").refusal == told
    assert ".obj" in command("flatten", "cloth.shape", "--units", "m").refusal
    assert "is a directory" in command("run", "folder.obj").refusal
    assert "no such file" in command("run", "absent.toml").refusal
    assert "did you mean" in command("run", "cloth.obj".replace("o.", "ob.").replace("cloth", "clotj")).refusal
    assert "is a mesh, not a text in TOML" in command("run", "cloth.obj").refusal


def test_units_are_asked_for_and_checked(command: Command):
    Path("cloth.obj").write_text(SQUARE)
    told = command("flatten", "cloth.obj").refusal
    assert "cloth.obj" in told
    assert "units" in told
    assert "cm" in command("flatten", "cloth.obj", "--units", "centimeter-ish").refusal


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--fabric", "demin"], "^--fabric: unknown fabric 'demin': did you mean 'denim'"),
        (["--stretch-warp", "5"], "^--stretch-warp = 5"),
        (["--datum", "0,77"], "77"),
        (["--datum", "0,0"], "."),
        (["--datum", "botom"], "bottom"),
        (["--datum", "/World/none"], "none"),
        (["--max-steps", "0"], "^--max-steps = 0"),
        (["--max-steps", "x"], "--max-steps.*'x' is not a valid integer"),
        (["--time-step", "-1"], "^--time-step = -1"),
        (["--time-step", "nan"], "^--time-step: "),
        (["--frames", "-3"], "^--frames: should be greater than or equal to 0"),
        (["--component", "7"], "7"),
        (["--name", "a/b"], "name: 'a/b' cannot name files: .*only spaces and _ . -; 'a_b' would do"),
        (["--name", "Ärmel links"], "name: 'Ärmel links' cannot name files: .*; 'Armel links' would do"),
        (["--fabric-file", "none.toml"], "none.toml: no such file"),
        (["--untis", "m"], "'--untis'.*'--units'"),
    ],
)
def test_wrong_options_are_told_in_one_line(command: Command, options: list[str], message: str):
    Path("cloth.obj").write_text(SQUARE)
    told = command("flatten", "cloth.obj", "--units", "m", *options).refusal
    assert re.search(message, told), told


@pytest.mark.parametrize(
    ("file", "piece"),
    [("Ärmel.obj", "Armel"), ("Łokieć (1).obj", "Lokiec_1"), ("Maß-Rücken.obj", "Mass-Rucken"), ("袖.obj", "piece")],
)
def test_a_file_names_its_piece_without_accents(command: Command, file: str, piece: str):
    Path(file).write_text(SQUARE)
    code, _, _, _ = command("flatten", file, "--units", "m", "--frames", "0", "--no-picture")
    assert code == 0
    assert (Path("out") / piece / f"{piece}.obj").exists()


@pytest.mark.parametrize("value", ["0", "-100", "nan", "1e99", '"soft"'])
def test_impossible_stiffness_is_refused_by_name(command: Command, value: str):
    Path("cap.toml").write_text(f"[surface]\nshape = 'dome'\n[fabric]\nbase = 'woven'\nstiffness_weft = {value}\n")
    told = command("run", "cap.toml").refusal
    assert told.startswith("cap.toml: ")
    assert "stiffness_weft" in told


def test_an_output_folder_that_cannot_be_written(command: Command):
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 7\n")
    Path("taken").write_text("a file")
    assert "taken" in command("run", "cap.toml", "--out", "taken").refusal
    assert "taken" in command("run", "cap.toml", "--out", "taken/below").refusal
    assert Path("taken").read_text() == "a file"
    assert "/proc" in command("run", "cap.toml", "--out", "/proc/warpflat").refusal


# --- fabrics, help


def test_fabrics_lists_the_library(command: Command):
    code, out, err, _ = command("fabrics")
    assert (code, err) == (0, "")
    assert re.search(r"^denim +0\.324 +411 +2,028 +27 ", out, re.MULTILINE)
    assert re.search(r"^linen +~0\.170 +~25,000 ", out, re.MULTILINE)
    assert re.search(r"^trousers +0\.220 +>4,033 ", out, re.MULTILINE)
    assert "A read from data or code" in out


def test_one_fabric_shows_unit_test_load_grade_and_source(command: Command):
    out = command("fabrics", "jersey")[1]
    assert re.search(r"^stiffness_weft +69 +N/m +low strain +A +\[1\]$", out, re.MULTILINE)
    assert "[1] Wang, O'Brien, Ramamoorthi 2011" in out
    assert "16.7 %: 136 N/m" in out
    assert "estimate" in command("fabrics", "linen")[1]


def test_fabrics_as_json_and_from_a_file(command: Command):
    Path("mine.toml").write_text("[mine]\nbase = 'denim'\nshear_stiffness = 40.0\n")
    code, out, _, _ = command("fabrics", "mine", "--file", "mine.toml", "--json")
    assert code == 0
    data = json.loads(out)["mine"]
    assert data["shear_stiffness"] == 40.0
    assert data["provenance"]["stiffness_warp"]["grade"] == "A"
    assert set(json.loads(command("fabrics", "--json")[1])) >= {"woven", "denim", "power-net"}
    assert "did you mean 'denim'" in command("fabrics", "demin").refusal
    Path("mine.toml").write_text("[mine]\nbase = 'denim'\nstifness_warp = 40.0\n")
    assert "did you mean 'stiffness_warp'" in command("fabrics", "--file", "mine.toml").refusal


def test_a_maker_may_allow_more_or_less_shear_than_the_cloth(command: Command):
    """Just below the largest shear of a dome the pattern does not fit everywhere, just above it does; a scene's key says the same."""
    scene = 'fabric = "interlock"\n[surface]\nshape = "dome"\nresolution = 9\n[output]\nframes = 0\npicture = false\n'
    Path("dome.toml").write_text(scene)
    wear = json.loads(command("run", "dome.toml", "--json", "--shear-limit", "60")[1])["pieces"]["dome"]["wear"]
    most = max(abs(wear["shear"]["min"]), wear["shear"]["max"])
    assert wear["shear_limit"] == 60.0
    assert wear["outside"] == 0.0
    Path("strict.toml").write_text(f"shear_limit = {0.9 * most}\n{scene}")
    for arguments in (("dome.toml", "--shear-limit", f"{0.9 * most}"), ("strict.toml",)):
        code, out, _, _ = command("run", *arguments, "--json", "--out", "strict")
        told = json.loads(out)["pieces"]["dome" if len(arguments) > 1 else "strict"]["wear"]
        assert code == 0
        assert told["outside"] > 0.0
        assert told["where_not"][0].startswith(f"sheared {most:.1f} degrees (limit {0.9 * most:.3g} degrees)")
    refusal = command("run", "dome.toml", "--shear-limit", "0.2").refusal
    assert (
        "--shear-limit = 0.2 degrees is out of range; must lie between 0.5 and 80 degrees (if that is in radians"
        in refusal
    )


def test_usage_errors_are_one_line(command: Command):
    assert "Did you mean 'fabrics'" in command("fabric").refusal
    assert "Did you mean '--out'" in command("run", "--otu", "x", "y.toml").refusal
    assert "warpflat run --help" in command("run").refusal


@pytest.mark.parametrize("name", [[], ["run"], ["flatten"], ["compare"], ["cuts"], ["fabrics"]])
def test_help_teaches(command: Command, name: list[str]):
    code, out, err, _ = command(*name, "--help")
    assert (code, err) == (0, "")
    assert "Examples:" in out
    if name != ["fabrics"]:
        assert re.search(r"Exit codes:\n +0 +done\n", out)


@pytest.mark.parametrize(
    ("name", "printed", "folder"),
    [
        ("run", "metrics.json", "out/NAME"),
        ("flatten", "metrics.json", "out/NAME"),
        ("compare", "compare.json", "out/NAME-compared"),
        ("cuts", "ledger.json, with --apply metrics.json, of an edited dart edit.json,", "out/NAME"),
    ],
)
def test_help_says_what_is_printed_and_where_files_go(command: Command, name: str, printed: str, folder: str):
    told = " ".join(command(name, "--help")[1].split())
    assert f"--json Print {printed} on standard output" in told
    assert f"Folder for the files. [default: {folder}]" in told


@pytest.mark.parametrize("key", SCENE_OPTIONS)
def test_an_option_of_a_scene_takes_what_its_key_takes(key: str):
    *table, last = key.split(".")
    tables = {
        "surface": schema.FileSurface, "find_seams": schema.FindSeamsTable, "wear": schema.WearTable,
        "relax": schema.RelaxTable, "output": schema.OutputTable,
    }  # fmt: skip
    field, option = (tables[table[0]] if table else schema.SceneTable).model_fields[last], SCENE_OPTIONS[key]
    if option.kind in (int, float):
        assert option.kind.__name__ in str(field.annotation)
    told = re.search(r"default: ([\w.]+)\]", option.help)
    default = getattr(RelaxOptions(), last) if key.startswith("relax.") else field.default
    if told is not None and default is not None:
        assert told[1] == f"{default:g}" if isinstance(default, float) else str(default)


def test_version(command: Command):
    code, out, _, _ = command("--version")
    assert code == 0
    assert __version__ in out


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from warpflat.app.cli.main import main; main(['--help'])\n"
        "heavy = {'warp', 'pxr', 'trimesh', 'matplotlib', 'scipy', 'pydantic', 'potpourri3d'} & set(sys.modules)\n"
        "sys.exit(f'loaded {heavy}' if heavy else 0)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "Usage: warpflat" in result.stdout


def test_a_mistake_found_late_is_one_line_in_a_fresh_process_too(tmp_path: Path):
    (tmp_path / "cloth.obj").write_text(SQUARE)
    result = subprocess.run(
        [sys.executable, "-m", "warpflat", "flatten", "cloth.obj", "--units", "m", "--device", "cuda:99"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    ended = Ended(result.returncode, result.stdout, result.stderr, frozenset())
    assert ended.refusal.startswith("--device 'cuda:99'")


@pytest.mark.skipif(wp.is_cuda_available(), reason="this machine has a CUDA device")
def test_a_machine_without_cuda_is_told_in_one_line(command: Command):
    Path("cloth.obj").write_text(SQUARE)
    told = command("flatten", "cloth.obj", "--units", "m", "--device", "cuda").refusal
    assert told == "--device 'cuda' is not available; did you mean 'cpu'? valid: cpu"


def test_memory_that_runs_out_is_one_line(command: Command, monkeypatch: pytest.MonkeyPatch):
    def short(*_: object, **__: object) -> None:
        raise RuntimeError("Failed to allocate 9586176 bytes on device 'cpu'")

    monkeypatch.setattr("warpflat.app.cli.progress_bar.ProgressBar.__call__", short)
    Path("cap.toml").write_text("[surface]\nshape = 'dome'\nresolution = 9\n")
    assert command("run", "cap.toml").refusal.startswith("not enough memory: Failed to allocate 9586176 bytes")
    assert not Path("out").exists()


def test_a_run_that_fails_leaves_no_folder(command: Command, tmp_path: Path):
    (tmp_path / "hung.toml").write_text(
        'form = "dress"\n[mannequin]\nsize = "EU 38"\n[[seams]]\nname = "sid left"\nease = 0.1\n'
    )
    (tmp_path / "flat.toml").write_text("datum = 'centr'\n[surface]\nshape = 'dome'\nresolution = 9\n")
    for arguments in (("run", "hung.toml"), ("run", "flat.toml"), ("cuts", "flat.toml")):
        assert command(*arguments, "--out", "deep/inside").refusal
    # One that was there stays, with what it holds.
    (tmp_path / "mine").mkdir()
    assert command("run", "flat.toml", "--out", "mine/inside").refusal


def test_the_module_runs_as_a_program(tmp_path: Path):
    result = subprocess.run(
        [sys.executable, "-m", "warpflat", "run", "absent.toml"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert result.returncode == 2
    assert re.fullmatch(r"warpflat: absent.toml: no such file[^\n]*\n", result.stderr)


def test_progress_shows_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    look = SimpleNamespace(stage="relax", step=7, max_steps=100, model_energy_j=0.0021, residual=0.5)
    for stream, hidden, shown in ((Terminal(), False, True), (Terminal(), True, False), (io.StringIO(), False, False)):
        monkeypatch.setattr("sys.stderr", stream)
        monkeypatch.setattr("warpflat.app.cli.progress_bar._REFRESH", 0.0)
        with ProgressBar("cap", hidden=hidden) as bar:
            bar(look)  # type: ignore[arg-type]
        assert ("cap: relax: 7 steps" in stream.getvalue()) == shown
        assert ("model energy 2.1 mJ, residual 5.0e-01" in stream.getvalue()) == shown


def test_a_size_takes_measures_of_ones_own(command: Command):
    code, out, err, _ = command("mannequin", "--size", "EU 38", "--measure", "waist=0.76", "--resolution", "30")
    assert code == 0
    assert "waist = 76.0 cm instead of the 72.0 cm of size EU 38" in err
    assert "size EU 38 with waist = 76 cm" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--measure", "bust=0.9", "--measure", "bust=0.92"], "--measure bust is given twice, 0.9 and 0.92"),
        (["--measure", "bust=nan"], "is not NAME=LENGTH"),
        (["--size", "EU 38", "--table", "men"], "size 'EU 38' is completed by the table 'women', not by 'men'"),
        (["--table", "women"], "give the body in one way: --size or --measure, or both"),
        (["--scan", "body.obj", "--size", "EU 38"], "give the body in one way: --size or --measure, or both"),
        (["--scan", "body.obj", "--table", "men"], "--table completes measurements"),
        (["--size", "EU 38", "--units", "cm"], "--units is about a --scan"),
        (["--size", "EU 38", "--landmark", "waist=1.0"], "--landmark is about a --scan"),
        (["--size", "EU 38", "--resolution", "50"], "'--resolution'"),
    ],
)
def test_a_mannequin_asked_for_in_two_ways_is_one_line_of_options(command: Command, arguments: list[str], words: str):
    code, _, err, _ = command("mannequin", *arguments)
    assert code == 2
    assert words in err
    assert err.count("\n") == 1
    assert "[mannequin" not in err


# --- the program


def test_program_ends_without_a_last_search_of_its_memory():
    code = (
        "import gc, sys; from warpflat.__main__ import program; sys.argv = ['warpflat', '--version']\n"
        "usual = gc.get_threshold()[0]; code = program()\n"
        "sys.exit(10 + code if gc.get_freeze_count() > 1000 and gc.get_threshold()[0] > usual else 1)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, capture_output=True).returncode == 10


def test_an_example_is_written_beside_what_is_there_and_says_the_next_command(command: Command, tmp_path: Path):
    listed = command("example")
    assert listed.code == 0
    assert {line.split("  ")[0] for line in listed.out.splitlines() if "  " in line} == {
        path.stem for path in SCENES.iterdir() if path.suffix in (".toml", ".py")
    }
    written = command("example", "dome")
    assert written.changed == {"dome.toml"}
    assert written.out.splitlines()[-1] == "next: warpflat run dome.toml"
    assert read_toml(tmp_path / "dome.toml") == read_toml(SCENES / "dome.toml")
    assert "scenes/" not in (tmp_path / "dome.toml").read_text()
    assert command(*shlex.split(written.out.splitlines()[-1])[2:], "--quiet").code == 0
    # Nothing is replaced, and a batch brings its scenes.
    (tmp_path / "basic_block.toml").write_text("mine")
    assert "is there already" in command("example", "dome.toml").refusal
    batch = command("example", "batch_sizes")
    assert batch.changed == {"batch_sizes.toml"}
    assert "next: warpflat batch batch_sizes.toml" in batch.out
    assert "did you mean 'dome'" in command("example", "dom").refusal
