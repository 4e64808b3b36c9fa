"""A drawn figure as a PNG file, several times faster than a general writer that tries every filter on every row."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["png_bytes", "save_png"]

# Pages are white for the most part and large: the fastest level takes half the time of the usual one, and 1.2 times the bytes.
_LEVEL = 1
_BAND = 32  # rows
_UP = 2  # filter: each byte as the difference from the one above
_METRE = 1.0 / 0.0254  # [in]


def save_png(path: Path, figure: Any, text: Mapping[str, str]) -> None:
    """Draw a matplotlib figure that has an Agg canvas, and write it at its own resolution, without its opacity.

    Args:
        path: the file.
        figure: drawn once.
        text: what the file says of itself, as ``{"Software": "warpflat"}``.
    """
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    path.write_bytes(png_bytes(pixels, dots_per_inch=float(figure.dpi), text=text))


def png_bytes(pixels: NDArray[np.uint8], *, dots_per_inch: float, text: Mapping[str, str]) -> bytes:
    """The content of a PNG file (ISO/IEC 15948) of RGB `pixels`, #R by #C by 3, with `text` in Latin-1."""
    rows, columns, _ = pixels.shape
    dots = round(dots_per_inch * _METRE)
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)),
        (b"pHYs", struct.pack(">IIB", dots, dots, 1)),
        *((b"tEXt", f"{key}\0{value}".encode("latin-1")) for key, value in text.items()),
        (b"IDAT", _compressed(pixels)),
        (b"IEND", b""),
    ]
    parts = [b"\x89PNG\r\n\x1a\n"]
    for kind, data in chunks:
        parts += [struct.pack(">I", len(data)), kind, data, struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))]
    return b"".join(parts)


def _compressed(pixels: NDArray[np.uint8]) -> bytes:
    """The rows, filtered and compressed, in bands that stay in the processor's cache."""
    rows, columns, channels = pixels.shape
    packer = zlib.compressobj(_LEVEL)
    parts = []
    band = np.zeros((_BAND + 1, columns, channels), dtype=np.uint8)
    filtered = np.full((_BAND, 1 + columns * channels), _UP, dtype=np.uint8)
    for start in range(0, rows, _BAND):
        count = min(_BAND, rows - start)
        for channel in range(channels):
            # Several times faster than all three at once, where they come from four.
            band[1 : count + 1, :, channel] = pixels[start : start + count, :, channel]
        flat = band.reshape(_BAND + 1, -1)
        np.subtract(flat[1 : count + 1], flat[:count], out=filtered[:count, 1:])
        parts.append(packer.compress(filtered[:count].data))
        band[0] = band[count]
    parts.append(packer.flush())
    return b"".join(parts)
