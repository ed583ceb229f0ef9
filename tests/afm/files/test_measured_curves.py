"""Measured curves in CSV files: units in the header, and errors that say what is wanted."""

import math

import pandas as pd
import pytest

from saltus import InputError, afm


def test_a_huge_text_file_is_refused_before_it_is_read(tmp_path):
    with open(tmp_path / "c.csv", "wb") as file:
        file.truncate(2**28 + 1)  # a hole, which takes no disk
    with pytest.raises(InputError, match="a CSV file that can be read; it has 268,435,457 bytes, more than"):
        afm.read_curve(tmp_path / "c.csv")


def test_a_written_file_is_read_back_the_same(tmp_path):
    table = pd.DataFrame(
        {"f_kHz": [299.1, 299.1 + 1e-13], "amplitude_nm": [0.1 + 0.2, float("nan")], "lag_deg": [1.0 / 3.0, -720.25],
         "direction": ["up", "down"]}
    )  # fmt: skip
    table.to_csv(tmp_path / "tune.csv", index=False)
    pd.testing.assert_frame_equal(afm.read_curve(tmp_path / "tune.csv"), table, check_exact=True)


def test_comments_and_spaces_are_no_data(tmp_path):
    path = tmp_path / "apd.csv"
    path.write_text("# lever S\nZc_nm, amplitude_nm\n10.0, 9.9\n")
    assert afm.read_curve(path).to_dict("list") == {"Zc_nm": [10.0], "amplitude_nm": [9.9]}


OTHER = "Freq [MHz],Amp (pm),Phase (rad),Way\n0.3,7250,1.5,up\n0.301,,0.5,down\n"


def test_other_headers_are_read_by_names_and_their_units_converted(tmp_path):
    path = tmp_path / "tune.txt"
    path.write_text(OTHER)
    names = {"f_kHz": "Freq [MHz]", "amplitude_nm": "Amp (pm)", "lag_deg": "Phase (rad)", "direction": "Way"}
    table = afm.read_curve(path, names)
    assert table["f_kHz"].tolist() == [300.0, 301.0]
    assert table["amplitude_nm"].iloc[0] == 7.25
    assert pd.isna(table["amplitude_nm"].iloc[1])
    assert table["lag_deg"].tolist() == pytest.approx([1.5 * 180.0 / math.pi, 0.5 * 180.0 / math.pi], rel=1e-15)
    assert table["direction"].tolist() == ["up", "down"]
    scaled = afm.read_curve(path, names, scale={"amplitude_nm": -0.5})
    assert scaled["amplitude_nm"].iloc[0] == -3625.0


@pytest.mark.parametrize(
    ("columns", "scale", "told"),
    [
        ({"f_kHz": "Freq", "lag_deg": "Phase (rad)"}, {}, r"column = 'Freq': .*Freq \[MHz\] \(MHz\).*did you mean"),
        ({"f_kHz": "Freq [MHz]", "lag_deg": "Way"}, {}, "column = 'Way': must be one with a unit"),
        ({"f_kHz": "Freq [MHz]", "lag_deg": "Way"}, {"lag_deg": 1.0}, "column 'Way', line 2 = 'up': must be a number"),
        ({"f_kHz": "Freq [MHz]", "lag_deg": "Amp (pm)"}, {}, "unit of 'Amp \\(pm\\)' = 'pm': must be .* in degrees"),
        ({"f_kHz": "Freq [MHz]", "lag_deg": "Amp (pm)"}, {"lag_deg": 0.0}, "another factor than 0"),
        ({"f_kHz": "Freq [MHz]", "lag_deg": "Phase (rad)"}, {"lag_dg": 1.0}, "scale = 'lag_dg'.*mean 'lag_deg'"),
        ({"f_kHz": "Freq [MHz]", "direction": "Way"}, {}, "at least one reading"),
        ({"f_kHz": 1, "lag_deg": "Phase (rad)"}, {}, r"columns\['f_kHz'\] = 1: must be the name of a column"),
        (["f_kHz"], {}, "columns = .*: must be a mapping"),
        (None, {"lag_deg": 2.0}, "columns = None: must be given"),
        ({"f_kHz": "Freq [MHz]", "lag_deg": "Phase (rad)", "direction": "Amp (pm)"}, {}, "direction = '7250'"),
    ],
)
def test_names_and_factors_that_do_not_fit_are_told(tmp_path, columns, scale, told):
    path = tmp_path / "tune.csv"
    path.write_text(OTHER)
    with pytest.raises(InputError, match=told):
        afm.read_curve(path, columns, scale=scale)


BAD = {
    "f,amplitude_nm\n1,2\n": "column = 'f'.*name it with its unit: f_kHz or f_Hz",
    "f_kHz,amplitude\n1,2\n": "name it with its unit: amplitude_nm",
    "f_kHz,amplitude (V)\n1,2\n": "name it with its unit: amplitude_nm",
    "f_kHz,lag_rad\n1,2\n": "name it with its unit: lag_deg",
    "f_kHz,f_Hz,lag_deg\n1,2,3\n": "exactly one of Zc_nm, f_kHz, f_Hz",
    "amplitude_nm\n1\n": "exactly one of Zc_nm, f_kHz, f_Hz",
    "f_kHz\n1\n": "at least one reading",
    "f_kHz,lag_deg\n1,2\n2,high\n": "column 'lag_deg', line 3 = 'high': must be a number",
    "f_kHz,lag_deg,direction\n1,2,left\n": "direction = 'left'",
    "": "a CSV file that can be read",
}


@pytest.mark.parametrize("text", BAD)
def test_what_is_no_curve_is_told(tmp_path, text):
    path = tmp_path / "wrong.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=BAD[text]):
        afm.read_curve(path)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(InputError, match=r"path = .*nowhere\.csv.*No such file"):
        afm.read_curve(tmp_path / "nowhere.csv")


@pytest.mark.parametrize(
    ("rows", "told"),
    [("10,2,\n11,3,\n", "more cells than the header"), ("1,5,2,5\n", "commas in numbers"), ("", "it has no rows")],
)
def test_rows_that_do_not_fit_the_header_are_refused_and_shift_no_column(tmp_path, rows, told):
    (tmp_path / "curve.csv").write_text("Zc_nm,amplitude_nm\n" + rows)
    with pytest.raises(InputError, match=told):
        afm.read_curve(tmp_path / "curve.csv")


@pytest.mark.parametrize(
    ("content", "values"),
    [
        (b"f_kHz;amplitude_nm\n299,5;7,25\n300;1,5e-1\n", [7.25, 0.15]),
        (b"f_kHz;amplitude_nm\n299.5;7.25\n300;0.15\n", [7.25, 0.15]),
        ("f_kHz\tamplitude_nm\n299.5\t7.25\n300\t0.15\n".encode("utf-16"), [7.25, 0.15]),
        ("f_kHz,amplitude_nm\r\n299.5,7.25\r\n300,0.15\r\n".encode("utf-8-sig"), [7.25, 0.15]),
    ],
    ids=["decimal commas", "semicolons", "UTF-16 with tabs", "UTF-8 with a mark"],
)
def test_tables_of_other_programs_are_read(tmp_path, content, values):
    (tmp_path / "tune.csv").write_bytes(content)
    assert afm.read_curve(tmp_path / "tune.csv").to_dict("list") == {"f_kHz": [299.5, 300.0], "amplitude_nm": values}
    named = afm.read_curve(tmp_path / "tune.csv", {"f_kHz": "f_kHz", "amplitude_nm": "amplitude_nm"})
    assert named["amplitude_nm"].tolist() == values


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"# lever S\nf_kHz,amplitude_nm\n299.5,inf\n", "column 'amplitude_nm', line 3 = 'inf': must be a finite"),
        (b"f_kHz,amplitude_nm\n299.5,7\n1e999,7\n", "column 'f_kHz', line 3 = '1e999': must be a finite number"),
        (b"f_kHz,amplitude_nm,lag_deg\n299.5,7,90\n\n300,7\n", "line 4 has fewer cells than the header: is it cut"),
        (b"f_Hz;amplitude_nm\n299,500;7\n300,500;7\n", "line 2: the comma of '299,500' may be a decimal one, or part"),
        (b"f_Hz;amplitude_nm\n299.500,5;7\n", "line 2: '299.500,5' is no number with a decimal comma"),
        ("f_kHz,amplitude_nm\n299.5,7\n".encode("utf-16-le"), "UTF-16 without a byte order mark"),
    ],
    ids=["inf", "overflow", "cut row", "thousands", "points and commas", "no mark"],
)
def test_what_is_no_table_of_numbers_says_where(tmp_path, content, told):
    (tmp_path / "c.csv").write_bytes(content)
    with pytest.raises(InputError, match=told):
        afm.read_curve(tmp_path / "c.csv")
