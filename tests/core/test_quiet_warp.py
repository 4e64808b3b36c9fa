"""A script sees no greeting of Warp, and Warp's log level stays the user's."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import warp
{setting}
before = warp.config.log_level
import warpflat
pattern = warpflat.flatten(warpflat.make_shape("dome", resolution=5))
warpflat.plot(pattern)
assert warp.config.log_level == before
"""


@pytest.mark.parametrize(
    ("setting", "greets"), [("", False), ("warp.config.log_level = warp.LOG_DEBUG", True)], ids=["default", "own"]
)
def test_a_script_hears_of_warp_only_what_it_asked_for(setting: str, greets: bool) -> None:
    command = [sys.executable, "-c", SCRIPT.format(setting=setting)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = done.stdout + done.stderr
    assert ("initialized" in said) == greets
    assert greets or said == ""
