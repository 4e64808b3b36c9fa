"""The door for files of others: whatever goes wrong behind it is one line; what is no regular file of bounded size is not opened."""

import os
from pathlib import Path

import pytest

from warpflat.app.cli.main import main
from warpflat.core.errors import InputError
from warpflat.core.input_files import FORMATS, file_digest, read_json, read_result, reading


def deeper(count: int) -> int:
    return deeper(count + 1)


@pytest.mark.parametrize(
    "fault",
    [
        lambda: deeper(0),
        lambda: float(10**400),
        lambda: {}["key"],
        lambda: [][3],
        lambda: 1 / 0,
        lambda: None.gone,
        lambda: bytes(1 << 60),
        lambda: "\n".join(3),
        lambda: exec("assert False"),
    ],
)
def test_any_error_of_a_reader_is_one_line_about_the_file(tmp_path, fault):
    file = tmp_path / "a.dxf"
    file.write_text("0\nEOF\n")

    def read() -> None:
        with reading(file, "DXF") as place:
            place.at = "LINE on layer 3"
            fault()

    with pytest.raises(InputError) as caught:
        read()
    told = str(caught.value)
    assert told.startswith(f"{file}: LINE on layer 3: ")
    assert "\n" not in told


def test_an_interruption_is_no_error_of_the_file(tmp_path):
    file = tmp_path / "a.dxf"
    file.write_text("0\nEOF\n")
    with pytest.raises(KeyboardInterrupt), reading(file, "DXF"):
        raise KeyboardInterrupt


def test_pipes_folders_and_sparse_files_of_gigabytes_are_not_opened(tmp_path):
    pipe, sparse = tmp_path / "pipe.dxf", tmp_path / "sparse.dxf"
    os.mkfifo(pipe)
    with sparse.open("wb") as file:
        file.truncate(FORMATS["DXF"].most + 1)
    for path, words in ((pipe, "is a pipe or a device"), (sparse, "at most 50 MB"), (tmp_path, "is a directory")):
        with pytest.raises(InputError, match=words), reading(path, "DXF"):
            raise AssertionError("it was opened")


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("a.toml", ["run", "a.toml"]),
        ("a.toml", ["batch", "a.toml"]),
        ("a.obj", ["flatten", "a.obj", "--units", "m"]),
        ("a.ply", ["flatten", "a.ply", "--units", "m"]),
        ("a.usdc", ["flatten", "a.usdc"]),
        ("a.svg", ["drape", "a.svg"]),
        ("a.toml", ["fabrics", "--file", "a.toml"]),
        ("pattern.json", ["export", ".", "--format", "svg"]),
        ("metrics.json", ["review", "."]),
    ],
)
@pytest.mark.parametrize("kind", ["pipe", "sparse"])
def test_no_command_waits_for_a_pipe_or_reads_gigabytes(tmp_path, monkeypatch, capsys, name, arguments, kind):
    monkeypatch.chdir(tmp_path)
    if kind == "pipe":
        os.mkfifo(name)
    else:
        with Path(name).open("wb") as file:
            file.truncate(8_000_000_000)
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert name in told


def test_an_internal_error_has_a_line_and_an_exit_code_of_its_own(monkeypatch, capsys):
    monkeypatch.delenv("WARPFLAT_TRACEBACK", raising=False)
    monkeypatch.setattr("warpflat.app.cli.main.cli.main", lambda **_: {}["gone"])
    assert main(["fabrics"]) == 70
    told = capsys.readouterr().err
    assert told.startswith("warpflat: internal error")
    assert told.count("\n") == 1
    monkeypatch.setenv("WARPFLAT_TRACEBACK", "1")
    assert main(["fabrics"]) == 70
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("given", ["abc", "", "1e5", "-1", "9" * 5000])
def test_a_source_date_that_is_no_number_is_one_line(monkeypatch, capsys, given):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", given)
    assert main(["fabrics"]) == 2
    assert "whole seconds since 1970" in capsys.readouterr().err


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(tmp_path, monkeypatch):
    file = tmp_path / "a.json"
    opened = os.open

    def replaced(path, flags, *more, **options):
        file.unlink()
        os.mkfifo(file)
        return opened(path, flags, *more, **options)

    for read in (read_json, read_result, file_digest):
        file.unlink(missing_ok=True)
        file.write_text("{}")
        with monkeypatch.context() as patch:
            patch.setattr(os, "open", replaced)
            with pytest.raises(InputError, match=r"a\.json: is a pipe or a device"):
                read(file)


def test_a_link_is_followed_to_a_file_of_others_and_not_in_a_folder_of_results(tmp_path):
    (tmp_path / "there.json").write_text('{"a": 1}')
    link = tmp_path / "a.json"
    link.symlink_to("there.json")
    assert read_json(link) == {"a": 1}
    assert file_digest(link, "named") == file_digest(tmp_path / "there.json")
    for read in (read_result, file_digest):
        with pytest.raises(InputError, match=r"a\.json: is a link"):
            read(link)
