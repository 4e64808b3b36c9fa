"""What damages a seed: bytes, words of a text, the structure of TOML and JSON, and the command line.

Everything is drawn from a `random.Random`: one with a seed by hand, one of Hypothesis in the tests, whose draws shrink.
"""

from __future__ import annotations

import copy
import json
import re
import struct
from random import Random
from typing import Any

import click

from warpflat.core.toml_file import tomllib

from .seeds import COMMANDS

__all__ = [
    "DEEP", "DIGITS", "NAMES", "WORDS", "damaged_bytes", "damaged_json", "damaged_structure", "damaged_toml", "little_work",
    "odd_arguments", "toml_text",
]  # fmt: skip

DIGITS, DEEP = "9" * 5000, "@deep@"
"""An integer longer than Python converts; and what stands for lists in lists, deeper than Python recurses."""
NUMBERS = (
    "nan", "inf", "-inf", "1e400", "-1", "0", "1e308", "1e-320", "1e30", "0.5", "1", "2", "1e9", "999999999", "2147483648", "-2147483649",
    "4294967296", "9223372036854775808", "18446744073709551616", DIGITS, "-0", "1_0", "0x10", "1.", "+1", "1e", "1,5", "½", "٣",
)  # fmt: skip
NAMES = (
    "", "a" * 3000, "a/b", "..", "../../up", ".", "con", "\x00", "\x1b[31mred", "\x07", "\u202eabc", "\u2028", "\ufeff", "\r", "\t", "\n",
    "'", '"', "#", "%s", "{0}", "${NOT_SET}", "é" * 200, "\U0001f455", "\u0301", "<b>&amp;", "]]>",
    "all", "true", "[]", "{}", "nul\x7f", "\x85",
)  # fmt: skip
WORDS = NUMBERS + NAMES
_MUCH_WORK = re.compile(rb"(resolution\W+)\d{3,7}(?!\d)")
"""What asks for so many vertices, rightly, that it takes minutes."""
_FLOATS = (float("nan"), float("inf"), -1.0, 1e38, 1e-40, 0.0, 1e9)
_INTEGERS = (0, -1, 1, 255, 2**16, 2**31 - 1, -(2**31), 10**6, 10**9)


def little_work(content: bytes) -> bytes:
    """A scene that asks for few vertices only."""
    return _MUCH_WORK.sub(rb"\g<1>5", content)


def _patch(random: Random, data: bytes) -> bytes:
    """Writes an odd number over some bytes."""
    at = random.randrange(len(data) + 1)
    form = random.choice("<>") + random.choice("fdihbq")
    if form[1] in "fd":
        number = struct.pack(form, random.choice(_FLOATS))
    else:
        size = struct.calcsize(form)
        number = (random.choice(_INTEGERS) % 256**size).to_bytes(size, "little" if form[0] == "<" else "big")
    return data[:at] + number + data[at + len(number) :]


def _flip(random: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 5, 20))):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _block(random: Random, data: bytes) -> tuple[int, int]:
    start = random.randrange(len(data) + 1)
    return start, min(len(data), start + random.choice((1, 2, 4, 12, 50, 300, 5000)))


def _delete(random: Random, data: bytes) -> bytes:
    start, end = _block(random, data)
    return data[:start] + data[end:]


def _double(random: Random, data: bytes) -> bytes:
    start, end = _block(random, data)
    at = random.choice((end, random.randrange(len(data) + 1)))
    return data[:at] + data[start:end] * random.choice((1, 1, 2, 100)) + data[at:]


def _truncate(random: Random, data: bytes) -> bytes:
    return data[: random.randrange(len(data) + 1)]


def _insert(random: Random, data: bytes) -> bytes:
    at = random.randrange(len(data) + 1)
    return (
        data[:at]
        + random.choice((b"\xff", b"\x00", b"\x80", b"\xff\xfe", b"\r", b"\n")) * random.choice((1, 1, 4, 200))
        + data[at:]
    )


def _change_word(random: Random, data: bytes) -> bytes:
    """Replaces a word or a number of a text."""
    words = [match.span() for match in re.finditer(rb"[^\s,;:=\[\](){}\"'/]+", data)][:100_000]
    if not words:
        return data
    start, end = random.choice(words)
    is_number = data[start:end].strip(b"+-")[:1].isdigit()
    word = random.choice(NUMBERS if is_number and random.randrange(4) else WORDS)
    return data[:start] + word.encode("utf-8", "surrogatepass") + data[end:]


def _change_head(random: Random, data: bytes) -> bytes:
    """Replaces a number near the beginning, where a file says how much it has of what."""
    numbers = [match.span() for match in re.finditer(rb"\d+", data[:600])]
    if not numbers:
        return _patch(random, data)
    start, end = random.choice(numbers)
    return data[:start] + random.choice(NUMBERS).encode() + data[end:]


def _change_lines(random: Random, data: bytes) -> bytes:
    """Deletes, doubles, swaps or splits lines."""
    lines = data.split(b"\n")
    a, b = random.randrange(len(lines)), random.randrange(len(lines))
    what = random.randrange(4)
    if what == 0:
        del lines[a]
    elif what == 1:
        lines.insert(b, lines[a])
    elif what == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a] = lines[a].replace(b" ", b"\n", 1)
    return b"\n".join(lines)


_OF_BYTES = (_patch, _flip, _delete, _double, _truncate, _insert, _change_head)
_OF_TEXT = (
    _change_word,
    _change_word,
    _change_word,
    _change_lines,
    _change_lines,
    _delete,
    _double,
    _truncate,
    _insert,
    _flip,
)


def _times(random: Random) -> int:
    return random.choice((1, 1, 1, 2, 4))


def damaged_bytes(random: Random, data: bytes) -> bytes:
    """A file with one or more damages; text is damaged by its words, too."""
    text = b"\x00" not in data
    for _ in range(_times(random)):
        data = random.choice(_OF_TEXT if text and random.randrange(4) else _OF_BYTES)(random, data)
    return data


def _paths(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to everything in tables and lists."""
    found = [path] if path else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        found += _paths(item, (*path, key))
    return found


def _odd_value(random: Random, old: Any) -> Any:
    kind = random.randrange(8)
    if kind == 0 and isinstance(old, (int, float)):
        return -old
    if kind <= 2:
        return random.choice(
            (float("nan"), float("inf"), -1, 0, 1e308, 1e-320, -0.5, 10**9, 2**63, "@digits@", 1e400, 2, 0.3)
        )
    if kind <= 4:
        return random.choice(NAMES)
    if kind == 5:
        return random.choice(([], {}, [[]], [{}], {"": ""}, True, False, [1, "a"], [[0.0, 0.0], [1e308, 0.0]], "1"))
    if kind == 6:
        return random.choice(([old], {"a": old}, str(old), [old, old]))
    return DEEP if random.randrange(4) == 0 else old


def damaged_structure(random: Random, value: Any) -> Any:
    """Tables and lists with one or more entries gone, renamed, of another type, copied elsewhere or nested."""
    value = copy.deepcopy(value)
    for _ in range(_times(random)):
        paths = _paths(value)
        if not paths:
            return value
        *way, last = random.choice(paths)
        holder = value
        for key in way:
            holder = holder[key]
        what = random.randrange(8)
        if what == 0:
            del holder[last]
        elif what == 1 and isinstance(holder, dict):
            holder[random.choice((*NAMES, *holder))] = holder.pop(last)
        elif what == 1:
            holder.insert(last, copy.deepcopy(holder[last]))
        elif what == 2:
            source: Any = value
            for key in random.choice(paths):
                source = source[key]
            holder[last] = copy.deepcopy(source)
        else:
            holder[last] = _odd_value(random, holder[last])
    return value


def _spelled(text: str) -> bytes:
    text = text.replace(f'"{DEEP}"', "[" * 100_000 + "]" * 100_000).replace('"@digits@"', DIGITS)
    return text.encode("utf-8", "surrogatepass")


def _toml_value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    # JSON's words for what is no number are not TOML's; its strings are, but for the escape of DEL.
    return str(value) if isinstance(value, float) else json.dumps(value).replace("\x7f", "\\u007f")


def toml_text(table: dict[str, Any]) -> str:
    """A table as TOML, a line per key."""
    return "".join(f"{json.dumps(key)} = {_toml_value(value)}\n" for key, value in table.items())


def damaged_toml(random: Random, text: str) -> bytes:
    """A file of TOML with a damage of its bytes or its tables."""
    if random.randrange(3) == 0:
        return damaged_bytes(random, text.encode())
    return _spelled(toml_text(damaged_structure(random, tomllib.loads(text))))


def damaged_json(random: Random, value: Any) -> bytes:
    """A file of JSON with a damage of its bytes or its data."""
    if random.randrange(4) == 0:
        return damaged_bytes(random, json.dumps(value).encode())
    return _spelled(json.dumps(damaged_structure(random, value)))


def _options() -> dict[str, list[tuple[str, bool]]]:
    """The options of every command, each with whether it is a flag."""
    from warpflat.app.cli.main import cli

    return {
        name: [(p.opts[-1], p.is_flag) for p in command.params if isinstance(p, click.Option)]
        for name, command in cli.commands.items()
    }


def odd_arguments(random: Random) -> list[str]:
    """A command line with odd values, missing, doubled or added options."""
    arguments = list(random.choice(COMMANDS))
    options = _options()[arguments[0]]
    # No shell passes NUL. What begins with a slash is somebody's folder.
    words = [word.replace("\x00", "") for word in WORDS] + [
        "/dev/null",
        "/dev/null/x",
        "\udcff\udcfe",
        "x" * 300,
        "cuda",
        "cpu",
        "0,1,2",
        "--",
        "-q",
    ]
    for _ in range(_times(random)):
        at = random.randrange(len(arguments))
        what = random.randrange(5)
        if what == 0:
            del arguments[at]
        elif what == 1:
            arguments.insert(at, arguments[at])
        elif what == 2:
            option, is_flag = random.choice(options)
            arguments += [option] if is_flag else [option, random.choice(words)]
        else:
            arguments[at] = random.choice(words)
        arguments = arguments or ["--help"]
    return arguments
