"""A signal ends the program in one line at any moment, from the first import to the end of the process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="only POSIX has signals that can be handled")

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
# The process sends itself the signal when it is about to import the module.
AT_IMPORT = """
import os, sys
class Interruptor:
    def find_spec(self, name, *_):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Interruptor())
from warpflat.__main__ import program
sys.argv = ["warpflat", "flatten", "cloth.obj", "--units", "m", "--no-picture"]
sys.exit(program())
"""


def ended(code: str, folder: Path, *, within: float | None = None) -> tuple[int, str]:
    """Exit code and standard error of a process that runs this code, in so many seconds."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False, timeout=within
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("number", "module"),
    [
        *((signal.SIGINT, module) for module in ("logging", "numpy", "pydantic", "warp", "pxr")),
        (signal.SIGTERM, "warp"),
    ],
)  # fmt: skip
def test_a_signal_while_modules_are_imported_is_one_line(number: signal.Signals, module: str, tmp_path: Path):
    (tmp_path / "cloth.obj").write_text(SQUARE)
    told = "warpflat: interrupted\n" if number == signal.SIGINT else "warpflat: terminated\n"
    assert ended(AT_IMPORT.format(module=module, number=int(number)), tmp_path) == (128 + number, told)
    assert [path.name for path in tmp_path.iterdir()] == ["cloth.obj"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_process_ends_changes_nothing(number: signal.Signals, tmp_path: Path):
    code = (
        "import atexit, os, sys; from warpflat.__main__ import program\n"
        f"atexit.register(os.kill, os.getpid(), {int(number)}); sys.argv = ['warpflat', 'run', 'absent.toml']\n"
        "sys.exit(program())"
    )
    returned, told = ended(code, tmp_path)
    assert returned == 2
    assert told.startswith("warpflat: absent.toml: no such file")
    assert told.count("\n") == 1


def test_a_signal_at_the_very_end_of_the_process_changes_nothing(tmp_path: Path):
    """Python takes the handlers away before it ends; what is still to be destroyed then takes the signal."""
    code = (
        "import os, signal, sys; from warpflat.__main__ import program\n"
        "class Ends:\n    def __del__(self, kill=os.kill, me=os.getpid()):\n"
        "        [kill(me, number) for number in (signal.SIGINT, signal.SIGTERM)]\n"
        "sys.modules['sys'].ends = Ends()\nsys.argv = ['warpflat', 'fabrics', 'nylon']\nsys.exit(program())"
    )
    assert ended(code, tmp_path)[0] == 2


def test_a_signal_in_a_destructor_is_not_lost(tmp_path: Path):
    code = (
        "import os, signal, sys, time; from warpflat.app.cli.signals import Stopped, stop_on_signals\n"
        "class Ends:\n    def __del__(self): os.kill(os.getpid(), signal.SIGTERM); time.sleep(0)\n"
        "try:\n    with stop_on_signals():\n        Ends()\n        time.sleep(30)\n"
        "except Stopped as stopped: sys.exit(stopped.code)"
    )
    assert ended(code, tmp_path, within=20) == (143, "")


def test_a_signal_in_a_module_that_swallows_all_exceptions_is_not_lost(tmp_path: Path):
    (tmp_path / "swallowing.py").write_text(
        "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGTERM)\nexcept BaseException:\n    pass\n"
    )
    code = (
        "import sys, time; from warpflat.app.cli.signals import Stopped, stop_on_signals; sys.path.insert(0, '.')\n"
        "try:\n    with stop_on_signals():\n        import swallowing\n        time.sleep(30)\n"
        "except Stopped as stopped: sys.exit(stopped.code)"
    )
    assert ended(code, tmp_path, within=20) == (143, "")


def test_an_ignored_signal_stays_ignored(tmp_path: Path):
    code = AT_IMPORT.format(module="click", number=int(signal.SIGINT)).replace("flatten", "fabrics", 1)
    code = code.replace(', "cloth.obj", "--units", "m", "--no-picture"', "")
    assert ended(f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{code}", tmp_path) == (0, "")


def test_warnings_and_logs_of_libraries_are_not_told(tmp_path: Path):
    code = (
        "import logging, sys, warnings; from warpflat.__main__ import program; sys.argv = ['warpflat', '--version']\n"
        "program(); warnings.warn('overflow', RuntimeWarning); logging.getLogger('trimesh').warning('no texture')"
    )
    assert ended(code, tmp_path) == (0, "")
