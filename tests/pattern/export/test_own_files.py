"""What the package writes it reads: pattern.json whole, DXF and SVG with all that they hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from polygons import corners_of, drafted, polygon, sewn

from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.export.dxf import write_dxf
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json
from warpflat.pattern.export.read_dxf import read_dxf
from warpflat.pattern.export.read_svg import read_svg
from warpflat.pattern.export.svg import write_svg

#: A block with a dart in its lower edge.
DARTED = [(0.0, 0.0), (0.13, 0.0), (0.15, 0.12), (0.17, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)]
NAMES = ("hem left", "d.left", "d.right", "hem right", "side right", "neck", "side left")
KINDS = ("hem", "dart", "dart", "hem", "seam", "seam", "seam")
WIDTHS = (0.03, None, None, 0.03, 0.015, 0.0, 0.015)
BOTH = pytest.mark.parametrize("ending", ["dxf", "svg"])


def darted(**more) -> DraftedGarment:
    """The block, drafted; `more` is of its dart."""
    dart = Dart(name="d", left="d.left", right="d.right", **more)
    return drafted(polygon("front", DARTED, names=NAMES, kinds=KINDS, widths=WIDTHS, darts=[dart]))


def through(garment: DraftedGarment, ending: str, folder: Path) -> Pattern:
    """The garment written and read."""
    write, read = (write_dxf, read_dxf) if ending == "dxf" else (write_svg, read_svg)
    write(garment, folder / f"p.{ending}")
    return read(folder / f"p.{ending}")


def test_a_dart_of_pattern_json_is_still_cut_away():
    read = pattern_from_json(pattern_json(darted(cut=True)))
    assert read.pieces[""][0].piece.darts[0].cut


def test_pattern_json_keeps_how_seams_are_sewn_and_notched_and_the_notes():
    fronts = [polygon(f"front_{k}", corners_of(0.2, 0.3)) for k in (1, 2)]
    seam = sewn(
        "front_1.e1", "front_2.e3", "cf", as_laid=True, double=True, notches=(0.25, 0.5), size_notches={"": (0.3,)}
    )
    given = Pattern(name="p", pieces={"": fronts}, seams=[seam], notes=["the file says so"])
    read = pattern_from_json(pattern_json(draft_garment(given))).pattern
    assert read.seams == [seam]
    assert list(read.notes) == given.notes


@BOTH
def test_allowances_are_those_that_are_drawn(ending: str, tmp_path: Path):
    (piece,) = through(darted(), ending, tmp_path).pieces[""]
    assert [dart.name for dart in piece.darts] == ["d"]
    assert {edge.name: edge.width for edge in piece.edges} == pytest.approx(
        {name: width or 0.0 for name, width in zip(NAMES, WIDTHS, strict=True)}
    )


@BOTH
def test_hems_and_raw_edges_stay_what_they_are(ending: str, tmp_path: Path):
    kinds = ("hem", "cut", "seam", "cut")
    (piece,) = through(drafted(polygon("band", corners_of(0.2, 0.3), kinds=kinds)), ending, tmp_path).pieces[""]
    assert tuple(edge.kind for edge in piece.edges) == kinds


@BOTH
def test_a_pleat_is_sewn_as_far_as_before(ending: str, tmp_path: Path):
    (piece,) = through(darted(pleat=0.04), ending, tmp_path).pieces[""]
    (dart,) = piece.darts
    assert (dart.name, dart.left, dart.right) == ("d", "d.left", "d.right")
    assert dart.pleat == pytest.approx(0.04, abs=1e-6)
    assert piece.edge("d.left").length == pytest.approx(np.hypot(0.02, 0.12), abs=1e-6)


@BOTH
def test_fisheye_darts_come_back_and_what_does_not_is_counted(ending: str, tmp_path: Path):
    eye = np.array([(0.1, 0.1), (0.11, 0.2), (0.1, 0.3), (0.09, 0.2)])
    hole = np.array([(0.2, 0.1), (0.25, 0.1), (0.25, 0.15), (0.2, 0.15)])
    piece = polygon(
        "front", corners_of(0.4, 0.4), internal_lines={"hip": np.array([(0.02, 0.35), (0.3, 0.35)])},
        holes=[Hole(name="waist dart", points=eye, kind="dart"), Hole(name="window", points=hole)],
    )  # fmt: skip
    before = drafted(piece)
    read = through(before, ending, tmp_path)
    (found,) = read.pieces[""]
    assert [(hole.name, hole.kind) for hole in found.holes] == [("waist dart", "dart")]
    assert len(found.edges) == 4
    extent = np.ptp(before.pieces[""][0].fisheyes["waist dart"], axis=0)
    assert np.ptp(found.holes[0].points, axis=0) == pytest.approx(extent, abs=1e-5)
    assert read.notes == ["what belongs to pieces and is not read: " + ", ".join(
        ("inner line", "inner cut", "drill hole (2)") if ending == "dxf" else ("drill hole (2)", "inner cut", "inner line")
    )]  # fmt: skip


@BOTH
def test_a_round_piece_is_one_edge(ending: str, tmp_path: Path):
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = 0.09 * np.column_stack([np.cos(turn), np.sin(turn)])
    circle[-1] = circle[0]
    crown = Piece(name="crown", edges=[Edge(name="rim", points=circle)])
    band = polygon("band", corners_of(0.18 * np.pi, 0.07))
    read = through(drafted(crown, band, seams=[sewn("crown.rim", "band.e2", "rim")]), ending, tmp_path)
    assert [seam.name for seam in read.seams] == ["rim"]
    (edge,) = read.piece("crown", "").edges
    assert (edge.name, edge.width) == ("rim", pytest.approx(0.01))
    assert edge.length == pytest.approx(0.18 * np.pi, rel=1e-3)


@BOTH
def test_pieces_of_one_title_and_seams_of_any_name_stay_apart(ending: str, tmp_path: Path):
    fronts = [replace(polygon(f"front_{k}", corners_of(0.2, 0.3)), title="Front") for k in (1, 2)]
    read = through(drafted(*fronts, seams=[sewn("front_1.e1", "front_2.e3", "cf | side 1")]), ending, tmp_path)
    (seam,) = read.seams
    assert seam.name == "cf | side 1"
    assert len({side.piece for side in seam.stretches}) == 2


def test_every_cloth_of_a_piece_comes_back(tmp_path: Path):
    piece = replace(polygon("front", corners_of(0.2, 0.3)), fabric="wool", also={"fusible": 1})
    (read,) = through(drafted(piece), "dxf", tmp_path).pieces[""]
    assert (read.fabric, read.also) == ("wool", {"fusible": 1})
