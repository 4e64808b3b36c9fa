"""Members of a folder of results that are not what a run has left: refused in one line, and never followed, run or decoded."""

from __future__ import annotations

import json
import os
import shutil
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
from command import Command

from warpflat.app.batch.plan import load_batch
from warpflat.app.cli.main import main
from warpflat.pattern.files.output import seal_of

SCENE = "[surface]\nshape = 'dome'\nresolution = 9\n[output]\nframes = 4\n[pattern]\nformats = ['svg', 'json']\n"
STILL = SCENE.replace("frames = 4", "frames = 0")
PLAIN = "[surface]\nshape = 'dome'\nresolution = 7\n[output]\nframes = 0\npicture = false\n[pattern]\nformats = []\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the results of a scene, and with those of it without a film."""
    folder = tmp_path_factory.mktemp("made")
    for out, scene in (("out", SCENE), ("still", STILL)):
        (folder / "cap.toml").write_text(scene)
        assert main(["run", str(folder / "cap.toml"), "--out", str(folder / out), "-q"]) == 0
    return folder


@pytest.fixture
def run(made: Path, command: Command) -> Path:
    shutil.copytree(made / "out", "out")
    Path("secret.txt").write_text("secret")
    return Path("out")


@pytest.mark.parametrize("target", ["../secret.txt", "/dev/zero", "..", "a pipe"])
@pytest.mark.parametrize("file", ["cap.svg", "picture.png", "frames.usdc", "metrics.json", "review.html"])
def test_a_link_or_a_pipe_in_a_run_is_not_followed(run: Path, file: str, target: str, command: Command):
    (run / file).unlink()
    if target == "a pipe":
        os.mkfifo(run / file)
    else:
        os.symlink(target, run / file)
    before = {path.name: path.lstat().st_mtime_ns for path in run.iterdir()}
    assert f"out/{file}: is a link, a folder, a pipe or a device" in command("review", "out", "-q").refusal
    assert {path.name: path.lstat().st_mtime_ns for path in run.iterdir()} == before


def png(wide: int, high: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", wide, high, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


ENDLESS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 99 99\n%%EndComments\n{} loop\n%%EOF\n"


@pytest.mark.parametrize(
    "content",
    [ENDLESS, png(60_000, 60_000), png(0, 4), png(2**31 - 1, 2**31 - 1), b"GIF89a", b"", png(4, 4)],
    ids=["EPS", "large", "no width", "largest", "GIF", "empty", "no pixels"],
)
def test_a_picture_is_a_png_of_bounded_size_or_refused(
    made: Path, content: bytes, command: Command, monkeypatch: pytest.MonkeyPatch
):
    def started(command: list[str], *_: Any, **__: Any) -> None:
        pytest.fail(f"{command[0]} was started")

    monkeypatch.setattr("subprocess.Popen", started)
    shutil.copytree(made / "still", "out")
    Path("out/picture.png").write_bytes(content)
    told = command("review", "out", "-q").refusal
    assert told.startswith(("out/picture.png: is no PNG", "out/picture.png: cannot be read"))


# --- batches


BATCH = ("batch", "b.toml", "--out", "o", "-q")


@pytest.fixture(scope="module")
def made_batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("batch")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("s.toml").write_text(PLAIN)
        Path("b.toml").write_text("scenes = ['s.toml']\n")
        assert main(list(BATCH)) == 0
    return folder


@pytest.fixture
def batch(made_batch: Path, command: Command) -> str:
    """The key of a batch's task, which is done."""
    shutil.copytree(made_batch, ".", dirs_exist_ok=True)
    return load_batch("b.toml")[0].key


@pytest.mark.parametrize("file", ["metrics.json", "task.json"])
def test_a_damaged_result_is_a_failure_of_its_task(batch: str, file: str, command: Command):
    path = Path("o") / batch / file
    damaged = [
        '{"pieces":{}}', "[" * 200_000, "{}", "[]", "", '"\\ud800"', "9" * 5000, '{"seconds": "x", "memory_mb": []}', "null",
    ]  # fmt: skip
    for text in damaged:
        path.write_text(text)
        told = command(*BATCH)
        assert told.code == 1
        assert told.err.count("\n") == 1
        assert f"{batch}/{file}: is not of warpflat" in told.err or f"{batch}/{file}: was changed" in told.err
        assert path.read_text() == text
    shutil.rmtree(path.parent)
    assert command(*BATCH).code == 0


@pytest.mark.parametrize(
    ("key", "value"),
    [("strain_energy_j", "x"), ("strain_energy_j", float("inf")), ("converged", None), ("wear", {"held": "\x1b[31m"})],
)  # fmt: skip
def test_a_result_of_wrong_types_with_a_seal_does_not_stop_the_batch(
    batch: str, key: str, value: object, command: Command
):
    path = Path("o") / batch / "metrics.json"
    metrics = json.loads(path.read_text())
    next(iter(metrics["pieces"].values()))[key] = value
    path.write_text(json.dumps({**metrics, "sha256": seal_of(metrics)}))
    assert command(*BATCH).code in (0, 1)


@pytest.mark.parametrize("message", ["\ud800", "\x1b[31mred", "\u202e", "a\nb", "", 3, None, ["x"]])
def test_a_message_of_a_task_is_one_plain_line(batch: str, message: object, command: Command):
    shutil.rmtree(Path("o") / batch)
    (Path("o") / f"{batch}.error.json").write_text(json.dumps({"status": "error", "message": message}))
    told = command(*BATCH)
    assert told.code == told.err.count("\n") == (1 if isinstance(message, str) else 0)
    assert told.err.replace("\n", "").isprintable()


@pytest.mark.parametrize("name", ["KEY", "KEY.started", "KEY/metrics.json", "KEY.error.json"])
@pytest.mark.parametrize("target", ["secret", "/dev/zero", "a pipe"])
def test_a_link_or_a_pipe_in_a_batch_is_not_followed(batch: str, name: str, target: str, command: Command):
    secret = Path("secret")
    if name == "KEY":
        os.replace(Path("o") / batch, secret)  # a result elsewhere
    else:
        secret.write_text("secret")
        shutil.rmtree(Path("o") / batch)
        (Path("o") / batch).mkdir()
    path = Path("o") / name.replace("KEY", batch)
    if target == "a pipe" and name != "KEY":
        os.mkfifo(path)
    else:
        os.symlink(secret.absolute() if target != "/dev/zero" else target, path)
    before = path.lstat().st_mtime_ns
    told = command(*BATCH)
    assert told.code == told.err.count("\n") == (0 if "error" in name else 1)
    assert path.lstat().st_mtime_ns == before
    assert name == "KEY" or secret.read_text() == "secret"


def test_a_batch_of_billions_is_counted_before_it_is_made(batch: str, command: Command):
    several = {
        "scenes": ["s.toml"] * 283,
        "fabrics": ["denim"] * 283,
        "overrides": [{"grain_angle": float(k)} for k in range(283)],
    }
    text = "".join(f"{key} = {json.dumps(value)}\n" for key, value in several.items())
    Path("b.toml").write_text(
        text.replace('{"grain_angle": ', "{grain_angle = ") + "[[bodies]]\nsize = 'EU 38'\n" * 283
    )
    assert "has 6,414,247,921 tasks; a batch has at most 100,000" in command("batch", "b.toml").refusal


@pytest.mark.parametrize(
    "address",
    ["tls://127.0.0.1:1", "nonsense", "", "tcp://", "tcp://127.0.0.1:99999999", "x://y:1", "tcp://\x1b[31m:1", "tcp://[::1:1"],
)  # fmt: skip
def test_an_address_that_is_none_is_one_line(batch: str, address: str, command: Command):
    pytest.importorskip("distributed", reason="the extra `batch` (Dask) is not installed")
    assert "tcp://HOST:8786" in command("batch", "b.toml", "--out", "new", "--scheduler", address).refusal
