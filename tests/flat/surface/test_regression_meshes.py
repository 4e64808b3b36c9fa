"""Mesh files that once broke a reader, each kept as it was: a surface comes of it, or one line, and nothing else."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.read import read_surface

FILES = Path(__file__).parents[2] / "regressions" / "meshes"
WORDS = {
    "array_beyond_the_file.usdc": "not a readable USD file",
    "array_of_gigabytes.usdc": "not a readable USD file",
    "attribute_unreadable.usdc": "not a readable USD file",
    "coordinates_below_all_bounds.obj": "lie within 8e-201 m of each other",
    "coordinates_of_300_digits.obj": "vertex 4 (counted from 0) lies at (8e+299, 0, 0) m, too far to compute with",
    "crash_of_the_library.usdc": "not a readable USD file",
    "cut_short.off": "is cut short: it holds 9 of its 16 faces",
    "cut_short.ply": "is cut short: it holds 13 of its 18 rows of element 'face'",
    "cut_short_triangles.ply": "is cut short: it holds 29 of its 32 rows",
    "cut_within_a_corner.obj": "is cut short: its last line is 'f 18/18 19/19 24/24 2'",
    "cut_within_a_face.ply": "line 52: '3' is no 'face': its list is cut short",
    "name_not_utf8.usdc": "not a readable USD file",
    "cycles_and_missing_layers.usda": "refers to './missing.usda', which is missing",
    "one_vertex_far_off.obj": "vertex 7 (counted from 0) lies at (999999999, 0.2, 0), far from all others",
    "table_of_exabytes_at_opening.usdc": "not a readable USD file",
    "table_of_gigabytes_at_opening.usdc": "not a readable USD file",
    "unit_-1.usda": "metersPerUnit is -1; it must be a number above 0",
    "unit_0.usda": "metersPerUnit is 0;",
    "unit_inf.usda": "metersPerUnit is inf;",
    "unit_nan.usda": "metersPerUnit is nan;",
    "value_of_another_type.usdc": "not a readable USD file",
}


@pytest.mark.parametrize("file", sorted(FILES.iterdir()), ids=lambda file: file.name)
def test_file_that_broke_a_reader_becomes_a_surface_or_one_line(file, capfd):
    units = "m" if file.suffix in (".obj", ".off", ".ply", ".stl") else None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            surface = read_surface(file, units=units)
        except InputError as error:
            message = str(error)
            assert message.startswith(f"{file}: ")
            assert "\n" not in message
            assert WORDS[file.name] in message
        else:
            assert file.name not in WORDS
            assert len(surface.faces)
            assert all("\n" not in note and len(note) < 1000 for note in surface.notes)
    assert capfd.readouterr().err == ""


def test_usd_warnings_become_one_note(tmp_path):
    stage = (FILES / "cycles_and_missing_layers.usda").read_text()
    for missing in (",@./nope.usda@", "@./missing.usda@</x>, "):
        assert missing in stage
        stage = stage.replace(missing, "")
    (tmp_path / "cycles_and_missing_layers.usda").write_text(stage)
    (note,) = read_surface(tmp_path / "cycles_and_missing_layers.usda").notes
    assert note.startswith("the stage was not read whole: ")
    assert note.endswith(", and 1 more")


def test_off_is_read_over_lines_with_its_colours_left_out(tmp_path):
    surface = read_surface(FILES / "faces_over_several_lines.off", units="m")
    assert surface.faces.tolist() == [[0, 1, 2, -1], [0, 2, 3, -1]]
    assert surface.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    coloured = tmp_path / "a.off"
    for header in ("COFF", "OFF"):
        rows = "".join(f"{x} {y} 0 0.5 0.5 0.5 1\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
        coloured.write_text(f"{header}\n4 1 4\n{rows}4 0 1 2 3\n")
        assert read_surface(coloured, units="m").faces.tolist() == [[0, 1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("OFF\n", "the counts of vertices and faces"),
        ("OFF BINARY\n3 1 0\n", "the counts of vertices and faces"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n", "a vertex is not three numbers"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n", "holds 2 of its 3 vertices"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "face 0 (counted from 0) refers to vertex 7"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "'2' is not its count of corners"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n999999999 0 1\n", "holds 0 of its 1 faces"),
        ("OFF\n-3 -1 0\n", "is cut short"),
    ],
)
def test_bad_off_is_refused(tmp_path, text, words):
    file = tmp_path / "a.off"
    file.write_text(text)
    with pytest.raises(InputError) as error:
        read_surface(file, units="m")
    assert words in str(error.value)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".glb"])
def test_binary_files_cut_short_are_refused(tmp_path, suffix):
    import trimesh

    whole, part = tmp_path / f"whole{suffix}", tmp_path / f"part{suffix}"
    trimesh.creation.icosphere(subdivisions=1).export(whole)
    data = whole.read_bytes()
    for length in (len(data) - 1, len(data) - 50, len(data) // 2):
        part.write_bytes(data[:length])
        with pytest.raises(InputError, match=r"part\.\w+: not a readable"):
            read_surface(part, units="m")


def test_the_process_that_reads_usd_does_not_load_warp():
    code = "import sys, warpflat.flat.surface.io.usd_stage; print('warp' in sys.modules or 'scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_face_of_20000_corners_is_cut_into_triangles_that_are_no_slivers():
    from warpflat.flat.surface.repair.polygons import split_polygons

    angle = np.linspace(0.0, 2.0 * np.pi, 20_000, endpoint=False)
    outline = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    faces, origin = split_polygons(outline, np.arange(20_000)[None])
    assert len(faces) == 19_998
    assert not origin.any()
    a, b, c = outline[faces[:, :3]].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_face_with_too_many_corners_beside_many_faces_is_named():
    from warpflat.flat.surface.repair.polygons import pad_corners

    sizes = np.full(100_000, 3)
    sizes[7] = 50_000
    with pytest.raises(InputError, match=r"face 7 \(counted from 0\) has 50,000 corners"):
        pad_corners(np.zeros(sizes.sum(), dtype=np.int64), sizes)
