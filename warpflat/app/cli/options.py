"""Parts that commands share: exit codes, options, and the check for memory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.environment import require_environment
from warpflat.core import require_memory_for_libraries

__all__ = [
    "BAD_INPUT",
    "DONE",
    "EXIT_CODES",
    "NOT_CONVERGED",
    "RUN_FILES",
    "ComputingCommand",
    "fabric_file_option",
    "output_options",
    "shear_limit_option",
]


DONE, NOT_CONVERGED, BAD_INPUT = 0, 1, 2

EXIT_CODES = """\b
Exit codes:
  0    done
  1    done, but a piece did not converge, has flipped faces or lies over itself, in whatever size, the
       sides of a drawn seam differ, or a step that the pattern needs had to be left out
  2    bad input; one line says what is wrong, where, and what would be right
  70   an internal error, which is the program's own fault; WARPFLAT_TRACEBACK=1 prints its traceback
  129  the terminal was closed
  130  interrupted
  143  terminated"""

RUN_FILES = """\b
What comes out, in DIR:
  metrics.json  errors, energies [J], flips and stages of every piece
  NAME.obj      the surface [m] with the pattern [m] as texture coordinates
  frames.usdc   surface and pattern from the development to the end, coloured by energy
  picture.png   both side by side, with a scale in J/m2
  review.html   all of it on one page, with the film; needs no network
  NAME.dxf      the pattern for apparel CAD: cut and sewing lines, notches, grain
  NAME.svg      the same for screen and plotter, in millimetres
  pattern.pdf   the same in true size, tiled on A4
  pattern.json  everything of the pattern; warpflat export makes the others from it"""


_VERBOSE = click.option(
    "--verbose", "-v", is_flag=True, help="Print the tables of pieces and seams, every note, and all advice on the fit."
)


def _check_shear_limit(_: click.Context, __: click.Parameter, value: float | None) -> float | None:
    from warpflat.flat import check_value

    if value is not None:
        check_value("shear_limit", value, "--shear-limit")
    return value


shear_limit_option = click.option(
    "--shear-limit",
    type=float,
    metavar="DEGREES",
    callback=_check_shear_limit,
    help="How far warp and weft may be off the right angle; tailors trust 5 to 8.  [default: the fabric's]",
)
"""The option `--shear-limit` of commands that take a fabric."""


fabric_file_option = click.option(
    "--fabric-file",
    "fabric_files",
    multiple=True,
    metavar="FILE",
    help="A fabric file of your own; its only fabric needs no --fabric.",
)
"""The option `--fabric-file` of commands that flatten a mesh."""


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


def output_options(
    *, folder: str = "out/NAME", printed: str = "metrics.json", verbose: bool = True
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add the options of a command that writes files into a folder and prints one of them on demand.

    Args:
        folder: the default one, for the help.
        printed: which file --json prints, for the help.
        verbose: whether there is more to print.
    """
    options = [
        click.option(
            "--out",
            "-o",
            type=click.Path(path_type=Path),
            metavar="DIR",
            help=f"Folder for the files.  [default: {folder}]",
        ),
        click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes and warnings."),
        *([_VERBOSE] if verbose else []),
        click.option("--json", "as_json", is_flag=True, help=f"Print {printed} on standard output, nothing else."),
        click.option("--device", metavar="NAME", help="Warp device, such as cpu or cuda:0.  [default: Warp's choice]"),
    ]

    def with_options(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return with_options
