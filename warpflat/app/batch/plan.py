"""Batch files: the scenes, bodies, fabrics and overrides of a batch, and the tasks that they make."""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from warpflat._version import __version__
from warpflat.app.scene.as_toml import laid_over
from warpflat.app.scene.load import Scene, errors_named, expand_variables, make_scene
from warpflat.app.scene.plain_names import with_plain_letters
from warpflat.app.scene.schema import PATH_KEYS
from warpflat.core import InputError, Table, check_table, file_digest, quote_value, read_toml
from warpflat.garment import MannequinTable

__all__ = ["BatchTable", "BodyTable", "Task", "TaskTable", "load_batch"]

# Hexadecimal digits of a key: in a million tasks two share one with a chance of 3e-8.
_KEY_DIGITS = 16
_KEY_LETTERS = 60
_LONGEST_LABEL = 80
# Tasks of a batch: each is held in memory, and has a row in the index.
_MOST_TASKS = 100_000

Names = Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]


class BodyTable(MannequinTable):
    """A body: a `[mannequin]` table; `name` is how the index calls it."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = None

    @property
    def label(self) -> str:
        """The name of the body in the index."""
        return self.name or super().label

    def as_mannequin(self) -> dict[str, Any]:
        """Return the `[mannequin]` table of a scene."""
        return self.model_dump(exclude_unset=True, exclude={"name"})


class TaskTable(Table):
    """One task: a scene file or the name of a form, and what changes in it."""

    scene: str | None = None
    form: str | None = None
    body: BodyTable | None = None
    fabric: str | None = None
    override: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_source(self) -> TaskTable:
        if (self.scene is None) == (self.form is None):
            raise ValueError('a task needs either scene = "FILE" or form = "NAME"')
        return self


class BatchTable(Table):
    """A batch file: the product of scenes or forms, bodies, fabrics and overrides; or a list of tasks.

    Paths start in the batch file's folder, those in a scene file in that file's folder. An override is merged into the scene: tables key
    by key, everything else is replaced.
    """

    scenes: Names | None = None
    forms: Names | None = None
    bodies: Annotated[list[BodyTable], Field(min_length=1)] | None = None
    fabrics: Names | None = None
    overrides: Annotated[list[dict[str, Any]], Field(min_length=1)] | None = None
    tasks: Annotated[list[TaskTable], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> BatchTable:
        if sum(given is not None for given in (self.scenes, self.forms, self.tasks)) != 1:
            raise ValueError('give the batch in one way: scenes = ["FILE"], forms = ["NAME"], or [[tasks]]')
        product = [key for key in ("bodies", "fabrics", "overrides") if getattr(self, key) is not None]
        if self.tasks is not None and product:
            raise ValueError(f"{product[0]} belongs to scenes or forms; in [[tasks]] each has its own")
        return self

    @property
    def count(self) -> int:
        """The number of tasks, before any is made."""
        lists = (self.tasks or self.scenes or self.forms, self.bodies, self.fabrics, self.overrides)
        return math.prod(len(each) for each in lists if each is not None)

    def all_tasks(self) -> Iterator[TaskTable]:
        """Yield the listed tasks, or those of the product."""
        if self.tasks is not None:
            yield from self.tasks
            return
        source = "scene" if self.scenes is not None else "form"
        names = self.scenes or self.forms or []
        bodies: Sequence[BodyTable | None] = self.bodies or [None]
        fabrics: Sequence[str | None] = self.fabrics or [None]
        for name, body, fabric, override in itertools.product(names, bodies, fabrics, self.overrides or [{}]):
            yield TaskTable.model_validate({source: name, "body": body, "fabric": fabric, "override": override})


@dataclass(frozen=True, kw_only=True)
class Task:
    """One run of a batch.

    Attributes:
        key: scene, body, fabric and a hash, the name of its folder.
        name: of the scene, and of its files.
        scene, body, fabric, override: what the index says of it; a body or an override may be empty.
        data: the scene's tables; paths are absolute.
        where: what messages begin with.
    """

    key: str
    name: str
    scene: str
    body: str
    fabric: str
    override: str
    data: Mapping[str, Any]
    where: str

    def make_scene(self) -> Scene:
        """Return the checked scene."""
        return make_scene(self.data, name=self.name, folder=Path(), where=self.where)


def load_batch(path: str | Path) -> list[Task]:
    """Load the tasks of a batch file; of several with the same key only the first.

    Raises:
        InputError: the file, or a scene file, is unreadable or no TOML, has an unknown key or a wrong value, or names a file that
            cannot be read.
    """
    path = Path(path)
    data = read_toml(path)
    if not data:
        raise InputError(
            f'{path}: is empty; a batch needs scenes = ["FILE"] or forms = ["NAME"], and [[bodies]] or fabrics'
        )
    table = check_table(BatchTable, data, str(path))
    if table.count > _MOST_TASKS:
        raise InputError(f"{path}: has {table.count:,} tasks; a batch has at most {_MOST_TASKS:,}: make several of it")
    read = functools.lru_cache(maxsize=None)(lambda file: _with_absolute_paths(read_toml(file), file.parent))
    digest = functools.lru_cache(maxsize=None)(
        lambda file: file_digest(file, "named", missing="cannot be read: no such file")
    )
    tasks: dict[str, Task] = {}
    differ = table.overrides is None or len(table.overrides) > 1  # one for all tells none apart
    folder = path.parent.absolute()
    for entry in table.all_tasks():
        override = _label(entry.override) if differ else ""
        source = entry.scene if entry.scene is not None else str(entry.form)
        parts = [source, "" if entry.body is None else entry.body.label, entry.fabric or "", override]
        where = f"{path}: {', '.join(filter(None, parts))}"
        with errors_named(where):
            if entry.scene is not None:
                file = folder / expand_variables(entry.scene)
                data, name = read(file), file.stem
            else:
                data, name = {"form": entry.form}, source
            if entry.body is not None:
                kept = {"resolution_mm"} & _table(data, "mannequin").keys()
                body = {key: _table(data, "mannequin")[key] for key in kept} | entry.body.as_mannequin()
                if body.get("scan"):
                    body["scan"] = _path(body["scan"], folder)
                data = data | {"mannequin": body}
            if entry.fabric is not None:
                data = data | {"fabric": entry.fabric}
            data = laid_over(data, _with_absolute_paths(entry.override, folder), joins=False)
            scene = make_scene(data, name=name, folder=folder, where=where)
            settings = scene.settings
            # The key is a hash of the version, the resolved scene, and the contents of the files that it names. Digests stand
            # for paths: a file that is moved leaves the key as it is, a file that changes does not.
            named = _map_paths(settings.model_dump(mode="json"), lambda file: digest(Path(file)))
        text = json.dumps([__version__, scene.name, named], sort_keys=True)
        body_table = entry.body or settings.mannequin
        label = "" if body_table is None else body_table.label
        fabric = settings.fabric if isinstance(settings.fabric, str) else "own"
        # Who looks into the folder finds a task by its words; the digits tell apart what they leave out.
        words = "-".join(filter(None, (scene.name, label, fabric)))
        plain = with_plain_letters(words)[:_KEY_LETTERS].strip("_.-")
        key = f"{plain}-{hashlib.sha256(text.encode()).hexdigest()[:_KEY_DIGITS]}"
        task = Task(
            key=key,
            name=name,
            scene=scene.name,
            body=label,
            fabric=fabric,
            override=override,
            data=data,
            where=where,
        )
        tasks.setdefault(key, task)
    return list(tasks.values())


def _with_absolute_paths(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    return _map_paths(data, lambda file: _path(file, folder))


def _map_paths(data: Mapping[str, Any], change: Callable[[str], str]) -> dict[str, Any]:
    """Return a scene's tables with all paths of files changed; what is no text is left to the check of the scene."""

    def changed(value: Any, keys: Sequence[str]) -> Any:
        if isinstance(value, list):
            return [changed(each, keys) for each in value]
        if isinstance(value, Mapping) and keys and keys[0] in value:
            return {**value, keys[0]: changed(value[keys[0]], keys[1:])}
        return change(value) if isinstance(value, str) and value and not keys else value

    return functools.reduce(changed, PATH_KEYS, dict(data))


def _path(file: str, folder: Path) -> str:
    return str((folder / expand_variables(file)).absolute())


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = data.get(key)
    return found if isinstance(found, Mapping) else {}


def _label(override: Mapping[str, Any]) -> str:
    def entries(table: Mapping[str, Any], before: str) -> Iterator[str]:
        for key, value in table.items():
            if isinstance(value, Mapping):
                yield from entries(value, f"{before}{key}.")
            else:
                yield f"{before}{key}={value if isinstance(value, str) else quote_value(value)}"

    label = ", ".join(entries(override, ""))
    return label if len(label) <= _LONGEST_LABEL else f"{label[: _LONGEST_LABEL - 3]}..."
