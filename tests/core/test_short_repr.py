"""What results show of themselves."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import pytest

import warpflat


@pytest.mark.parametrize("name", [n for n in warpflat.__all__ if is_dataclass(getattr(warpflat, n))])
def test_no_public_result_prints_its_arrays(name: str):
    cls = getattr(warpflat, name)
    holds_arrays = any("Array" in str(each.type) for each in fields(cls))
    # The one that the standard library makes prints them.
    assert not (holds_arrays and hasattr(cls.__repr__, "__wrapped__"))


def test_a_mannequin_is_one_line():
    words = repr(warpflat.Mannequin.from_size("EU 38", resolution_mm=40.0))
    assert words.startswith("<Mannequin layout: Layout, vertices: ")
    assert len(words) < 200
    assert "\n" not in words
