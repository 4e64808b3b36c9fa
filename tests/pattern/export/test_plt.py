"""HP-GL for plotters and cutters, read back: true size, pens by kind of line, the cutting line last."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import shapely
from command import Command
from polygons import sewn, sides

from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.export.pattern_json import write_pattern_json
from warpflat.pattern.export.plt import write_plt


@dataclass
class Plotted:
    """What a plotter draws: lines [m] and words by pen, and the pens in their order."""

    lines: dict[int, list[np.ndarray]] = field(default_factory=dict)
    words: dict[int, list[tuple[str, tuple[float, float]]]] = field(default_factory=dict)
    pens: list[int] = field(default_factory=list)


def plotted(path: Path) -> Plotted:
    """Obey the commands of a file: IN, SP, PU, PD, LO, DI, SI and LB."""
    found, pen, at, line = Plotted(), 0, (0.0, 0.0), list[tuple[float, float]]()
    for command, given in re.findall(r"\s*(LB|[A-Z]{2})([^;\x03]*)(?:;|\x03;)", path.read_bytes().decode("ascii")):
        if command == "SP":
            pen = int(given)
            found.pens.append(pen)
        elif command in ("PU", "PD"):
            numbers = [int(each) / 40_000 for each in given.split(",")] if given else []
            points = list(zip(numbers[::2], numbers[1::2], strict=True))
            if command == "PU":
                if len(line) > 1:
                    found.lines.setdefault(pen, []).append(np.array(line))
                line = points[-1:] or [line[-1]] if line or points else []
            else:
                line += points
            at = line[-1] if line else at
        elif command == "LB":
            found.words.setdefault(pen, []).append((given, at))
        else:
            assert command in ("IN", "LO", "DI", "SI")
    return found


def garment(sizes: tuple[str, ...] = ("",)) -> DraftedGarment:
    """A piece with a dart, a hole, a curved edge and a seam to itself, in each size 10 mm wider."""
    pieces = {}
    for number, size in enumerate(sizes):
        wide = 0.4 + 0.01 * number
        corners = [(0.0, 0.0), (wide, 0.0), (wide, 0.3), (0.22, 0.3), (0.2, 0.15), (0.18, 0.3), (0.0, 0.3)]
        edges = sides(corners, kinds=["hem", "seam", "seam", "dart", "dart", "seam", "seam"], first=1)
        turn = np.linspace(0.0, np.pi, 61)
        arc = np.column_stack([wide / 2 - wide / 2 * np.cos(turn), -0.05 * np.sin(turn)])
        arc[[0, -1]] = corners[:2]
        edges[0] = Edge(name="e1", points=arc, kind="hem")
        hole = Hole(name="eye", points=np.array([(0.05, 0.05), (0.1, 0.05), (0.1, 0.1), (0.05, 0.1)]), allowance=0.0)
        pieces[size] = [
            Piece(name="Ärmel", size=size, edges=edges, holes=[hole], darts=[Dart(name="bust", left="e4", right="e5")])
        ]
    return draft_garment(Pattern(name="p", pieces=pieces, seams=[sewn("Ärmel.e2", "Ärmel.e7", "side")]))


def test_what_a_plotter_draws_is_the_pattern(tmp_path: Path):
    drafted = garment()
    write_plt(drafted, tmp_path / "p.plt")
    found = plotted(tmp_path / "p.plt")
    # Marks first, the cut last, no pen at the end.
    assert found.pens == [3, 2, 1, 0]
    (piece,) = drafted.pieces[""]
    (placed,) = lay_out(nests(drafted), width=1.5).placed
    cut, hole = sorted(found.lines[1], key=lambda line: -np.ptp(line[:, 0]))
    for line, wanted in ((cut, piece.cut_line), (hole, piece.cutouts["eye"].cut_line)):
        np.testing.assert_array_equal(line[0], line[-1])
        on_sheet = placed.on_sheet(np.vstack([wanted, wanted[:1]]))
        assert shapely.hausdorff_distance(shapely.LineString(line), shapely.LineString(on_sheet)) < 2e-5
    assert min(line.min() for line in found.lines[1]) >= 0.0
    slits = [line for line in found.lines[2] if len(line) == 2]
    assert {round(float(np.linalg.norm(line[1] - line[0])), 3) for line in slits} >= {round(piece.notches[0].depth, 3)}
    lengths = [shapely.LineString(line).length for line in found.lines[3]]
    for edge in piece.edges:
        assert min(abs(length - edge.length) for length in lengths) < 1e-4
    texts = [text for text, _ in found.words[3]]
    assert "ARMEL" in texts
    (low, _), (high, _) = (limit(placed.on_sheet(piece.cut_line), axis=0) for limit in (np.min, np.max))
    assert all(low < x < high for _, (x, _) in found.words[3])


def test_sizes_lie_upon_each_other_or_one_is_chosen(command: Command):
    drafted = garment(("36", "38", "40"))
    Path("run").mkdir()
    write_pattern_json(drafted, "run/pattern.json")
    assert command("export", "run", "--format", "plt").code == 0
    nest = plotted(Path("run/p.plt"))
    assert len(nest.lines[1]) == 6
    assert command("export", "run", "--format", "plt", "--size", "40", "--out", "one").code == 0
    one = plotted(Path("one/p.plt"))
    assert len(one.lines[1]) == 2
    widest = max(np.ptp(line[:, 0]) for line in one.lines[1])
    assert widest == pytest.approx(np.ptp(drafted.pieces["40"][0].cut_line[:, 0]), abs=3e-5)
    assert "no size '42'" in command("export", "run", "--format", "plt", "--size", "42").err
