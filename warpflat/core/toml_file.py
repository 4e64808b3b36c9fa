"""TOML files are read and checked against a pydantic model; a mistake becomes one line."""

from __future__ import annotations

import sys
import types
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from warpflat.core.errors import InputError, nearest
from warpflat.core.file_kinds import other_kind_words
from warpflat.core.input_files import RIGHT_NUMBER, check_values, reading
from warpflat.core.text import quote_value

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["Table", "check_table", "read_toml"]

Model = TypeVar("Model", bound=BaseModel)


class Table(BaseModel):
    """A frozen table of a file, or made in a script, without unknown keys, "1" for 1, or NaN.

    Raises:
        InputError: the first thing that is wrong, as :func:`check_table` tells it.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    if not TYPE_CHECKING:  # which reads the fields

        def __init__(self, **data: Any) -> None:
            try:
                super().__init__(**data)
            except ValidationError as error:
                raise _input_error(type(self), data, type(self).__name__, error) from None

        # A table within a table is made without it, so that the message names the outer one's key.
        __init__.__pydantic_base_init__ = True

    def given(self) -> dict[str, Any]:
        """Return what the file says, by its own keys; without what holds by default."""
        return self.model_dump(exclude_unset=True, by_alias=True)


def read_toml(path: Path) -> dict[str, Any]:
    """Read the tables of a file.

    Raises:
        InputError: no such file, a directory, unreadable, or not TOML (with the line).
    """
    with reading(path, "TOML"):
        try:
            tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors save it with a byte order mark
        except UnicodeDecodeError as error:
            other = other_kind_words(path, "a text in TOML")
            raise InputError(other or f"is not a text file (byte {error.start}); give a .toml file in UTF-8") from None
        except tomllib.TOMLDecodeError as error:
            raise InputError(other_kind_words(path, "a text in TOML") or f"is not valid TOML: {error}") from None
        except ValueError:  # Python turns no more than 4300 digits into a number
            raise InputError(f"has a number of thousands of digits; {RIGHT_NUMBER}") from None
        check_values(tables)
    return tables


def check_table(model: type[Model], data: Mapping[str, Any], where: str = "") -> Model:
    """Check data against a model and return them as one.

    Args:
        model: what it must be.
        data: as read.
        where: the file (and table), the beginning of the message.

    Raises:
        InputError: the first thing that is wrong: its key, what would be right, the nearest key for an unknown one.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _input_error(model, data, where, error) from None


def _input_error(model: type[BaseModel], data: Mapping[str, Any], where: str, error: ValidationError) -> InputError:
    """Return the first thing that is wrong with data, in one line; `where` begins it."""
    problems = error.errors(include_url=False)
    # A misspelled key is usually also a missing one: report the cause, not the consequence.
    problems.sort(key=lambda p: p["type"] != "extra_forbidden")
    problem = problems[0]
    location, kind = problem["loc"], problem["type"]
    # The keys of a location as the file has them (pydantic adds tags of unions), and the annotation they lead to.
    parent: Any = model
    value: Any = data
    parents: list[str] = []
    for step in location[:-1] if kind in ("extra_forbidden", "missing") else location:
        if isinstance(value, Mapping) and step in value:
            value = value[step]
            parents.append(str(step))
        elif isinstance(value, (list, tuple)) and isinstance(step, int) and step < len(value):
            value = value[step]
            if parents:
                parents[-1] += f"[{step}]"
        else:
            continue
        found: Any = None
        for member in _members(parent):
            if isinstance(member, type) and issubclass(member, BaseModel):
                found = _fields(member).get(str(step), found)
            elif get_origin(member) in (dict, Mapping):
                found = get_args(member)[-1]
            elif get_origin(member) in (list, tuple):
                found = get_args(member)[0]
        parent = found
    if kind == "extra_forbidden":
        key = str(location[-1])
        path = ".".join([*parents, key])
        models = [one for one in _members(parent) if isinstance(one, type) and issubclass(one, BaseModel)]
        valid = [name for each in models for name in _fields(each)]
        words = f"unknown key {quote_value(key)}; {nearest(key, valid)}"
    elif kind == "missing":
        path, words = ".".join([*parents, str(location[-1])]), "is missing"
    else:
        path, given = ".".join(parents), problem["input"]
        words = problem["msg"].removeprefix("Value error, ").removeprefix("Input ")
        if kind != "value_error" and not isinstance(given, (dict, list)):
            words += f", got {quote_value(given)}"
            if kind in ("literal_error", "enum"):
                options = [str(x) for m in _members(parent) if get_origin(m) is Literal for x in get_args(m)]
                words += f"; {nearest(str(given), options)}" if options else ""
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return InputError(f"{': '.join(filter(None, (where, path, words)))}{more}")


def _members(annotation: Any) -> Iterator[Any]:
    origin = get_origin(annotation)
    if origin is Union or origin is types.UnionType:
        for member in get_args(annotation):
            yield from _members(member)
    elif hasattr(annotation, "__metadata__"):
        yield from _members(get_args(annotation)[0])
    else:
        yield annotation


def _fields(model: type[BaseModel]) -> dict[str, Any]:
    """Annotations by the keys that a file has for them."""
    return {field.alias or name: field.annotation for name, field in model.model_fields.items()}
