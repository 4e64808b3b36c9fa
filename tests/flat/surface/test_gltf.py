"""What trimesh would leave out of a glTF, or read as something else, is written out or refused by name."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.read import read_surface

POINTS = np.array([[0, 0, 0], [0.5, 0, 0], [1, 0, 0.1], [0, 1, 0], [0.5, 1, 0], [1, 1, 0.1]])
STRIP = np.array([0, 1, 3, 4, 1, 2, 4, 5])
FACES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
KINDS = {"<f4": 5126, "<i2": 5122, "<u2": 5123, "<u1": 5121}


class Scene:
    """A file of one mesh, whose buffers are added one by one."""

    def __init__(
        self, points: np.ndarray = POINTS, kind: str = "<f4", faces: np.ndarray = FACES, **position: Any
    ) -> None:
        self.table: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "buffers": [], "bufferViews": [], "accessors": [],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        }  # fmt: skip
        self.add(points.astype(kind), "VEC3", **position)
        self.add(faces.astype("<u2").reshape(-1, 1), "SCALAR")

    @property
    def mesh(self) -> dict[str, Any]:
        first: dict[str, Any] = self.table["meshes"][0]["primitives"][0]
        return first

    def view(self, rows: np.ndarray) -> int:
        data = "data:;base64," + base64.b64encode(rows.tobytes()).decode()
        self.table["buffers"].append({"byteLength": rows.nbytes, "uri": data})
        self.table["bufferViews"].append({"buffer": len(self.table["buffers"]) - 1, "byteLength": rows.nbytes})
        return len(self.table["bufferViews"]) - 1

    def add(self, rows: np.ndarray, shape: str, **more: Any) -> None:
        entry = {
            "bufferView": self.view(rows),
            "componentType": KINDS[rows.dtype.str.replace("|", "<")],
            "count": len(rows),
        }
        self.table["accessors"].append({**entry, "type": shape, **more})

    def write(self, path: Path) -> Path:
        text = json.dumps(self.table).encode()
        if path.suffix != ".gltf":
            text += b" " * (-len(text) % 4)
            head = b"glTF" + (2).to_bytes(4, "little") + (20 + len(text)).to_bytes(4, "little")
            text = head + len(text).to_bytes(4, "little") + b"JSON" + text
        path.write_bytes(text)
        return path


def extents(path: Path) -> list[float]:
    surface = read_surface(path)
    assert len(surface.faces) == 4
    return [float(side) for side in np.ptp(surface.vertices, axis=0)]


@pytest.mark.parametrize("name", ["a.gltf", "a.glb", "a.vrm"])
def test_normalised_positions_are_shares_of_one(name: str, tmp_path: Path) -> None:
    scene = Scene(np.round(POINTS * 32767), "<i2", normalized=True)
    scene.table["extensionsRequired"] = ["KHR_mesh_quantization"]
    scene.table["nodes"][0]["scale"] = [0.5, 0.5, 0.5]
    assert extents(scene.write(tmp_path / name)) == pytest.approx([0.5, 0.5, 0.05], abs=1e-4)


def test_sparse_positions_lie_where_they_are_put(tmp_path: Path) -> None:
    scene = Scene()
    places, values = np.array([2, 5], dtype="<u2"), np.array([[1.5, 0, 0], [1.5, 1, 0]], dtype="<f4")
    sparse = {
        "count": 2, "indices": {"bufferView": scene.view(places), "componentType": 5123},
        "values": {"bufferView": scene.view(values)},
    }  # fmt: skip
    scene.table["accessors"][0]["sparse"] = sparse
    assert extents(scene.write(tmp_path / "a.gltf")) == pytest.approx([1.5, 1.0, 0.0])
    # Without a buffer of its own all others are zero.
    del scene.table["accessors"][0]["bufferView"]
    sparse |= {
        "count": 5, "indices": {"bufferView": scene.view(np.arange(1, 6, dtype="<u2")), "componentType": 5123},
        "values": {"bufferView": scene.view(2 * POINTS[1:].astype("<f4"))},
    }  # fmt: skip
    assert extents(scene.write(tmp_path / "a.gltf")) == pytest.approx([2.0, 2.0, 0.2])
    sparse["indices"] = {"bufferView": scene.view(np.arange(10, 15, dtype="<u2")), "componentType": 5123}
    with pytest.raises(InputError, match="replaces row 14 of 6"):
        read_surface(scene.write(tmp_path / "a.gltf"))


@pytest.mark.parametrize("mode", [5, 6])
def test_strips_and_fans_are_triangles(mode: int, tmp_path: Path) -> None:
    scene = Scene(faces=STRIP[:4] if mode == 5 else np.array([0, 1, 2, 5, 4, 3]))
    scene.mesh["mode"] = mode
    assert len(read_surface(scene.write(tmp_path / "a.gltf")).faces) == (2 if mode == 5 else 4)


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("KHR_draco_mesh_compression", "compressed with Draco; save it again without compression"),
        ("EXT_meshopt_compression", "compressed with meshopt"),
        ("ACME_secret", "it is not read; save it again without it"),
    ],
)
def test_a_required_extension_that_is_not_read_is_named(name: str, what: str, tmp_path: Path) -> None:
    scene = Scene()
    scene.table["extensionsUsed"] = [name]
    assert extents(scene.write(tmp_path / "a.glb")) == pytest.approx([1.0, 1.0, 0.1])
    scene.table["extensionsRequired"] = [name]
    with pytest.raises(InputError, match=f"requires the extension '{name}': .*{what}"):
        read_surface(scene.write(tmp_path / "a.glb"))


def test_an_extension_of_looks_is_passed_over(tmp_path: Path) -> None:
    scene = Scene()
    scene.table["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform"]
    assert extents(scene.write(tmp_path / "a.glb")) == pytest.approx([1.0, 1.0, 0.1])


def test_what_the_scene_does_not_show_is_named(tmp_path: Path) -> None:
    scene = Scene()
    scene.table["nodes"] = [{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b", "translation": [3, 0, 0]}]
    scene.mesh["targets"], scene.table["meshes"][0]["weights"] = [{"POSITION": 0}], [0.5]
    surface = read_surface(scene.write(tmp_path / "a.glb"))
    assert len(surface.faces) == 4
    assert [note for note in surface.notes if "left out" in note] == [
        "1 node with a mesh not in the scene that the file shows, left out: 'b'",
        "weights of morph targets were left out: meshes are read as they are without",
    ]


def test_instances_are_named(tmp_path: Path) -> None:
    scene = Scene()
    scene.table["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {}}
    with pytest.raises(InputError, match="repeats meshes as instances"):
        read_surface(scene.write(tmp_path / "a.glb"))
