"""Run the notebooks of the site and keep what they show: python docs/run_notebooks.py [--check]

With `--check` nothing is written: a notebook that raises ends the command.
"""

from __future__ import annotations

import base64
import io
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

PICTURE_WIDTH = 800


def shrink_pictures(notebook: nbformat.NotebookNode) -> None:
    """Make the pictures as wide as a page, with few colours, and drop what was written to the error stream."""
    for cell in notebook.cells:
        kept = [each for each in cell.get("outputs", ()) if each.get("name") != "stderr"]
        for output in kept:
            picture = output.get("data", {}).get("image/png")
            if picture is None:
                continue
            with Image.open(io.BytesIO(base64.b64decode(picture))) as large:
                height = round(large.height * PICTURE_WIDTH / large.width)
                small = large.convert("RGB").resize((PICTURE_WIDTH, height), Image.Resampling.LANCZOS).quantize(96)
            into = io.BytesIO()
            small.save(into, "PNG", optimize=True)
            output["data"]["image/png"] = base64.b64encode(into.getvalue()).decode()
        if "outputs" in cell:
            cell["outputs"] = kept


def main(arguments: list[str]) -> None:
    """Run every notebook in its folder."""
    for path in sorted((Path(__file__).parent / "notebooks").glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(
            notebook, timeout=600, record_timing=False, resources={"metadata": {"path": path.parent}}
        ).execute()
        notebook.metadata.pop("language_info", None)
        print(path.name, "runs")
        if "--check" not in arguments:
            shrink_pictures(notebook)
            nbformat.write(notebook, path)


if __name__ == "__main__":
    main(sys.argv[1:])
