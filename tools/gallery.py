"""Draw the pictures of the gallery anew: python tools/gallery.py [names]; without names those whose script has changed.

A picture remembers the code that it was drawn by; tests/test_site.py compares.
"""

from __future__ import annotations

import os
import runpy
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ["MPLBACKEND"] = "Agg"
sys.path.insert(0, str(Path(__file__).parent / "site"))

from examples import PICTURES, Example, examples
from matplotlib import pyplot as plt
from PIL import Image, PngImagePlugin

WIDTH = 900  # pixels of a stored picture, at most
COLOURS = 128
KEY = "drawn by"


def remembered(picture: Path) -> str:
    """Print of the code by which a picture was drawn; empty where there is none."""
    return str(Image.open(picture).text.get(KEY, "")) if picture.exists() else ""


def draw(example: Example) -> float:
    """Run the example and store its picture; return the seconds of the processor."""
    start = time.process_time()
    with TemporaryDirectory() as folder:
        drawn = Path(folder) / "picture.png"
        sys.argv = [str(example.file), str(drawn)]
        runpy.run_path(str(example.file), run_name="__main__")
        plt.close("all")
        image = Image.open(drawn).convert("RGB")
    seconds = time.process_time() - start
    if image.width > WIDTH:
        image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    said = PngImagePlugin.PngInfo()
    said.add_text(KEY, example.print)
    PICTURES.mkdir(parents=True, exist_ok=True)
    image.quantize(COLOURS).save(example.picture, optimize=True, pnginfo=said)
    return seconds


def main(names: list[str]) -> None:
    """Draw those named, or those that are stale."""
    for one in examples():
        if one.name in names or (not names and remembered(one.picture) != one.print):
            print(f"{one.name}: {draw(one):.1f} s of a processor, {one.picture.stat().st_size / 1024:.0f} KiB")
    for file in set(PICTURES.glob("*.png")) - {one.picture for one in examples()}:
        file.unlink()


if __name__ == "__main__":
    main(sys.argv[1:])
