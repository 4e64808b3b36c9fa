"""`warpflat example`: the scenes that come with the package are listed, and one is written into the current folder."""

from __future__ import annotations

import re
import shutil
import sys
import textwrap
from pathlib import Path

import click

from warpflat.app.cli.options import DONE

__all__ = ["example", "example_files"]

# Installed scenes lie in the package, those of a checkout beside it.
_FOLDERS = tuple(place / "scenes" for place in (Path(__file__).parents[2], Path(__file__).parents[3]))


@click.command()
@click.argument("name", required=False)
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Folder.  [default: the current one]")
def example(name: str | None, out: Path | None) -> int:
    """List the scenes that come with warpflat, or write one into the current folder, to be run and changed there.

    What is there already stays as it is.

    \b
    Examples:
      warpflat example
      warpflat example zip_dress
      warpflat run zip_dress.toml
    """
    from warpflat.core import InputError, nearest
    from warpflat.pattern import atomic_path

    found = example_files()
    if name is None:
        width = max(map(len, found))
        # A pipe takes whole lines.
        room = shutil.get_terminal_size().columns - width - 2 if sys.stdout.isatty() else 1000
        for each, path in found.items():
            # The first sentence of its first comment.
            text = path.read_text(encoding="utf-8").removeprefix('"""')
            comment = re.split(r'\n#?\n|"""', text, maxsplit=1)[0]
            words = " ".join(line.lstrip("# ").strip() for line in comment.splitlines())
            sentence = re.split(r"(?<=\.) ", words, maxsplit=1)[0].rstrip(".")
            click.echo(f"{each.ljust(width)}  {textwrap.shorten(sentence, room, placeholder=' ...')}")
        click.echo("\nwarpflat example NAME writes one into the current folder.")
        return DONE
    key = name.removesuffix(".toml").removesuffix(".py")
    if key not in found:
        raise InputError(f"{name}: no example has this name; {nearest(key, found)}")
    source = found[key]
    text = source.read_text(encoding="utf-8")
    # A batch names other scenes, which go along.
    others = [found[Path(each).stem] for each in re.findall(r'"(\w+\.toml)"', text) if Path(each).stem in found]
    folder = out if out is not None else Path()
    written = []
    for path in (source, *others):
        target = folder / path.name
        if target.exists() or target.is_symlink():
            if path is source:
                raise InputError(f"{target}: is there already; move it away, or choose another folder with --out")
            continue
        with atomic_path(target) as hidden:
            # Comments name the scene where it lies in a checkout.
            moved = re.sub(r"(?m)^(#.*?|python )scenes/", r"\1", path.read_text(encoding="utf-8"))
            hidden.write_text(moved, encoding="utf-8")
        written.append(str(target))
    click.echo(f"written: {', '.join(written)}")
    in_checkout = f"scenes/{source.name}"
    command = re.search(rf"(?m)((?:warpflat \w+|python) {re.escape(in_checkout)}(?: \S+)*)", text)
    next_one = f"warpflat run {in_checkout}" if command is None else command[1]
    click.echo(f"next: {next_one.replace(in_checkout, str(folder / source.name))}")
    if "WARPFLAT_DATA" in text:
        click.echo(
            "Its first lines say which mesh it needs in the folder that the environment variable WARPFLAT_DATA names."
        )
    return DONE


def example_files() -> dict[str, Path]:
    """Return scenes, batches and scripts that come with the package, by their names."""
    folder = next((each for each in _FOLDERS if (each / "dome.toml").is_file()), None)
    paths = [] if folder is None else sorted(folder.iterdir())
    return {path.stem: path for path in paths if path.suffix in (".toml", ".py") and path.stem != "__init__"}
