"""Patterns for cloth that shrinks: what is sewn is as large as without."""

from __future__ import annotations

import numpy as np
import pytest
from polygons import corners_of, drafted, polygon

from warpflat.pattern.drafting.finished import finished_lengths
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.marker import unfold_piece
from warpflat.pattern.drafting.shrinkage import Shrinkage, enlarged
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json

NAMES, KINDS = ("hem", "side right", "neck", "side left"), ("hem", "seam", "seam", "seam")


def skirt(share: float):
    piece = polygon(
        "front", corners_of(0.5, 0.6, left=-0.25), names=NAMES, kinds=KINDS, widths=(0.03, 0.02, 0.01, 0.02)
    )
    return enlarged(drafted(piece), Shrinkage(warp=share, weft=share), "")


def test_lengths_of_the_finished_garment_are_those_after_shrinking():
    assert finished_lengths(skirt(0.05), "") == pytest.approx(finished_lengths(skirt(0.0), ""))


def test_a_half_is_as_wide_as_the_half_of_the_whole_piece():
    drawn = skirt(0.10)
    half = halved(drawn).pieces[""][0]
    assert half.piece.on_fold
    extents = [np.ptp(line, axis=0) for line in (unfold_piece(half), drawn.pieces[""][0].cut_line)]
    np.testing.assert_allclose(*extents, atol=1e-5)
    assert half.enlarged == drawn.pieces[""][0].enlarged
    assert half.notes == drawn.pieces[""][0].notes


def test_the_pattern_of_a_file_is_as_large_as_it_was():
    read = pattern_from_json(pattern_json(skirt(0.05))).pattern
    assert np.ptp(read.pieces[""][0].outline, axis=0) == pytest.approx([0.5, 0.6])
