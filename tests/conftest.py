"""Fixtures: the systems of `systems`, each defined once a run. At the end of a run, what it cost."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read where numpy is imported: threads of small products only wait

from typing import Any

import hypothesis
import pytest

import systems
from saltus.system.hybrid import HybridSystem

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

# type checkers read the first, `make campaign` runs the second; collected, the third would be imported a second time
collect_ignore = ["typing/user_script.py", "campaign", "polynomial.py"]

# compiling makes millions of objects that live on: to look through them as often as by default takes 6 % of the time
gc.set_threshold(50_000, 50, 50)

# a shell ignores Ctrl-C for what it starts in the background, and so do all tests of interrupts then
if threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.default_int_handler)

# the same examples in each run, however busy the machine
hypothesis.settings.register_profile("saltus", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("saltus")


class Costs:
    """How many functions are compiled in a run, how long that takes, and the memory of each process at its largest.

    Attributes
    ----------
    functions : int
        Functions lowered to machine code, in all processes.
    seconds : float
        Time in the compiler, in all processes.
    peaks : list of float
        Largest memory of each process that runs tests, in MiB; none where the system does not tell it.
    """

    def __init__(self) -> None:
        self.functions, self.seconds = 0, 0.0
        self.peaks: list[float] = []

    def pytest_sessionstart(self) -> None:
        """Listen to Numba, once saltus has told it where to keep code."""
        from saltus.system.cache import let_numba_cache

        let_numba_cache()
        from numba.core import event

        from saltus.system.numba_tools.machine_code import LOWERED

        counter = self

        class Lowered(event.Listener):  # type: ignore[misc]
            def on_start(self, event: Any) -> None:
                counter.functions += event.kind == LOWERED or event.data["name"].startswith("native_lowering")

            def on_end(self, event: Any) -> None:
                """Nothing ends that is counted."""

        self._timer = event.TimingListener()
        for kind in (LOWERED, "numba:run_pass"):
            event.register(kind, Lowered())
        event.register("numba:compiler_lock", self._timer)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Add this process's time and memory; a worker sends its numbers."""
        self.seconds += self._timer.duration if self._timer.done else 0.0
        if session.config.getoption("dist", "no") == "no":  # the one that hands tests to workers runs none
            self.peaks += _peak()
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["costs"] = (self.functions, self.seconds, self.peaks)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Add what a worker has cost."""
        functions, seconds, peaks = getattr(node, "workeroutput", {}).get("costs", (0, 0.0, []))
        self.functions, self.seconds = self.functions + functions, self.seconds + seconds
        self.peaks += peaks

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Print the numbers."""
        terminalreporter.write_line(f"compiled: {self.functions} functions in {self.seconds:.0f} s")
        if self.peaks:
            terminalreporter.write_line(f"peak memory: {', '.join(f'{peak:.0f}' for peak in self.peaks)} MiB")


def _peak() -> list[float]:
    """Return the largest memory of this process, in MiB."""
    if resource is None:
        return []
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return [resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit]


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Costs(), "costs")


COMPILES_NOTHING = {"test_prose.py", "test_structure.py", "test_package.py", "test_typing.py"}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin the second half with what compiles nothing: two workers would compile the same kernels at the same time."""
    waiting = [item for item in items if item.path.name in COMPILES_NOTHING]
    others = [item for item in items if item.path.name not in COMPILES_NOTHING]
    first = min(len(items) // 2, len(others))
    items[:] = [*others[:first], *waiting, *others[first:]]


@pytest.fixture(scope="session")
def afm1() -> HybridSystem:
    return systems.afm(1)


@pytest.fixture(scope="session")
def afm2() -> HybridSystem:
    return systems.afm(2)


@pytest.fixture(scope="session")
def ball() -> HybridSystem:
    return systems.ball()


@pytest.fixture(scope="session")
def ball_on_table() -> HybridSystem:
    return systems.ball_on_table()


@pytest.fixture(scope="session")
def impact_oscillator() -> HybridSystem:
    return systems.impact_oscillator()


@pytest.fixture(scope="session")
def duffing() -> HybridSystem:
    return systems.duffing()


@pytest.fixture(scope="session")
def two_fields() -> HybridSystem:
    return systems.two_fields()


@pytest.fixture(scope="session")
def stick_slip() -> HybridSystem:
    return systems.stick_slip()


@pytest.fixture(scope="session")
def relay() -> HybridSystem:
    return systems.relay()
