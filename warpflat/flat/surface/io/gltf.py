"""GLB and glTF made plain for trimesh: what it would leave out or read as something else is written out, or refused by name."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from warpflat.core.errors import InputError
from warpflat.core.text import format_count, quote_value

__all__ = ["gltf_notes", "gltf_table", "plain_gltf"]

_MAGIC, _BIN = b"glTF", b"BIN\x00"
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
# Rows of an accessor, at most: as many vertices would take gigabytes.
_MOST_ROWS = 50_000_000
_TRIANGLES, _FAN = 4, 6
# Required extensions that change no shape, or that are read here.
_KNOWN = ("KHR_mesh_quantization", "KHR_lights_punctual", "KHR_xmp_json_ld", "VRM", "VRMC_")
_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "EXT_lights_")
_SAVE = "save it again without compression, as with: gltf-transform copy in.glb out.glb"
_DO = {
    "KHR_draco_mesh_compression": f"its meshes are compressed with Draco; {_SAVE}",
    "EXT_meshopt_compression": f"its meshes are compressed with meshopt; {_SAVE}",
    "KHR_meshopt_compression": f"its meshes are compressed with meshopt; {_SAVE}",
    "EXT_mesh_gpu_instancing": "it repeats meshes as instances; save it again with each as a mesh of its own",
}


def gltf_table(data: bytes) -> dict[str, Any]:
    """Return the table of a GLB or glTF file.

    Raises:
        ValueError: it is no such file.
    """
    if data[:4] == _MAGIC:
        data = data[20 : 20 + int.from_bytes(data[12:16], "little")]
    table = json.loads(data.decode("utf-8-sig"))
    if not isinstance(table, dict):
        raise ValueError("no table")
    return table


def gltf_notes(table: Mapping[str, Any]) -> list[str]:
    """Return what a file has beside the scene that it shows, in which meshes are as they are modelled: a sentence each."""
    nodes, scenes, notes = table.get("nodes", []), table.get("scenes", []), list[str]()
    if scenes:
        todo = list(scenes[table.get("scene", 0)].get("nodes", []))
        shown = set[int]()
        while todo:
            if (node := todo.pop()) not in shown:
                shown.add(node)
                todo += nodes[node].get("children", [])
        others = [each for k, each in enumerate(nodes) if "mesh" in each and k not in shown]
        if others:
            names = ", ".join(quote_value(each.get("name", "")) for each in others)
            notes.append(
                f"{format_count(len(others), 'node')} with a mesh not in the scene that the file shows, left out: {names}"
            )
    weights = [*nodes, *table.get("meshes", [])]
    if any(any(each.get("weights", [])) for each in weights):
        notes.append("weights of morph targets were left out: meshes are read as they are without")
    return notes


def plain_gltf(data: bytes, resolver: Any) -> bytes:
    """Return a GLB or glTF file with sparse and quantised accessors of its meshes written out, and fans as triangles.

    What needs nothing of this is returned as it is.

    Args:
        data: of the file.
        resolver: with `get`, which returns the bytes of a file beside it.

    Raises:
        InputError: the file requires an extension that is not read, or is compressed.
        ValueError, LookupError, TypeError: it is damaged.
    """
    table = gltf_table(data)
    required = [str(name) for name in table.get("extensionsRequired", [])]
    # What is only used has something in its place, but where the place is empty.
    primitives = [one for mesh in table.get("meshes", []) for one in mesh["primitives"]]
    views, accessors = table.get("bufferViews", []), table.get("accessors", [])
    instanced = any("EXT_mesh_gpu_instancing" in node.get("extensions", {}) for node in table.get("nodes", []))
    required += ["EXT_mesh_gpu_instancing"] * instanced
    for one in primitives:
        packed = [name for name in one.get("extensions", {}) if name in _DO]
        bare = any(
            "bufferView" not in accessors[k] and "sparse" not in accessors[k] for k in one["attributes"].values()
        )
        required += packed if bare else []
    required += [
        name
        for view in views
        for name in view.get("extensions", {})
        if name in _DO and "uri" not in table["buffers"][view["buffer"]] and view["buffer"] != 0
    ]
    for name in required:
        if not name.startswith((*_KNOWN, *_LOOKS)):
            raise InputError(
                f"requires the extension {quote_value(name)}: "
                + _DO.get(name, "it is not read; save it again without it, with plain vertices and faces")
            )
    source = _Source(table, data, resolver)
    # What is read of a mesh: its positions, its texture, its faces.
    used = {
        index: kind
        for one in primitives
        for kind, index in (*one["attributes"].items(), ("", one.get("indices")))
        if index is not None and kind in ("POSITION", "TEXCOORD_0", "")
    }
    changed = {index for index in used if "sparse" in accessors[index] or accessors[index].get("normalized")}
    fans = [one for one in primitives if one.get("mode", _TRIANGLES) == _FAN]
    if not changed and not fans:
        return data
    for index in changed:
        accessors[index] = source.add(source.rows(accessors[index]))
    for one in fans:
        corners = (
            source.rows(accessors[one["indices"]]).ravel()
            if "indices" in one
            else np.arange(accessors[one["attributes"]["POSITION"]]["count"], dtype=np.uint32)
        )
        faces = np.column_stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]])
        accessors.append(source.add(faces.astype("<u4").reshape(-1, 1)))
        one |= {"indices": len(accessors) - 1, "mode": _TRIANGLES}
    return source.written()


class _Source:
    """The buffers of a file, to which further ones are added.

    Attributes:
        table: of the file; accessors that are added go there by the caller.
    """

    def __init__(self, table: dict[str, Any], data: bytes, resolver: Any) -> None:
        self.table, self._resolver, self._read = table, resolver, dict[int, bytes]()
        self._binary = b""
        if data[:4] == _MAGIC:
            start = 20 + int.from_bytes(data[12:16], "little")
            if data[start + 4 : start + 8] == _BIN:
                self._binary = data[start + 8 : start + 8 + int.from_bytes(data[start : start + 4], "little")]

    def buffer(self, index: int) -> bytes:
        """Return the bytes of a buffer: of the file, in it as text, or of a file beside it."""
        if index not in self._read:
            uri = self.table["buffers"][index].get("uri")
            if uri is None:
                self._read[index] = self._binary
            elif uri.startswith("data:"):
                self._read[index] = base64.b64decode(uri.partition(",")[2])
            else:
                self._read[index] = bytes(self._resolver.get(unquote(uri)))
        return self._read[index]

    def rows(self, accessor: dict[str, Any]) -> NDArray[Any]:
        """Return the rows of an accessor, sparse ones in their places, normalised ones as shares of 1."""
        kind, count, columns = (
            np.dtype(_TYPES[accessor["componentType"]]),
            accessor["count"],
            _COLUMNS[accessor["type"]],
        )
        if not 0 <= count <= _MOST_ROWS:
            raise ValueError("count of an accessor")
        found = np.zeros((count, columns), dtype=kind)
        if "bufferView" in accessor:
            found = self._view(accessor["bufferView"], accessor.get("byteOffset", 0), kind, count, columns).copy()
        if (sparse := accessor.get("sparse")) is not None:
            at, values = sparse["indices"], sparse["values"]
            whole = np.dtype(_TYPES[at["componentType"]])
            places = self._view(at["bufferView"], at.get("byteOffset", 0), whole, sparse["count"], 1).ravel()
            if len(places) and not 0 <= int(places.min()) <= int(places.max()) < count:
                raise InputError(
                    f"a sparse accessor replaces row {int(places.max())} of {count:,}; rows are counted from 0"
                )
            found[places] = self._view(
                values["bufferView"], values.get("byteOffset", 0), kind, sparse["count"], columns
            )
        if accessor.get("normalized") and kind.kind in "iu":
            return np.maximum(found / float(np.iinfo(kind).max), -1.0).astype("<f4")
        return found

    def add(self, rows: NDArray[Any]) -> dict[str, Any]:
        """Add rows as a buffer, and return their accessor."""
        data = np.ascontiguousarray(rows).tobytes()
        kind = next(code for code, name in _TYPES.items() if np.dtype(name) == rows.dtype)
        self.table["buffers"].append({"byteLength": len(data), "uri": _inline(data)})
        self.table["bufferViews"].append({"buffer": len(self.table["buffers"]) - 1, "byteLength": len(data)})
        shape = next(name for name, columns in _COLUMNS.items() if columns == rows.shape[1])
        view = len(self.table["bufferViews"]) - 1
        return {"bufferView": view, "componentType": kind, "count": len(rows), "type": shape}

    def written(self) -> bytes:
        """Return the file as glTF, the buffer of a GLB as text."""
        for buffer in self.table["buffers"]:
            if "uri" not in buffer:
                buffer["uri"] = _inline(self._binary[: buffer["byteLength"]])
        return json.dumps(self.table).encode()

    def _view(self, index: int, offset: int, kind: np.dtype[Any], count: int, columns: int) -> NDArray[Any]:
        view = self.table["bufferViews"][index]
        data = self.buffer(view["buffer"])[view.get("byteOffset", 0) :][: view["byteLength"]]
        stride = view.get("byteStride", kind.itemsize * columns)
        return np.ndarray((count, columns), kind, data, offset, (stride, kind.itemsize))


def _inline(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()
