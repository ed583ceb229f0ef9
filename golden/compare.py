"""Hold two folders of golden numbers against each other: python golden/compare.py BEFORE AFTER [--digits 12].

Prints what differs, and ends with 1 where anything does. Calls are paired by the test's name without its file, so that
tests may move. With --digits, numbers may differ in the digits behind; counts and texts must be equal even so.
"""

from __future__ import annotations

import argparse
import gzip
import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any


def read(folder: Path) -> dict[str, list[Any]]:
    """Return the calls of each test, of all processes."""
    calls: dict[str, list[Any]] = {}
    for file in sorted(folder.glob("*.json.gz")):
        for test, made in json.loads(gzip.decompress(file.read_bytes()))["calls"].items():
            calls.setdefault(test, []).extend(made)
    return calls


def differs(before: dict[str, Any], after: dict[str, Any], digits: int | None) -> list[str]:
    """Return the names of the leaves that differ."""
    names = sorted(before.keys() | after.keys())
    return [name for name in names if not _equal(before.get(name), after.get(name), digits)]


def _equal(a: Any, b: Any, digits: int | None) -> bool:
    if a is None or b is None or digits is None or len(a) < 4 or len(b) < 4:
        return bool(a == b)
    if a[1] != b[1]:
        return False
    return bool(all(abs(x - y) <= 10.0**-digits * max(a[3], b[3]) for x, y in zip(a[2:], b[2:], strict=True)))


def unpaired(before: list[Any], after: list[Any]) -> tuple[list[Any], list[Any]]:
    """Return the calls of a test that have no equal one on the other side, whatever their order."""

    def texts(calls: list[Any]) -> Counter[str]:
        return Counter(json.dumps(call, sort_keys=True) for call in calls)

    one, other = texts(before), texts(after)
    return (
        [json.loads(text) for text in (one - other).elements()],
        [json.loads(text) for text in (other - one).elements()],
    )


def unknown_numbers(before: dict[str, list[Any]], after: dict[str, list[Any]]) -> tuple[int, list[str]]:
    """Return how many calls there are after, and those whose numbers no call had before, in whatever test."""

    def numbers(call: list[Any]) -> str:
        name, leaves = call
        return json.dumps([name, {path: leaf for path, leaf in leaves.items() if len(leaf) > 1}], sort_keys=True)

    known = {numbers(call) for calls in before.values() for call in calls}
    made = [(test, call) for test, calls in after.items() for call in calls]
    new = [(test, call) for test, call in made if any(len(leaf) > 1 for leaf in call[1].values())]
    return len(made), [f"{test}: {call[0]}" for test, call in new if numbers(call) not in known]


def main() -> int:
    """Compare two folders and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--digits", type=int, help="decimal digits, relative, to which numbers must agree")
    parser.add_argument("--most", type=int, default=40, help="lines to print")
    parser.add_argument("--numbers", action="store_true", help="numbers alone, whichever test asks for them")
    given = parser.parse_args()
    before, after = read(given.before), read(given.after)
    if given.numbers:
        count, lines = unknown_numbers(before, after)
        print(f"{count} calls after; numbers of {len(lines)} are none of those before")
        print("\n".join(lines[: given.most]))
        return 1 if lines else 0
    lines = []
    gone, new = sorted(before.keys() - after.keys()), sorted(after.keys() - before.keys())
    equal = 0
    for test in sorted(before.keys() & after.keys()):
        one, other = unpaired(before[test], after[test])
        equal += len(before[test]) - len(one)
        for k in range(max(len(one), len(other))):
            if k >= min(len(one), len(other)):
                lines.append(f"{test}: {len(one)} calls before, {len(other)} after")
                break
            (name, leaves), (again, others) = one[k], other[k]
            if name != again:
                lines.append(f"{test}: {name} before, {again} after")
            elif found := differs(leaves, others, given.digits):
                lines.append(f"{test}: {name}: {', '.join(found[:8])}")
            else:
                equal += 1
    print(f"{len(before)} and {len(after)} tests; {equal} calls equal, {len(lines)} different")
    for title, names in (("only before", gone), ("only after", new)):
        if names:
            print(f"{title}: {len(names)} tests, as {', '.join(names[:5])}")
    print("\n".join(lines[: given.most]))
    return 1 if lines or gone else 0


if __name__ == "__main__":
    sys.exit(main())
