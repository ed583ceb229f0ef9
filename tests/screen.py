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
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

TOKEN = "a-token-of-tests"
PATIENCE = 120_000  # milliseconds that a busy machine may need
_SERVER = "import sys; from saltus.cli import main; main(sys.argv[1:])"

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


def closed(window) -> None:
    """Close all pages of a window, and take back what it was allowed."""
    for page in window.pages:
        page.close()
    window.clear_permissions()


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
            self.page.wait_for_timeout(20)

    def text(self, name: str) -> str:
        """Return the text of a part of the page."""
        self.page.wait_for_selector(f".{name}", state="attached")
        return self.page.evaluate(_TEXT, f".{name}")

    def column(self, figure: str, glyph: str, column: str) -> list:
        """Return a column of what a figure draws."""
        return self.page.evaluate(_COLUMN, [f"{figure}-figure", glyph, column])

    def click_at(self, figure: str, x: float, y: float) -> None:
        """Click on a place of a figure, in its own coordinates."""
        self.page.mouse.click(*self.page.evaluate(_PLACE, [f"{figure}-figure", x, y]))

    def click_mark(self, label: str) -> None:
        """Click on a special point of the diagram, and wait until it is selected."""
        told = self.column("diagram", "marks", "told")
        x, y = (self.column("diagram", "marks", axis)[told.index(label)] for axis in "xy")
        self.click_at("diagram", x, y)
        self.until("selected", label)

    def until(self, name: str, text: str) -> None:
        """Wait until a part of the page has a text."""
        self.page.wait_for_function(f"([name, text]) => ({_TEXT})(name).includes(text)", arg=[f".{name}", text])

    def eventually(self, holds) -> None:
        """Wait until a function returns true."""
        begun = time.monotonic()
        while not holds():
            if time.monotonic() - begun > PATIENCE / 1e3:
                raise AssertionError("it did not come to hold")
            self.page.wait_for_timeout(50)

    def fill(self, name: str, value: str) -> None:
        """Type into a field and leave it."""
        field = self.page.locator(f".{name} input")
        field.fill(value)
        field.press("Enter")
        field.blur()
