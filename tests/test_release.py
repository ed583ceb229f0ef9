"""What goes out with a release: one version in all places, the content of the wheel, recipe and paper."""

import re
import runpy
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import saltus

ROOT = Path(__file__).parents[1]
DIST = runpy.run_path(str(ROOT / "tools/dist.py"), run_name="dist")
PROJECT = DIST["_project"]()
RECIPE = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text(encoding="utf-8"))
CONDA = {"matplotlib-base": "matplotlib"}
"""Names of packages that conda calls otherwise."""

SECTIONS = [
    "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
    "AI usage disclosure", "Acknowledgements", "References",
]  # fmt: skip
"""Sections of a paper in the Journal of Open Source Software."""


def test_the_version_is_the_same_in_all_places():
    assert DIST["version"]() == saltus.__version__
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == RECIPE["context"]["version"] == saltus.__version__
    changes = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert next(name for name in changes if name != "Unreleased") == saltus.__version__
    assert [*map(_numbers, changes[-2:])] == sorted(map(_numbers, changes[-2:]), reverse=True)


def _numbers(version):
    return tuple(map(int, version.split(".")))


@pytest.mark.campaign
def test_nothing_in_the_wheel_imports_what_only_tests_bring():
    texts = {str(path): path.read_bytes() for path in DIST["sources"]() if path.suffix == ".py"}
    assert len(texts) > 600
    assert DIST["foreign_imports"](texts) == set()


@pytest.mark.parametrize(
    ("text", "foreign"),
    [("import hypothesis.strategies", "hypothesis"), ("def f():\n    from heyoka import taylor_adaptive", "heyoka")],
)
def test_an_import_of_what_only_tests_bring_is_seen(text, foreign):
    assert DIST["foreign_imports"]({"a.py": f"import numpy, sys, saltus\n{text}".encode()}) == {foreign}


def test_the_recipe_requires_what_pyproject_does():
    extras = PROJECT["optional-dependencies"]
    texts = [*PROJECT["dependencies"], *(text for name in ("cli", "data", "plot", "store") for text in extras[name])]
    wanted = {one.name: str(one.specifier) for one in map(Requirement, texts) if one.name != "saltus"}
    bounds = [text.split(" ", 1) for text in RECIPE["requirements"]["run"] if " " in text]
    assert {CONDA.get(name, name): bound for name, bound in bounds if name != "python"} == wanted
    assert PROJECT["requires-python"] == f">={RECIPE['context']['python_min']}"
    constrained = [text.split(" ", 1) for text in RECIPE["requirements"]["run_constraints"]]
    every = {one.name: str(one.specifier) for texts in extras.values() for one in map(Requirement, texts)}
    assert {name: every[name] for name, _ in constrained} == dict(constrained)
    (entry,) = PROJECT["scripts"].items()
    assert RECIPE["build"]["python"]["entry_points"] == [" = ".join(entry)]


def test_workflows_call_what_there_is():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for path in (ROOT / ".github/workflows").glob("*.yml"):
        jobs = yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"]
        commands = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
        assert commands or "publish" in jobs
        for command in commands:
            first, *rest = command.split()
            assert first != "make" or rest[0] in targets
            assert first != "python" or rest[0] == "-m" or (ROOT / rest[0]).is_file()


def test_the_paper_has_the_sections_and_the_length_that_the_journal_asks_for():
    _, front, text = (ROOT / "paper/paper.md").read_text(encoding="utf-8").split("---\n", 2)
    assert re.findall(r"^# (.+)$", text, re.MULTILINE) == SECTIONS
    assert 750 <= len(re.sub(r"\[@[^]]*\]|`[^`]*`", "x", text).split()) <= 1750
    assert yaml.safe_load(front)["bibliography"] == "paper.bib"
    kept = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper/paper.bib").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"@(\w+)", text)) == kept


def test_the_description_of_the_package_leads_to_no_file_of_the_checkout():
    describe = runpy.run_path(str(ROOT / "tools/description.py"))["description"]
    text = describe((ROOT / "README.md").read_text(encoding="utf-8"))
    assert not re.findall(r"\]\((?!https?:)", text)
    assert "https://doi.org/10.1115/1.4062228" in text
    assert "## Ten lines" in text
    assert "Extras add datasets" in text
    assert PROJECT["dynamic"] == ["readme", "version"]
