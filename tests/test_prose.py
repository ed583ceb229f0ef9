"""What pages say is true: files that they name exist, what is public is on its page, figures are those of their tables.

A measured figure in prose is followed by a comment that says where it comes from, which readers do not see:
``8.7 us<!-- benchmarks: Basins: how fast | a motion of Fig. 9's plane, one core | min -->``. That is a section of
benchmarks/README.md, the beginning of one row's first cell there, and a column. A section alone stands for its text.
The figure must be one of the numbers there, perhaps rounded. "... a second" is one over a time.

Other sources are a constant, ``<!-- code: saltus.scales.RECURS -->``, and a test whose text has the number,
``<!-- tests: basins/measures/test_entropy.py | test_name -->``.
"""

import ast
import inspect
import pkgutil
import re
import runpy
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

import saltus
from saltus import afm, plotting
from saltus.basins import map_basins
from saltus.continuation.core.point_types import POINT_TYPES

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "saltus"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += [page for folder in ("theory", "afm", "elsewhere") for page in sorted((ROOT / "docs" / folder).glob("*.md"))]

FILE = re.compile(r"`([\w./-]+\.pyi?)`")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
ANCHOR = re.compile(r"\]\(([^)#:]*)#([^)]+)\)")


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def anchors_of(page):
    """Names of the headings of a page, as GitHub makes them."""
    headings = HEADING.findall(re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", ["docs/architecture.md", "docs/glossary.md", "CONTRIBUTING.md"])
def test_files_that_the_page_names_exist(page):
    named = set(FILE.findall(text_of(page)))
    missing = {name for name in named if not ((PACKAGE / name).exists() or (ROOT / name).exists())}
    assert named
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_names_of_the_package_on_a_page_exist(page):
    for name in re.findall(r"`(saltus(?:\.\w+)+)`", page.read_text(encoding="utf-8")):
        assert pkgutil.resolve_name(name) is not None


def test_the_map_of_files_is_the_one_that_its_tool_writes():
    tool = runpy.run_path(str(ROOT / "tools" / "file_map.py"))
    assert tool["page"]() == text_of("docs/files.md"), "run python tools/file_map.py"


def test_the_page_of_benchmarks_is_the_one_that_its_tool_writes():
    tool = runpy.run_path(str(ROOT / "tools" / "bench_page.py"))
    assert tool["page"]() == text_of("docs/benchmarks_over_time.md"), "run python tools/bench_page.py"


def test_the_architecture_stays_short():
    assert len(text_of("docs/architecture.md").splitlines()) <= 200


def test_the_table_of_floors_is_the_contract():
    contracts = tomllib.loads(text_of("pyproject.toml"))["tool"]["importlinter"]["contracts"]
    floors = [set(layer.split(" | ")) for layer in contracts[0]["layers"]]
    rows = re.findall(r"^\| \d+ \| (.*?) \|", text_of("CONTRIBUTING.md"), re.MULTILINE)
    assert [set(re.findall(r"`(\w+)`", row)) for row in rows] == floors


@pytest.mark.parametrize("module", [saltus, afm], ids=lambda module: module.__name__)
def test_every_public_function_has_its_path_in_the_architecture(module):
    page = text_of("docs/architecture.md")
    every = {name: getattr(module, name) for name in module.__all__}
    public = [name for name, value in every.items() if callable(value) and not isinstance(value, type)]
    assert public
    assert not [name for name in public if f"`{name}`" not in page]


def test_every_kind_of_result_that_is_drawn_is_on_the_page_of_pictures():
    rows = re.findall(r"^\| `(\w+)` \| `plot\(", text_of("docs/theory/plotting.md"), re.MULTILINE)
    assert sorted(rows) == sorted(kind.rpartition(".")[2] for kind in plotting._HOMES)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_within_pages_lead_to_headings(page):
    for target, anchor in ANCHOR.findall(page.read_text(encoding="utf-8")):
        other = page if not target else (page.parent / target).resolve()
        assert anchor in anchors_of(other), f"{target}#{anchor}"


def test_every_end_of_a_segment_is_in_the_table_of_end_conditions():
    table = text_of("docs/theory/orbits.md").partition("$E_i$ is of one of")[2].partition("\n\n**")[0]
    kinds = re.findall(r"^(\w+)_END = \d", text_of(PACKAGE / "orbits" / "signature.py"), re.MULTILINE)
    told = [row.replace("mean rate", "mean").upper() for row in re.findall(r"^\| ([a-z ]+?) \|", table, re.MULTILINE)]
    assert sorted(told) == sorted(["KIND", *kinds])


def test_the_glossary_has_every_type_of_special_point():
    table = text_of("docs/glossary.md").partition("## Names of special points")[2].partition("\n## ")[0]
    told = {name.strip() for row in re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE) for name in row.split(",")}
    assert set(POINT_TYPES) <= told


def test_every_entry_of_the_glossary_says_where_more_stands():
    lists = text_of("docs/glossary.md").partition("## Definition")[2]
    entries = [entry.partition("\n\n")[0] for entry in re.split(r"^- (?=\*\*)", lists, flags=re.MULTILINE)[1:]]
    assert len(entries) > 80
    assert not [entry for entry in entries if "](" not in entry and not FILE.search(entry)]


# constants

FOLDERS = sorted({str(file.parent.relative_to(PACKAGE)) for file in PACKAGE.rglob("*.py")})


@pytest.mark.parametrize("folder", FOLDERS)
def test_each_constant_of_a_module_stands_on_a_line_of_its_own(folder):
    shared = [
        f"{file.name}:{node.lineno}"
        for file in sorted((PACKAGE / folder).glob("*.py"))
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
        and (len(node.targets) > 1 or (isinstance(node.targets[0], ast.Tuple) and not isinstance(node.value, ast.Call)))
    ]
    assert not shared


# sentences

MOST_WORDS = 25  # of a sentence, in which a formula or a piece of code counts as one word


def sentences(text):
    """Sentences of a page, without code, tables, displayed formulas and references."""
    text = re.sub(r"^```.*?^```", "", text.partition("\n## References")[0], flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\$\$.*?\$\$|<!--.*?-->", " ", text, flags=re.DOTALL)
    for part in re.split(r"\n\s*\n|\n(?=\s*[-*|] |\s*#|\s*\d+\. )", text):
        if not part.lstrip().startswith(("|", "#", "!")):
            part = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(part.split()))
            yield from re.split(r"(?<=[.!?:;]) ", re.sub(r"\$[^$]*\$|`[^`]*`", "X", part))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_sentences_are_short(page):
    text = page.read_text(encoding="utf-8")
    assert not [said for said in sentences(text) if len(re.findall(r"[\w'-]+", said)) > MOST_WORDS]


def docstrings(file):
    """Texts of a module's docstrings, without references and examples, paragraph by paragraph."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and (text := ast.get_docstring(node)):
            text = re.split(r"\n(?:References|Examples)\n-+", text)[0]
            text = re.sub(r"\n\w+\n-{3,}\n", "\n\n", text)
            yield from re.split(r"\n\s*\n|\n(?=\S[^\n]* : )|(?<= )\w[^\n]* : [^\n]*\n|\n(?=\s*- )", text)


@pytest.mark.parametrize("folder", FOLDERS)
def test_sentences_of_docstrings_are_short(folder):
    long = []
    for file in sorted((PACKAGE / folder).glob("*.py")):
        for part in docstrings(file):
            if not part.lstrip().startswith("==="):
                said = re.sub(r"``[^`]*``|`[^`]*`|\([^)]*\)", "X", " ".join(part.split()))
                each = re.split(r"(?<=[.!?:;]) ", said)
                long += [(file.name, one) for one in each if len(re.findall(r"[\w'-]+", one)) > MOST_WORDS]
    assert not long


# figures

MARK = re.compile(r"<!-- (benchmarks|code|tests):\s+([^>]*?)\s+-->")
QUANTITY = re.compile(r"(\d+(?: \d{3})*(?:\.\d+)?(?:e-?\d+)?)\s*(a second|us|ms|s\b|%|GiB)?")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
FIGURES = [
    (page.name, text[: mark.start()][-60:], " ".join(mark[2].split()), mark[1])
    for page in PAGES
    for text in [page.read_text(encoding="utf-8")]
    for mark in MARK.finditer(text)
]


def quantities(text):
    """Numbers in a text as (value, half a unit of its last digit, unit), of which "10.8; 6.1 s" has the unit twice."""
    found = []
    text = re.sub(r"10\^\{?(-?\d+)\}?", r"1e\1", text)
    for digits, unit in reversed(QUANTITY.findall(text)):
        unit = unit or (found[-1][2] if found else "")
        mantissa, _, exponent = digits.replace(" ", "").partition("e")
        zeros = len(mantissa) - len(mantissa.rstrip("0")) if "." not in mantissa else 0
        digit = 10.0 ** (zeros - len(mantissa.partition(".")[2]) + int(exponent or 0))
        found.append((float(f"{mantissa}e{exponent or 0}"), 0.5 * digit, unit))
    return found[::-1]


def in_seconds(value, unit):
    return value * SECONDS[unit] if unit in SECONDS else value


def same(figure, source):
    value, rounding, unit = figure
    if unit == "a second":
        return source[2] in SECONDS and abs(value - 1.0 / in_seconds(source[0], source[2])) <= rounding
    if unit != source[2] and not {unit, source[2]} <= set(SECONDS) and "" not in (unit, source[2]):
        return False
    at, width = in_seconds(value, unit), in_seconds(rounding, unit)
    return abs(at - in_seconds(source[0], source[2])) <= width * (1.0 + 1e-9)


def table_cell(section, row, column):
    """The cell of a table of the benchmarks, by the beginning of its row's first cell and its column's name."""
    cells = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in section.splitlines() if "|" in line]
    heads = [above for above, below in pairwise(cells) if set("".join(below)) <= set("-| ")]
    head, found = None, []
    for line in cells:
        head = line if line in heads else head
        if line is not head and head and column in head and line[0].startswith(row):
            found.append(line[head.index(column)])
    assert len(found) == 1, f"{row}: {len(found)} rows with a column {column}"
    return found[0]


def source_of(mark, kind="benchmarks"):
    if kind == "code":
        return repr(float(pkgutil.resolve_name(mark)))
    section, *place = mark.split(" | ")
    if kind == "tests":
        (found,) = re.findall(rf"^def {place[0]}\(.*?(?=\n\n\n|\Z)", text_of(f"tests/{section}"), re.DOTALL | re.M)
        return found
    text = text_of("benchmarks/README.md").partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    assert text, f"no section {section}"
    return table_cell(text, *place) if place else text


@pytest.mark.parametrize(("page", "before", "mark", "kind"), FIGURES, ids=[" ".join(figure[::2]) for figure in FIGURES])
def test_a_figure_in_prose_is_that_of_its_source(page, before, mark, kind):
    figure = quantities(before)[-1]
    if kind == "code" and figure[2] == "%":
        figure = (figure[0] / 100.0, figure[1] / 100.0, "")
    source = source_of(mark, kind)
    assert any(same(figure, each) for each in quantities(source)), f"{page}: ...{before!r} is not in {source!r}"


@pytest.mark.parametrize(
    "page", ["README.md", "basins.md", "basins_at_scale.md", "sweeps.md", "orbits.md", "integrity.md", "lyapunov.md"]
)
def test_pages_with_measured_figures_say_whence_they_are(page):
    assert [name for name, *_ in FIGURES].count(page) >= 2


def test_the_docstring_of_basins_tells_how_many_labels_were_wrong():
    said = " ".join((map_basins.__doc__ or "").split())
    cells = 20_000
    assert "of 20 000 random cells" in said
    rows = {"0 per cent": "Fig. 9,", "0.015 per cent": "Fig. 10, q2 = 3.12", "0.02 per cent": "[-5, 5]^4"}
    for share, row in rows.items():
        assert share in said
        counts = quantities(source_of(f"Basins: how true | {row} | wrong"))
        assert max(count for count, _, _ in counts) == pytest.approx(0.01 * float(share.split()[0]) * cells, abs=1e-9)


def test_a_figure_that_is_not_in_its_table_is_seen():
    (cell,) = quantities("15.4 us")
    assert same((65000.0, 500.0, "a second"), cell)
    assert not same((66000.0, 500.0, "a second"), cell)
    assert same((15.0, 0.5, "us"), cell)
    assert not same((15.3, 0.05, "us"), cell)
    assert not same((15.4, 0.05, "ms"), cell)


def public_functions():
    """Functions of the front door, and methods of its classes, that take arguments."""
    for module in (saltus, saltus.options, saltus.results, afm):
        for name in module.__all__:
            found = getattr(module, name)
            if inspect.isclass(found) and not issubclass(found, Exception):
                members = {f"{name}.{key}": value for key, value in inspect.getmembers(found) if key[0] != "_"}
            else:
                members = {name: found}
            for called, value in members.items():
                if (inspect.isfunction(value) or inspect.ismethod(value)) and set(
                    inspect.signature(value).parameters
                ) - {"self", "cls"}:
                    yield pytest.param(value, id=called)


@pytest.mark.parametrize("function", list(public_functions()))
def test_a_public_function_tells_what_it_takes_returns_and_raises(function):
    told = inspect.getdoc(function)
    for section in ("Parameters", "Returns", "Raises"):
        assert f"\n{section}\n{'-' * len(section)}\n" in told, section
