"""The structure: no cycles of imports, texts that name their sources, sizes, a test for each place."""

from __future__ import annotations

import ast
import inspect
import statistics
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import saltus
from saltus import afm
from saltus.ensemble import compiled as ensemble
from saltus.system import compiled as system

PACKAGE = Path(saltus.__file__).parent

WRITERS = {
    system.FLOW: "system.writing.codegen",
    system.SECOND_DERIVATIVES: "system.writing.codegen",
    system.GRADIENTS: "system.writing.gradient_writer",
    system.SERIES: "system.writing.series_writer",
    system.LINEAR: "system.writing.series_writer",
    ensemble.LANES: "ensemble.writer",
}

INNOCENT = {
    "checks",
    "checks.numeric",
    "checks.objects",
    "checks.textual",
    "errors",
    "system.accelerations",
    "system.definition",
    "system.mechanics",
    "system.parts",
}
"""What says no more than whether a definition can be used; the definition itself is in the name of a file."""


@cache
def modules() -> dict[str, Path]:
    names = {}
    for file in PACKAGE.rglob("*.py"):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        names[".".join(part for part in parts if part != "__init__")] = file
    return names


@cache
def imports(name: str, *, typing: bool = True) -> frozenset[str]:
    """Modules that a module imports, wherever in it; with `typing` those that only a type checker imports as well."""
    tree = ast.parse(modules()[name].read_text(encoding="utf-8"))
    return frozenset(found for found in _imported(tree, typing) if found != name)


def _imported(tree: ast.AST, typing: bool) -> Iterator[str]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING" and not typing:
            continue
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "saltus":
            home = (node.module or "").partition(".")[2]
            for alias in node.names:
                inner = f"{home}.{alias.name}".lstrip(".")
                yield inner if inner in modules() else home
        elif isinstance(node, ast.Import):
            yield from (a.name.partition(".")[2] for a in node.names if a.name.partition(".")[0] == "saltus")
        yield from _imported(node, typing)


def reached(start: str, *, typing: bool) -> set[str]:
    found, waiting = set(), [start]
    while waiting:
        for name in imports(waiting.pop(), typing=typing) - found:
            found.add(name)
            waiting.append(name)
    return found


@pytest.mark.parametrize("name", sorted(modules()))
def test_no_module_imports_itself_by_any_way(name):
    assert name not in reached(name, typing=True)


@pytest.mark.parametrize("kind", WRITERS, ids=lambda kind: kind.name)
def test_a_generated_text_names_all_modules_it_comes_from(kind):
    starts = (WRITERS[kind], "system.derivatives")
    wanted = set(starts).union(*(reached(start, typing=False) for start in starts))
    assert set(kind.sources) == wanted - INNOCENT - {"", "system", "system.writing", "ensemble"}


def test_a_change_in_the_ensemble_leaves_the_other_texts_valid():
    for kind in WRITERS:
        assert kind is ensemble.LANES or not any(source.startswith("ensemble") for source in kind.sources)


# sizes

LONGEST_MODULE = 450  # lines
MEDIAN_MODULE = 180  # lines
LONGEST_FUNCTION = 80  # lines, without the docstring
MOST_MODULES = 30  # in a folder, its own file apart
MOST_ARGUMENTS = 12  # of a compiled function
MOST_PAIRS = 3  # of places with the same lines of code
SAME_LINES = 6  # that make a pair


def functions(name: str) -> Iterator[tuple[ast.FunctionDef, int]]:
    """Functions of a module, and their lines without docstrings."""
    for node in ast.walk(ast.parse(modules()[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            lines = (node.end_lineno or 0) - node.lineno + 1
            if ast.get_docstring(node) is not None:
                lines -= (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
            yield node, lines


def test_modules_can_be_read_at_one_sitting():
    lines = {name: len(file.read_text(encoding="utf-8").splitlines()) for name, file in modules().items()}
    assert {name: count for name, count in lines.items() if count > LONGEST_MODULE} == {}
    assert statistics.median(lines.values()) <= MEDIAN_MODULE


def test_folders_can_be_looked_over():
    counts = Counter(file.parent for file in modules().values() if file.stem != "__init__")
    assert {str(home.relative_to(PACKAGE)): count for home, count in counts.items() if count > MOST_MODULES} == {}


@pytest.mark.parametrize("name", sorted(modules()))
def test_functions_fit_on_a_page(name):
    assert {node.name: lines for node, lines in functions(name) if lines > LONGEST_FUNCTION} == {}


@pytest.mark.parametrize("name", sorted(name for name in modules() if ".kernels." in name))
def test_compiled_functions_take_few_arguments(name):
    counts = {node.name: len(node.args.args) for node, _ in functions(name)}
    assert {function: count for function, count in counts.items() if count > MOST_ARGUMENTS} == {}


# the same lines twice


def lines_of_code(file: Path) -> list[tuple[int, str]]:
    """Numbers and texts of a module's lines without docstrings, imports, signatures, comments and single brackets."""
    text = file.read_text(encoding="utf-8")
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        ):
            left_out |= set(range(node.lineno, (node.end_lineno or 0) + 1))
        elif isinstance(node, ast.FunctionDef):
            left_out |= set(range(node.lineno, node.body[0].lineno))
    stripped = ((number, line.partition("  # ")[0].strip()) for number, line in enumerate(text.splitlines(), 1))
    return [
        (number, line) for number, line in stripped
        if number not in left_out and len(line) > 1 and not line.startswith("#")
    ]  # fmt: skip


def test_the_same_lines_of_code_stand_in_few_places() -> None:
    known: dict[tuple[str, ...], tuple[str, int]] = {}
    pairs: dict[tuple[str, str, int], tuple[int, int]] = {}
    for name, file in sorted(modules().items()):
        lines = lines_of_code(file)
        for k in range(len(lines) - SAME_LINES + 1):
            number = lines[k][0]
            other, place = known.setdefault(tuple(line for _, line in lines[k : k + SAME_LINES]), (name, number))
            if (other, place) != (name, number):
                pairs.setdefault((other, name, number - place), (place, number))
    assert len(pairs) <= MOST_PAIRS, pairs


# a test for each place

TESTS = Path(__file__).parent
BESIDE = {"kernels", "sets", "typing"}
"""Folders that are tested with the package that they lie in: compiled loops, files of values."""


def covered(folder: Path) -> set[str]:
    """Names of what the test files in a folder are about, with those of its folders that have some."""
    return {file.stem.removeprefix("test_") for file in folder.glob("test_*.py")} | {
        inner.name for inner in folder.glob("*/") if any(inner.rglob("test_*.py"))
    }


def test_each_package_has_a_folder_of_tests_or_a_file_of_its_name():
    packages = [file.parent.relative_to(PACKAGE) for file in PACKAGE.rglob("__init__.py")]
    with_code = [home for home in packages if home.parts and home.name not in BESIDE]
    assert [str(home) for home in with_code if home.name not in covered(TESTS / home.parent)] == []


def test_each_module_beside_the_packages_has_a_file_of_its_name():
    doors = {file.stem for file in PACKAGE.glob("*.pyi")}  # test_doors.py opens them all
    alone = {file.stem for file in PACKAGE.glob("*.py")} - {"__main__", "version"} - doors
    assert alone - covered(TESTS) == set()


@pytest.mark.parametrize("door", [saltus, afm], ids=["saltus", "saltus.afm"])
def test_each_public_function_has_a_file_of_its_module_s_name(door):
    missing = {}
    for function in (getattr(door, name) for name in door.__all__):
        if inspect.isfunction(function):
            home = Path(*function.__module__.split(".")[1:])
            if home.name not in covered(TESTS / home.parent):
                missing[function.__name__] = str(home)
    assert missing == {}
