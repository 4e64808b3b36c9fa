"""The table of WARPFLAT_DATA/faults again: small files that once lost something without a word, each row as its README has it.

`pytest tests/fuzz/test_faults.py -v` prints the table.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import Command, Ended
from real_files import DATA

from warpflat.core.file_kinds import FOREIGN
from warpflat.flat.surface.io.read import read_surface

_FAULTS = DATA / "faults"
pytestmark = pytest.mark.skipif(
    not _FAULTS.is_dir(), reason="WARPFLAT_DATA/faults is not there: the small files that failed once"
)


@pytest.fixture
def row(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a test's row, copied, as the folder that the command runs in."""
    number = request.node.name.partition("test_")[2][:2]
    source = next(_FAULTS.glob(f"{number}-*"))
    for file in source.rglob("*"):
        target = tmp_path / file.relative_to(source)
        if file.is_dir():
            target.mkdir(exist_ok=True)
        else:
            target.parent.mkdir(exist_ok=True)
            shutil.copyfile(file, target)
    return tmp_path


def edges(ended: Ended) -> dict[str, list[tuple[str, str]]]:
    """Return the lengths and kinds of all edges that a listing shows, by piece."""
    assert ended.code == 0, ended.err
    found: dict[str, list[tuple[str, str]]] = {}
    for line in ended.out.splitlines():
        name, _, words = line.partition(": ")
        length, kind, _ = words.split(", ", 2)
        found.setdefault(name.rpartition(".")[0], []).append((length, kind))
    return found


@pytest.mark.parametrize(
    ("file", "length"), [("half.dxf", "520.0 mm"), ("half_sewing_line_open_at_fold.dxf", "502.0 mm")]
)
def test_01_a_half_lies_on_its_line_of_symmetry(row: Path, command: Command, file: str, length: str) -> None:
    pieces = edges(command("drape", file, "--body", "EU 38", "--edges"))
    assert (length, "fold") in pieces["FRONT"]
    assert sum(kind == "fold" for _, kind in pieces["FRONT"]) == 1


@pytest.mark.parametrize("file", ["crossing.dxf", "gap_0.02.dxf", "gap_0.dxf"])
def test_02_outlines_of_several_lines_are_pieces(row: Path, command: Command, file: str) -> None:
    pieces = edges(command("drape", file, "--edges"))
    assert set(pieces) == {"FRONT", "SLEEVE"}
    assert len(pieces["SLEEVE"]) == 4


def test_03_pieces_that_overlap_or_lie_in_a_frame_are_read(row: Path, command: Command) -> None:
    assert set(edges(command("drape", "two.svg", "--edges"))) == {"front", "back", "pocket"}
    framed = command("drape", "frame.svg", "--edges")
    assert set(edges(framed)) == {"front", "back"}
    assert "'page' has the page's size" in framed.err


@pytest.mark.parametrize(
    ("file", "names"),
    [
        ("circle.svg", {"skirt", "band"}),
        ("joined.svg", {"body", "s1"}),
        ("lines.svg", {"body", "sleeve"}),
        ("skew.svg", {"body"}),
    ],
)
def test_04_all_shapes_are_read(row: Path, command: Command, file: str, names: set[str]) -> None:
    ended = command("drape", file, "--edges")
    assert set(edges(ended)) == names
    assert ended.err == ""


def flattened(command: Command, file: str, *more: str) -> Ended:
    return command("flatten", file, "--out", "out", "--frames", "0", "--no-picture", *more)


def test_05_quantised_meshes_are_read_and_compressed_ones_named(row: Path, command: Command) -> None:
    for file in ("float.glb", "quantised.glb"):
        ended = flattened(command, file)
        assert ended.code == 0
        assert "reads as 0.6 m tall" in ended.out
    for file, name in (("draco.glb", "Draco"), ("meshopt.glb", "meshopt")):
        assert f"compressed with {name}; save it again" in flattened(command, file).refusal


def test_06_a_file_of_another_program_says_what_to_export(row: Path, command: Command) -> None:
    for file in sorted(row.glob("own.*")):
        if file.suffix == ".vrm":
            continue
        for words in (
            ("drape",),
            ("flatten",),
            ("run",),
            ("mannequin", "--scan"),
            ("export", "--format", "pdf"),
            ("marker",),
        ):
            refusal = command(*words, file.name).refusal
            assert FOREIGN[file.suffix][0] in refusal, (words, refusal)
            assert FOREIGN[file.suffix][1] in refusal
    assert "not a readable VRM file" in command("flatten", "own.vrm").refusal
    assert "no faces" in command("flatten", "edges.obj", "--units", "m").refusal


def test_09_the_marker_of_a_fold_is_read(row: Path, command: Command) -> None:
    pieces = edges(command("drape", "fold.svg", "--body", "EU 38", "--edges"))
    assert ("550.0 mm", "fold") in pieces["front"]


def test_10_what_is_no_json_says_so_and_where(row: Path, command: Command) -> None:
    for words in (("drape",), ("export", "--format", "svg"), ("marker",)):
        assert "own.json: line 1, column 1: is no JSON" in command(*words, "own.json").refusal


def test_11_pieces_belong_to_sizes(row: Path, command: Command) -> None:
    ended = command("drape", "some.dxf", "--edges")
    assert set(edges(ended)) == {"FRONT", "YOKE"}
    assert ended.err == "warpflat: note: piece 'YOKE' is in size 42 only\n"


def test_13_slits_in_line_are_one_seam(row: Path, command: Command) -> None:
    ended = flattened(command, "back.obj", "--units", "m", "--seams", "uv")
    assert ended.code == 0
    assert "2 pieces, 1 seam of 61 cm" in ended.err


def test_14_islands_may_be_stacked(row: Path, command: Command) -> None:
    for file in ("apart.obj", "stacked.obj"):
        ended = flattened(command, file, "--units", "mm", "--pattern", "uv")
        assert ended.code == 0
        # Equal islands are one piece of the pattern, to be cut twice.
        assert "1 pattern piece," in ended.out
        assert "front.obj, back.obj" in ended.out


def test_15_what_the_seams_lose_with_the_inner_shell_is_dropped(row: Path, command: Command) -> None:
    ended = flattened(command, "back.obj", "--units", "m", "-v")
    assert ended.code == 0
    assert "its outer sheet was taken" in ended.err


def test_20_sparse_accessors_are_read(row: Path, command: Command) -> None:
    assert "(0.834 x 0.5 x 0.3 m)" in flattened(command, "m.gltf").out


def test_21_layers_are_checked_as_the_file_is(row: Path, command: Command) -> None:
    assert "outside its folder" in command("flatten", "a/reference_rel.usda").refusal
    os.mkfifo(row / "a/secret.usda")
    layer = (row / "a/reference_rel.usda").read_text()
    (row / "a/pipe.usda").write_text(layer.replace("../secret/", "./"))
    assert "is a pipe" in command("flatten", "a/pipe.usda").refusal
    assert stat.S_ISFIFO((row / "a/secret.usda").stat().st_mode)


def test_22_a_missing_part_is_named(row: Path, command: Command) -> None:
    assert "'back.usda', which is missing" in command("flatten", "garment.usda", "--component", "all", "-q").refusal


def test_23_pieces_apart_are_drawn_with_their_guide(row: Path, command: Command) -> None:
    ended = flattened(command, "m.obj", "--units", "m", "--component", "all")
    assert (row / "out" / "pattern.pdf").is_file()
    assert "Error" not in ended.err
    assert "left out" not in ended.err


def test_24_an_unknown_required_extension_is_refused(row: Path, command: Command) -> None:
    assert "requires the extension 'KHR_evil'" in command("flatten", "m.gltf").refusal


def laid(file: Path) -> np.ndarray:
    """Return the warp and weft of the cloth on the body over those in its pattern, #F by 2, of an OBJ of the package with its texture."""
    surface = read_surface(file, units="m")
    rows = [line.split() for line in file.read_text().splitlines()]
    places = np.array([row[1:3] for row in rows if row[0] == "vt"], dtype=float)
    corners = np.array([[word.split("/")[:2] for word in row[1:4]] for row in rows if row[0] == "f"], dtype=int) - 1
    points = surface.input_vertices[corners[:, :, 0]]
    worn, flat = (np.swapaxes(each[:, 1:] - each[:, :1], 1, 2) for each in (points, places[corners[:, :, 1]]))
    return np.linalg.norm(worn @ np.linalg.inv(flat), axis=1)[:, ::-1]


def test_25_the_only_fabric_of_a_file_is_meant(row: Path, command: Command) -> None:
    """A tube of 2.5133 m around and 2 kPa: the hoop's 800 N/m stretch 500 kN/m by .16 %."""
    ended = flattened(command, "tube.obj", "--units", "m", "--fabric-file", "pvc.toml", "--pressure", "2000")
    assert ended.code == 0
    assert np.abs(laid(row / "out" / "tube.obj") - [1.0, 1.0016]).max() < 2e-5


def test_26_pressure_loads_a_ball_both_ways(row: Path, command: Command) -> None:
    """A gore of a ball of .5 m radius, 500 Pa, 5 kN/m: 2.5 % both ways, and as much as its own curvature strains it."""
    subprocess.run([sys.executable, "ballgore.py"], cwd=row, check=True)
    ended = flattened(
        command, "ballgore.obj", "--units", "m", "--fabric-file", "film.toml", "--fabric", "film", "--model", "membrane",
        "--pressure", "500",
    )  # fmt: skip
    assert ended.code == 0
    np.testing.assert_allclose(np.median(laid(row / "out" / "ballgore.obj"), axis=0), [1.025, 1.025], atol=4e-3)


def test_27_what_misses_by_hundredths_of_a_millimetre_closes(row: Path, command: Command) -> None:
    assert [length for length, _ in edges(command("drape", "panel.dxf", "--edges"))["piece_1"]] == [
        "2300.0 mm", "400.0 mm", "2300.0 mm", "400.0 mm",
    ]  # fmt: skip
