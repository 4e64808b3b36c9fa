"""A drawn figure as a PNG file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["keep_words_on_page", "save_png"]

# Pages are large and mostly white: zlib's fastest level takes half the time of the usual one, and 1.2 times the bytes.
_LEVEL = 1


def keep_words_on_page(figure: Any) -> None:
    """Shorten level texts of a figure with an Agg canvas that would run over its left or right edge, with dots at their ends."""
    renderer, page = figure.canvas.get_renderer(), figure.bbox
    for text in [*figure.texts, *(text for axes in figure.axes for text in axes.texts)]:
        whole, share = text.get_text().split("\n"), 1.0
        while whole != [""] and not text.get_rotation() and share > 0.01:
            box = text.get_window_extent(renderer)
            if box.x0 >= page.x0 - 1.0 and box.x1 <= page.x1 + 1.0:
                break
            at = {"left": box.x0, "right": box.x1}.get(text.get_ha(), 0.5 * (box.x0 + box.x1))
            room = {"left": page.x1 - at, "right": at - page.x0}.get(text.get_ha(), 2 * min(page.x1 - at, at - page.x0))
            share *= min(max(room, 0.0) / box.width, 0.95)
            most = int(share * max(map(len, whole)))
            text.set_text("\n".join(line if len(line) <= most else f"{line[:most].rstrip()}…" for line in whole))


def save_png(path: Path, figure: Any, text: Mapping[str, str]) -> None:
    """Draw a matplotlib figure and write its pixels as opaque RGB, at the figure's own resolution.

    Args:
        path: the file.
        figure: with an Agg canvas; it is drawn once.
        text: entries of the file's metadata, such as ``{"Software": "warpflat"}``.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    keep_words_on_page(figure)
    figure.canvas.draw()
    image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
    metadata = PngInfo()
    for key, value in text.items():
        metadata.add_text(key, value)
    resolution = float(figure.dpi)
    image.save(path, format="PNG", dpi=(resolution, resolution), pnginfo=metadata, compress_level=_LEVEL)
