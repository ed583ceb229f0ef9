"""The explorer in a real browser: times from a person's act to the picture, and frames while something moves.

    python benchmarks/bench_explorer.py [rounds]

Needs Chromium. Each figure is the least and the median of some rounds: time on the wall, and time of processors in the
server, its workers and the browser together, where the system tells it. The server is started anew in each round.
Modules are compiled to bytecode once before, as an installer does, wherever ``PYTHONDONTWRITEBYTECODE`` is set.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from playwright.sync_api import sync_playwright

from screen import Screen, browser, served

SYSTEM = """
import saltus
system = saltus.HybridSystem.smooth({"x": "v", "v": "-c*v + x - x**3 + F*cos(s)"}, {"c": 0.2, "F": 0.1, "w": 1.2},
                                    phase=("s", "w"))
"""
_TICK = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 1
_DRAG = 40  # moves of a slider, of two pixels each: each is another value

# frames of the page while the diagram is dragged
_FRAMES = """() => { window.frames_ = []; let last = performance.now(); window.running_ = true
  const step = now => { window.frames_.push(now - last); last = now; if (window.running_) requestAnimationFrame(step) }
  requestAnimationFrame(step) }"""


# times at which the motion is drawn while a slider moves
_DRAWN = """() => {
  window.drawn = []
  const document = Bokeh.documents.find(d => d.get_model_by_name('portrait-figure') != null)
  const glyph = document.get_model_by_name('portrait-figure').renderers.find(r => r.name == 'live')
  glyph.data_source.properties.data.change.connect(() => window.drawn.push(performance.now()))
}"""


class Clock:
    """Notes how long acts take."""

    def __init__(self) -> None:
        self.wall: dict[str, list[float]] = defaultdict(list)
        self.processor: dict[str, list[float]] = defaultdict(list)
        self.begin()

    def begin(self) -> None:
        """Begin an act."""
        self._begun, self._used = time.perf_counter(), _used()

    def note(self, name: str) -> None:
        """Note how long the act has taken so far, in milliseconds."""
        self.wall[name].append(1e3 * (time.perf_counter() - self._begun))
        self.processor[name].append(1e3 * (_used() - self._used))

    def table(self) -> None:
        """Print the least and the median of each act."""
        for name, values in self.wall.items():
            used = self.processor.get(name, [])
            more = f"   processors min {min(used):6.0f} ms   median {statistics.median(used):6.0f} ms" if used else ""
            print(f"{name:66} min {min(values):6.0f} ms   median {statistics.median(values):6.0f} ms{more}")


def _used() -> float:
    """Return the seconds of processors that all processes below this one have used so far; 0 where that is not told."""
    used, parents = {}, {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            told = status.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        number = int(status.parent.name)
        parents[number], used[number] = int(told[1]), sum(map(int, told[11:15])) / _TICK

    def is_below(number: int) -> bool:
        while number in parents:
            number = parents[number]
            if number == os.getpid():
                return True
        return False

    return sum(seconds for number, seconds in used.items() if is_below(number))


def main() -> None:
    """Run the rounds and print a table."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    clock = Clock()
    with sync_playwright() as play:
        started = play.chromium.launch(executable_path=browser(), args=["--no-sandbox"])
        with tempfile.TemporaryDirectory() as bytecode:
            _rounds(rounds, started, Path(bytecode), clock)
        started.close()
    clock.table()


def _rounds(rounds: int, started, bytecode: Path, clock: Clock) -> None:
    """Run the rounds with modules that are compiled before."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(bytecode)
    with tempfile.TemporaryDirectory() as folder, served(Path(folder), "tapping-mode-1") as (address, _):
        page = started.new_page()
        Screen(page, address).wait("orbit1")
        page.close()
    for number in range(rounds):
        for act in (new_system, tapping_mode):
            with tempfile.TemporaryDirectory() as folder:
                act(started, Path(folder), clock)
        print(f"round {number + 1} of {rounds}, load {os.getloadavg()[0]:.1f}", file=sys.stderr)


def new_system(started, folder: Path, clock: Clock) -> None:
    """Explore a system that was never seen, with empty caches and again; then move a slider."""
    file = folder / "oscillator.py"
    file.write_text(SYSTEM)
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(folder / "caches")
    try:
        for caches, wanted in (("empty", 5000), ("warm", 2000)):
            with served(folder, f"{file}:system") as (address, _):
                page = started.new_page(viewport={"width": 1500, "height": 900})
                screen = Screen(page, address)
                clock.begin()
                screen.wait("orbit1")
                clock.note(f"from the page to a new system's first orbit, {caches} caches ({wanted})")
                if caches == "warm":
                    slide(screen, clock)
                page.close()
    finally:
        os.environ.pop("XDG_CACHE_HOME")
        if before is not None:
            os.environ["XDG_CACHE_HOME"] = before


def slide(screen: Screen, clock: Clock) -> None:
    """Drag a slider, and note the time between pictures of the motion."""
    page = screen.page
    screen.fill("start-x", "0.7")
    screen.eventually(lambda: screen.column("portrait", "carried", "x"))  # the process that draws is ready
    page.evaluate(_DRAWN)
    screen.drag("F", _DRAG, 2.0)
    page.mouse.up()
    screen.eventually(lambda: len(page.evaluate("() => window.drawn")) >= 4)
    drawn = page.evaluate("() => window.drawn")
    between = [later - sooner for sooner, later in pairwise(drawn)]
    clock.wall["between two pictures of the motion while a slider moves (50)"].append(statistics.median(between))


def tapping_mode(started, folder: Path, clock: Clock) -> None:
    """Do everything once with tapping mode."""
    clock.begin()
    with served(folder, "tapping-mode-1") as (address, _):
        page = started.new_page(viewport={"width": 1500, "height": 900})
        screen = Screen(page, address)
        clock.note("from the command to the first page (2500)")
        screen.wait("orbit1")
        clock.note("from the command to the first orbit")
        page.wait_for_timeout(6000)  # the process that works loads the code of basins
        clock.begin()
        page.click(".continue")
        page.wait_for_function(_drawn("diagram", "points", 100, "x"))
        clock.note("from the button to the branch of Fig. 3 (500)")
        page.locator(".bk-tab", has_text="Basins").click()
        clock.begin()
        page.click(".map-basins")
        page.wait_for_function(_drawn("basins", "image", 1, "image"))
        clock.note("from the button to the first picture of a basin (3000)")
        screen.until("basin-legend", "100 x 100")
        clock.note("from the button to 100 x 100 cells")
        page.locator(".bk-tab", has_text="Orbit").click()
        page.wait_for_timeout(500)  # the axes have moved
        x, y = (screen.column("diagram", "points", axis) for axis in "xy")
        for place in (0.82, 1.04, 1.15, 1.35):  # away from special points, where a click opens a list
            index = min(range(len(x)), key=lambda i, place=place: abs(x[i] - place))
            page.wait_for_timeout(700)  # sooner it would be a double click
            before = screen.column("portrait", "curves", "xs")[0][0]
            clock.begin()
            screen.click_at("diagram", x[index], y[index])
            page.wait_for_function(_other("portrait", "curves", before), polling=5)
            clock.note("from a click on the branch to the drawn orbit (150)")
        page.locator(".bk-tab", has_text="Basins").click()
        left = screen.column("basins", "image", "x")[0]
        clock.begin()
        page.click(".map-basins")
        page.wait_for_function(f"() => {_SOURCE}('basins-figure', 'image').data['x'][0] != {left!r}", polling=5)
        clock.note("the same of a slowly attracting orbit, next to a fold")
        frames(screen, clock.wall)
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
    found["between two frames, 2000 points dragged, median"].append(statistics.median(times))
    found["between two frames, 2000 points dragged, longest"].append(times[-1])


def _drawn(figure: str, glyph: str, least: int, column: str = "xs") -> str:
    return f"() => {_SOURCE}('{figure}-figure', '{glyph}').data['{column}'].length >= {least}"


def _other(figure: str, glyph: str, before: float) -> str:
    return f"() => {_SOURCE}('{figure}-figure', '{glyph}').data['xs'][0][0] != {before!r}"


_SOURCE = """((name, glyph) => Bokeh.documents.find(d => d.get_model_by_name(name) != null)
  .get_model_by_name(name).renderers.find(r => r.name == glyph).data_source)"""


if __name__ == "__main__":
    main()
