"""Random actions in two windows on one session: no exception, no lost result, no growing memory."""

import os
import random
import signal
from contextlib import suppress
from pathlib import Path

import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.server import LEFT
from saltus.explorer.session import Session, new_folder
from saltus.explorer.subjects import of_system
from screen import TOKEN, Screen, asked, browser
from selection import guarding
from systems import ball_on_table

pytestmark = [
    pytest.mark.skipif(browser() is None, reason="no Chromium: pages of the explorer are not tested"),
    pytest.mark.campaign,
]

SYSTEMS = {
    "ball": ball_on_table,
    "pendulum": lambda: saltus.HybridSystem.smooth(
        {"x": "v", "v": "-sin(x) - 0.2*v + F*cos(s)"}, {"F": 0.5, "w": 0.7}, phase=("s", "w")
    ),
    "brusselator": lambda: saltus.HybridSystem.smooth(
        {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}, {"A": 1.0, "B": 2.5}
    ),
    "lorenz": lambda: saltus.HybridSystem.smooth(
        {"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}, {"sigma": 10.0, "r": 28.0, "b": 8.0 / 3.0}
    ),
    "spring": lambda: saltus.HybridSystem.smooth({"x": "v", "v": "cos(s) - x - 0.1*v"}, {"w": 0.8}, phase=("s", "w")),
}
GROWTH = 20.0  # megabytes by which the server, the largest worker and each window may grow in a repetition
WHOLE = 200  # actions a system, before a release: the second half is the first again
# Repetitions in one of which the largest worker must grow little. Whether a button is offered depends on how long work
# takes: a repetition may load code that those before did not need, 50 MB for the first branch. A leak shows in each.
REPETITIONS = 3
FEW = 24  # actions in a campaign
# clicks a button if it is offered, at one sitting: it may go between a look and a click
_CLICK = """([one]) => { if (one && one.getBoundingClientRect().width > 0 && !one.disabled) one.click() }"""


class Monkey:
    """Does something in one of two windows."""

    def __init__(self, windows: list[Screen], seed: str) -> None:
        self.windows, self.chance = windows, random.Random(seed)

    def act(self) -> None:
        """Do one thing; buttons that are not offered are passed over."""
        screen = self.chance.choice(self.windows)
        kind = self.chance.choices(["click", "fill", "reload", "wait", "row", "diagram"], [40, 20, 5, 15, 10, 10])[0]
        getattr(self, f"_{kind}")(screen if kind == "wait" else screen.page)

    def _click(self, page) -> None:
        names = ["find-orbit", "find-equilibrium", "continue", "extend", "undo", "sweep", "stop", "switch", "follow"]
        page.locator(f".{self.chance.choice(names)} button").evaluate_all(_CLICK)

    def _fill(self, page) -> None:
        fields = page.locator(".parameter-name ~ * input, [class*=start-] input, .axis-y input, .sweep-values input")
        if fields.count():
            field = fields.nth(self.chance.randrange(fields.count()))
            field.fill(self.chance.choice(["20", "0.5", "max_x", "period", "-1", ""]), force=True)
            field.press("Enter")

    def _reload(self, page) -> None:
        page.reload()
        page.wait_for_selector(".find-orbit")

    def _wait(self, screen: Screen) -> None:
        screen.draw(self.chance.choice([1, 6, 30]))

    def _row(self, page) -> None:
        boxes = page.locator("[class*=show-] input")
        if boxes.count():
            boxes.nth(self.chance.randrange(boxes.count())).click(force=True, no_wait_after=True)

    def _diagram(self, page) -> None:
        box = page.locator(".diagram").bounding_box()
        page.mouse.click(*(box[k] + self.chance.random() * box[size] for k, size in (("x", "width"), ("y", "height"))))


def memory(windows: list[Screen], address: str, server: int) -> dict[str, float]:
    """Return the memory of a server, its workers and the scripts of two windows, in megabytes, once all have rested."""
    empty(windows)
    os.kill(server, signal.SIGUSR1)  # it collects its garbage
    assert asked(address, f"/metadata?token={TOKEN}")[0] == 200  # it answers after that
    found = {"workers": 0.0}
    for status in Path("/proc").glob("[0-9]*/status"):
        with suppress(OSError):  # it has ended meanwhile
            told = dict(line.split(":", 1) for line in status.read_text().splitlines())
            if server in (number := int(told["Pid"]), int(told["PPid"])) and "VmRSS" in told:
                size = int(told["VmRSS"].split()[0]) / 1e3
                found |= {"server": size} if number == server else {"workers": max(found["workers"], size)}
    for number, screen in enumerate(windows):
        cdp = screen.page.context.new_cdp_session(screen.page)
        cdp.send("HeapProfiler.collectGarbage")
        found[f"window {number}"] = cdp.send("Runtime.getHeapUsage")["usedSize"] / 1e6
        cdp.detach()
    return found


def empty(windows: list[Screen]) -> None:
    """Drop all results, one after the other, once nothing is under way: so windows can be compared."""
    for screen in windows:
        screen.rest()
    undo = windows[0].page.locator(".undo button")
    while undo.is_enabled():  # rows of a list that is drawn anew come one by one: their number tells nothing
        undo.click()
        windows[0].heard()
    windows[0].eventually(lambda: not any(screen.results or screen.page.is_visible(".stop") for screen in windows))


def agreed(windows: list[Screen], folder: Path) -> bool:
    """End all work, and return whether windows and folder have the same results."""
    for screen in windows:
        screen.rest()
    try:
        kept = [entry.name for entry in Session.reopened(folder).entries]
    except InputError:  # a result goes just now
        return False
    return all(screen.results == kept and not screen.page.is_visible(".stop") for screen in windows)


@pytest.mark.parametrize(("count", "name"), guarding([(FEW, "ball"), *((WHOLE, name) for name in SYSTEMS)], campaign=1))
def test_random_actions_lose_nothing(window, server, home, name, count):
    address, process = server
    folder = new_folder(home / "saltus" / "explorer")
    Session(of_system(SYSTEMS[name](), name), folder).keep()
    said = len((home / "server.log").read_text())
    windows = [Screen(window.new_page(), address, f"&session={folder.name}") for _ in range(2)]

    def act(times: int) -> None:
        """Do the same things each time this is called, and look whether anything went wrong."""
        monkey = Monkey(windows, f"{name} {count}")
        for _ in range(times):
            monkey.act()
        try:
            windows[0].eventually(lambda: agreed(windows, folder))
        finally:
            print([(screen.results, screen.text("work")) for screen in windows])
        lines = (home / "server.log").read_text()[said:].splitlines()
        assert [line for line in lines if LEFT not in line] == []
        assert [screen.errors for screen in windows] == [[], []]

    if count == FEW:
        act(count)
        return
    act(count // 2)
    grown: dict[str, float] = {}
    for _ in range(REPETITIONS):
        before = memory(windows, address, process.pid)
        act(count // 2)

        def little() -> bool:
            """Return whether server and windows have grown little; a page loaded again is forgotten after a while."""
            after = memory(windows, address, process.pid)
            grown.update({what: round(after[what] - least, 1) for what, least in before.items()})  # noqa: B023
            print(f"{name}, megabytes in {count // 2} actions: {grown}")
            return max(size for what, size in grown.items() if what != "workers") <= GROWTH

        windows[0].eventually(little)
        if grown["workers"] <= GROWTH:
            return
    raise AssertionError(f"the largest worker grows each time: {grown}")
