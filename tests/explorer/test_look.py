"""Figures, labels and tables of the page."""

import math
from importlib.resources import files

import numpy as np
import pytest

import saltus
from saltus.explorer import look
from saltus.plotting import style


def test_every_kind_of_curve_has_a_dash_and_faulty_ones_share_theirs():
    assert set(style.FAULTY) < set(look.DASHES)
    assert len({str(look.DASHES[kind]) for kind in style.FAULTY}) == 1
    assert look.DASHES["stable"] == "solid"


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("z1_nm", "z₁ (nm)"),
        ("k_N_m", "k (N/m)"),
        ("lambda", "λ"),
        ("Omega", "Ω"),
        ("D_rep", "D_rep"),
        ("max_x", "max x"),
        ("amplitude(x, 1)", "amplitude(x, 1)"),
        ("period", "period"),
    ],
)
def test_labels_have_no_tex(name, label):
    assert look.bare_label(name) == label


def test_a_figure_shows_all_values_with_room():
    made = look.figure_of("some")
    look.fit(made, [0.0, 10.0], [2.0, 4.0], 0.1)
    assert (made.x_range.start, made.x_range.end) == pytest.approx((-1.0, 11.0))
    assert (made.y_range.start, made.y_range.end) == pytest.approx((1.8, 4.2))
    assert made.x_range.reset_end == made.x_range.end


def test_a_figure_of_nothing_stays_as_it_is():
    made = look.figure_of("some")
    look.fit(made, [], [math.nan, math.inf])
    assert (made.x_range.start, made.x_range.end, made.y_range.start, made.y_range.end) == (-1.0, 1.0, -1.0, 1.0)


def test_one_value_has_room_about_it():
    made = look.figure_of("some")
    look.fit(made, [5.0], [0.0])
    assert made.x_range.start < 5.0 < made.x_range.end
    assert (made.y_range.start, made.y_range.end) == (-1.0, 1.0)


def test_few_values_far_away_are_left_outside():
    made = look.figure_of("some")
    many = np.linspace(0.0, 1.0, 200)
    look.fit(made, [*many, 1e6], [*many, 5.0])
    assert made.x_range.end < 2.0
    assert made.y_range.end > 5.0


def test_a_figure_is_found_by_its_name():
    assert look.figure_of("some", height=99).name == "some-figure"
    assert look.figure_of("some", height=99).height == 99


def test_a_table_never_holds_html_of_its_values():
    told = look.table({"<b>": "<script>", "n": 3, "x": 1.0 / 3.0}, ("", "a & b"))
    assert "<script>" not in told
    assert "<th>&lt;b&gt;</th><td>&lt;script&gt;</td>" in told
    assert "<th>n</th><td>3</td>" in told
    assert "<th>x</th><td>0.333333333</td>" in told
    assert "<th>a &amp; b</th>" in told
    assert look.table({}, ("", "value")) == ""


@pytest.mark.parametrize(
    ("value", "text"), [(2.0 + 0j, "2"), (-0.5 + 1e-3j, "-0.5 + 0.001i"), (1.0 / 3.0 - 2j, "0.333333333 − 2i")]
)
def test_complex_numbers_read_as_in_print(value, text):
    assert look.complex_text(value) == text


def test_special_points_have_a_meaning_and_events_are_events():
    assert look.meaning_of("PD") == "period doubling"
    assert look.meaning_of("a user's event") == "event"
    assert look.meaning_of("CH") == "accumulation of hits"
    assert look.meaning_of("CH", "TR") == "Chenciner point"


def test_the_style_sheets_know_what_the_page_writes():
    inner = files("saltus.explorer").joinpath("widgets.css").read_text()
    assert all(f".{name}" in inner for name in ("swatch", "result", "hint"))
    assert ".status" in look.page_style()


@pytest.mark.parametrize("value", [1e15, -4.2e7 + 0j, 12.5 - 3j, 0j])
def test_numbers_in_a_figure_have_three_digits(value):
    text = look.rounded_text(complex(value)).replace("−", "-")
    assert complex(text.replace(" ", "").replace("i", "j")) == pytest.approx(value, rel=5e-3)
    assert len(text) <= 14


def test_time_has_the_unit_of_the_system_s_names(ball_on_table):
    assert look.time_label("t", ball_on_table) == "t"
    lever = saltus.HybridSystem.smooth({"z1_nm": "v1_nm_us", "v1_nm_us": "-z1_nm"})
    assert [look.time_label(name, lever) for name in ("t", "period", "z1_nm")] == ["t (us)", "period (us)", "z₁ (nm)"]
