"""What native code writes to standard error is kept from it, and known."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

import pytest

from warpflat.core.native_output import native_errors


def test_lines_of_native_code_are_kept_from_standard_error(capfd: pytest.CaptureFixture[str]):
    print("before", file=sys.stderr)
    with native_errors() as lines:
        os.write(2, b"first\nsecond\n")
        assert lines == []
    print("after", file=sys.stderr)
    assert lines == ["first", "second"]
    assert capfd.readouterr().err == "before\nafter\n"


def test_standard_error_is_back_after_an_exception(capfd: pytest.CaptureFixture[str]):
    with suppress(ValueError), native_errors() as lines:
        os.write(2, b"noise\n")
        raise ValueError
    assert lines == ["noise"]
    os.write(2, b"after\n")
    assert capfd.readouterr().err == "after\n"
