"""The program: its commands, its errors and its exit codes."""

from __future__ import annotations

import errno
import io
import os
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, TextIO

import click

from warpflat._version import __version__
from warpflat.app.cli.batch import batch
from warpflat.app.cli.compare import compare
from warpflat.app.cli.cuts import cuts
from warpflat.app.cli.drape import drape
from warpflat.app.cli.example import example
from warpflat.app.cli.export import export
from warpflat.app.cli.fabrics import fabrics
from warpflat.app.cli.fit import fit
from warpflat.app.cli.flatten import flatten
from warpflat.app.cli.internal_error import report_internal_error
from warpflat.app.cli.mannequin import mannequin
from warpflat.app.cli.marker import marker
from warpflat.app.cli.new import new
from warpflat.app.cli.options import BAD_INPUT, DONE, EXIT_CODES, FAULTY
from warpflat.app.cli.review import review
from warpflat.app.cli.run import run
from warpflat.app.cli.signals import INTERRUPTED, Stopped, signal_message, stop_on_signals
from warpflat.app.cli.studio import studio
from warpflat.core import InputError, is_out_of_memory, memory_limit, one_line, system_reason
from warpflat.pattern import LeftOut, listening_to_left_out, source_date, written_folders

__all__ = ["cli", "main"]


class _Interrupted(Exception):
    """A signal has ended the command; the argument is the exit code."""


class _Group(click.Group):
    def invoke(self, ctx: click.Context) -> Any:
        left_out = list[LeftOut]()
        try:
            with stop_on_signals(), listening_to_left_out(left_out.append):
                code = super().invoke(ctx)
        except KeyboardInterrupt as error:
            # Click would print an empty line of its own.
            raise _Interrupted(error.code if isinstance(error, Stopped) else INTERRUPTED) from None
        for step in dict.fromkeys(left_out):
            where = "" if step.folder is None else f"{step.folder}: "
            head = "" if step.is_needed else f"note: {where}"
            click.echo(one_line(f"warpflat: {head}{step.note}"), err=True)
        return code or (FAULTY if any(step.is_needed for step in left_out) else DONE)


@click.group(
    cls=_Group,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog=EXIT_CODES,
)
@click.version_option(__version__, prog_name="warpflat")
@click.pass_context
def cli(context: click.Context) -> None:
    """Flat sewing patterns from 3D garment surfaces.

    A surface is developed into the plane from a datum line, and the strain energy of its cloth is released by
    approximate implicit integration.

    \b
    Examples:
      warpflat example                                    the scenes that come with it; example dome writes dome.toml
      warpflat run dome.toml                              a scene file, into out/dome
      warpflat new shirt --size "EU 38" --collar stand    a scene of a garment, for a size
      warpflat flatten front.obj --units cm --fabric denim
      warpflat fit shirt.obj --units m --to "EU 44"       a garment for another body
      warpflat mannequin --size "EU 38"                   a dress form, into out/mannequin
      warpflat drape scenes/basic_block.toml              sewn and worn again: where does it fit?
      warpflat cuts scenes/bodice.toml                    which cut would release how much energy
      warpflat batch scenes/batch_sizes.toml              many bodies and fabrics
      warpflat export bought.dxf --format pdf             the pattern of another program on paper
      warpflat marker bought.dxf --width 140              its pieces on cloth
      warpflat review out/dome                            one page to review a run
      warpflat studio scenes/bodice.toml                  a page in the browser to edit a scene
      warpflat fabrics                                    what cloths there are
      warpflat fabrics denim                              where its values come from
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for _command in (
    run,
    new,
    example,
    flatten,
    fit,
    batch,
    drape,
    mannequin,
    compare,
    fabrics,
    cuts,
    export,
    marker,
    review,
    studio,
):
    cli.add_command(_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code; a user's mistake is one line on stderr, never a traceback."""
    # A standard stream that is closed opens on the null device, so that no file takes its number.
    for number, name in ((1, "stdout"), (2, "stderr")):
        if not _is_open(getattr(sys, name)):
            stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (open as long as the process)
            setattr(sys, name, stream)
            if stream.fileno() != number:
                os.dup2(stream.fileno(), number)
    written = len(written_folders())
    try:
        source_date()
        code = cli.main(args=arguments, prog_name="warpflat", standalone_mode=False)
        return code if isinstance(code, int) else DONE
    except InputError as error:
        return _fail(str(error))
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        hint = f"; see {context.command_path} --help" if context is not None else ""
        return _fail(error.format_message().rstrip(".") + hint)
    except _Interrupted as stopped:
        return _report_signal(stopped.args[0])
    except (KeyboardInterrupt, click.Abort):
        return _report_signal(INTERRUPTED)
    except BrokenPipeError:
        # The reader of a pipe, such as head, has what it wanted.
        sys.stderr.close()
        return DONE
    except Exception as error:
        if isinstance(error, MemoryError | RuntimeError | ImportError | OSError) and is_out_of_memory(error):
            reasons = ", ".join(filter(None, [str(error) or "no more is to be had", memory_limit()]))
            return _fail(f"not enough memory: {reasons}; use a coarser mesh, or give it more memory")
        if not isinstance(error, OSError):
            return report_internal_error(error, sys.argv[1:] if arguments is None else arguments)
        reason = system_reason(error)
        printing = any(frame.f_code is click.echo.__code__ for frame, _ in traceback.walk_tb(error.__traceback__))
        if error.filename is None and printing:
            # To the null device: at the end of the process what is left of standard output would fail once more.
            with suppress(OSError, ValueError), open(os.devnull, "w", encoding="utf-8") as nothing:
                os.dup2(nothing.fileno(), sys.stdout.fileno())
            message = f"cannot write to standard output: {reason}"
            if len(written_folders()) > written:
                click.echo(f"warpflat: {message}; the files are written", err=True)
                return FAULTY
            return _fail(message)
        return _fail(f"cannot read or write {error.filename or 'a temporary file'}: {reason}")


def _is_open(stream: TextIO | None) -> bool:
    """Return whether a stream can be written; a descriptor that a shell has closed may belong to a file that is read by now."""
    try:
        os.write(-1 if stream is None else stream.fileno(), b"")
    except (AttributeError, io.UnsupportedOperation):
        return True
    except OSError as error:
        return error.errno != errno.EBADF  # what is full is open
    return True


def _report_signal(code: int) -> int:
    message = signal_message(code)
    if message is not None:
        click.echo(message, err=True)
    return code


def _fail(message: str) -> int:
    click.echo(f"warpflat: {one_line(message)}", err=True)
    return BAD_INPUT
