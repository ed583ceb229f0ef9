"""Spectra in files: units of frequencies and densities, what is no spectrum."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import afm
from saltus.errors import InputError


def written(tmp_path, header, rows):
    file = tmp_path / "thermal.csv"
    file.write_text("\n".join([header, *rows]))
    return file


@pytest.mark.parametrize(
    ("f_name", "f", "name", "cell", "column", "wanted"),
    [
        ("f_Hz", 2e3, "psd_pm2_Hz", 4.0, "psd_nm2_Hz", 4e-6),
        ("f_kHz", 2.0, "asd_pm_rtHz", 2.0, "psd_nm2_Hz", 4e-6),
        ("Frequency (kHz)", 2.0, "PSD (m²/Hz)", 4e-24, "psd_nm2_Hz", 4e-6),
        ("Frequency (Hz)", 2e3, "Amplitude [pm/√Hz]", 2.0, "psd_nm2_Hz", 4e-6),
        ("Frequency (Hz)", 2e3, "Deflection (fm/rtHz)", 2e3, "psd_nm2_Hz", 4e-6),
        ("Frequency (MHz)", 2e-3, "PSD (mV^2/Hz)", 4.0, "psd_V2_Hz", 4e-6),
        ("f_kHz", 2.0, "asd_mV_rtHz", 2.0, "psd_V2_Hz", 4e-6),
        ("f_kHz", 2.0, "Noise (V/sqrt(Hz))", 2e-3, "psd_V2_Hz", 4e-6),
    ],
)
def test_units_are_those_of_the_names(tmp_path, f_name, f, name, cell, column, wanted):
    rows = [f"{(1.0 + i / 100) * f!r},{cell!r}" for i in range(30)]
    table = afm.read_spectrum(written(tmp_path, f"{f_name},{name}", rows))
    assert list(table) == ["f_kHz", column]
    assert table["f_kHz"].iloc[0] == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(table[column], wanted, rtol=1e-12)


def test_columns_and_scale_take_names_without_units(tmp_path):
    file = written(tmp_path, "x,y", [f"{i + 1},2" for i in range(30)])
    table = afm.read_spectrum(file, {"f_kHz": "x", "psd_V2_Hz": "y"}, scale={"f_kHz": 0.5, "psd_V2_Hz": 1e-12})
    assert table.iloc[1].to_dict() == {"f_kHz": 1.0, "psd_V2_Hz": 2e-12}
    with pytest.raises(InputError, match="a column whose name has its unit"):
        afm.read_spectrum(file, {"f_kHz": "x", "psd_V2_Hz": "y"})


def test_what_is_no_spectrum_is_refused(tmp_path):
    with pytest.raises(InputError, match="names tell the units"):
        afm.read_spectrum(written(tmp_path, "f,psd", ["1,2"] * 30))
    with pytest.raises(InputError, match="at least 20 rows"):
        afm.read_spectrum(written(tmp_path, "f_kHz,psd_nm2_Hz", ["1,2"]))
    with pytest.raises(InputError, match="another frequency in each row"):
        afm.read_spectrum(written(tmp_path, "f_kHz,psd_nm2_Hz", ["1,2"] * 30))
    with pytest.raises(InputError, match="0 or above"):
        afm.read_spectrum(written(tmp_path, "f_kHz,psd_nm2_Hz", [f"{i},-2" for i in range(30)]))
    with pytest.raises(InputError, match="numbers in all rows"):
        afm.read_spectrum(written(tmp_path, "f_kHz,psd_nm2_Hz", [f"{i},two" for i in range(30)]))
    with pytest.raises(InputError, match="a CSV file that can be read"):
        afm.read_spectrum(written(tmp_path, "", []))
    with pytest.raises(InputError, match="a CSV file that can be read"):
        afm.read_spectrum(tmp_path / "none.csv")
    (tmp_path / "bytes.csv").write_bytes(bytes(range(256)) * 10)
    with pytest.raises(InputError):
        afm.read_spectrum(tmp_path / "bytes.csv")
    with pytest.raises(InputError, match="a table with columns"):
        afm.calibrate(3.0)


def test_decimal_commas_are_refused_and_shift_no_column(tmp_path):
    file = tmp_path / "thermal.csv"
    file.write_text("f_kHz,psd_nm2_Hz\n" + "".join(f"{i},5,{i},7\n" for i in range(1, 40)))
    with pytest.raises(InputError, match="more cells than the header: commas in numbers"):
        afm.read_spectrum(file)
