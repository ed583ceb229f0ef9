"""Measured curves in CSV files: units in the header, and errors that say what is wanted."""

import pandas as pd
import pytest

from saltus import InputError, afm


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


BAD = {
    "f,amplitude_nm\n1,2\n": "column = 'f'.*name it with its unit: f_kHz or f_Hz",
    "f_kHz,amplitude\n1,2\n": "name it with its unit: amplitude_nm",
    "f_kHz,amplitude (V)\n1,2\n": "name it with its unit: amplitude_nm",
    "f_kHz,lag_rad\n1,2\n": "name it with its unit: lag_deg",
    "f_kHz,f_Hz,lag_deg\n1,2,3\n": "exactly one of Zc_nm, f_kHz, f_Hz",
    "amplitude_nm\n1\n": "exactly one of Zc_nm, f_kHz, f_Hz",
    "f_kHz\n1\n": "at least one reading",
    "f_kHz,lag_deg\n1,2\n2,high\n": "column 'lag_deg', row 2 = 'high': must be a number",
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
