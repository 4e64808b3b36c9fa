"""Run every scene as its first comment says, and make the gallery of the site: `docs/gallery.md` and its pictures.

python docs/make_gallery.py [SCENE ...]

Without names all scenes are run; scenes with real meshes need `WARPFLAT_DATA`. `--page` writes the page alone.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

from PIL import Image, ImageDraw

DOCS = Path(__file__).resolve().parent
SCENES = DOCS.parent / "scenes"
OUT = DOCS.parent / "out" / "gallery"
PICTURE_WIDTH = 720  # as wide as a page's text
THUMBNAIL_WIDTH, THUMBNAILS_IN_ROW = 84, 5
# Of a line drawing [pixels], and by how much finer it is drawn before it is made small.
DRAWING_HEIGHT, DRAWING_MARGIN, FINER = 190, 12, 4


def read_comment(scene: Path) -> tuple[list[str], list[str]]:
    """Return the paragraphs of a scene's first comment, and the commands in it."""
    lines = scene.read_text(encoding="utf-8").splitlines()
    end = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    text = [line[1:] for line in lines[:end]]
    commands = [line.split("        ")[0].strip() for line in text if line.startswith("     ")]
    words = [" " if line.startswith("     ") else line.strip() for line in text]
    return [each.replace("\n", " ") for each in "\n".join(words).split("\n\n") if each.strip()], commands


def scene_files() -> list[Path]:
    """Return the scenes that `warpflat run` takes: all but batches."""
    return sorted(path for path in SCENES.glob("*.toml") if not path.name.startswith("batch"))


def gallery_page() -> str:
    """Return the page: a thumbnail of each scene, and folded below it the scene's words, its command and its picture."""
    blocks = [
        "# Gallery",
        "Every scene of `scenes/`: click a picture for what it shows and for its command. Of a garment it has the line drawing, how the "
        "garment lies on the body, and its pieces. Colours are strain energy density [J/m2].\n"
        "`python docs/make_gallery.py` runs the commands and makes this page.",
    ]
    thumbnails, folded = [], []
    for path in scene_files():
        paragraphs, commands = read_comment(path)
        # tests/app/scene runs every scene, and tests/app/cli/test_docs.py what is not marked.
        fence = "<!-- only parsed -->\n```sh\n" + "\n".join(commands) + "\n```"
        picture = []
        if (DOCS / "gallery" / f"{path.stem}.webp").exists():
            shown = f'<img src="gallery/{path.stem}.webp" alt="{path.stem}" width="{THUMBNAIL_WIDTH}">'
            thumbnails.append(f'<a href="#{path.stem}">{shown}</a><br>{path.stem}')
            picture = [f"![What {path.name} makes](gallery/{path.stem}.webp)"]
        # A browser opens the fold around what a link leads to.
        summary = f'<details>\n<summary>{path.stem}</summary>\n<a id="{path.stem}"></a>'
        folded.append("\n\n".join([summary, *paragraphs, fence, *picture, "</details>"]))
    rows = [thumbnails[k : k + THUMBNAILS_IN_ROW] for k in range(0, len(thumbnails), THUMBNAILS_IN_ROW)]
    empty = "|" + " |" * THUMBNAILS_IN_ROW
    table = [empty, "|" + "---|" * THUMBNAILS_IN_ROW, *("| " + " | ".join(row) + " |" for row in rows)]
    return "\n\n".join([*blocks, "\n".join(table), *folded]) + "\n"


def make_picture(scene: Path) -> None:
    """Run a scene by its command and keep its picture, made small.

    Raises:
        subprocess.CalledProcessError: the run fails.
    """
    command = next(each for each in read_comment(scene)[1] if " run " in f" {each} ")
    words = shlex.split(command.removeprefix("WARPFLAT_DATA=path/to/meshes "))
    assert words[0] == "warpflat"
    folder = OUT / scene.stem
    subprocess.run([sys.executable, "-m", *words, "--out", str(folder)], check=True, cwd=DOCS.parent)
    with Image.open(folder / "picture.png") as picture:
        height = round(picture.height * PICTURE_WIDTH / picture.width)
        small = picture.convert("RGB").resize((PICTURE_WIDTH, height), Image.Resampling.LANCZOS)
    drawing = line_drawing(folder / "pattern.json")
    if drawing is not None:
        whole = Image.new("RGB", (PICTURE_WIDTH, drawing.height + small.height), "white")
        whole.paste(drawing, ((PICTURE_WIDTH - drawing.width) // 2, 0))
        whole.paste(small, (0, drawing.height))
        small = whole
    (DOCS / "gallery").mkdir(exist_ok=True)
    small.save(DOCS / "gallery" / f"{scene.stem}.webp", quality=70, method=6)


def line_drawing(pattern: Path) -> Image.Image | None:
    """Return the line drawing of a garment, front and back, as its pattern's first page has it; None of what is worn on no body."""
    worn = json.loads(pattern.read_text(encoding="utf-8")).get("worn") if pattern.exists() else None
    if not worn or not worn["measures"] or not any(worn["views"].values()):
        return None
    rings = {side: [ring for piece in row for ring in piece["outlines"]] for side, row in worn["views"].items()}
    points = [point for row in rings.values() for ring in row for point in ring]
    (left, low), (right, high) = (tuple(map(end, zip(*points, strict=True))) for end in (min, max))
    room = PICTURE_WIDTH / len(rings) - 2 * DRAWING_MARGIN
    scale = FINER * min(DRAWING_HEIGHT / (high - low), room / (right - left))
    wide = round(scale * (right - left)) + 2 * FINER * DRAWING_MARGIN
    image = Image.new("RGB", (wide * len(rings), round(scale * (high - low)) + 2 * FINER * DRAWING_MARGIN), "white")
    pen = ImageDraw.Draw(image)
    for number, row in enumerate(worn["views"].values()):

        def place(point: list[float], number: int = number) -> tuple[float, float]:
            return (
                number * wide + FINER * DRAWING_MARGIN + scale * (point[0] - left),
                FINER * DRAWING_MARGIN + scale * (high - point[1]),
            )

        for piece in row:
            for ring in piece["outlines"]:
                pen.polygon([place(point) for point in ring], fill="white", outline=(40, 44, 52), width=FINER + 2)
            for line in piece["lines"]:
                pen.line([place(point) for point in line], fill=(40, 44, 52), width=FINER + 2, joint="curve")
    return image.resize((image.width // FINER, image.height // FINER), Image.Resampling.LANCZOS)


def main(names: list[str]) -> None:
    """Run the named scenes, or all, and write the page."""
    if names != ["--page"]:
        for path in scene_files():
            if names and path.stem not in names:
                continue
            if "WARPFLAT_DATA" in path.read_text(encoding="utf-8") and "WARPFLAT_DATA" not in os.environ:
                print(f"{path.name}: left out, WARPFLAT_DATA is not set", file=sys.stderr)
                continue
            make_picture(path)
    (DOCS / "gallery.md").write_text(gallery_page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
