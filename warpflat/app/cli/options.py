"""Parts that commands share: exit codes, options, and the check for memory."""

from __future__ import annotations

import functools
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.environment import require_environment
from warpflat.app.scene.options import SCENE_OPTIONS
from warpflat.core import require_memory_for_libraries

__all__ = [
    "BAD_INPUT",
    "DONE",
    "EXIT_CODES",
    "FAULTY",
    "RUN_FILES",
    "ComputingCommand",
    "Output",
    "files_line",
    "measure_option",
    "out_option",
    "output_options",
    "scene_option",
    "scene_options",
    "tell",
    "tell_files",
]


DONE, FAULTY, BAD_INPUT = 0, 1, 2

EXIT_CODES = """\b
Exit codes:
  0    done
  1    done, but it is no pattern yet: a piece did not converge, has flipped faces or lies over itself, in whatever size, the
       sides of a drawn seam differ, a step that the pattern needs was left out, too much of a garment whose seams were found
       is beyond the cloth's limit, or a drape is not at rest or stretches cloth by over 50 %
  2    bad input; one line says what is wrong, where, and what would be right
  70   an internal error, which is the program's own fault; WARPFLAT_TRACEBACK=1 prints its traceback
  129  the terminal was closed
  130  interrupted
  143  terminated"""

RUN_FILES = """\b
What comes out, in DIR:
  metrics.json    errors, energies [J], flips and stages of every piece
  NAME.obj        the surface [m] with the pattern [m] as texture coordinates
  frames.usdc     surface and pattern from the development to the end, coloured by energy
  mannequin.usdc  of a garment on a body: that body, to which frames.usdc refers
  picture.png     surface and pattern side by side, with a scale in J/m2
  walked.png      of a garment on a body: both sides of every seam laid along each other
  wear.png        where the scene has [wear], or the cloth is smaller than the body: strain when worn; of a mesh NAME.wear.png
  review.html     all of it on one page, with the film; needs no network
  NAME.dxf        the pattern for apparel CAD: cut and sewing lines, notches, grain; of several sizes with NAME.rul
  NAME.svg        the same for screen and plotter, in millimetres
  pattern.pdf     the same in true size, tiled on A4
  pattern.json    everything of the pattern; warpflat export makes the others from it
  NAME.marker.svg, NAME.marker.json
                  where the scene has [marker]: the pieces on cloth; NAME.CLOTH.marker.* of every further cloth"""


Command = Callable[..., Any]


def _check_shear_limit(_: click.Context, __: click.Parameter, value: float | None) -> float | None:
    from warpflat.flat import check_value

    if value is not None:
        check_value("shear_limit", value, "--shear-limit")
    return value


def measure_option() -> Callable[[Command], Command]:
    """Return the option of measurements of the body."""
    words = "A measurement in metres, such as bust=0.88; what can only be centimetres or millimetres is read as such."
    return click.option("--measure", "measures", multiple=True, metavar="NAME=LENGTH", help=words)


def out_option(words: str) -> Callable[[Command], Command]:
    """Return the option of the folder into which a command writes; `words` tell its default."""
    return click.option("--out", "-o", type=click.Path(path_type=Path), metavar="DIR", help=words)


def scene_option(key: str, *, help: str = "") -> Callable[[Command], Command]:
    """Add the option of a command that sets a key of a scene; `help` replaces what it says of itself."""
    option = SCENE_OPTIONS[key]
    if option.kind is bool:
        return click.option(option.name, flag_value=False, default=None, help=help or option.help)
    return click.option(
        option.name,
        type=option.kind if isinstance(option.kind, type) else click.Choice(option.kind),
        metavar=option.declaration.partition(" ")[2] or None,
        multiple=option.multiple,
        callback=_check_shear_limit if key == "shear_limit" else None,
        help=help or option.help,
    )


def scene_options(first: str, last: str) -> Callable[[Command], Command]:
    """Add the options of a command that set the keys of a scene from one to another, in the order of `SCENE_OPTIONS`."""
    keys = list(SCENE_OPTIONS)
    between = keys[keys.index(first) : keys.index(last) + 1]
    return lambda command: functools.reduce(lambda made, key: scene_option(key)(made), reversed(between), command)


class ComputingCommand(click.Command):
    """A command that loads the numerical libraries, if they can run here."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command.

        Raises:
            InputError: the memory limit leaves no room for the libraries, or what surrounds the process would make them crash.
        """
        require_environment()
        require_memory_for_libraries()
        return super().invoke(ctx)


@dataclass(frozen=True, kw_only=True)
class Output:
    """Where a command writes, and how much it prints.

    Attributes:
        out: the folder that was asked for.
        quiet, verbose, as_json: print less, more, or a file instead.
        device: Warp device.
    """

    out: Path | None
    quiet: bool
    verbose: bool
    as_json: bool
    device: str | None

    @property
    def tells(self) -> bool:
        """Whether a command says in words what it does."""
        return not (self.quiet or self.as_json)

    def folder(self, name: str) -> Path:
        """Return the folder that was asked for, or one of this name in `out`."""
        return self.out if self.out is not None else Path("out") / name

    def tell_notes(self, notes: Iterable[str]) -> None:
        """Print notes on standard error, unless the command is to be silent."""
        for note in notes if self.tells else ():
            tell(f"note: {note}")

    def report(self, file: Path, words: Callable[[], Iterable[str]]) -> None:
        """Print a JSON file that was written, or what came out in lines of words, as was asked for."""
        if self.as_json:
            click.echo(file.read_text(encoding="utf-8"), nl=False)
        elif not self.quiet:
            for line in words():
                click.echo(line)


def tell(line: str) -> None:
    """Print a line about the command on standard error."""
    click.echo(f"warpflat: {line}", err=True)


def files_line(folder: Path | str, files: Iterable[str]) -> str:
    """Return a folder, as a shell takes it, and the names of files in it."""
    return f"{shlex.quote(str(folder))}: {', '.join(files)}"


def tell_files(files: Sequence[Path], notes: Iterable[str]) -> None:
    """Print the names of files that have been written into one folder, and the notes on them."""
    for note in notes:
        tell(f"note: {note}")
    click.echo(files_line(files[0].parent, (file.name for file in files)))


def output_options(
    *, folder: str = "out/NAME", printed: str = "metrics.json", verbose: bool = True
) -> Callable[[Command], Command]:
    """Add the options of a command that writes files into a folder and prints one of them on demand; it takes them as `output`.

    Args:
        folder: the default one, for the help.
        printed: which file --json prints, for the help.
        verbose: whether there is more to print.
    """
    options: list[Callable[[Command], Command]] = [
        out_option(f"Folder for the files.  [default: {folder}]"),
        click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes and warnings."),
        click.option(
            "--verbose",
            "-v",
            is_flag=True,
            help="Print the tables of pieces and seams, every note, and all advice on the fit.",
        ),
        click.option("--json", "as_json", is_flag=True, help=f"Print {printed} on standard output, nothing else."),
        scene_option("device"),
    ]
    if not verbose:
        del options[2]

    def with_options(command: Command) -> Command:
        @functools.wraps(command)
        def with_output(**given: Any) -> Any:
            names = [field.name for field in fields(Output)]
            output = Output(**{name: given.pop(name, False) for name in names})
            return command(**given, output=output)

        made: Command = with_output
        for option in reversed(options):
            made = option(made)
        return made

    return with_options
