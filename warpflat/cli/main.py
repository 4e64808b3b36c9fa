"""The command line: thin. Options become a scene, a scene is run, a table is printed."""

from __future__ import annotations

import io
import json
import math
import os
import re
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TextIO

import click

from warpflat._version import __version__
from warpflat.cli.signals import INTERRUPTED, Stopped, raised_by_signals, words_of
from warpflat.core.errors import InputError
from warpflat.core.memory_limit import (
    is_out_of_memory,
    memory_limit,
    require_memory_for_libraries,
    require_memory_for_usd,
)
from warpflat.core.text import one_line, plain_letters

if TYPE_CHECKING:
    from warpflat.scene.load import Scene
    from warpflat.scene.write import SceneResult

__all__ = ["cli", "main"]

DONE, NOT_CONVERGED, BAD_INPUT = 0, 1, 2

_EXIT_CODES = """\b
Exit codes:
  0    done
  1    done, but a piece did not converge or has flipped faces, in whatever size, or a pattern could not be drawn
  2    bad input; one line says what is wrong, where, and what would be right
  129  the terminal was closed
  130  interrupted
  143  terminated"""

_FILES = """\b
What comes out, in DIR:
  metrics.json  errors, energies [J], flips and stages of every piece
  NAME.obj      the surface [m] with the pattern [m] as texture coordinates
  frames.usdc   surface and pattern from the development to the end, coloured by energy
  picture.png   both side by side, with a scale in J/m2
  NAME.dxf      the pattern for apparel CAD: cut and sewing lines, notches, grain
  NAME.svg      the same for screen and plotter, in millimetres
  pattern.pdf   the same in true size, tiled on A4
  pattern.json  everything of the pattern; warpflat export makes the others from it"""

_COMPARED = """\b
What comes out, in DIR:
  compare.json  measures of every piece in each fabric, and how far the outlines lie apart [m]
  compare.png   the outlines laid upon each other
  compare.svg   the same in true size"""


class _Interrupted(Exception):
    """With the exit code."""


class _Group(click.Group):
    def invoke(self, ctx: click.Context) -> Any:
        try:
            with raised_by_signals():
                return super().invoke(ctx)
        except KeyboardInterrupt as error:
            # Click would print an empty line of its own.
            raise _Interrupted(error.code if isinstance(error, Stopped) else INTERRUPTED) from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code; a user's mistake is one line on stderr, never a traceback."""
    _open_stderr()
    try:
        code = cli.main(args=arguments, prog_name="warpflat", standalone_mode=False)
        return code if isinstance(code, int) else DONE
    except InputError as error:
        return _fail(str(error))
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        hint = f"; see {context.command_path} --help" if context is not None else ""
        return _fail(error.format_message().rstrip(".") + hint)
    except _Interrupted as stopped:
        return _stopped(stopped.args[0])
    except (KeyboardInterrupt, click.Abort):
        return _stopped(INTERRUPTED)
    except BrokenPipeError:
        # The reader of a pipe, such as head, has what it wanted.
        sys.stderr.close()
        return DONE
    except (MemoryError, RuntimeError, ImportError, OSError) as error:
        if is_out_of_memory(error):
            return _fail(f"not enough memory: {_end_of_memory(error)}; use a coarser mesh, or give it more memory")
        if not isinstance(error, OSError):
            raise
        reason = (error.strerror or str(error)).lower()
        if error.filename is None and _was_printing(error):
            _drop_output()
            return _fail(f"cannot write to standard output: {reason}")
        return _fail(f"cannot read or write {error.filename or 'a temporary file'}: {reason}")


def _open_stderr() -> None:
    """Where standard error is closed, open it on nothing: what is told there is lost, no file that is opened takes its number."""
    if not _is_open(sys.stderr):
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (open as long as the process)
        if sys.stderr.fileno() != 2:
            os.dup2(sys.stderr.fileno(), 2)


def _is_open(stream: TextIO | None) -> bool:
    """Whether it can be written to, if it is a file: what a shell has closed may be another file by now, to be read only."""
    try:
        os.write(-1 if stream is None else stream.fileno(), b"")
    except (AttributeError, io.UnsupportedOperation):
        return True
    except OSError:
        return False
    return True


def _was_printing(error: OSError) -> bool:
    """Whether an error came out of what prints results, and not of a file without a name."""
    return any(frame.f_code is click.echo.__code__ for frame, _ in traceback.walk_tb(error.__traceback__))


def _drop_output() -> None:
    """What could not be written is tried again at the end of the process, which would fail once more."""
    with suppress(OSError, ValueError), open(os.devnull, "w", encoding="utf-8") as nothing:
        os.dup2(nothing.fileno(), sys.stdout.fileno())


def _stopped(code: int) -> int:
    words = words_of(code)
    if words is not None:
        click.echo(words, err=True)
    return code


def _end_of_memory(error: BaseException) -> str:
    told = [str(error) or "no more is to be had", memory_limit()]
    return ", ".join(filter(None, told))


def _fail(message: str) -> int:
    click.echo(f"warpflat: {one_line(message)}", err=True)
    return BAD_INPUT


class _Command(click.Command):
    def invoke(self, ctx: click.Context) -> Any:
        if self.name != "fabrics":  # it prints a table, and needs hardly a library
            require_memory_for_libraries()
        return super().invoke(ctx)


_Group.command_class = _Command


@click.group(
    cls=_Group,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog=_EXIT_CODES,
)
@click.version_option(__version__, prog_name="warpflat")
@click.pass_context
def cli(context: click.Context) -> None:
    """Flat sewing patterns from 3D garment surfaces.

    A surface is developed into the plane from a datum line, and the strain energy of its cloth is released by
    approximate implicit integration.

    \b
    Examples:
      warpflat run scenes/dome.toml                       a scene file, into out/dome
      warpflat flatten front.obj --units cm --fabric denim
      warpflat mannequin --size "EU 38"                   a dress form, into out/mannequin
      warpflat cuts scenes/bodice.toml                    which cut would release how much energy
      warpflat fabrics                                    what cloths there are
      warpflat fabrics denim                              where its values come from
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def _output_options(
    *, folder: str = "out/NAME", printed: str = "metrics.json"
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options of commands that leave files in a folder, by default in this one, and print one of them on demand."""
    options = [
        click.option(
            "--out",
            type=click.Path(path_type=Path),
            metavar="DIR",
            help=f"Folder for the files.  [default: {folder}]",
        ),
        click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes and warnings."),
        click.option("--json", "as_json", is_flag=True, help=f"Print {printed} on standard output, nothing else."),
        click.option("--device", metavar="NAME", help="Warp device, such as cpu or cuda:0.  [default: Warp's choice]"),
    ]

    def with_options(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return with_options


@cli.command(epilog=f"{_FILES}\n\n{_EXIT_CODES}")
@click.argument("scene", type=click.Path(path_type=Path))
@_output_options()
def run(scene: Path, out: Path | None, quiet: bool, as_json: bool, device: str | None) -> int:
    """Run a scene file.

    A scene is a TOML file that names a surface, its feature lines, a fabric and settings; see the folder scenes.

    \b
    Examples:
      warpflat run scenes/dome.toml
      warpflat run scenes/bodice.toml --out bodice --json
    """
    from warpflat.scene.load import load_scene

    return _run(load_scene(scene), out, quiet=quiet, as_json=as_json, device=device)


@cli.command(epilog=f"{_FILES}\n\n{_EXIT_CODES}")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option("--units", metavar="UNIT", help="Unit of the file: m, cm, mm, in ... Needed unless the file says (USD).")
@click.option("--component", metavar="WHICH", help="Which connected part: largest, or 0, 1, ... by size.")
@click.option("--prim", metavar="PATH", help="Which mesh of a USD file.")
@click.option("--name", metavar="NAME", help="Name of the piece and its files.  [default: the file's]")
@click.option("--fabric", metavar="NAME", help="A fabric of the library; warpflat fabrics lists them.")
@click.option("--fabric-file", "fabric_files", multiple=True, metavar="FILE", help="A fabric file of your own.")
@click.option(
    "--datum",
    metavar="LINE",
    help="The line laid straight first: two vertices A,B, counted from 0 (the shortest path between them), a side "
    "of the piece (bottom, left, right, top), or a line of the file (a USD curve).  [default: a long line through the "
    "middle]",
)
@click.option("--grain-angle", type=float, metavar="DEGREES", help="Turns the warp from the datum; 45 is the bias.")
@click.option("--model", metavar="NAME", help="springs, or membrane: the cloth measured as worn.  [default: springs]")
@click.option("--stretch-warp", type=float, metavar="SHARE", help="Worn so much longer than flat along the warp: 0.1.")
@click.option("--stretch-weft", type=float, metavar="SHARE", help="The same along the weft.")
@click.option("--pressure", type=float, metavar="PA", help="On the skin; sets the stretch that runs around the body.")
@click.option(
    "--solver",
    type=click.Choice(["multilevel", "plain"]),
    help="Plain: the paper's steps alone.  [default: multilevel]",
)
@click.option("--max-steps", type=int, metavar="N", help="Give up after the work of so many steps.")
@click.option("--time-step", type=float, metavar="SECONDS", help="Of the approximate implicit integration.")
@click.option("--frames", type=int, metavar="N", help="About how many frames, 0 for none.  [default: 60]")
@click.option("--no-picture", is_flag=True, help="Write no picture.png.")
@_output_options()
def flatten(
    mesh: Path, out: Path | None, quiet: bool, as_json: bool, device: str | None, datum: str | None, **options: Any
) -> int:
    """Flatten one mesh: OBJ, PLY, STL, OFF, GLB, glTF or USD.

    \b
    Examples:
      warpflat flatten front.obj --units cm
      warpflat flatten scan.ply --units mm --component largest --fabric jersey
      warpflat flatten dress.usdc --prim /World/front --datum /World/centre_front
      warpflat flatten front.obj --units m --datum 120,2087 --out front
    """
    from warpflat.scene.load import make_scene

    tables: dict[str, Any] = {"surface": {"file": str(mesh)}, "relax": {}, "output": {}}
    places = {
        "units": ("surface", "units"),
        "component": ("surface", "component"),
        "prim": ("surface", "prim"),
        "solver": ("relax", "solver"),
        "max_steps": ("relax", "max_steps"),
        "time_step": ("relax", "time_step"),
        "frames": ("output", "frames"),
        "stretch_warp": ("wear", "stretch_warp"),
        "stretch_weft": ("wear", "stretch_weft"),
        "pressure": ("wear", "pressure"),
    }
    for option, (table, key) in places.items():
        if options[option] is not None:
            tables.setdefault(table, {})[key] = options[option]
    if options["component"] is not None and re.fullmatch(r"-?[0-9]{1,18}", options["component"]):
        tables["surface"]["component"] = int(options["component"])
    for key in ("name", "fabric", "grain_angle", "model"):
        if options[key] is not None:
            tables[key] = options[key]
    tables["fabric_files"] = list(options["fabric_files"])
    tables["output"]["picture"] = not options["no_picture"]
    if datum is not None and re.fullmatch(r"[0-9]{1,18}(,[0-9]{1,18})+", datum):
        vertices = [int(vertex) for vertex in datum.split(",")]
        ends = {"from": vertices[0], "to": vertices[1]}
        tables["datum"] = "datum"
        tables["lines"] = {"datum": ends if len(vertices) == 2 else {"vertices": vertices}}
    elif datum is not None:
        # A USD curve becomes a line of its name.
        tables["datum"] = datum.rstrip("/").rpartition("/")[2]
    scene = make_scene(tables, name=_safe_name(mesh), folder=Path(), where="command line")
    try:
        return _run(scene, out, quiet=quiet, as_json=as_json, device=device)
    except InputError as error:
        raise InputError(str(error).replace('component = "largest"', "--component largest")) from None


@cli.command()
@click.option("--size", metavar="SIZE", help='Of a size table: "EU 38", "UK 10", "US 8", "JIS 9AR", "men 50".')
@click.option("--measure", "measures", multiple=True, metavar="NAME=METRES", help="A measurement, such as bust=0.88.")
@click.option(
    "--table", type=click.Choice(["women", "men"]), help="Completes the measurements.  [default: the size's, or women]"
)
@click.option("--scan", metavar="FILE", help="The mesh of a standing body: OBJ, PLY, STL, OFF, GLB.")
@click.option("--units", metavar="UNIT", help="Of the scan: m, cm, mm ...  [default: told from its height]")
@click.option("--facing", metavar="AXIS", help="Where the scan looks, such as +z.  [default: told from its shape]")
@click.option("--up", metavar="AXIS", help="Where the scan's head is, such as +y.  [default: told from its shape]")
@click.option("--landmark", "landmarks", multiple=True, metavar="NAME=METRES", help="A height known better.")
@click.option("--mirror", is_flag=True, help="Average the scan's left and right.")
@click.option(
    "--resolution", type=click.FloatRange(2, 40), metavar="MM", help="Wished edge of the quads.  [default: 10]"
)
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="[default: out/mannequin]")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
@click.option("--json", "as_json", is_flag=True, help="Print metrics.json on standard output, nothing else.")
def mannequin(
    size: str | None,
    measures: tuple[str, ...],
    landmarks: tuple[str, ...],
    resolution: float | None,
    out: Path | None,
    quiet: bool,
    as_json: bool,
    **source: Any,
) -> int:
    """Build a dress form of feature lines and bricks, and write USD, OBJ, measures and a labelled picture.

    \b
    Examples:
      warpflat mannequin --size "EU 38"
      warpflat mannequin --measure bust=0.90 --measure waist=0.74 --measure hip=0.99
      warpflat mannequin --size "EU 38" --measure waist=0.76
      warpflat mannequin --scan body.obj --units m --out body
    """
    from warpflat.cli.tables import mannequin_table
    from warpflat.core.atomic_files import output_folder
    from warpflat.core.toml_file import check_table
    from warpflat.mannequin.output import MANNEQUIN_FILES, write_mannequin
    from warpflat.mannequin.table import MannequinTable, mannequin_from_table

    require_memory_for_usd()  # mannequin.usdc is always written
    tables: dict[str, Any] = {key: value for key, value in source.items() if value not in (None, False)}
    _check_body(tables, size=size, measures=measures, landmarks=landmarks)
    if size is not None:
        tables["size"] = size
    if measures:
        tables["measurements"] = _lengths(measures, "--measure")
    if landmarks:
        tables["landmarks"] = _lengths(landmarks, "--landmark")
    if resolution is not None:
        tables["resolution_mm"] = resolution
    table = check_table(MannequinTable, tables, "command line")
    with output_folder(out if out is not None else Path("out") / "mannequin", MANNEQUIN_FILES.values()) as folder:
        body = mannequin_from_table(table, path_of=Path)
        files = write_mannequin(body, folder)
    if as_json:
        click.echo(files["metrics"].read_text(encoding="utf-8"), nl=False)
    elif not quiet:
        for note in body.notes:
            click.echo(f"warpflat: note: {note}", err=True)
        click.echo(mannequin_table(body.source, body.levels()))
        click.echo(f"{folder}: {', '.join(file.name for file in files.values())}")
    return DONE


def _check_body(
    options: Mapping[str, Any], *, size: str | None, measures: Sequence[str], landmarks: Sequence[str]
) -> None:
    """See that the body is given in one way, and that no option is of another one."""
    scan = options.get("scan")
    if (scan is None) == (size is None and not measures):
        raise InputError(
            "command line: give the body in one way: --size or --measure, or both, which replaces some of the size's; or --scan"
        )
    of_scan = [f"--{key}" for key in options if key not in ("scan", "table")] + ["--landmark"] * bool(landmarks)
    if scan is None and of_scan:
        raise InputError(f"command line: {of_scan[0]} is about a --scan; leave it out")
    if scan is not None and "table" in options:
        raise InputError("command line: --table completes measurements; a scan has its own: leave it out")


def _lengths(texts: Sequence[str], option: str) -> dict[str, float]:
    """Every NAME=METRES, each name once."""
    found: dict[str, float] = {}
    for text in texts:
        name, value = _metres(text, option)
        if name in found:
            raise InputError(
                f"command line: {option} {name} is given twice, {found[name]:g} and {value:g}; give it once"
            )
        found[name] = value
    return found


def _metres(text: str, option: str) -> tuple[str, float]:
    """NAME=METRES as a pair."""
    name, equals, value = text.partition("=")
    try:
        metres = float(value)
    except ValueError:
        metres = math.nan
    if not math.isfinite(metres):
        shown = f"{name.strip()}=0.88" if equals else "bust=0.88"
        raise InputError(f"command line: {option} {text!r} is not NAME=METRES, such as {shown}")
    return name.strip(), metres


@cli.command(epilog=f"{_COMPARED}\n\n{_EXIT_CODES}")
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--fabric", "fabrics", multiple=True, metavar="NAME", help="One of those to compare; the first is the base."
)
@_output_options(folder="out/NAME-compared", printed="compare.json")
def compare(
    scene: Path, fabrics: tuple[str, ...], out: Path | None, quiet: bool, as_json: bool, device: str | None
) -> int:
    """Run a scene in several fabrics and lay the outlines upon each other: table, compare.png, compare.svg, compare.json.

    Cuts, seams and constraints are the scene's in each of them; cuts found automatically are found once and all made.

    \b
    Examples:
      warpflat compare scenes/bodice.toml --fabric denim --fabric jersey --fabric power-net
    """
    from warpflat.cli.tables import ProgressBar, warnings_of
    from warpflat.core.atomic_files import output_folder
    from warpflat.scene.compare import COMPARED_FILES, compare_fabrics, comparison_table, save_comparison
    from warpflat.scene.load import load_scene

    job = load_scene(scene)
    _start_warp()
    target = out if out is not None else Path("out") / f"{job.name}-compared"
    with (
        ProgressBar(job.name, hidden=quiet or as_json) as bar,
        output_folder(target, COMPARED_FILES, sources=job.sources) as folder,
    ):
        comparison = compare_fabrics(job, fabrics, on_progress=lambda _, progress: bar(progress), device=device)
        files = save_comparison(comparison, folder)
    warnings = [
        f"{fabric}: {line}"
        for fabric, pieces in comparison.results.items()
        for line in warnings_of(
            {"pieces": {name: piece.measures for name, piece in pieces.items()}, **comparison.sewing[fabric]}
        )
    ]
    for warning in warnings:
        click.echo(f"warpflat: {warning}", err=True)
    if as_json:
        click.echo((folder / "compare.json").read_text(encoding="utf-8"), nl=False)
    elif not quiet:
        click.echo(comparison_table(comparison))
        click.echo(f"{folder}: {', '.join(files)}")
    return NOT_CONVERGED if warnings else DONE


@cli.command()
@click.argument("name", required=False)
@click.option("--file", "files", multiple=True, type=click.Path(path_type=Path), help="A fabric file of your own.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def fabrics(name: str | None, files: tuple[Path, ...], as_json: bool) -> None:
    """List the fabrics, or one in detail with the source of each value.

    \b
    Examples:
      warpflat fabrics
      warpflat fabrics denim
      warpflat fabrics --file my_fabrics.toml --json
    """
    from warpflat.cli.tables import fabric_data, fabric_sheet, fabric_table
    from warpflat.fabric.library import find_fabric, load_library

    library = load_library(files)
    shown = list(library.values()) if name is None else [find_fabric(name, library)]
    if as_json:
        click.echo(json.dumps({fabric.name: fabric_data(fabric) for fabric in shown}, indent=2))
    elif name is None:
        click.echo(fabric_table(shown))
    else:
        click.echo(fabric_sheet(shown[0]))


@cli.command(epilog=_EXIT_CODES)
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("--apply", "apply", type=int, metavar="N", help="Make the cut of that number and run the scene with it.")
@click.option(
    "--by",
    type=click.Choice(["per_cm", "released"]),
    default="per_cm",
    show_default=True,
    help="What the order goes by: energy released per centimetre cut, or in all.",
)
@_output_options(printed="ledger.json, with --apply metrics.json,")
def cuts(
    scene: Path,
    out: Path | None,
    quiet: bool,
    as_json: bool,
    device: str | None,
    apply: int | None,
    by: Literal["per_cm", "released"],
) -> int:
    """Compare cuts: where the energy is, and what each candidate would release.

    Candidates are the feature lines through or near the peaks of the energy, whole or from the border to the peak, and
    paths that follow the energy. Each is tried with a coarse relaxation, without the scene's seams and constraints;
    --apply relaxes fully, with them. Writes ledger.json and ledger.png, with --apply all that a run leaves, too.

    \b
    Examples:
      warpflat cuts scenes/bodice.toml
      warpflat cuts scenes/bodice.toml --apply 1 --out cut
    """
    from warpflat.cli.tables import ProgressBar, ledger_table
    from warpflat.core.atomic_files import output_folder
    from warpflat.core.json_file import write_json
    from warpflat.cutting.ledger_picture import write_ledger_picture
    from warpflat.scene.cuts import story_of_entry
    from warpflat.scene.load import load_scene
    from warpflat.scene.run import files_of_run, run_scene, scene_ledger

    loaded = load_scene(scene)
    _start_warp()
    target = out if out is not None else Path("out") / loaded.name
    files = ["ledger.json", "ledger.png", *(files_of_run(loaded) if apply is not None else [])]
    result = None
    with (
        ProgressBar(loaded.name, hidden=quiet or as_json) as bar,
        output_folder(target, files, sources=loaded.sources) as folder,
    ):
        ledger = scene_ledger(loaded, by=by, device=device)
        write_json(folder / "ledger.json", ledger.as_dict())
        write_ledger_picture(folder / "ledger.png", ledger)
        if apply is not None:
            story = story_of_entry(ledger, apply)
            result = run_scene(loaded, folder, on_progress=bar, device=device, cuts=story)
    if as_json and result is None:
        click.echo((folder / "ledger.json").read_text(encoding="utf-8"), nl=False)
    elif not (quiet or as_json):
        for note in ledger.notes:
            click.echo(f"warpflat: note: {note}", err=True)
        click.echo(f"{ledger_table(ledger)}\n{folder}: ledger.json, ledger.png")
    return DONE if result is None else _tell_of_run(result, folder, quiet=quiet, as_json=as_json)


@cli.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--format", "formats", type=click.Choice(["dxf", "svg", "pdf", "json"]), multiple=True, required=True, help="Which."
)
@click.option("--dialect", type=click.Choice(["aama", "astm"]), default="aama", show_default=True, help="Of the DXF.")
@click.option("--paper", type=click.Choice(["A4", "Letter", "A0"]), default="A4", show_default=True, help="Of the PDF.")
@click.option("--size", "sizes", multiple=True, metavar="SIZE", help="Only this size of a graded pattern; not of json.")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
def export(
    folder: Path, formats: tuple[str, ...], dialect: str, paper: str, sizes: tuple[str, ...], quiet: bool
) -> int:
    """Write a run's pattern files again, from its pattern.json: another dialect, another paper, one size.

    \b
    Examples:
      warpflat export out/dress --format dxf --dialect astm
      warpflat export out/dress --format pdf --paper Letter --size "EU 38"
    """
    from warpflat.garment.pattern_files import export_patterns

    if folder.name == "pattern.json" and folder.is_file():
        folder = folder.parent
    files = export_patterns(folder, formats, dialect=dialect, paper=paper, sizes=sizes or None)
    if not quiet:
        click.echo(f"{folder}: {', '.join(files)}")
    return DONE


def _start_warp() -> None:
    """Start Warp without its greeting: standard output is for results, and a mistake is one line on standard error.

    That a machine has no CUDA driver is printed by Warp's native part straight to the file descriptor, whatever the log
    level; anything else that it says there is passed on.
    """
    import warp

    from warpflat.core.compile import start_warp
    from warpflat.core.native_output import native_errors

    warp.config.log_level = warp.LOG_ERROR
    with native_errors() as lines:
        start_warp()
    for line in lines:
        if "Could not find or load the NVIDIA CUDA driver" not in line:
            click.echo(line, err=True)


def _run(scene: Scene, out: Path | None, *, quiet: bool, as_json: bool, device: str | None) -> int:
    from warpflat.cli.tables import ProgressBar
    from warpflat.scene.run import run_scene

    _start_warp()
    folder = out if out is not None else Path("out") / scene.name
    with ProgressBar(scene.name, hidden=quiet or as_json) as bar:
        result = run_scene(scene, folder, on_progress=bar, device=device)
    return _tell_of_run(result, folder, quiet=quiet, as_json=as_json)


def _tell_of_run(result: SceneResult, folder: Path, *, quiet: bool, as_json: bool) -> int:
    """Print what a run has come to, and return the exit code."""
    from warpflat.cli.tables import run_summary, warnings_of
    from warpflat.flattening.fit_report import fit_lines

    warnings = warnings_of(result.metrics)
    if not (quiet or as_json):
        for note in result.notes:
            if note not in warnings:
                click.echo(f"warpflat: note: {note}", err=True)
    for warning in warnings:
        click.echo(f"warpflat: {warning}", err=True)
    if as_json:
        click.echo((folder / "metrics.json").read_text(encoding="utf-8"), nl=False)
    elif not quiet:
        click.echo(run_summary(result.metrics, result.files, str(folder)))
        for line in fit_lines(result.metrics):
            click.echo(line)
    return NOT_CONVERGED if warnings else DONE


def _safe_name(mesh: Path) -> str:
    """The file's name as a name for a piece and its files: "Ärmel (1).obj" gives "Armel_1"."""
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", plain_letters(mesh.stem)).strip("_.-")
    return name or "piece"
