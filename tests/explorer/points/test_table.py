"""The table of special points: sorted, as HTML, as text."""

import math

import pytest

from saltus.explorer.points.table import COLUMNS, Row, rows_of, sorted_rows, table_of, text_of
from saltus.explorer.steps import Place

ROWS = [
    Row("branch1", "SN2", "SN", 9.5, 2.0, -1.0, "nondegenerate"),
    Row("branch1", "SN10", "SN", 3.5, 1.0, math.nan, ""),
    Row("branch10", "PD1", "PD", 1.5, 3.0, 5.0, "supercritical"),
    Row("branch2", "PD1", "PD", 1.5, 3.0, 4.0, "supercritical"),
]


def labels(column: str, **how: bool) -> list[str]:
    return [f"{row.of} {row.label}" for row in sorted_rows(ROWS, column, **how)]


def test_every_special_point_has_a_row(results):
    rows = rows_of(results, ("a", "max_z"), {("branch1", "SN1"): "nondegenerate"})
    curves = [name for name in ("branch1", "locus1") for _ in results[name].special_points]
    assert [row.of for row in rows] == curves
    fold = next(row for row in rows if (row.of, row.label) == ("branch1", "SN1"))
    assert (fold.x, fold.form) == (pytest.approx(math.pi / 3.0, rel=1e-9), "nondegenerate")  # pi (1 - e)/(1 + e)
    assert fold.y == results["branch1"]["SN1"].orbit.max["z"]
    assert math.isnan(rows_of(results, ("a", "nothing"), {})[0].y)


def test_numbers_in_names_count_as_numbers():
    assert labels("result") == ["branch1 SN10", "branch1 SN2", "branch2 PD1", "branch10 PD1"]
    assert labels("point")[-2:] == ["branch1 SN2", "branch1 SN10"]


def test_numbers_are_sorted_both_ways_and_missing_ones_come_last():
    assert labels("y") == ["branch1 SN2", "branch2 PD1", "branch10 PD1", "branch1 SN10"]
    assert labels("y", falling=True) == ["branch10 PD1", "branch2 PD1", "branch1 SN2", "branch1 SN10"]
    assert labels("x")[0] == "branch1 SN10"
    for column in COLUMNS:
        assert sorted(labels(column)) == sorted(labels(column, falling=True)) == sorted(labels("result"))


def test_rows_select_and_heads_sort():
    told = table_of(ROWS, ("Omega", "min_z"), "-x", Place(of="branch2", label="PD1"))
    assert told.count("<tr") == 5
    assert told.count("aria-selected") == 1
    assert 'aria-sort="descending"' in told
    assert "Ω ▾" in told
    assert 'data-wish="[&quot;take&quot;, &quot;branch2&quot;, &quot;PD1&quot;]"' in told
    assert 'data-wish="[&quot;sort&quot;, &quot;normal form&quot;]"' in told
    assert "−1" in told
    assert "nan" not in told
    assert "No special points" in table_of([], ("a", "b"), "x", None)


def test_the_text_has_all_digits_and_a_line_for_each_point():
    lines = text_of([ROWS[1], ROWS[0]._replace(x=1.0 / 3.0)], ("Omega", "min_z")).splitlines()
    assert lines[0].split("\t") == ["result", "point", "meaning", "Omega", "min_z", "normal form"]
    assert lines[1].split("\t") == ["branch1", "SN10", "saddle-node", "1.0", "", ""]
    assert float(lines[2].split("\t")[3]) == 1.0 / 3.0


def test_names_are_never_html():
    told = table_of([ROWS[0]._replace(label="<b>", form="<i>")], ("a", "b"), "x", None)
    assert "<b>" not in told
    assert "<i>" not in told
