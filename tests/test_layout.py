"""The layers of the package and their rooms: imports between them run one way, and none runs in a circle.

Every import counts: at the top of a module, inside a function, and for types alone. What a layer's door names counts as an import of the
module behind it.
"""

from __future__ import annotations

import ast
import functools
import os
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import warpflat

PACKAGE = Path(warpflat.__file__).parent
ROOT = PACKAGE.parent
KERNELS = ROOT / "kernels" if (ROOT / "kernels").is_dir() else PACKAGE / "kernels"

#: The layers, from the paper up, and their rooms. `core` and `kernels` lie beneath.
LAYERS = {
    "flat": "surface fabric model solver flattening cutting",
    "pattern": "files drafting export",
    "garment": "mannequin construction draping seams",
    "app": "scene cli studio batch review",
}

#: Each room, and the rooms from which it may import. Kernels of the warpflat.kernels package import each other alone.
ROOMS = {
    "core": "kernels",
    "surface": "core kernels",
    "fabric": "core",
    "model": "core surface fabric kernels",
    "solver": "core surface fabric model kernels",
    "files": "core",
    "drafting": "core surface files",
    "export": "core surface fabric model flattening cutting files drafting kernels",
    "flattening": "core surface fabric model solver kernels",
    "cutting": "core surface model solver flattening",
    "mannequin": "core surface files drafting export kernels",
    "construction": "core surface fabric model solver files drafting export flattening cutting mannequin kernels",
    "draping": "core surface fabric model solver files drafting export flattening mannequin construction kernels",
    "seams": "core surface fabric model solver files drafting flattening cutting construction",
    "review": "core surface files export",
    "scene": "core surface fabric model solver files drafting export flattening cutting mannequin construction draping seams review",
    "batch": "core surface fabric model solver files drafting export flattening cutting mannequin construction draping seams review scene",
    "studio": "core surface fabric model solver files drafting export flattening cutting mannequin construction draping seams review scene",
    "cli": " ".join([*LAYERS.values(), "core"]),
    "kernels": "",
}


def _modules() -> dict[str, Path]:
    found = {}
    for folder, name in ((PACKAGE, "warpflat"), (KERNELS, "warpflat.kernels")):
        for path in folder.rglob("*.py"):
            parts = path.relative_to(folder).with_suffix("").parts
            found[".".join((name, *(part for part in parts if part != "__init__")))] = path
    return found


MODULES = _modules()


def _named(stub: Path) -> dict[str, str]:
    """The names of a door, each with the module behind it, as `__init__.pyi` has them."""
    found = {}
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            found |= {alias.name: str(node.module) for alias in node.names}
    return found


#: The door of each layer, and of `core`: the module behind each name.
DOORS = {
    layer: {name: f"warpflat.{layer}.{module}" for name, module in _named(PACKAGE / layer / "__init__.pyi").items()}
    for layer in ("core", *LAYERS)
}


@functools.cache
def _nodes(path: Path) -> list[ast.AST]:
    """All nodes of a file; the first is its module."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@functools.cache
def _imports(module: str) -> set[str]:
    """The modules of the package that a module imports, wherever in its text."""
    found = set()
    for node in _nodes(MODULES[module]):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            # Kernels import each other relatively, as they stand in a folder of their own.
            source = "warpflat.kernels" + (f".{node.module}" if node.module else "") if node.level else str(node.module)
            door = DOORS.get(source.removeprefix("warpflat."), {})
            for alias in node.names:
                below = f"{source}.{alias.name}"
                found.add(door.get(alias.name) or (below if below in MODULES else source))
    return {name for name in found if name.split(".")[0] == "warpflat"}


def _room(module: str) -> str:
    """The room of a module; of the door of a layer the layer."""
    parts = [part for part in module.split(".")[1:3] if part]
    return "" if not parts else parts[-1] if parts[0] in LAYERS else parts[0]


def test_every_module_lies_in_a_room() -> None:
    loose = {module for module in MODULES if len(module.split(".")) == 2 and MODULES[module].stem != "__init__"}
    assert loose == {"warpflat.__main__", "warpflat._version"}
    assert {_room(module) for module in MODULES} == {*ROOMS, *LAYERS, "", "__main__", "_version"}
    rooms = {layer: {path.parent.name for path in (PACKAGE / layer).glob("*/__init__.py")} for layer in LAYERS}
    assert rooms == {layer: set(names.split()) for layer, names in LAYERS.items()}
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} - {"kernels"} == {"core", *LAYERS}


def test_a_layer_imports_from_layers_below_it() -> None:
    order = {room: number for number, rooms in enumerate(LAYERS.values()) for room in rooms.split()}
    wrong = {
        f"{module} imports {name}"
        for module in MODULES
        for name in _imports(module)
        if order.get(_room(name), -1) > order.get(_room(module), len(LAYERS))
    }
    assert wrong == set()


@pytest.mark.parametrize("room", list(ROOMS))
def test_a_room_imports_from_rooms_below_it(room: str) -> None:
    allowed = {room, "_version", *ROOMS[room].split()}
    wrong = {
        f"{module} imports {name}"
        for module in MODULES
        if _room(module) == room
        for name in _imports(module)
        if _room(name) not in allowed
    }
    assert wrong == set()


def test_a_layer_is_entered_by_its_door() -> None:
    """What is above a layer imports names from its `__init__`, which has no others; the paper may enter `core` anywhere."""
    used = {layer: set[str]() for layer in DOORS}
    past = set()
    for module, path in MODULES.items():
        mine = module.split(".")[1] if "." in module else ""
        for node in _nodes(path):
            source = str(node.module).split(".") if isinstance(node, ast.ImportFrom) and not node.level else []
            if source[:1] != ["warpflat"] or len(source) < 2 or source[1] not in DOORS:
                continue
            layer = source[1]
            if mine in ("", "core", layer, "__main__") or (mine, layer) == ("flat", "core"):
                continue
            if len(source) > 2:
                past.add(f"{module} imports from {'.'.join(source)}")
            assert isinstance(node, ast.ImportFrom)
            used[layer] |= {alias.name for alias in node.names}
    assert past == set()
    for name, layer in _named(PACKAGE / "__init__.pyi").items():
        if layer in used:
            used[layer].add(name)
    assert {layer: set(door) for layer, door in DOORS.items()} == used
    for layer, door in DOORS.items():
        assert {name for name, module in door.items() if name not in _defined(MODULES[module])} == set(), layer


def test_no_import_runs_in_a_circle() -> None:
    inner = {
        module: {name for name in _imports(module) if name in MODULES} for module in MODULES if module != "warpflat"
    }
    try:
        TopologicalSorter(inner).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_rooms_hold_no_second_path_to_a_name() -> None:
    """The `__init__` of a room is its description; names are at the doors of layers alone."""
    doors = {PACKAGE, *(PACKAGE / layer for layer in DOORS)}
    rooms = [path for path in PACKAGE.rglob("__init__.py") if path.parent not in (*doors, KERNELS)]
    filled = [str(path) for path in rooms if len(_body(path)) != 1]
    assert filled == []
    assert {path.parent for path in PACKAGE.rglob("*.pyi")} == doors
    again = {
        f"{module}: {name}"
        for module, path in MODULES.items()
        if module != "warpflat"
        for name in _exported(path) - _defined(path)
    }
    assert again == set()


def test_no_module_imports_a_private_name_of_another() -> None:
    private = {
        f"{module} imports {node.module}.{alias.name}"
        for module, path in MODULES.items()
        for node in _nodes(path)
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("warpflat")
        for alias in node.names
        if alias.name.startswith("_") and not alias.name.startswith("__") and alias.name != "_version"
    }
    assert private == set()


def test_contributing_draws_the_house_as_it_is() -> None:
    text = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)) == set(ROOMS) - {"kernels"}
    way = text[text.index("### A scene's way") : text.index("## Habits")]
    folder, gone = "", []
    for named, file in re.findall(r"((?:\w+/)*)(\w+\.py|\w+\.toml)", way):
        folder = named or folder
        path = PACKAGE.parent / "scenes" / file if file.endswith(".toml") else PACKAGE / folder / file
        gone += [] if path.is_file() else [str(path)]
    assert gone == []
    assert way.count(".py") > 20


def test_tests_lie_in_the_room_of_what_they_test() -> None:
    here = Path(__file__).parent
    folders = {str(path.parent.relative_to(here)) for path in here.rglob("test_*.py") if path.parent != here}
    assert folders <= {
        "core",
        "kernels",
        "fuzz",
        *(f"{layer}/{room}" for layer in LAYERS for room in LAYERS[layer].split()),
    }
    assert {path.name for path in here.glob("test_*.py")} == {Path(__file__).name}


def test_a_checkout_holds_one_package() -> None:
    """A second copy of the package below itself would have classes of its own."""
    with pytest.raises(ModuleNotFoundError):
        __import__("warpflat.warpflat")
    with pytest.raises(ModuleNotFoundError):
        __import__("warpflat.tests")


def test_the_package_shows_what_users_need() -> None:
    assert dir(warpflat) == sorted(warpflat.__all__)
    for name in warpflat.__all__:
        assert getattr(warpflat, name).__doc__, name
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = warpflat.no_such_name  # type: ignore[attr-defined]


def test_importing_the_package_loads_none_of_its_rooms() -> None:
    code = "import sys, warpflat; print(*(m for m in sys.modules if m.startswith('warpflat.')))"
    found = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=found)
    assert set(done.stdout.split()) <= {"warpflat._version", "warpflat.kernels"}


def _body(path: Path) -> list[ast.stmt]:
    module = _nodes(path)[0]
    assert isinstance(module, ast.Module)
    return module.body


def _exported(path: Path) -> set[str]:
    for node in _body(path):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__":
            return set(ast.literal_eval(node.value))
    return set()


def _defined(path: Path) -> set[str]:
    found = set()
    for node in _nodes(path):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return found
