"""Cuts of a tube in any order: openings are made after them, cross none, and are sewn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from obj_files import write_obj

from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene

QUIET = {"output": {"frames": 0, "picture": False}, "pattern": {"formats": []}}
CENTRE = {"name": "centre", "plane": {"point": [0.0, 0.3, 0.05], "normal": [1.0, 0.0, 0.0]}}
INSEAMS = [{"name": f"inseam {n}", "from": [0.0, 0.2, 0.0], "to": [x, 0.0, 0.0]} for n, x in ((1, -0.05), (2, 0.05))]


def _shorts(path: Path) -> None:
    """Shorts as two layers of 40 by 40 cm that meet along their sides and inseams; the gap between the legs is 10 cm wide."""
    inside = [[not (y < 4 and x in (3, 4)) for x in range(8)] for y in range(8)]
    points, at, faces = list[tuple[float, float, float]](), dict[tuple[int, int, int], int](), list[list[int]]()

    def vertex(x: int, y: int, layer: int) -> int:
        seam = x in (0, 8) or (y < 4 and x in (3, 5)) or (y == 4 and x == 4)
        key = (x, y, 0 if seam or (y == 4 and x in (3, 5)) else layer)
        if key not in at:
            at[key] = len(points)
            points.append((0.05 * (x - 4), 0.05 * y, 0.04 * key[2]))
        return at[key]

    for layer in (1, -1):
        for y in range(8):
            for x in range(8):
                if inside[y][x]:
                    corners = [vertex(x + i, y + j, layer) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
                    faces.append(corners[::layer])
    write_obj(path, (points, faces), digits="")


def _run(folder: Path, cuts: list[dict[str, Any]]) -> Any:
    _shorts(folder / "shorts.obj")
    data = {"surface": {"file": "shorts.obj", "units": "m"}, "cuts": cuts, "fabric": "jersey", **QUIET}
    return run_scene(make_scene(data, name="shorts", folder=folder, where="shorts.toml"), folder / "out")


@pytest.mark.parametrize("at", range(3))
def test_cuts_of_shorts_part_them_in_any_order(at: int, tmp_path: Path):
    """The inseams are mirror images: which of them comes first makes no difference."""
    result = _run(tmp_path, [*INSEAMS[:at], CENTRE, *INSEAMS[at:]])
    assert not any("a tube" in note for note in result.notes)
    assert set(result.metrics["pieces"]) == {"shorts.left", "shorts.right"}
    assert max(abs(seam["difference_mm"]) for seam in result.metrics["seams"]) < 0.1
    assert len({seam["name"] for seam in result.metrics["seams"]}) >= 4  # the centre at least twice, both inseams


def test_what_cuts_leave_a_tube_is_opened_without_crossing_them(tmp_path: Path):
    across = {"name": "across", "plane": {"point": [0.1, 0.3, 0.04], "normal": [0.0, 1.0, 0.0]}}
    result = _run(tmp_path, [across])
    assert sum("a tube, cut open where its borders are nearest" in note for note in result.notes) == 1
    assert len(result.metrics["pieces"]) == 2
    names = [seam["name"] for seam in result.metrics["seams"]]
    assert any(name.startswith("across") for name in names)
    assert sum(name.startswith("opening") for name in names) >= 3
    assert max(abs(seam["difference_mm"]) for seam in result.metrics["seams"]) < 0.1


def test_a_cut_along_another_is_left_out_with_a_note(tmp_path: Path):
    back = {"name": "back", "plane": {"point": [0.0, 0.3, -0.05], "normal": [1.0, 0.0, 0.0]}}
    result = _run(tmp_path, [*INSEAMS, CENTRE, back])
    assert set(result.metrics["pieces"]) == {"shorts.left", "shorts.right"}
    assert "cut 'back' is left out where it runs along another cut" in result.notes
