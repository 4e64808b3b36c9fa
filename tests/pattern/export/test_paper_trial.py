"""The printed pattern, joined, cut, unfolded and sewn in software."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from sample_dress import sample_dress

from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.export.pattern_json import write_pattern_json

pytest.importorskip("pypdf")
sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))


def test_printed_seams_close_and_notches_meet(tmp_path):
    from paper_trial import try_pattern

    dress = draft_garment(sample_dress(("38",)))
    write_pattern_json(dress, tmp_path / "pattern.json")
    rows, pieces, sheets = try_pattern(tmp_path / "pattern.json")
    assert pieces == len(dress.pieces["38"])
    assert sheets > 1
    assert len(rows) == len(dress.pattern.seams)
    assert sum(notches for *_, notches in rows) > 0
    for name, gap, missed, _ in rows:
        assert abs(gap) < 0.5, name
        assert missed < 0.5, name
