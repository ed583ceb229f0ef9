"""The examples run, agree with the closed forms that they print, and draw one picture each."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import pytest
from matplotlib import pyplot as plt

from selection import guarding

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 3


@pytest.mark.campaign
def test_the_pictures_of_the_laws_are_those_of_the_pages(tmp_path, monkeypatch):
    folder = EXAMPLES[0].parents[1] / "docs" / "images" / "laws"
    (script,) = [path for path in EXAMPLES if path.stem.endswith("laws_of_force")]
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path / "all.png"), str(tmp_path / "laws")])
    try:
        runpy.run_path(str(script), run_name="__main__")
    finally:
        plt.close("all")
    assert {path.name for path in (tmp_path / "laws").iterdir()} == {path.name for path in folder.iterdir()}


SHORT = {
    "01_bouncing_ball", "02_impact_oscillator", "03_afm_response", "04_bifurcation_loci", "10_distance_curve",
    "14_border_collision", "18_thin_sample",
}  # fmt: skip
NAMES = [path.stem for path in EXAMPLES]


@pytest.mark.parametrize("name", guarding(NAMES, *sorted(SHORT)))
def test_example_draws_its_picture(name, tmp_path, monkeypatch, capsys):
    path = EXAMPLES[NAMES.index(name)]
    picture = tmp_path / "new" / "picture.png"
    monkeypatch.setattr(sys, "argv", [str(path), str(picture)])
    try:
        runpy.run_path(str(path), run_name="__main__")
    finally:
        plt.close("all")
    assert picture.read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert printed.splitlines()[-1] == f"written {picture}"
    differences = [float(text) for text in re.findall(r"difference (\S+)", printed)]
    assert all(abs(difference) < 1e-10 for difference in differences)
    if "closed form" in path.read_text():
        assert len(differences) == 2
