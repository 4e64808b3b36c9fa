"""Messages are one plain line of bounded length."""

from __future__ import annotations

from warpflat.core.text import LONGEST_LINE, LONGEST_WORD, list_some, one_line


def test_a_long_word_and_a_long_line_lose_their_middle() -> None:
    word = one_line(f"file {'a' * 400}z: is odd")
    assert word.startswith("file aaa")
    assert word.endswith("az: is odd")
    assert len(word.split()[1]) <= LONGEST_WORD + 1
    assert len(one_line("word " * 1000)) <= LONGEST_LINE


def test_lines_are_joined_and_control_characters_escaped() -> None:
    assert one_line("one\n  two\x1b[31m") == r"one two\x1b[31m"


def test_a_list_is_cut_short_with_the_number_of_the_others() -> None:
    assert list_some(["a", "b"], 2) == "a, b"
    assert list_some(range(2000), 3) == "0, 1, 2 and 1,997 more"
    assert list_some([]) == ""
