"""Files of instruments: true files, written here byte by byte or by the maker, and what is told of broken ones."""

import random
import struct
import sys
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from saltus import InputError, SaltusError, afm
from saltus.afm.files.instrument_files import READERS
from saltus.afm.files.unit_conversion import factor_between

SWEEP = {"f_kHz": "x", "amplitude_nm": "Amp", "lag_deg": "Phase"}


def ibw(values, *, unit="", x=(0.0, 1.0, ""), labels=()):
    """An Igor binary wave of version 5, after Technical Note 3 of WaveMetrics: headers, numbers, long units, labels."""
    values = np.asarray(values, dtype="<f8")
    start, step, unit_of_x = x
    sizes = (*values.shape, 0, 0, 0)[:4]
    short, long = (unit, "") if len(unit.encode()) <= 3 else ("", unit)
    texts = b"".join(label.encode().ljust(32, b"\0") for label in ("", *labels)) if labels else b""
    header = struct.pack("<III i hh 6x h 32s i I", 0, 0, 0, values.size, 4, 0, 1, b"wave0", 0, 0)
    header += struct.pack("<4i 4d 4d", *sizes, step, 1.0, 1.0, 1.0, start, 0.0, 0.0, 0.0)
    header += struct.pack("<4s 16s hh dd I4I4II 64x", short.encode(), unit_of_x.encode(), 0, 0, 0.0, 0.0, *[0] * 10)
    header += struct.pack("<hhh bb I i hh II", *[0] * 11)
    content = values.tobytes(order="F")
    of_units = len(long.encode())
    first = struct.pack("<hh iii i 4i 4i iii", 5, 0, len(header) + len(content), 0, 0, of_units, *[0] * 4,
                        0, len(texts), 0, 0, 0, 0, 0)  # fmt: skip
    return first + header + content + long.encode() + texts


def nid(frames):
    """A .nid file: an INI header, and signed integers of 32 bits over the range of each channel."""
    sets, top, content = [], ["[DataSet]", f"GroupCount={len(frames)}"], b""
    for g, (frame, channels, dim0, lines) in enumerate(frames):
        top += [f"Gr{g}-Name={frame}", f"Gr{g}-Count={len(channels)}"]
        for c, (name, unit, values) in enumerate(channels):
            values = np.atleast_2d(values)
            low, extent = values.min() - 1.0, np.ptp(values) + 2.0
            top.append(f"Gr{g}-Ch{c}=DataSet-{g}:{c}")
            entries = {"Points": values.shape[1], "Lines": values.shape[0], "Frame": frame, "Dim0Name": dim0[2]}
            entries |= {"Dim0Unit": dim0[3], "Dim0Min": dim0[0], "Dim0Range": dim0[1], "Dim1Min": 0, "Dim1Range": 0}
            entries |= {
                "Dim2Name": name,
                "Dim2Unit": unit,
                "Dim2Min": repr(float(low)),
                "Dim2Range": repr(float(extent)),
            }
            entries |= {"SaveMode": "Binary", "SaveBits": 32, "SaveSign": "Signed", "SaveOrder": "Intel"}
            entries |= lines
            sets.append("\r\n".join([f"[DataSet-{g}:{c}]", *(f"{key}={value}" for key, value in entries.items())]))
            content += np.round((values - low) / extent * 2.0**32 - 2.0**31).astype("<i4").tobytes()
    header = ["\r\n".join(top), "[DataSet-Info]\r\nVersion=2", *sets]
    return ("\r\n\r\n".join(header) + "\r\n\r\n\r\n").encode() + b"#!" + content


def nhf(path, *, unit="Meter (m)", version=2, blocks=(3, 2)):
    """A .nhf file of version 2: a segment with integers, their calibration, and the sizes of its curves."""
    with h5py.File(path, "w") as file:
        file.attrs.update(nsf_file_version_major=version, nsf_file_version_minor=0)
        file.create_group("group_0000").attrs.update(measurement_name="Spectroscopy", group_type="spectroscopy")
        group = file.create_group("group_0000/subgroup_0000")
        group.attrs["segment_name"] = "Approach"
        sizes = group.create_dataset("dataset_0009", data=np.array(blocks))
        sizes.attrs["dataset_block_size_id"] = "blocks"
        for i, (name, low, high, stored) in enumerate(
            [("Position Z", -1e-6, 3e-6, [0, 2**30, -(2**30), 5, 6]), ("Amplitude", 0.0, 2e-7, [-(2**31), 1, 2, 3, 4])]
        ):
            one = group.create_dataset(f"dataset_000{i}", data=np.array(stored, dtype="i4"), fillvalue=-(2**31))
            one.attrs.update(signal_name=name, dataset_element_type="int32", dataset_block_size_source="blocks")
            one.attrs.update(signal_calibration_min=low, signal_calibration_max=high)
            one.attrs.update(signal_calibration_unit=unit, signal_unit=unit)
    return path


def written(path, content):
    path.write_bytes(content)
    return path


@pytest.fixture
def sweep(tmp_path):
    pytest.importorskip("igor2")
    return written(tmp_path / "tune.ibw", ibw([[1.0, 10.0], [3.0, 20.0], [np.nan, 30.0]], unit="m",
                                              x=(299.0, 0.5, "kHz"), labels=("Amp", "Phase")))  # fmt: skip


def frames(along=(300e3, 200.0, "Frequency", "Hz")):
    amplitude = np.array([1e-9, 4e-9, 2e-9])
    return [("Frequency sweep", [("Amplitude", "m", amplitude), ("Phase", "°", amplitude * 1e10)], along, {})]


@pytest.fixture
def tune(tmp_path):
    return written(tmp_path / "tune.nid", nid(frames()))


def test_columns_of_a_wave_are_read_by_their_labels_in_the_units_wanted(sweep):
    table = afm.read_curve(sweep, SWEEP, scale={"lag_deg": 1.0})
    assert table["f_kHz"].tolist() == [299.0, 299.5, 300.0]
    assert table["amplitude_nm"].tolist()[:2] == [1e9, 3e9]
    assert np.isnan(table["amplitude_nm"].iloc[2])
    assert table["lag_deg"].tolist() == [10.0, 20.0, 30.0]


def test_a_wave_of_one_column_has_its_name_and_long_units(tmp_path):
    pytest.importorskip("igor2")
    path = written(tmp_path / "one.IBW", ibw([1.0, 2.0], unit="degrees", x=(1.0, 1.0, "MHz")))
    table = afm.read_curve(path, {"f_Hz": "x", "lag_deg": "wave0"})
    assert table.to_dict("list") == {"f_Hz": [1e6, 2e6], "lag_deg": [1.0, 2.0]}


def test_a_wave_of_an_old_version_is_read(tmp_path):
    """Version 2 as on a Mac: big-endian, one dimension, 16 bytes behind the numbers."""
    pytest.importorskip("igor2")
    header = struct.pack(">hI20shhI4s4sihdd", 4, 0, b"amp", 0, 0, 0, b"pm", b"Hz", 2, 0, 50.0, 3e5)
    header += struct.pack(">hhhdd", 0, 0, 0, 0.0, 0.0) + bytes(2 + 4 + 4 + 4 + 2 + 4 + 4)
    content = struct.pack(">2d", 12.5, 25.0)
    first = struct.pack(">hiiih", 2, len(header) + len(content) + 16, 0, 0, 0)
    path = written(tmp_path / "old.ibw", first + header + content + bytes(16))
    table = afm.read_curve(path, {"f_kHz": "x", "amplitude_nm": "amp"})
    assert table["f_kHz"].tolist() == pytest.approx([300.0, 300.05], rel=1e-15)
    assert table["amplitude_nm"].tolist() == pytest.approx([0.0125, 0.025], rel=1e-15)


def test_one_unit_for_all_columns_of_a_wave_is_no_unit_of_an_angle(sweep):
    with pytest.raises(InputError, match=r"unit of 'Phase' = 'm': must be one of a quantity in degrees; or give"):
        afm.read_curve(sweep, SWEEP)


def test_a_missing_unit_is_told_with_what_the_file_has(tmp_path):
    pytest.importorskip("igor2")
    path = written(tmp_path / "none.ibw", ibw([[1.0, 2.0]], x=(1.0, 1.0, "kHz"), labels=("Amp", "Phase")))
    listed = r"the file has x \(kHz\), Amp \(no unit\), Phase \(no unit\)"
    with pytest.raises(InputError, match=rf"column = 'Amp': must be one with a unit, or give a factor.*{listed}"):
        afm.read_curve(path, SWEEP)


def test_a_file_of_an_instrument_needs_names_of_columns_and_lists_them(sweep, tune):
    with pytest.raises(InputError, match=r"columns = None: must be given, .*: x \(kHz\), Amp \(m\), Phase \(m\)"):
        afm.read_curve(sweep)
    with pytest.raises(InputError, match=r"'Ampl': must be one of the file's: x \(kHz\).*did you mean 'Amp'"):
        afm.read_curve(sweep, {"f_kHz": "x", "amplitude_nm": "Ampl"})
    with pytest.raises(InputError, match=r"sweep: Dim0 \(Hz\), Frequency sweep: Amplitude \(m\), .*: Phase \(°\)"):
        afm.read_curve(tune)


def test_a_file_of_an_instrument_has_no_column_of_directions(sweep):
    with pytest.raises(InputError, match="without 'direction', which only text files have; table.assign"):
        afm.read_curve(sweep, {"f_kHz": "x", "amplitude_nm": "Amp", "direction": "x"})


def test_a_frequency_sweep_of_a_nid_file_is_read_to_the_step_of_its_integers(tune):
    table = afm.read_curve(tune, {"f_kHz": "Dim0", "amplitude_nm": "Amplitude", "lag_deg": "Frequency sweep: Phase"})
    assert table["f_kHz"].tolist() == pytest.approx([300.0, 300.1, 300.2], rel=1e-15)
    assert table["amplitude_nm"].to_numpy() == pytest.approx([1.0, 4.0, 2.0], abs=2.0 * 1e9 / 2.0**32)
    assert table["lag_deg"].to_numpy() == pytest.approx([10.0, 40.0, 20.0], abs=32.0 / 2.0**32)


def test_curves_of_a_map_have_numbers_lengths_and_distances_of_their_own(tmp_path):
    z = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    lines = {"LineDim0Min": 0, "LineDim0Range": 1e-6, "LineDim0Points": 3, "LineDim1Min": 1e-6, "LineDim1Range": 2e-6,
             "LineDim1Points": 2}  # fmt: skip
    both = [(frame, [("Amplitude", "m", z * 1e-9)], (0, 1e-6, "Z-Axis", "m"), lines)
            for frame in ("Spec forward", "Spec backward")]  # fmt: skip
    both.append(("Scan forward", [("Z-Axis", "m", z[:1])], (0, 1e-6, "X*", "m"), {}))  # an image, which is no curve
    path = written(tmp_path / "map.nid", nid(both))
    wanted = {"Zc_nm": "Spec backward: Dim0 #2", "amplitude_nm": "Spec backward: Amplitude #2"}
    table = afm.read_curve(path, wanted, scale={"Zc_nm": -1e9})  # the axis points to the sample
    assert table["Zc_nm"].tolist() == pytest.approx([-1000.0, -3000.0])
    assert table["amplitude_nm"].to_numpy() == pytest.approx([4.0, 5.0], abs=1e9 * 2.0 / 2.0**32)
    with pytest.raises(InputError, match="one of the file's: Spec forward: Amplitude .*Spec backward: Amplitude"):
        afm.read_curve(path, wanted | {"amplitude_nm": "Amplitude #2"})
    with pytest.raises(InputError, match="one of 2 curves; name it with its number, as 'Spec backward: Amplitude #1'"):
        afm.read_curve(path, wanted | {"amplitude_nm": "Spec backward: Amplitude"})
    with pytest.raises(InputError, match="one of the curves 1 to 2"):
        afm.read_curve(path, wanted | {"amplitude_nm": "Spec backward: Amplitude #3"})
    with pytest.raises(InputError, match="columns of one length"):
        afm.read_curve(path, wanted | {"amplitude_nm": "Spec backward: Amplitude #1"})


def test_the_makers_thermal_tune_has_its_peak_where_its_header_tells():
    """The header says: 179.8 kHz, 772 fm/sqrt(Hz), steps of 38.147 Hz. The curve has noise below the peak, too."""
    maker = Path(pytest.importorskip("NSFopen").__file__).parent / "example" / "Spring_Constant" / "thermal.nid"
    density = "Spectrum Fit: Amplitude Spectral Density"
    table = afm.read_curve(maker, {"f_Hz": "Spectrum Fit: Dim0", "amplitude_nm": density}, scale={"amplitude_nm": 1e9})
    peak = table["amplitude_nm"].idxmax()
    assert table["f_Hz"][peak] == pytest.approx(179.8e3, abs=50.0 + 38.147 / 2.0)
    assert table["amplitude_nm"][peak] == pytest.approx(772e-6, rel=0.01)
    assert np.diff(table["f_Hz"]) == pytest.approx(38.147, abs=5e-4)


def test_the_makers_map_is_what_the_makers_own_reader_has():
    """All curves of a map, of which some ended early; Dim0 grows towards the sample on both ways."""
    reading = pytest.importorskip("NSFopen.read")
    maker = Path(reading.__file__).parents[1] / "example" / "Force_Spectroscopy" / "spectroscopy.nid"
    wanted = reading.nid_read(str(maker), dataframe=False).data["Spec"]
    found = {column.name: column for column in READERS[".nid"](maker).columns}
    assert list(found) == [
        f"Spec {way}: {name}" for way in ("forward", "backward") for name in ("Dim0", "Deflection", "Z-Axis Sensor")
    ]
    for way in ("Forward", "Backward"):
        for name, unit in (("Deflection", "N"), ("Z-Axis Sensor", "m")):
            column = found[f"Spec {way.lower()}: {name}"]
            assert column.unit == unit
            assert all(np.array_equal(*pair) for pair in zip(column.lines, wanted[way][name], strict=True))
    assert {len(line) for line in found["Spec forward: Deflection"].lines} > {980, 1024}
    along, sensor = (found[f"Spec backward: {name}"].lines[0] for name in ("Dim0", "Z-Axis Sensor"))
    assert np.corrcoef(along, sensor)[0, 1] > 0.99


def test_a_nhf_file_is_read_by_its_calibration_and_what_is_missing_is_nan(tmp_path):
    path = nhf(tmp_path / "spec.nhf")
    table = afm.read_curve(path, {"Zc_nm": "Approach: Position Z #1", "amplitude_nm": "Amplitude #1"})
    assert table["Zc_nm"].to_numpy() == pytest.approx([1000.0, 2000.0, 0.0], abs=1e-5)
    assert np.isnan(table["amplitude_nm"].iloc[0])
    assert table["amplitude_nm"].iloc[1] == pytest.approx(100.0, abs=1e-6)
    second = afm.read_curve(path, {"Zc_nm": "Position Z #2", "amplitude_nm": "Amplitude #2"})
    assert second["Zc_nm"].to_numpy() == pytest.approx([1000.0, 1000.0], abs=1e-5)


@pytest.mark.parametrize(("changes", "told"), [({"version": 1}, "version 1, not 2"), ({"blocks": (3, 3)}, "blocks 6")])
def test_a_nhf_file_of_another_kind_is_refused(tmp_path, changes, told):
    with pytest.raises(InputError, match=f"a .nhf file of Nanosurf.*{told}"):
        afm.read_curve(nhf(tmp_path / "spec.nhf", **changes), {"Zc_nm": "Position Z", "amplitude_nm": "Amplitude"})


def test_a_part_of_a_file_is_refused_wherever_it_ends(tmp_path, sweep, tune):
    whole = nhf(tmp_path / "spec.nhf")
    wanted = {".ibw": SWEEP, ".nid": {"f_kHz": "Dim0", "amplitude_nm": "Amplitude"},
              ".nhf": {"Zc_nm": "Position Z #1", "amplitude_nm": "Amplitude #1"}}  # fmt: skip
    for path in (sweep, tune, whole):
        content = path.read_bytes()
        for cut in np.unique(np.linspace(0, len(content) - 1, 60).astype(int)):
            path.write_bytes(content[:cut])
            with pytest.raises(InputError, match=r"path = .*\.(ibw|nid|nhf)': must be an?"):
                afm.read_curve(path, wanted[path.suffix], scale={"amplitude_nm": 1.0})


@pytest.mark.parametrize("kind", ["sweep", "tune", "nhf"])
def test_a_flipped_bit_is_refused_or_read_and_takes_no_memory(kind, tmp_path, request):
    path = nhf(tmp_path / "spec.nhf") if kind == "nhf" else request.getfixturevalue(kind)
    content, rng, told = path.read_bytes(), random.Random(kind), []
    good = [column.name for column in afm.instrument_file(path).columns]
    end = 8 * (64 + 320) if kind == "sweep" else 8 * len(content)  # of the wave its headers
    tracemalloc.start()
    for _ in range(40):
        bits, place = bytearray(content), rng.randrange(end)
        bits[place // 8] ^= 1 << place % 8
        try:
            afm.instrument_file(written(path.with_stem("changed"), bytes(bits)))
        except InputError as error:
            told.append(str(error))
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()
    assert told
    assert not any("\n" in line for line in told)
    assert [column.name for column in afm.instrument_file(path).columns] == good


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_flipped_bit_of_a_wave_takes_no_memory_and_spoils_no_other_file(sweep):
    """Every bit of the sizes, and every seventh of all headers: the file is refused in one line, or read."""
    content = sweep.read_bytes()
    wanted = {"scale": {"amplitude_nm": 1.0, "lag_deg": 1.0}}
    good = afm.read_curve(sweep, SWEEP, **wanted)
    changed, told = sweep.with_name("changed.ibw"), []
    tracemalloc.start()
    for place in [*range(8 * 64), *range(8 * 64, 8 * 384, 7), *range(8 * (384 + 48), 8 * len(content), 11)]:
        bits = bytearray(content)
        bits[place // 8] ^= 1 << place % 8
        try:
            afm.read_curve(written(changed, bytes(bits)), SWEEP, **wanted)
        except InputError as error:
            told.append(str(error))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**24
    assert not any("\n" in line for line in told)
    assert len(told) > 300  # all bits of the sizes but those of no meaning
    assert afm.read_curve(sweep, SWEEP, **wanted).equals(good)


@pytest.mark.parametrize("suffix", [".ibw", ".nid", ".nhf"])
@pytest.mark.parametrize(
    "content", [b"", b"f_kHz,lag_deg\n1,2\n", bytes(range(256)) * 4], ids=["empty", "csv", "noise"]
)
def test_a_foreign_file_is_refused(tmp_path, suffix, content):
    pytest.importorskip("igor2")
    with pytest.raises(InputError, match="it is another file, or a part is missing"):
        afm.read_curve(written(tmp_path / f"curve{suffix}", content), SWEEP)


def test_a_curve_of_a_nid_file_that_is_longer_than_its_room_is_refused(tmp_path):
    lines = {"LineDim0Min": 0, "LineDim0Range": 1e-6, "LineDim0Points": 4}
    content = nid([("Spec forward", [("Amplitude", "m", [1.0, 2.0, 3.0])], (0, 1e-6, "Z-Axis", "m"), lines)])
    with pytest.raises(InputError, match="a curve of 4 points has room for 3"):
        afm.read_curve(written(tmp_path / "spec.nid", content), {"Zc_nm": "Dim0", "amplitude_nm": "Amplitude"})


def test_numbers_behind_the_end_of_a_nid_file_are_refused(tune):
    tune.write_bytes(tune.read_bytes() + b"\0\0\0\0")
    with pytest.raises(InputError, match="header describes 24 bytes of numbers, and the file has 28"):
        afm.read_curve(tune, {"f_kHz": "Dim0", "amplitude_nm": "Amplitude"})


def test_unsigned_numbers_of_a_nid_file_are_refused(tune):
    tune.write_bytes(tune.read_bytes().replace(b"SaveSign=Signed", b"SaveSign=Unsigned"))
    with pytest.raises(InputError, match="saved as Binary Unsigned Intel"):
        afm.read_curve(tune, {"f_kHz": "Dim0", "amplitude_nm": "Amplitude"})


def test_columns_of_a_wave_of_asylum_have_ways_and_constants(tmp_path):
    """The note follows the numbers; it says where the ways begin, and the constants of the lever."""
    pytest.importorskip("igor2")
    note = b"SpringConstant: 2\rInvOLS: 4e-08\rIndexes: 0,2,4\rDirection: NaN,1,-1,\r"
    content = ibw(np.arange(10.0).reshape(5, 2), unit="m", labels=("Raw", "Amp"))
    sizes = struct.unpack_from("<3i", content, 4)  # of header and numbers, of a formula, of the note
    behind = 64 + sizes[0]
    noted = content[:4] + struct.pack("<3i", sizes[0], 0, len(note)) + content[16:behind] + note + content[behind:]
    found = afm.instrument_file(written(tmp_path / "force.ibw", noted))
    columns = {column.name: column.lines[0].tolist() for column in found.columns}
    assert (columns["approach: Amp"], columns["retract: Amp"]) == ([1.0, 3.0], [5.0, 7.0, 9.0])
    assert found.calibration == {"k_N_m": 2.0, "invols_nm_V": 40.0}


def test_a_thermal_tune_of_the_maker_has_the_constants_of_its_header():
    maker = Path(pytest.importorskip("NSFopen").__file__).parent / "example" / "Spring_Constant" / "thermal.nid"
    assert afm.instrument_file(maker).calibration == {"k_N_m": 27.13, "f0_kHz": 179.8, "Q": 442.0}


def test_a_missing_package_is_told_with_the_line_that_installs_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "igor2", None)
    with pytest.raises(SaltusError, match=r"an Igor binary wave needs igor2: pip install 'saltus\[files\]'$"):
        afm.read_curve(written(tmp_path / "curve.ibw", b""), SWEEP)


def test_a_missing_file_is_told_for_each_kind(tmp_path):
    for suffix in (".nhf", ".csv"):
        with pytest.raises(InputError, match=rf"path = .*nowhere\{suffix}.*No such file"):
            afm.read_curve(tmp_path / f"nowhere{suffix}", SWEEP)


def test_a_wave_of_other_things_than_columns_of_numbers_is_refused(tmp_path):
    pytest.importorskip("igor2")
    content = ibw([1.0, 2.0])
    place = content.index(struct.pack("<ihh", 2, 4, 0)) + 4  # of the type: 4 is float64, 3 is complex64
    changed = content[:place] + struct.pack("<h", 3) + content[place + 2 :]
    wrong = {"complex64 in 1": changed, "0 elements": ibw(np.zeros(0)), "in 3": ibw(np.zeros((2, 2, 2)))}
    for told, one in wrong.items():
        with pytest.raises(InputError, match=f"a wave of real numbers in one column or several; it has.* {told}"):
            afm.read_curve(written(tmp_path / "other.ibw", one), SWEEP)


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [("m", "nm", 1e9), ("µm", "nm", 1e3), ("pm", "nm", 1e-3), ("Hz", "kHz", 1e-3), ("MHz", "Hz", 1e6),
     ("nN", "nN", 1.0), ("°", "degrees", 1.0), ("ms", "us", 1e3), ("%", "", 0.01), ("V", "nm", None),
     ("m", "degrees", None), ("N/m", "nN", None)],
)  # fmt: skip
def test_units_are_converted_by_exact_powers_of_ten_or_not_at_all(unit, wanted, factor):
    assert factor_between(unit, wanted) == factor


def test_angles_and_energies_are_converted():
    assert factor_between("mrad", "degrees") == pytest.approx(np.degrees(1e-3), rel=1e-15)
    assert factor_between("aJ", "eV") == pytest.approx(6.241509074460763, rel=1e-14)
