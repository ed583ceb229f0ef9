"""A page of the explorer in a real browser, with words for what tests do there."""

from __future__ import annotations

import http.client
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TOKEN = "a-token-of-tests"
_LOOK = 50  # milliseconds between two looks
PATIENCE = 120_000  # milliseconds that a busy machine may need
_IDLE = "about:blank"
_FIELDS = "axis-[xy]|parameter-|start-|sweep-values"  # classes of fields
_SERVER = """
import gc, signal, sys
def pages(*told):
    names = [type(one).__qualname__ for one in gc.get_objects() if type(one).__module__ == 'saltus.explorer.page']
    print('pages:', names.count('Page'))
if hasattr(signal, 'SIGUSR1'):
    signal.signal(signal.SIGUSR1, lambda *told: gc.collect())  # for tests of its memory
    signal.signal(signal.SIGUSR2, pages)
from saltus.cli import main
main(sys.argv[1:])
"""

# where a place of a figure is on the screen
_PLACE = """([name, x, y]) => {
  const document = Bokeh.documents.find(d => d.get_model_by_name(name) != null)
  const view = Bokeh.index.find_one(document.get_model_by_name(name))
  const box = view.el.getBoundingClientRect()
  return [box.left + view.frame.x_scale.compute(x), box.top + view.frame.y_scale.compute(y)]
}"""

# a column of what a figure draws
_COLUMN = """([name, glyph, column]) => {
  const document = Bokeh.documents.find(d => d.get_model_by_name(name) != null)
  const renderer = document.get_model_by_name(name).renderers.find(r => r.name == glyph)
  return Array.from(renderer.data_source.data[column])
}"""

# whether a figure is on the page
_IS_THERE = "name => Bokeh.documents.some(d => d.get_model_by_name(name) != null)"
_IS_DRAWN = """name => Bokeh.documents.some(d => {
  const figure = d.get_model_by_name(name)
  return figure?.inner_width > 0 && Bokeh.index.find_one(figure) != null
})"""

# selects a solution, as a button in a list does
_TAKE = """name => {
  const document = Bokeh.documents.find(d => d.get_model_by_name('wishes') != null)
  const wish = JSON.stringify(['take', name, null])
  document.get_model_by_name('wishes').data = {wish: [wish], at: [`tidied ${Date.now()}`]}
}"""

# the text of a part of the page, whose content lies in a shadow tree
_TEXT = """(selector => {
  const look = root => {
    const found = root.querySelector(selector)
    if (found) return found
    for (const node of root.querySelectorAll('*')) {
      const inner = node.shadowRoot && look(node.shadowRoot)
      if (inner) return inner
    }
    return null
  }
  const part = look(document)
  if (!part) return ''
  const texts = [...(part.shadowRoot ?? part).children].filter(child => !['STYLE', 'LINK'].includes(child.tagName))
  return texts.map(child => child.innerText).join(' ')
})"""


# what stands in fields that are seen, by the class that a pattern matches
_SHOWN_FIELDS = """pattern => {
  const found = {}, wanted = new RegExp('^(' + pattern + ')')
  const look = root => {
    for (const node of root.querySelectorAll('*')) {
      const name = [...node.classList].find(one => wanted.test(one)), inside = node.shadowRoot ?? node
      const inputs = name ? inside.querySelectorAll('input') : []
      if (inputs.length == 1 && node.getBoundingClientRect().width > 0) found[name] = inputs[0].value
      if (node.shadowRoot) look(node.shadowRoot)
    }
  }
  look(document)
  return found
}"""


# stops what is under way, once, and returns whether nothing is; a button that goes is not waited for
_RESTS = """all => {
  const seen = all.filter(one => one.getBoundingClientRect().width > 0)
  const unasked = seen.filter(one => one.innerText == 'Stop' && !one.dataset.asked)
  for (const one of unasked) {
    one.dataset.asked = true
    one.click()
  }
  return seen.length == 0
}"""

# waits until some frames are drawn
_FRAMES = """count => new Promise(done => {
  const step = () => count-- > 0 ? requestAnimationFrame(step) : done()
  step()
})"""


def browser() -> str | None:
    """Return a Chromium that is installed, if there is one."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    return next((found for name in names if (found := shutil.which(name))), None)


@contextmanager
def served(home: Path, *arguments: str) -> Iterator[tuple[str, subprocess.Popen]]:
    """Run `saltus explore` and give the address of its page without the token, and the process."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    given = ["--no-browser", "--token", TOKEN, "--port", str(port)]
    command = [sys.executable, "-c", _SERVER, "explore", *arguments, *given]
    surroundings = os.environ | {"XDG_DATA_HOME": str(home), "PYTHONUNBUFFERED": "1"}
    log = home / "server.log"
    with log.open("w") as output:
        server = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=surroundings)
    try:
        yield _address(server, log), server
    finally:
        server.terminate()
        server.wait(30)


def asked(address: str, path: str = "/", **headers: str) -> tuple[int, str]:
    """Return the status of an answer and the cookie that it sets."""
    place = address.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(place, timeout=120)
    try:
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.getheader("Set-Cookie") or ""
    finally:
        connection.close()


def _address(server: subprocess.Popen, log: Path) -> str:
    begun = time.monotonic()
    while not (found := re.search(r"(http://127\.0\.0\.1:\d+/)\?token=", log.read_text())):
        if server.poll() is not None or time.monotonic() - begun > PATIENCE / 1e3:
            raise RuntimeError(log.read_text())
        time.sleep(0.05)
    return found[1]


def apart(work: Callable[[], Any]) -> Any:
    """Return what a function returns in a thread of its own: in that of the tests a browser's event loop may run."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(work).result()


class Window:
    """A window of a size. Its pages are idle tabs of one browser, where there are any: they keep compiled code."""

    def __init__(self, context, width: int, height: int) -> None:
        self.context, self._size = context, {"width": width, "height": height}

    def new_page(self) -> Any:
        """Return an empty page."""
        page = next((page for page in self.context.pages if page.url == _IDLE), None) or self.context.new_page()
        page.set_viewport_size(self._size)
        return page

    def tidy(self, but: Screen | None = None) -> None:
        """Leave all pages but one, and take back what pages were allowed."""
        for page in self.context.pages:
            if page.url != _IDLE and (but is None or page is not but.page):
                page.goto(_IDLE)
        self.context.clear_permissions()


class Screen:
    """A page, and what it has said on its console."""

    def __init__(self, page, address: str, query: str = "") -> None:
        self.page, self.said = page, []
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: self.said.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: self.said.append(f"error: {error}"))
        page.on("request", lambda request: self._asked(request.url, address))
        page.goto(f"{address}?token={TOKEN}{query}")
        page.wait_for_selector(".find-orbit")

    def _asked(self, url: str, address: str) -> None:
        if not url.startswith((address, address.replace("http", "ws"), "data:", "blob:")):
            self.said.append(f"error: asks {url}")

    @property
    def errors(self) -> list[str]:
        """What went wrong by the console, and addresses outside that the page asked."""
        return [line for line in self.said if line.startswith("error")]

    def wait(self, result: str) -> str:
        """Wait for a result in the list and return its line; a line that is being replaced has no text for a moment."""
        line = f".result-{result} .result"
        self.page.wait_for_selector(line)
        self.eventually(lambda: self.page.inner_text(line))
        return self.page.inner_text(line)

    def until_value(self, selector: str, value: float, within: float) -> None:
        """Wait until a field holds a number."""
        begun = time.monotonic()
        while not abs(float(self.page.input_value(selector)) - value) < within:
            assert time.monotonic() - begun < PATIENCE / 1e3, f"{self.page.input_value(selector)}, not {value}"
            self.page.wait_for_timeout(_LOOK)

    def text(self, name: str) -> str:
        """Return the text of a part of the page."""
        self.page.wait_for_selector(f".{name}", state="attached")
        return self.page.evaluate(_TEXT, f".{name}")

    def column(self, figure: str, glyph: str, column: str) -> list:
        """Return a column of what a figure draws; one in a tab is made when a person looks there."""
        self.page.wait_for_function(_IS_THERE, arg=f"{figure}-figure", polling=_LOOK)
        return self.page.evaluate(_COLUMN, [f"{figure}-figure", glyph, column])

    def drawn(self, figure: str) -> None:
        """Wait until a figure is drawn."""
        self.page.wait_for_function(_IS_DRAWN, arg=f"{figure}-figure", polling=_LOOK)

    def click_at(self, figure: str, x: float, y: float) -> None:
        """Click on a place of a figure, in its own coordinates."""
        self.drawn(figure)
        self.page.mouse.click(*self.page.evaluate(_PLACE, [f"{figure}-figure", x, y]))

    def click_mark(self, label: str) -> None:
        """Click on a special point of the diagram, and wait until it is selected."""
        told = self.column("diagram", "marks", "told")
        x, y = (self.column("diagram", "marks", axis)[told.index(label)] for axis in "xy")
        self.click_at("diagram", x, y)
        self.until("selected", label)

    def drag(self, slider: str, moves: int, by: float, frames: int = 1) -> None:
        """Press a slider's handle and move it in steps of some pixels and frames; it is not let go."""
        box = self.page.locator(f".slider-{slider} .noUi-handle").bounding_box()
        x, y = box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for k in range(moves):
            self.page.mouse.move(x + by * k, y)
            self.draw(frames)

    def until(self, name: str, text: str) -> None:
        """Wait until a part of the page has a text."""
        holds = f"([name, text]) => ({_TEXT})(name).includes(text)"
        self.page.wait_for_function(holds, arg=[f".{name}", text], polling=_LOOK)  # each frame would take a processor

    def draw(self, frames: int = 1) -> None:
        """Wait until the browser has drawn some frames."""
        self.page.evaluate(_FRAMES, frames)

    def heard(self) -> None:
        """Wait until the server has taken in what was done so far."""
        self.eventually(lambda: self.page.evaluate("() => heard()"))

    def eventually(self, holds) -> None:
        """Wait until a function returns true."""
        begun = time.monotonic()
        while not holds():
            if time.monotonic() - begun > PATIENCE / 1e3:
                raise AssertionError("it did not come to hold")
            self.page.wait_for_timeout(_LOOK)

    def fill(self, name: str, value: str) -> None:
        """Type into a field and leave it."""
        field = self.page.locator(f".{name} input")
        field.fill(value)
        field.press("Enter")
        field.blur()

    @property
    def results(self) -> list[str]:
        """The names of the results in the list."""
        return self.page.locator(".result b").all_inner_texts()

    def rest(self) -> None:
        """Stop all work, that of the last click too, and wait until none is under way."""
        self.heard()
        stop = self.page.locator(".stop button")
        self.eventually(lambda: stop.evaluate_all(_RESTS))

    def fields(self) -> dict[str, str]:
        """Return what stands in the fields of axes, parameters and the start, by their class."""
        return self.page.evaluate(_SHOWN_FIELDS, _FIELDS)


class SharedPage:
    """A page that tests show one after the other: it is tidied up where that is possible, else opened anew."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.screen: Screen | None = None
        self._of: tuple = ()

    def shown(self, window, folder: Path) -> Screen:
        """Return the page of a copy of a session in a window, as it was when it was opened."""
        if self._of != (window, folder) or not self._tidied():
            self.close()
            copy = folder.with_name(f"{time.time_ns() % 16**12:012x}")
            shutil.copytree(folder, copy)
            self.screen, self._of = Screen(window.new_page(), self.address, f"&session={copy.name}"), (window, folder)
            self.screen.wait("branch1")
            self._url, self._results, self._fields = self.screen.page.url, self.screen.results, self.screen.fields()
        assert self.screen is not None
        self.screen.said.clear()
        return self.screen

    def close(self) -> None:
        """Leave the page, so that the next one is opened anew."""
        if self.screen is not None and not self.screen.page.is_closed():
            self.screen.page.goto(_IDLE)
        self.screen, self._of = None, ()

    def _tidied(self) -> bool:
        """Bring the page back to what it showed first; return whether that is possible."""
        screen = self.screen
        if screen is None or screen.page.is_closed() or screen.page.url != self._url:
            return False
        screen.rest()
        if (shown := screen.results)[: len(self._results)] != self._results:
            return False
        for name in reversed(shown[len(self._results) :]):
            screen.page.click(".undo")
            screen.page.wait_for_selector(f".result-{name}", state="detached")
        for name in {name for name, text in screen.fields().items() if text != self._fields.get(name, text)}:
            screen.fill(name, self._fields[name])
        for tab in ("Orbit", "Results"):
            screen.page.locator(".bk-tab", has_text=tab).first.click()
        screen.page.evaluate(_TAKE, self._results[0])
        screen.until("selected", self._results[0])
        return True
