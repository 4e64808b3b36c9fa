"""A file of another kind says what it is, and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import Command

from warpflat.core.file_kinds import FOREIGN


@pytest.mark.parametrize("ending", sorted(FOREIGN))
def test_a_file_of_another_program_says_what_to_export(ending: str, command: Command) -> None:
    Path(f"own{ending.upper()}").write_bytes(b"\x00\xff odd")
    what, advice = FOREIGN[ending]
    for words in (("drape",), ("flatten",), ("run",), ("export", "--format", "svg"), ("marker",)):
        assert (
            command(*words, f"own{ending.upper()}").refusal
            == f"own{ending.upper()}: is {what}, which is not read; {advice}"
        )


def test_a_file_of_another_command_names_that(command: Command) -> None:
    Path("own.obj").write_text("v 0 0 0\n")
    Path("own.dxf").write_text("0\nEOF\n")
    assert command("run", "own.obj").refusal == "own.obj: is a mesh, not a text in TOML: warpflat flatten reads it"
    assert (
        "is a pattern, not a mesh: warpflat drape, export and marker read it" in command("flatten", "own.dxf").refusal
    )
    assert "own.obj: is a mesh, not a pattern" in command("marker", "own.obj").refusal


@pytest.mark.parametrize("text", ["// made by hand\n{}", '{"pattern": {}, # no\n}', "{'a': 1}", '{"a": 1,}', ""])
def test_what_is_no_json_says_where(text: str, command: Command) -> None:
    Path("own.json").write_text(text)
    told = command("drape", "own.json").refusal
    assert "own.json: line " in told
    assert "is no JSON" in told
    assert "run the scene again" not in told
