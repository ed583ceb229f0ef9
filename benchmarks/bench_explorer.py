"""The explorer in a real browser: times from a person's act to the picture, and frames while the diagram moves.

    python benchmarks/bench_explorer.py [rounds]

Needs Chromium. Each figure is the least and the median of some rounds; the server is started anew in each.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from playwright.sync_api import sync_playwright

from screen import Screen, browser, served

# frames of the page while the diagram is dragged
_FRAMES = """() => { window.frames_ = []; let last = performance.now(); window.running_ = true
  const step = now => { window.frames_.push(now - last); last = now; if (window.running_) requestAnimationFrame(step) }
  requestAnimationFrame(step) }"""


def main() -> None:
    """Run the rounds and print a table."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    found: dict[str, list[float]] = {}
    with sync_playwright() as play:
        started = play.chromium.launch(executable_path=browser(), args=["--no-sandbox"])
        for _ in range(rounds):
            with tempfile.TemporaryDirectory() as folder:
                one_round(started, Path(folder), found)
    for name, values in found.items():
        print(f"{name:58} min {min(values):8.0f} ms   median {statistics.median(values):8.0f} ms")


def one_round(started, folder: Path, found: dict[str, list[float]]) -> None:
    """Do everything once and note the times in milliseconds."""

    def note(name: str, begun: float) -> None:
        found.setdefault(name, []).append(1e3 * (time.perf_counter() - begun))

    begun = time.perf_counter()
    with served(folder, "tapping-mode-1") as (address, _):
        page = started.new_page(viewport={"width": 1500, "height": 900})
        screen = Screen(page, address)
        note("from the command to the first page (3000)", begun)
        screen.wait("orbit1")
        note("from the command to the first orbit", begun)
        page.wait_for_timeout(6000)  # the process that works loads the code of basins
        begun = time.perf_counter()
        page.click(".continue")
        page.wait_for_function(_drawn("diagram", "points", 100, "x"))
        note("from the button to the branch of Fig. 3 (500)", begun)
        page.locator(".bk-tab", has_text="Basins").click()
        begun = time.perf_counter()
        page.click(".map-basins")
        page.wait_for_function(_drawn("basins", "image", 1, "image"))
        note("from the button to the first picture of a basin (1000)", begun)
        screen.until("basin-legend", "100 x 100")
        note("from the button to 100 x 100 cells", begun)
        page.locator(".bk-tab", has_text="Orbit").click()
        page.wait_for_timeout(500)  # the axes have moved
        x, y = (screen.column("diagram", "points", axis) for axis in "xy")
        for index in (5, 45, 80, 110):
            page.wait_for_timeout(700)  # sooner it would be a double click
            before = screen.column("portrait", "curves", "xs")[0][0]
            begun = time.perf_counter()
            screen.click_at("diagram", x[index], y[index])
            page.wait_for_function(_other("portrait", "curves", before), polling=5)
            note("from a click on the branch to the drawn orbit (150)", begun)
        page.locator(".bk-tab", has_text="Basins").click()
        left = screen.column("basins", "image", "x")[0]
        begun = time.perf_counter()
        page.click(".map-basins")
        page.wait_for_function(f"() => {_SOURCE}('basins-figure', 'image').data['x'][0] != {left!r}", polling=5)
        note("the same of a slowly attracting orbit, next to a fold", begun)
        frames(screen, found)
        page.close()


def frames(screen: Screen, found: dict[str, list[float]]) -> None:
    """Drag the diagram with at least 2000 points on it, and note the time between frames."""
    page = screen.page
    for number in range(2, 20):
        page.click(".continue")
        screen.wait(f"branch{number}")
    shown = len(screen.column("diagram", "points", "x"))
    assert shown >= 2000, shown
    box = page.locator(".centre .diagram").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate(_FRAMES)
    for step in range(40):
        page.mouse.move(x + 4 * step, y + 2 * step)
    page.mouse.up()
    times = sorted(page.evaluate("() => { window.running_ = false; return window.frames_ }"))
    found.setdefault("between two frames, 2000 points dragged, median", []).append(statistics.median(times))
    found.setdefault("between two frames, 2000 points dragged, longest", []).append(times[-1])


def _drawn(figure: str, glyph: str, least: int, column: str = "xs") -> str:
    return f"() => {_SOURCE}('{figure}-figure', '{glyph}').data['{column}'].length >= {least}"


def _other(figure: str, glyph: str, before: float) -> str:
    return f"() => {_SOURCE}('{figure}-figure', '{glyph}').data['xs'][0][0] != {before!r}"


_SOURCE = """((name, glyph) => Bokeh.documents.find(d => d.get_model_by_name(name) != null)
  .get_model_by_name(name).renderers.find(r => r.name == glyph).data_source)"""


if __name__ == "__main__":
    main()
