"""Every Python block of the documentation runs, in the order of its page."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from saltus import afm
from saltus.afm.probe.units import QUANTITIES
from selection import guarding

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += [page for folder in ("theory", "afm", "elsewhere") for page in sorted((ROOT / "docs" / folder).glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def blocks(page):
    text = page.read_text(encoding="utf-8")
    return [(text[: found.start(1)].count("\n"), found.group(1)) for found in BLOCK.finditer(text)]


NAMES = [str(page.relative_to(ROOT)) for page in PAGES if blocks(page)]
LONG = {
    f"docs/{name}.md"
    for name in (
        "afm",
        "afm/bimodal_maps",
        "afm/calibration",
        "afm/curves",
        "afm/force_from_data",
        "afm/laws",
        "afm/liquids",
        "afm/loops",
        "afm/modulus",
        "afm/probe_and_drive",
        "afm/instrument_to_modulus",
        "basins",
        "border_collisions",
        "branch-switching",
        "changing_dimension",
        "chatter",
        "conservative",
        "equilibrium_to_chaos",
        "families",
        "fitting",
        "impact_fit",
        "loci",
        "maps",
        "optimisation",
        "simulation",
        "sliding",
        "sweeps",
        "theory/continuation",
        "theory/integrity",
        "verification",
    )
}
LONG |= {name for name in NAMES if name.startswith("docs/elsewhere/")}


@pytest.mark.parametrize(
    "page",
    guarding(NAMES, *(name for name in NAMES if name not in LONG)),
)
def test_blocks_of_the_page_run_in_order(page, tmp_path, monkeypatch):
    page = ROOT / page
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": page.stem}
    try:
        for line, block in blocks(page):
            exec(compile("\n" * line + block, str(page), "exec"), namespace)
    finally:
        pyplot.close("all")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_the_page_lead_to_files(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


LAWS = [getattr(afm, name) for name in afm.__all__ if isinstance(getattr(afm, name), type)]
LAWS = [kind for kind in LAWS if issubclass(kind, afm.Law) and kind is not afm.Law]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_a_law_has_a_page_with_its_picture_and_the_plausible_range_of_each_parameter(law):
    """The list of laws leads to the page; its table has the fields that take a number."""
    (name,) = re.findall(
        rf"\| \[`{law.__name__}`\]\((\w+)\.md\)", (ROOT / "docs/afm/laws.md").read_text(encoding="utf-8")
    )
    text = (ROOT / "docs" / "afm" / f"{name}.md").read_text(encoding="utf-8")
    assert text.startswith(f"# `{law.__name__}`: ")
    assert f"](../images/laws/{name}.png)" in text
    told = {
        row[0]: row[1:]
        for row in re.findall(r"^\| `(\w+)` \| [^|]* \| ([^|]*) \| (.+) to (.+) \|$", text, re.MULTILINE)
    }
    wanted = {one.name: QUANTITIES[one.name] for one in fields(law) if one.name in QUANTITIES}
    assert {n: (unit.strip(), float(low), float(high)) for n, (unit, low, high) in told.items()} == {
        n: (quantity.unit, quantity.low, quantity.high) for n, quantity in wanted.items()
    }
