"""The site's pages, as far as they can be checked without Sphinx: shelves, links, pictures, notebooks, examples."""

from __future__ import annotations

import ast
import inspect
import json
import runpy
import sys
from importlib import import_module
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import examples as gallery
import pages
import pytest
import stage
from matplotlib import pyplot as plt
from PIL import Image

ROOT = Path(__file__).parents[1]
EXAMPLES = gallery.examples()
OF_THE_GALLERY = [one for one in EXAMPLES if one.file.parent.name == "gallery"]


def test_every_page_stands_below_exactly_one_other():
    placed = [name for below in pages.children().values() for name in below]
    assert len(placed) == len(set(placed))
    assert set(placed) | {"index"} == set(pages.sources()) | {pages.GALLERY}


def test_the_landing_page_has_six_doors_with_pictures():
    text = (pages.DOCS / "index.md").read_text(encoding="utf-8")
    cards = pages.doors(text)
    assert cards.count(":::{grid-item-card}") == 6
    assert "![" not in cards
    assert all(
        (pages.DOCS / line.split(": ")[1]).exists() for line in cards.splitlines() if line.startswith(":img-top:")
    )


def test_links_of_a_page_for_sphinx_lead_where_the_page_s_own_links_lead():
    file = pages.DOCS / "theory" / "afm.md"
    told = pages.prepared("theory/afm", file, [], {})
    assert pages.page_at(ROOT / "examples" / "12_tip_radius.py") == "gallery/12_tip_radius"
    assert "<!--" not in told
    soft = pages.prepared("afm/soft_samples", pages.DOCS / "afm" / "soft_samples.md", ["afm/cone"], {})
    assert "](../afm.md" in soft
    assert soft.endswith("```{toctree}\n:hidden:\n:titlesonly:\n\ncone\n```\n")


def test_a_page_of_the_reference_leads_to_what_uses_the_name(tmp_path, monkeypatch):
    monkeypatch.setattr(stage, "SOURCE", tmp_path)
    ball = next(one for one in EXAMPLES if one.name == "01_bouncing_ball")
    stage.stage_reference(stage.Staging(), {"saltus.find_orbit": [ball]}, gallery.public_names())
    page = (tmp_path / "api/saltus.find_orbit.rst").read_text(encoding="utf-8")
    assert ".. autofunction:: find_orbit\n" in page
    assert "\n   ~results.PeriodicOrbit\n" in page
    assert "\n- :doc:`/tutorial`\n" in page
    assert page.endswith(f"- :doc:`{ball.title} </gallery/01_bouncing_ball>`\n")
    error = (tmp_path / "api/saltus.errors.InputError.rst").read_text(encoding="utf-8")
    assert ".. autoexception:: InputError\n   :members:" in error


def test_the_switcher_offers_the_versions_that_there_are_the_newest_first(tmp_path):
    for name in ("0.2.0", "0.10.0", "files"):
        (tmp_path / name).mkdir()
    entries = json.loads(stage.switcher(tmp_path))
    assert [(one["version"], one["preferred"]) for one in entries] == [("0.10.0", True), ("0.2.0", False)]


@pytest.mark.parametrize("one", EXAMPLES, ids=lambda one: one.name)
def test_the_picture_of_an_example_was_drawn_by_its_code(one):
    assert Image.open(one.picture).text["drawn by"] == one.print, "run make gallery"
    assert one.picture.stat().st_size < 150_000
    assert one.title
    assert one.field in gallery.FIELDS


@pytest.mark.parametrize("one", EXAMPLES, ids=lambda one: one.name)
def test_the_notebook_of_an_example_has_its_code_and_its_arguments(one):
    cells = json.loads(gallery.notebook(one))["cells"]
    code = "\n\n".join(cell["source"] for cell in cells if cell["cell_type"] == "code")
    compile(code, one.name, "exec")
    assert code.startswith(f'import sys\n\nsys.argv = ["{one.name}.py", "{one.name}.png"]\n')
    assert ast.dump(ast.parse(one.code)) == ast.dump(ast.Module(ast.parse(code).body[2:], []))
    assert cells[0]["source"].startswith(f"# {one.title}")


@pytest.mark.campaign
@pytest.mark.parametrize("one", OF_THE_GALLERY, ids=lambda one: one.name)
def test_an_example_of_the_gallery_agrees_with_its_source_and_draws_its_picture(one, tmp_path, monkeypatch, capsys):
    picture = tmp_path / "picture.png"
    monkeypatch.setattr(sys, "argv", [str(one.file), str(picture)])
    try:
        runpy.run_path(str(one.file), run_name="__main__")
    finally:
        plt.close("all")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.splitlines()[-1] == f"written {picture}"
    assert any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(one.code)))


NAMES = [f"{module}.{name}" for module, names in gallery.public_names().items() for name in names]


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_has_an_example_in_its_docstring(name):
    module, _, last = name.rpartition(".")
    assert ">>> " in (inspect.getdoc(getattr(import_module(module), last)) or "")


@pytest.mark.parametrize(("opening", "closing"), [(r"\Bigl(", r"\Bigr)"), (r"\Big(", r"\Big)"), (r"\bigl[", r"\bigr]")])
def test_large_brackets_grow_with_what_they_enclose(opening, closing):
    found = pages.with_fences(rf"{opening}\frac{{a}}{{b}}{closing}^2 + (c)")
    assert found == rf"\left{opening[-1]}\frac{{a}}{{b}}\right{closing[-1]}^2 + (c)"
