"""A mesh with a colour per vertex as a binary glTF, which a browser reads at once."""

from __future__ import annotations

import json
import struct

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import vertex_normals
from warpflat.pattern import linear_rgb

__all__ = ["before_tone_mapping", "coloured_mesh"]

# The tone mapping of three.js (ACES, the fit of Stephen Hill), through which viser shows whatever it shows.
_ACES_IN = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_ACES_OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
_EXPOSURE = 0.6
_FLOAT, _UNSIGNED, _VERTICES, _INDICES = 5126, 5125, 34962, 34963


def coloured_mesh(positions: FloatArray, triangles: IntArray, colours: FloatArray, *, lit: bool) -> bytes:
    """Return a mesh as GLB 2.0.

    Args:
        positions: #V by 3 [m].
        triangles: #T by 3.
        colours: #V by 3, sRGB, 0 to 1.
        lit: whether light falls on it; otherwise it has exactly these colours.
    """
    arrays = {"POSITION": positions.astype("<f4"), "COLOR_0": before_tone_mapping(colours).astype("<f4")}
    if lit:
        normals = vertex_normals(positions, triangles)
        # The format wants a length of 1, of vertices without a face, too.
        normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
        arrays["NORMAL"] = normals.astype("<f4")
    blocks = [np.ascontiguousarray(array).tobytes() for array in arrays.values()]
    blocks.append(np.ascontiguousarray(triangles.astype("<u4")).tobytes())
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    views = [
        {"buffer": 0, "byteOffset": start, "byteLength": len(block), "target": _VERTICES}
        for start, block in zip(starts, blocks, strict=False)
    ]
    views[-1]["target"] = _INDICES
    accessors: list[dict[str, object]] = [
        {"bufferView": number, "componentType": _FLOAT, "count": len(positions), "type": "VEC3"}
        for number in range(len(arrays))
    ]
    accessors[0] |= {"min": arrays["POSITION"].min(axis=0).tolist(), "max": arrays["POSITION"].max(axis=0).tolist()}
    accessors.append({"bufferView": len(arrays), "componentType": _UNSIGNED, "count": triangles.size, "type": "SCALAR"})
    material: dict[str, object] = {
        "doubleSided": True, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    }  # fmt: skip
    document: dict[str, object] = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "attributes": {name: number for number, name in enumerate(arrays)}, "indices": len(arrays), "material": 0,
        }]}],
        "materials": [material], "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": starts[-1]}],
    }  # fmt: skip
    if not lit:
        material["extensions"] = {"KHR_materials_unlit": {}}
        document["extensionsUsed"] = ["KHR_materials_unlit"]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(blocks)
    size = 12 + 8 + len(text) + 8 + len(body)
    head = struct.pack("<4sII", b"glTF", 2, size)
    return b"".join(
        [head, struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", len(body), b"BIN\0"), body]
    )


def before_tone_mapping(colours: FloatArray) -> FloatArray:
    """Return the linear colours that are shown as these sRGB colours (#V by 3), so that a map has the colours of its scale."""
    shown = np.linalg.solve(_ACES_OUT, linear_rgb(colours).T).clip(0.0, 0.99)
    # The curve is y = (v² + a v - b) / (c v² + d v + e), and v the greater root.
    square, first = 1.0 - 0.983729 * shown, 0.0245786 - 0.4329510 * shown
    last = -(0.000090537 + 0.238081 * shown)
    before = (-first + np.sqrt(first**2 - 4.0 * square * last)) / (2.0 * square)
    return np.asarray(_EXPOSURE * np.linalg.solve(_ACES_IN, before).T)
