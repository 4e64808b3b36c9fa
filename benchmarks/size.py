"""Measure the size of a Python tree: whether things are said once, not whether lines are squeezed.

    python benchmarks/size.py [FOLDER ...]          by default warpflat, kernels and tests

For each folder: modules, lines by kind, functions that are private and named only once in their own file, import lines,
modules that one other module imports, and functions of seven arguments or more.
"""

from __future__ import annotations

import argparse
import ast
import io
import tokenize
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

_MANY_ARGUMENTS = 7
_LAYOUT = {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


@dataclass
class Size:
    """What was counted in a folder."""

    modules: int = 0
    lines: int = 0
    code: int = 0
    docstring: int = 0
    comment: int = 0
    import_lines: int = 0
    functions: int = 0
    private: int = 0
    private_once: int = 0
    many_arguments: int = 0
    importers: Counter[str] = field(default_factory=Counter)


def measure(folder: Path) -> Size:
    """Count one folder of Python files."""
    size = Size()
    for path in sorted(folder.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        docstring = {
            line
            for node in ast.walk(tree)
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
            and ast.get_docstring(node, clean=False) is not None
            for line in range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)
        }
        code: set[int] = set()
        comment: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                comment.add(token.start[0])
            elif token.type not in _LAYOUT:
                code |= set(range(token.start[0], token.end[0] + 1))
        used: Counter[str] = Counter()
        imported: set[str] = set()
        private: list[str] = []
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                size.functions += 1
                given = node.args
                names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
                count = len(names) + bool(given.vararg) + bool(given.kwarg) - (names[:1] in (["self"], ["cls"]))
                size.many_arguments += count >= _MANY_ARGUMENTS
                if node.name.startswith("_") and not node.name.startswith("__"):
                    private.append(node.name)
            elif isinstance(node, ast.ImportFrom):
                size.import_lines += (node.end_lineno or node.lineno) - node.lineno + 1
                imported.add(node.module or "")
            elif isinstance(node, ast.Import):
                size.import_lines += 1
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                used[node.id] += 1
            elif isinstance(node, ast.Attribute):
                used[node.attr] += 1
        size.modules += 1
        size.lines += len(text.splitlines())
        size.code += len(code - docstring)
        size.docstring += len(docstring)
        size.comment += len(comment - code - docstring)
        size.private += len(private)
        size.private_once += sum(used[name] <= 1 for name in private)
        size.importers.update(imported)
    return size


def main() -> None:
    """Print a column for each folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", default=["warpflat", "kernels", "tests"], metavar="FOLDER")
    folders = [Path(name) for name in parser.parse_args().folders]
    sizes = {folder.name: measure(folder) for folder in folders}

    def row(title: str, values: list[str]) -> None:
        print(f"{title:44}" + "".join(f"{value:>14}" for value in values))

    row("", list(sizes))
    for name in ("modules", "lines", "code", "docstring", "comment"):
        row(name, [f"{getattr(size, name):,}" for size in sizes.values()])
    row("import lines", [f"{each.import_lines / each.lines:.1%}" for each in sizes.values()])
    row("functions", [f"{each.functions:,}" for each in sizes.values()])
    row(
        "private functions named once in their file",
        [f"{each.private_once} ({each.private_once / max(each.functions, 1):.0%})" for each in sizes.values()],
    )
    row(f"functions of {_MANY_ARGUMENTS} arguments or more", [str(each.many_arguments) for each in sizes.values()])
    row(
        "modules that one other module imports",
        [
            str(sum(count == 1 for name, count in each.importers.items() if name.startswith(folder)))
            for folder, each in sizes.items()
        ],
    )


if __name__ == "__main__":
    main()
