"""What edges and darts are called."""

from __future__ import annotations

import pytest

from warpflat.pattern.drafting.names import dart_words, line_name


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("neck left 2", "neck"),
        ("waist 2 3", "waist"),
        ("gore_2", "gore"),
        ("panel2 left", "panel2"),
        ("right.1", "right"),
    ],
)
def test_a_number_that_is_a_word_of_its_own_is_no_part_of_a_line_name(name: str, line: str):
    assert line_name(name) == line


def test_a_dart_is_called_so_once() -> None:
    assert [dart_words(name) for name in ("waist dart left", "bust_dart", "bust", "cut 2")] == [
        "waist dart left",
        "bust_dart",
        "dart bust",
        "dart cut 2",
    ]
