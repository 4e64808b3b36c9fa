"""The promise of the command line, and what runs one case and says whether it held.

Bad input gets exit code 2 and one line on standard error that starts with "warpflat: "; nothing is written, nothing is lost.
Anything else ends with 0 or 1 and whole files. No input crashes, hangs, or takes all memory.
"""

from __future__ import annotations

import json
import os
import re
import resource
import select
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unicodedata
import xml.etree.ElementTree
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType

from .snapshot import snapshot

__all__ = ["CLOTH", "Case", "Environment", "Verdict", "Worker", "broken_promise", "words"]

MEMORY = 2 * 1024**3
"""The most that one case may take [B]."""
LONGEST_LINE = 2000
"""Letters of a message. A path may have 4,096, but no case has one."""
CASES_PER_PROCESS = 500
CLOTH = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.2\nv 2 1 0.2\nf 1 2 3 4\nf 2 5 6 3\n"
"""The least that can be flattened: two quads, as OBJ."""
_INTERNAL = r": (\w*(?:Error|Exception|Interrupt|Warning|StopIteration))\b"
"""A note that names an error of Python: a fault of the program."""


@dataclass(frozen=True)
class Environment:
    """What surrounds a case that needs a process of its own."""

    variables: Mapping[str, str | None] = field(default_factory=dict)
    """None where one is not set."""
    limits: Mapping[int, int] = field(default_factory=dict)
    """By `resource.RLIMIT_...`."""
    stop: tuple[int, float] | None = None
    """A signal and the seconds after which it is sent."""


@dataclass(frozen=True)
class Case:
    """Files in a folder, and the command line that is run there."""

    kind: str
    files: Mapping[str, bytes]
    arguments: tuple[str, ...]
    subject: str = ""
    """The file that is odd; "" where the command line is."""
    leaves: str | None = None
    """The file that a run leaves and that names the others."""
    replaces: str = ""
    """The one of the files that the command is asked to write anew; "*" for all in `out`."""
    keeps: str = ""
    """The one of the files in `out` that stays nevertheless."""
    links: Mapping[str, str] = field(default_factory=dict)
    """Symbolic links beside the files, each with its target."""
    says: str = ""
    """What must be printed."""
    names: tuple[str, ...] = ()
    """What must be printed, too: the pieces that were drawn."""
    refused: bool | None = None
    """Whether it must be refused, or must not; None where either is right."""
    seconds: float = 20.0
    """A case that takes more of the processor fails."""
    environment: Environment | None = None
    name: str = ""

    @property
    def patience(self) -> float:
        """Seconds of the clock after which a case hangs, on a machine however busy."""
        return 5.0 * self.seconds + 5.0


@dataclass(frozen=True)
class Verdict:
    """How a case ended."""

    code: int | None
    seconds: float
    memory: int
    stdout: str
    stderr: str
    broken: str = ""
    """What was not as promised; "" where all was."""

    @property
    def cause(self) -> str:
        """What cases that fail for the same reason have in common."""
        raised = [line for line in self.stderr.splitlines() if re.match(r"\w[\w.]*(Error|Exception|Interrupt)\b", line)]
        places = re.findall(r'File "[^"]*/(warpflat/[^"]+)", line (\d+),? in (\w+)', self.stderr)
        cause = self.broken
        if raised:
            cause += f": {raised[-1].partition(':')[0]}"
        if places:
            first_is_innermost = "most recent call first" in self.stderr
            file, line, function = places[0 if first_is_innermost else -1]
            cause += f" at {file}:{line} {function}"
        elif extra := [line for line in self.stderr.splitlines() if not line.startswith("warpflat: ")]:
            cause += f": {extra[0][:100]}"
        return re.sub(r"-?\b(0x[0-9a-f]+|\d{5,})", "#", re.sub(r"/tmp/\S+", "PATH", cause))


def words(command: str) -> tuple[str, ...]:
    """The words of a command line, as a shell has them."""
    return tuple(shlex.split(command))


def _broken_message(case: Case, stdout: str, stderr: str) -> str:
    lines = stderr.splitlines()
    if len(lines) != 1 or not stderr.endswith("\n"):
        return f"{min(len(lines), 2)}{'+' * (len(lines) > 1)} lines on standard error instead of one"
    if not lines[0].startswith("warpflat: "):
        return "the line does not start with warpflat:"
    if len(lines[0]) > LONGEST_LINE:
        return f"the line is longer than {LONGEST_LINE} letters"
    if any(unicodedata.category(letter) == "Cc" for letter in lines[0]):
        return "control characters on standard error"
    if stdout:
        return "refused, but something is on standard output"
    if case.subject and not any(Path(file).name in lines[0] for file in case.files) and "memory" not in lines[0]:
        return "the line names no file"
    return ""


def _broken_files(case: Case, here: str, before: Mapping[str, bytes | None], after: Mapping[str, bytes | None]) -> str:
    """What is wrong with the files of a run that ended well."""
    for path, content in after.items():
        name = Path(path).name
        if content is None or before.get(path) == content:
            continue
        try:
            if path.endswith(".json"):
                json.loads(content, parse_constant=lambda word: float(f"no number: {word}"))
            elif path.endswith(".svg"):
                xml.etree.ElementTree.fromstring(content)
        except ValueError:
            return f"{name} is no JSON"
        except xml.etree.ElementTree.ParseError:
            return "an SVG is no XML"
        if name.startswith("."):
            return "a hidden file is left"
    if case.leaves is None:
        return ""
    told = after.get(os.path.join(here, case.leaves))
    if told is None:
        return f"done, but without {Path(case.leaves).name}"
    folder = os.path.dirname(os.path.join(here, case.leaves))
    named = json.loads(told).get("files", {})
    names = [name for value in named.values() for name in (value if isinstance(value, dict) else [value])]
    missing = [name for name in names if os.path.join(folder, name) not in after]
    return f"metrics.json names {missing[0]}, which is not there" if missing else ""


def _replaced(case: Case, here: str, path: str) -> bool:
    """Whether a file is one that the command is asked to write anew."""
    if case.keeps and path == os.path.join(here, case.keeps):
        return False
    return path.startswith(f"{here}/out/") if case.replaces == "*" else path == os.path.join(here, case.replaces)


def broken_promise(
    case: Case, here: str, ended: Verdict, before: dict[str, bytes | None], after: dict[str, bytes | None]
) -> str:
    """What was not as promised, or ""."""
    stop = case.environment.stop[0] if case.environment is not None and case.environment.stop is not None else None
    stopped = () if stop is None else (128 + stop,)
    if stop is not None and ended.code == -stop:
        if after == before and not ended.stderr:
            return ""  # ended before Python ran
        # Python ends by the signal itself where code from a string was interrupted; a shell calls that the same.
        ended = replace(ended, code=128 + stop)
    if ended.code is None or ended.code < 0:
        return "hangs" if ended.code is None else f"crash: {signal.Signals(-ended.code).name}"
    if ended.code not in (0, 1, 2, *stopped):
        return f"exit code {ended.code}"
    if "Traceback (most recent call last)" in ended.stderr:
        return "traceback"
    if ended.seconds > case.seconds:
        return f"takes more than {case.seconds:g} s"
    if ended.memory > MEMORY:
        return f"takes more than {MEMORY / 1e9:.1f} GB"
    if ended.code in (0, 1) and any(
        after.get(path) != content for path, content in before.items() if not _replaced(case, here, path)
    ):
        return "an input file is changed"
    if ended.code in (2, *stopped):
        if after != before:
            return "refused, but the folder is changed"
        if message := _broken_message(case, ended.stdout, ended.stderr):
            return message
    elif not all(line.startswith("warpflat: ") for line in ended.stderr.splitlines()):
        return "done, but a line on standard error is not ours"
    elif note := re.search(_INTERNAL, ended.stderr):
        return f"done, but something was left out by an internal error: {note[1]}"
    elif files := _broken_files(case, here, before, after):
        return files
    for words in (case.says, *case.names):
        if words not in ended.stdout + ended.stderr:
            return f"does not say {words}"
    if case.refused is not None and case.refused != (ended.code == 2) and not stopped:
        return "accepted" if case.refused else "refused"
    return ""


class _Place:
    """A folder with the files of a case; the command line is run in its subfolder `here`."""

    def __init__(self, root: Path, case: Case) -> None:
        self.root, self.here = root / "case", root / "case" / "here"
        self.stdout, self.stderr = root / "stdout", root / "stderr"
        shutil.rmtree(os.fsencode(self.root), ignore_errors=True)
        self.here.mkdir(parents=True)
        for file in (self.stdout, self.stderr):
            file.write_bytes(b"")
        for name, content in case.files.items():
            (self.here / name).parent.mkdir(parents=True, exist_ok=True)
            (self.here / name).write_bytes(content)
        for name, target in case.links.items():
            (self.here / name).parent.mkdir(parents=True, exist_ok=True)
            (self.here / name).symlink_to(target)
        self.case, self.before = case, snapshot(self.root)

    def judge(self, code: int | None, seconds: float, memory: int) -> Verdict:
        stdout, stderr = (file.read_text(encoding="utf-8", errors="replace") for file in (self.stdout, self.stderr))
        ended = Verdict(code, seconds, memory, stdout, stderr)
        broken = broken_promise(self.case, self.here.name, ended, self.before, snapshot(self.root))
        return Verdict(code, seconds, memory, stdout, stderr, broken)


class Worker:
    """A process that runs cases, and is replaced when it has died, hung, or run many."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="warpflat-fuzz-")
        self._process: subprocess.Popen[str] | None = None
        self._cases = 0

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        self._folder.cleanup()

    def run(self, case: Case) -> Verdict:
        """Run one case, in a process of its own where it needs one, and judge how it ended."""
        if case.environment is not None:
            return _run_apart(_Place(Path(self._folder.name), case))
        if self._cases >= CASES_PER_PROCESS:
            self._end()
        process = self._process or self._start()
        self._cases += 1
        place = _Place(Path(self._folder.name), case)
        request = {
            "folder": str(place.here),
            "arguments": list(case.arguments),
            "stdout": str(place.stdout),
            "stderr": str(place.stderr),
            "patience": case.patience,
        }
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(request) + "\n")
        process.stdin.flush()
        if not select.select([process.stdout], [], [], case.patience)[0]:
            self._end()
            return place.judge(None, case.patience, 0)
        answer = process.stdout.readline()
        if not answer:
            code = process.wait()
            self._end()
            return place.judge(code, 0.0, 0)
        return place.judge(**json.loads(answer))

    def _start(self) -> subprocess.Popen[str]:
        self._cases = 0
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "WARPFLAT_THREADS": "1", "WARPFLAT_TRACEBACK": "1"},
        )
        warm = Case("obj", {"cloth.obj": CLOTH}, words("flatten cloth.obj --units m --out out"), seconds=300)
        self.run(warm)  # compiles and loads the kernels, which no case shall pay for
        assert self._process is not None
        return self._process

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
        self._process = None


def _run_apart(place: _Place) -> Verdict:
    """Run the case of a place in a process of its own, in its environment."""
    case = place.case
    environment = case.environment or Environment()

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (int(case.seconds), int(case.seconds)))
        for name, value in environment.limits.items():
            resource.setrlimit(name, (value, value))

    variables = {**os.environ, **environment.variables}
    with open(place.stdout, "wb") as stdout, open(place.stderr, "wb") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "warpflat", *case.arguments],
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            cwd=place.here,
            env={name: value for name, value in variables.items() if value is not None},
            preexec_fn=limit,
        )
        try:
            if environment.stop is not None:
                number, seconds = environment.stop
                time.sleep(seconds)
                process.send_signal(number)
            code: int | None = process.wait(case.patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            code = None
    return place.judge(code, 0.0, 0)
