"""Symmetric pieces as halves on the fold."""

from __future__ import annotations

import numpy as np
import pytest
from polygons import corners_of, drafted, polygon

from warpflat.core.polyline import polyline_length
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.half_pieces import halved, is_symmetric
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.files.left_out import LeftOut, listening_to_left_out


def back(wave: float) -> Piece:
    """A back with a slit from the hem, .2 mm wide, that waves by so much [m] about the middle."""
    height = np.linspace(0.0, 0.2, 21)
    left = np.column_stack([wave * np.sin(np.arange(21) * np.pi / 2 + 0.3) - 1e-4, height])
    right = np.add(left, [2e-4, 0.0])
    tip = 0.5 * (left[-1:] + right[-1:]) + [0.0, 0.001]
    corners = np.array([right[0], (0.2, 0.0), (0.2, 0.5), (-0.2, 0.5), (-0.2, 0.0), left[0]])
    names = ["hem right", "side right", "top", "side left", "hem left"]
    edges = [Edge(name=name, points=corners[k : k + 2]) for k, name in enumerate(names)]
    vent = np.vstack([left, tip, right[::-1]])
    return Piece(name="back", size="", edges=[*edges, Edge(name="vent", points=vent)])


def test_a_piece_whose_half_would_cross_itself_is_printed_whole_and_named():
    drafted = draft_garment(Pattern(name="suit", pieces={"": [back(2.5e-4)]}))
    assert is_symmetric(drafted.pieces[""][0])
    heard = list[LeftOut]()
    with listening_to_left_out(heard.append):
        printed = halved(drafted)
    assert printed.pieces[""][0] is drafted.pieces[""][0]
    (left_out,) = heard
    assert "back is printed whole" in left_out.note
    assert not left_out.is_needed


def test_a_straight_slit_lies_on_the_fold():
    drafted = draft_garment(Pattern(name="suit", pieces={"": [back(0.0)]}))
    assert halved(drafted).pieces[""][0].piece.on_fold


def test_a_piece_with_a_dart_in_its_middle_is_printed_whole():
    corners = np.array([(0.2, 0.0), (0.2, 0.5), (-0.2, 0.5), (-0.2, 0.0)])
    mouth, tip = np.array([(-0.01, 0.0), (0.01, 0.0)]), (0.0, 0.2)
    ring = [tip, mouth[1], *corners, mouth[0], tip]
    names = ["right leg", "hem right", "side right", "top", "side left", "hem left", "left leg"]
    edges = [
        Edge(name=name, points=np.array(ring[k : k + 2]), kind="dart" if "leg" in name else "seam")
        for k, name in enumerate(names)
    ]
    piece = Piece(name="back", size="", edges=edges, darts=[Dart(name="dart", left="left leg", right="right leg")])
    drafted = draft_garment(Pattern(name="suit", pieces={"": [piece]}))
    heard = list[LeftOut]()
    with listening_to_left_out(heard.append):
        assert halved(drafted).pieces[""][0] is drafted.pieces[""][0]
    assert not heard


def test_a_closed_line_around_the_middle_keeps_all_of_its_half():
    pocket = np.array([(-0.1, 0.3), (-0.1, 0.1), (0.1, 0.1), (0.1, 0.3), (-0.1, 0.3)])
    for start in range(4):
        ring = np.roll(pocket[:-1], start, axis=0)
        line = np.concatenate([ring, ring[:1]])
        whole = drafted(polygon("front", corners_of(0.4, 0.5, left=-0.2), internal_lines={"pocket": line}))
        (half,) = halved(whole).pieces[""]
        assert half.piece.on_fold
        (drawn,) = half.internal_lines.values()
        assert polyline_length(drawn) == pytest.approx(0.4)
