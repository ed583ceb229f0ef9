"""Public calls on random hybrid systems, watched from outside: how each ends, in what time and memory.

Processes of their own work through the systems. A call that runs for longer than `SECONDS` of its processor, or takes
more than `BYTES` of memory beyond what stood there, is stopped with a note where it was. The checks by SciPy count for
neither.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path

from measure import machine
from random_calls import CALLS, Ending, Work, ending_of
from random_systems import draw

SECONDS = 60.0  # processor time of a call, compilation included
BYTES = 2 * 2**30  # resident memory that a call may add
PATIENCE = 10.0  # wall time over SECONDS after which a call that uses no processor, or a check, is stopped, too
GENERATION = 20  # systems after which a process is replaced


def serve(connection: Connection, seed: int, notes: str) -> None:
    """Work on the systems and calls asked for until the other side hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    work: Work | None = None
    with Path(notes).open("w") as file:
        faulthandler.register(signal.SIGUSR1, file=file, all_threads=False)
        while True:
            try:
                number, call = connection.recv()
            except EOFError:
                return
            if work is None or work.drawn.number != number:
                work = Work(draw(seed, number), connection.send)
            connection.send(ending_of(work, call))


@dataclass
class Process:
    """A process at work, seen from outside."""

    seed: int
    queue: deque[int]
    wanted: tuple[str, ...]
    calls: list[str] = field(default_factory=list)
    number: int = -1
    done: int = 0

    def __post_init__(self) -> None:
        self.notes = tempfile.NamedTemporaryFile(suffix=".txt")  # noqa: SIM115 (closed with the process)
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs, self.seed, self.notes.name), daemon=True)
        self.process.start()
        theirs.close()
        self.done = 0

    def next(self) -> bool:
        """Ask for the next call, of the next system where one is done; False where none is left."""
        if not self.calls:
            if not self.queue:
                self.connection.close()
                return False
            if self.done >= GENERATION:
                self.end()
                self._start()
            self.number, self.calls = self.queue.popleft(), list(self.wanted)
            self.done += 1
        self._begin(False)
        self.highest = 0
        self.connection.send((self.number, self.calls[0]))
        return True

    def _begin(self, asked: bool) -> None:
        self.asked, self.begun, self.cpu, self.memory = asked, time.perf_counter(), self._cpu(), self._memory()

    def _cpu(self) -> float:
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(") ", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def _memory(self) -> int:
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def look(self) -> Ending | None:
        """Return how the call ended, where it did or where it must."""
        about = str(draw(self.seed, self.number))
        if self.connection.poll():
            try:
                ending: Ending | bool = self.connection.recv()
            except EOFError:
                self.process.join()
                return self._stopped(about, "crash", f"exit code {self.process.exitcode}")
            if isinstance(ending, bool):
                self._begin(ending)
                return None
            self.calls.pop(0)
            return Ending(**{**vars(ending), "mib": self.highest / 2**20})
        try:
            cpu, memory = self._cpu() - self.cpu, self._memory() - self.memory
        except (FileNotFoundError, ProcessLookupError):
            return None  # the pipe tells in a moment
        self.highest = max(self.highest, memory if self.asked else 0)
        if (self.asked and cpu > SECONDS) or time.perf_counter() - self.begun > PATIENCE * SECONDS:
            return self._stopped(about, "slow" if self.asked else "no check", self._where())
        if self.highest > BYTES:
            return self._stopped(about, "memory", self._where())
        return None

    def _where(self) -> str:
        """Return where in Python the process is."""
        os.kill(int(self.process.pid or 0), signal.SIGUSR1)
        time.sleep(0.5)
        lines = [line.strip() for line in Path(self.notes.name).read_text().splitlines() if "saltus" in line]
        return " < ".join(line.split("saltus/")[-1] for line in lines[:4]) or "in compiled code"

    def _stopped(self, about: str, kind: str, text: str) -> Ending:
        seconds = time.perf_counter() - self.begun
        call = self.calls.pop(0)
        if call == "find_orbit" and self.calls and self.calls[0] == "continue_orbit":
            self.calls.pop(0)  # the orbit went with the process
        self.end()
        self._start()
        return Ending(self.number, about, call, kind, text, seconds, self.highest / 2**20)

    def end(self) -> None:
        """Stop the process."""
        self.connection.close()
        self.process.kill()
        self.process.join()


def endings(numbers: range, seed: int, processes: int, calls: tuple[str, ...] = CALLS) -> Iterator[Ending]:
    """Yield how each call on each system ended, as they come."""
    queue = deque(numbers)
    working = [Process(seed, queue, calls) for _ in range(min(processes, len(numbers)))]
    try:
        working = [p for p in working if p.next()]
        while working:
            wait([p.connection for p in working], timeout=0.05)
            for p in list(working):
                if (ending := p.look()) is not None:
                    yield ending
                    if not p.next():
                        working.remove(p)
                        p.end()
    finally:
        for p in working:
            p.end()


@dataclass
class Table:
    """Endings so far."""

    found: list[Ending] = field(default_factory=list)

    def troubled(self) -> list[tuple[Ending, str]]:
        """Return endings that should not be, and checks that failed, each with what is wrong."""
        wrong = ("stray", "long", "slow", "memory", "crash", "no check")
        bad = [(e, f"{e.kind}: {e.text}") for e in self.found if e.kind.startswith(wrong)]
        return bad + [
            (e, f"{name}: {text}") for e in self.found for name, text in e.checks if text and "too short" not in text
        ]

    def show(self, asked: int, seed: int, seconds: float) -> None:
        """Print how many calls ended how, how many checks held, and each trouble."""
        print(f"\n{machine()}")
        print(f"{len({e.number for e in self.found})} of {asked} systems, seed {seed}, {seconds:.0f} s")
        for call in CALLS:
            mine = [e for e in self.found if e.call == call]
            if not mine:
                continue
            slowest, largest = max(mine, key=lambda e: e.seconds), max(mine, key=lambda e: e.mib)
            counts = ", ".join(f"{count} {kind}" for kind, count in Counter(e.kind for e in mine).most_common())
            print(f"  {call:18} {counts}")
            print(
                f"  {'':18} longest {slowest.seconds:.1f} s (system {slowest.number}), "
                f"{largest.mib:.0f} MiB (system {largest.number})"
            )
            checks = Counter((name, _verdict(text)) for e in mine for name, text in e.checks)
            for name in sorted({name for name, _ in checks}):
                told = ", ".join(
                    f"{checks[name, v]} {v}" for v in ("agree", "ill conditioned", "differ") if checks[name, v]
                )
                print(f"  {'':18}   {name}: {told}")
        bad = sorted(self.troubled(), key=lambda pair: (pair[0].number, CALLS.index(pair[0].call)))
        print(f"{len(bad)} in trouble")
        for e, what in bad:
            print(f"  system {e.number} ({e.about}), {e.call}: {what}")


def _verdict(text: str) -> str:
    return "agree" if not text else "ill conditioned" if "too short" in text else "differ"


def run(numbers: range, seed: int, processes: int, calls: tuple[str, ...] = CALLS) -> None:
    """Work through the systems and print the table."""
    table, begin = Table(), time.perf_counter()
    try:
        for ending in endings(numbers, seed, processes, calls):
            table.found.append(ending)
            done, bad = len({e.number for e in table.found}), len(table.troubled())
            if sys.stderr.isatty():
                print(f"\r{done} of {len(numbers)} systems, {bad} in trouble", end="", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
    table.show(len(numbers), seed, time.perf_counter() - begin)
