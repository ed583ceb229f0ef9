"""What pages say of the code is true: the files that they name exist, and what is public is on its page."""

import re
from pathlib import Path

import pytest

import saltus
from saltus import afm, plotting

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "saltus"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "docs" / "theory").glob("*.md"))

FILE = re.compile(r"`([\w./-]+\.pyi?)`")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
ANCHOR = re.compile(r"\]\(([^)#:]*)#([^)]+)\)")


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def anchors_of(page):
    """Names of the headings of a page, as GitHub makes them."""
    headings = HEADING.findall(re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", ["docs/architecture.md", "docs/glossary.md"])
def test_files_that_the_page_names_exist(page):
    named = set(FILE.findall(text_of(page)))
    missing = {name for name in named if not ((PACKAGE / name).exists() or (ROOT / name).exists())}
    assert named
    assert not missing


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


def test_the_glossary_has_every_type_of_special_point():
    home = next(file for file in (PACKAGE / "continuation").glob("*.py") if '"CP": "cusp"' in text_of(file))
    types = re.findall(r'^    "([A-Z]{2,3}\d?)": "', text_of(home), re.MULTILINE)
    table = text_of("docs/glossary.md").partition("## Names of special points")[2].partition("\n## ")[0]
    told = {name.strip() for row in re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE) for name in row.split(",")}
    assert len(types) > 10
    assert set(types) <= told


def test_every_entry_of_the_glossary_says_where_more_stands():
    lists = text_of("docs/glossary.md").partition("## Definition")[2]
    entries = [entry.partition("\n\n")[0] for entry in re.split(r"^- (?=\*\*)", lists, flags=re.MULTILINE)[1:]]
    assert len(entries) > 80
    assert not [entry for entry in entries if "](" not in entry and not FILE.search(entry)]
