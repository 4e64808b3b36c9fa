"""Pieces that are equal are drawn once, and cut as often as there are."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from polygons import polygon
from pypdf import PdfReader

import warpflat
from warpflat.garment.construction.equal_pieces import draw_equal_pieces_once
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.label import cutting_words
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.seam_words import seam_words, seams_of_words
from warpflat.pattern.drafting.sewing_order import sewing_steps, sewn_seams
from warpflat.pattern.drafting.whole_pieces import whole_pieces
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json

RIGHT = np.array([[0.0, 0.0], [0.05, 0.1], [0.06, 0.2], [0.0, 0.4]])


def gore(number: int, turn: float = 0.0, off: float = 0.0, right: np.ndarray = RIGHT) -> Piece:
    """A gore that lies turned by an angle, along its grain; the last point of its right side is `off` aside [m]."""
    line = right + np.array([[0.0, 0.0], [off, 0.0], [0.0, 0.0], [0.0, 0.0]])
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    edges = [(f"edge {number}", line), (f"edge {number + 1}", line[::-1] * [-1.0, 1.0])]
    return Piece(
        name=f"piece_{number}",
        edges=[Edge(name=name, points=points @ rotation) for name, points in edges],
        grain=np.array([[0.0, 0.1], [0.0, 0.3]]) @ rotation,
    )


def ball(pieces: list[Piece]) -> Pattern:
    """Each gore is sewn to the next; every other seam is told the other way round."""
    seams = []
    for k, piece in enumerate(pieces):
        following = pieces[(k + 1) % len(pieces)]
        side = SeamSide(piece=piece.name, edge=piece.edges[0].name, reversed=k % 2 == 1)
        other = SeamSide(piece=following.name, edge=following.edges[1].name, reversed=k % 2 == 0)
        seams.append(Seam(name=f"seam {k}", sides=((side,), (other,)) if k % 3 else ((other,), (side,))))
    return Pattern(name="ball", pieces={"": pieces}, seams=seams)


def test_gores_that_are_equal_are_cut_from_one_and_all_their_seams_are_told() -> None:
    pattern, notes = draw_equal_pieces_once(ball([gore(k, 0.3 * k, 6e-4 * (k % 2)) for k in range(6)]))
    (piece,) = pattern.pieces[""]
    assert (piece.name, piece.quantity, cutting_words(piece, piece.quantity)) == ("piece_0", 6, "Cut 6")
    assert notes == (
        "piece_0: cut 6 times, it serves for piece_1, piece_2, piece_3, piece_4, piece_5 too; they are averaged, which moves their "
        "outlines by at most 0.3 mm",
    )
    # Each copy's two edges are sewn once, each the same way round as that which is drawn.
    sides = [side for seam in pattern.seams for side in seam.stretches]
    assert sorted((side.copy, side.edge) for side in sides) == [(k, f"edge {e}") for k in range(6) for e in (0, 1)]
    assert all(len({side.reversed for side in sides if side.edge == edge}) == 1 for edge in ("edge 0", "edge 1"))
    # Notches of one letter meet, as far from the tip.
    drafted = draft_garment(pattern)
    notches = {notch.edge: notch for notch in drafted.pieces[""][0].notches}
    assert {seam.letter for seam in sewn_seams(sewing_steps(drafted, ""))} == {"A"}
    assert sewn_seams(sewing_steps(drafted, ""))[0].count == 6
    assert notches["edge 0"].at == pytest.approx(notches["edge 1"].at * [-1.0, 1.0], abs=4e-4)
    # Files tell all of it again, and what is sewn has all six.
    assert list(pattern_from_json(pattern_json(drafted)).pattern.seams) == list(pattern.seams)
    words = [(*edge, text) for edge, row in seam_words(pattern.seams).items() for text in row]
    assert {seam.name: seam.sides for seam in seams_of_words(words)} == {s.name: s.sides for s in pattern.seams}
    whole, seams, _ = whole_pieces(pattern.pieces[""], pattern.seams)
    assert set(whole) == {"piece_0", *(f"piece_0 copy {k}" for k in range(2, 7))}
    assert len({side.place for seam in seams for side in seam.stretches}) == 12


def test_pieces_that_differ_or_lie_across_the_grain_are_drawn_each() -> None:
    longer = gore(2, right=RIGHT * [1.0, 1.02])
    across = replace(gore(3), grain=np.array([[0.0, 0.1], [0.1, 0.1]]))
    named = replace(gore(4), name="collar")
    pattern, notes = draw_equal_pieces_once(ball([gore(0), gore(1), longer, across, named]))
    assert [(piece.name, piece.quantity) for piece in pattern.pieces[""]] == [
        ("piece_0", 2), ("piece_2", 1), ("piece_3", 1), ("collar", 1),
    ]  # fmt: skip
    assert notes == ("piece_0: cut 2 times, it serves for piece_1 too",)


def test_pieces_that_are_mirror_images_are_cut_turned_over() -> None:
    def lopsided(number: int, side: float) -> Piece:
        points = np.array([[0.0, 0.0], [0.2, 0.05], [0.15, 0.3], [0.0, 0.25]]) * [side, 1.0]
        ring = points if side > 0 else points[::-1]
        return polygon(f"piece_{number}", ring, grain=np.array([[0.05, 0.05], [0.05, 0.2]]) * [side, 1.0])

    pieces = [lopsided(0, 1.0), lopsided(1, -1.0)]
    image = next(edge.name for edge in pieces[1].edges if edge.points.max() < 1e-9 or np.ptp(edge.points[:, 0]) < 1e-9)
    sides = (SeamSide(piece="piece_0", edge="e3"),), (SeamSide(piece="piece_1", edge=image, reversed=True),)
    pattern, _ = draw_equal_pieces_once(
        Pattern(name="bag", pieces={"": pieces}, seams=[Seam(name="centre", sides=sides)])
    )
    (piece,) = pattern.pieces[""]
    assert cutting_words(piece, piece.quantity) == "Cut 2, 1 mirrored"
    assert pattern.seams[0].sides == (
        (SeamSide(piece="piece_0", edge="e3"),), (SeamSide(piece="piece_0", edge="e3", mirrored=True),),
    )  # fmt: skip


def test_a_copy_that_is_not_cut_is_refused() -> None:
    sides = (SeamSide(piece="piece_0", edge="edge 0"),), (SeamSide(piece="piece_0", edge="edge 1", copy=1),)
    with pytest.raises(warpflat.InputError, match=r"piece_0.edge 1 \(copy 2\) is not cut; .* quantity of 1"):
        Pattern(name="ball", pieces={"": [gore(0)]}, seams=[Seam(name="seam", sides=sides)])


def test_prices_of_seams_are_printed_and_kept_in_the_file(tmp_path: Path) -> None:
    from warpflat.pattern.drafting.piece_parts import FoundSeam
    from warpflat.pattern.export.pdf import write_pdf

    found = [
        FoundSeam(name="side left", length=0.5, released=0.02),
        FoundSeam(name="side right", length=0.5, released=0.03),
        FoundSeam(name="shoulder", length=0.1, needed="opens a tube"),
    ]
    pattern = replace(ball([gore(k) for k in range(3)]), found_seams=found)
    drafted = draft_garment(pattern)
    assert pattern_from_json(pattern_json(drafted)).pattern.found_seams == found
    write_pdf(drafted, tmp_path / "pattern.pdf")
    text = "\n".join(page.extract_text() for page in PdfReader(tmp_path / "pattern.pdf").pages)
    assert re.search(
        r"What each seam is for.*side \(2 x\)\s*100 cm\s*50 mJ\s*0.5 mJ/cm\s*shoulder\s*10 cm\s*opens a tube",
        text,
        re.DOTALL,
    )
