from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from triaxcal.base.errors import RefusedError
from triaxcal.readings.measurements import Dwell, read_measurements, volts, write_measurements
from triaxcal.readings.measurements_csv import DEVIATIONS, READINGS
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.limits import Limits
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.thermometer import TemperatureSensor

REPO = Path(__file__).parent.parent
UNIT = UnitDescription(
    name="U-1",
    serial="SN-1",
    adc=Adc(24, 2.5, -(2**23), 2**23 - 1),
    temperature_sensor=TemperatureSensor(0.0078125, -50.0),
    gravity_g=1.0,
    t0_degc=20.0,
    range_degc=None,
    polarity=None,
    estimator="auto",
    thermal=ThermalChoice("auto"),
    method="matrix",
    output_q=24,
    model_error_max_micro_g=1.0,
    limits=Limits(3e-4, 10e-4),
)
V_HEADER = "position,temp_degc,ux_v,uy_v,uz_v"
FULL_HEADER = V_HEADER + ",count,sd_ux_v,sd_uy_v,sd_uz_v"


def read(folder: Path, data: str | bytes, unit: UnitDescription = UNIT) -> tuple[Dwell, ...]:
    path = folder / "measurements.csv"
    path.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)
    measurements = read_measurements(path, unit)
    assert measurements.source == str(path)
    return measurements.dwells


def refusal(folder: Path, data: str | bytes, unit: UnitDescription = UNIT) -> str:
    with pytest.raises(RefusedError) as caught:
        read(folder, data, unit)
    message = str(caught.value)
    assert message.isprintable()
    assert message.startswith(str(folder / "measurements.csv"))
    return message.removeprefix(str(folder / "measurements.csv"))


def test_volts(tmp_path: Path) -> None:
    (dwell,) = read(tmp_path, f"{V_HEADER}\nTP6,-40,-0.53893044,-1e-3,.5\n")
    assert (dwell.row, dwell.position, dwell.temp_degc) == (2, "TP6", -40.0)
    assert dwell.voltage_v.tolist() == [-0.53893044, -1e-3, 0.5]
    assert dwell.count is None
    assert dwell.sd_v is None
    assert dwell.variance_of_mean_v2 is None


def test_codes_and_statistics(tmp_path: Path) -> None:
    header = "count,uz_code,uy_code,ux_code,temp_code,position,sd_ux_code,sd_uy_code,sd_uz_code"
    (dwell,) = read(tmp_path, f"{header}\n400,-8388608,8388607,0.25,9600.5,CP3,37,0,1.5\n")
    lsb_v = 2.5 / 2**23
    assert dwell.temp_degc == 9600.5 / 128 - 50
    assert dwell.voltage_v.tolist() == [0.25 * lsb_v, 8388607 * lsb_v, -2.5]
    assert dwell.count == 400
    assert dwell.sd_v is not None
    assert dwell.sd_v.tolist() == [37 * lsb_v, 0.0, 1.5 * lsb_v]
    assert dwell.variance_of_mean_v2 is not None
    np.testing.assert_allclose(
        dwell.variance_of_mean_v2, (dwell.sd_v**2 / 400), rtol=0, atol=0, strict=True
    )


def test_format_1_stays_readable() -> None:
    """Comments, byte order mark, CRLF, spaces, blank lines, mV, statistics."""
    folder = REPO / "tests/formats/unit-v1"
    first, second = read_measurements(folder / "measurements.csv", read_unit(folder)).dwells
    assert (first.row, first.position, first.temp_degc) == (5, "TP1", 1144.5 * 0.0625 - 50)
    assert first.voltage_v.tolist() == [1.25e-3, -2.5e-3, 0.55]
    assert first.count == 100
    assert first.sd_v is not None
    assert first.sd_v.tolist() == [0.5e-3, 0.25e-3, 0.0]
    assert (second.row, second.position, second.temp_degc) == (7, "CP6", -25.0)
    assert second.voltage_v.tolist() == [-0.5, 0.250125, 3e-3]
    assert second.count == 7


def test_shipped_measurements_are_readable() -> None:
    for name, dwells in (("AT-CHERNIAK", 18), ("AT-SIM", 78)):
        folder = REPO / "units" / name
        read_back = read_measurements(folder / "measurements.csv", read_unit(folder))
        assert len(read_back.dwells) == dwells


@pytest.mark.parametrize(
    ("page", "rows"), [("reference/file-formats.md", 2), ("how-to/add-a-unit.md", 1)]
)
def test_the_example_of_the_docs_is_read(tmp_path: Path, page: str, rows: int) -> None:
    text = (REPO / "docs" / page).read_text(encoding="utf-8")
    blocks = [block for block in text.split("```")[1::2] if "\nTP1," in block]
    assert len(blocks) == 1
    assert len(read(tmp_path, blocks[0].lstrip("\n"))) == rows


def test_the_docs_name_every_column() -> None:
    text = (REPO / "docs/reference/file-formats.md").read_text(encoding="utf-8")
    columns = {"position", "temp_degc", "temp_code", "count"}
    columns |= {c for names in READINGS.values() for c in names} | set(DEVIATIONS["v"])
    assert all(f"`{column}`" in text for column in columns)


def test_arrays_of_a_dwell_cannot_be_written(tmp_path: Path) -> None:
    (dwell,) = read(tmp_path, f"{V_HEADER}\nTP6,20,-0.5,0,0\n")
    with pytest.raises(ValueError, match="read-only"):
        dwell.voltage_v[0] = 0.0


def test_count_without_deviations_is_read(tmp_path: Path) -> None:
    (dwell,) = read(tmp_path, f"{V_HEADER},count\nTP6,20,-0.5,0,0,7\n")
    assert (dwell.count, dwell.sd_v) == (7, None)


def test_quoted_cells_and_bare_carriage_returns_are_read(tmp_path: Path) -> None:
    dwells = read(tmp_path, f'{V_HEADER}\r"TP6", "20",-0.5,"0",0\rTP5,20,0.5,0,0')
    assert [(d.row, d.position) for d in dwells] == [(2, "TP6"), (3, "TP5")]


CELLS = [
    # In place of ux_v of a good row.
    ("", ": the cell is empty; expected a number such as -0.54859"),
    ("abc", ": found 'abc'; expected a number such as -0.54859"),
    ("nan", ": found 'nan'; expected a number such as -0.54859"),
    ("inf", ": found 'inf'; expected a number such as -0.54859"),
    ("1e999", ": found '1e999'; expected a number such as -0.54859"),
    ("1_0", ": found '1_0'; expected a number such as -0.54859"),
    ("0x10", ": found '0x10'; expected a number such as -0.54859"),
    ("٣", ": found '٣'; expected a number such as -0.54859"),
    ("0.5 V", ": found '0.5 V'; expected a number such as -0.54859"),
    ("a\x1b[1m", ": found 'a\\x1b[1m'; expected a number such as -0.54859"),
    ("z" * 99, f": found '{'z' * 36}...; expected a number such as -0.54859"),
    (
        '"-0,54859"',
        (
            ": found '-0,54859'; expected a number such as -0.54859; "
            "write a decimal point for the decimal comma"
        ),
    ),
    (
        '"0,125"',
        (
            ": found '0,125'; expected a number such as -0.54859; "
            "write a decimal point for the decimal comma"
        ),
    ),
    (
        '"1,234.5"',
        (
            ": found '1,234.5'; expected a number such as -0.54859; "
            "leave out the thousands separator"
        ),
    ),
    (
        "1 234",
        ": found '1 234'; expected a number such as -0.54859; leave out the thousands separator",
    ),
    (
        "−0.5",
        ": found '−0.5'; expected a number such as -0.54859; write the minus sign as a hyphen",
    ),
    (
        "2.6",
        (
            ": found '2.6'; expected -2.5 to 2.499999702 V, the range of [adc]; "
            "the ADC was saturated, or [adc] does not describe it"
        ),
    ),
    (
        "-548.59",
        (
            ": found '-548.59'; expected -2.5 to 2.499999702 V, the range of [adc]; "
            "mV taken for V? if it is in mV, name the columns ux_mv, uy_mv, uz_mv"
        ),
    ),
    (
        "1840000",
        (
            ": found '1840000'; expected -2.5 to 2.499999702 V, the range of [adc]; "
            "if it is a code, name the columns ux_code, uy_code, uz_code"
        ),
    ),
    (
        "1e9",
        (
            ": found '1e9'; expected -2.5 to 2.499999702 V, the range of [adc]; "
            "the ADC was saturated, or [adc] does not describe it"
        ),
    ),
]


@pytest.mark.parametrize(("cell", "expected"), CELLS, ids=[ascii(cell)[:20] for cell, _ in CELLS])
def test_a_wrong_cell_is_refused(tmp_path: Path, cell: str, expected: str) -> None:
    data = f"# comment\n{V_HEADER}\nTP6,20,-0.5,0,0\n\nTP5,20,{cell},0,0\n"
    assert refusal(tmp_path, data) == f", row 5, column ux_v{expected}"


@pytest.mark.parametrize(
    ("row", "column", "expected"),
    [
        (
            "tp1,20,0.5,0,0,4,1,1,1",
            "position",
            (
                "found 'tp1'; expected TP1 to TP6 (fitted) or CP1 to CP6 (only checked) "
                '(did you mean "TP1"?)'
            ),
        ),
        (
            "TP7,20,0.5,0,0,4,1,1,1",
            "position",
            "found 'TP7'; expected TP1 to TP6 (fitted) or CP1 to CP6 (only checked)",
        ),
        (
            ",20,0.5,0,0,4,1,1,1",
            "position",
            "the cell is empty; expected TP1 to TP6 (fitted) or CP1 to CP6 (only checked)",
        ),
        (
            "TP1,2560,0.5,0,0,4,1,1,1",
            "temp_degc",
            (
                "found '2560'; expected -200 to 400 degC; "
                "if these are codes, name the column temp_code"
            ),
        ),
        ("TP1,20,0.5,0,0,0,1,1,1", "count", "found '0'; expected a whole number from 1 to 10000"),
        ("TP1,20,0.5,0,0,-4,1,1,1", "count", "found '-4'; expected a whole number from 1 to 1000"),
        ("TP1,20,0.5,0,0,4.5,1,1,1", "count", "found '4.5'; expected a whole number from 1 to 10"),
        ("TP1,20,0.5,0,0,1e300,1,1,1", "count", "found '1e300'; expected a whole number from 1 t"),
        ("TP1,20,0.5,0,0,,1,1,1", "count", "the cell is empty; expected a number such as"),
        ("TP1,20,0.5,0,0,4,1,-1,1", "sd_uy_v", "found '-1'; expected a standard deviation, 0 or m"),
        ("TP1,20,0.5,0,0,4,1,1,2.6", "sd_uz_v", "found '2.6'; expected less than the ADC's full s"),
        ("TP1,20,0.5,0,0,4,1,1,nan", "sd_uz_v", "found 'nan'; expected a number such as"),
    ],
)
def test_a_wrong_row_is_refused(tmp_path: Path, row: str, column: str, expected: str) -> None:
    message = refusal(tmp_path, f"{FULL_HEADER}\n{row}\n")
    assert message.startswith(f", row 2, column {column}: {expected}")


def test_a_temperature_code_out_of_reason_shows_both(tmp_path: Path) -> None:
    message = refusal(tmp_path, "position,temp_code,ux_v,uy_v,uz_v\nTP1,128000,0.5,0,0\n")
    assert message == (
        ", row 2, column temp_code: found '128000', which is 950 degC; expected -200 to 400 degC"
    )


HEADERS = [
    ("position,temp_degc,ux_v,uy_v", "missing column: uz_v"),
    ("temp_degc,ux_mv,uy_mv", "missing column: position, uz_mv"),
    ("position", "missing column: temp_degc (or temp_code), ux_v, uy_v, uz_v"),
    (
        "position,temp,ux,uy_v,uz_v",
        (
            "missing column: temp_degc (or temp_code), ux_v; unknown column: "
            "'temp' (did you mean \"temp_degc\"?), 'ux' (did you mean \"ux_v\"?)"
        ),
    ),
    (f"{V_HEADER},", "unknown column: an empty name"),
    (f"{V_HEADER},Remark", "unknown column: 'Remark'"),
    (f"{V_HEADER},COUNT", "unknown column: 'COUNT' (did you mean \"count\"?)"),
    (f"{V_HEADER},count,sd_ux_v", "missing column: sd_uy_v, sd_uz_v"),
    (f"{V_HEADER},ux_v", "doubled column: 'ux_v'"),
    (
        "position,temp_degc,ux_v,uy_mv,uz_v",
        "columns in different units: ux_v, uz_v, uy_mv; expected one unit for all",
    ),
    (f"{V_HEADER},temp_code", "both temp_degc and temp_code; expected one of them"),
    (
        f"{V_HEADER},sd_ux_v,sd_uy_v,sd_uz_v",
        "standard deviations without count; expected the column count beside them",
    ),
    (
        f"{V_HEADER},count,sd_ux_mv,sd_uy_mv,sd_uz_mv",
        "sd_ux_mv beside ux_v; expected deviations in the unit of the readings, sd_ux_v",
    ),
    (V_HEADER.replace(",", ";"), "cells separated by semicolons; expected commas"),
    (V_HEADER.replace(",", "\t"), "cells separated by tabs; expected commas"),
]


@pytest.mark.parametrize(("header", "expected"), HEADERS)
def test_a_wrong_header_is_refused(tmp_path: Path, header: str, expected: str) -> None:
    message = refusal(tmp_path, f"# comment\n{header}\nTP1,20,0.5,0,0\n")
    assert message.removesuffix("; columns: see docs/reference/file-formats.md") == (
        f", row 2 (header): {expected}"
    )


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("TP1,20,0.5,0", "4 cells; expected 5, as in the header"),
        (
            "TP1,20,0,5,0,0",
            (
                "6 cells; expected 5, as in the header; "
                "a decimal comma or a thousands separator cuts a number in two: leave it out"
            ),
        ),
        (
            "TP1;20;0.5;0;0",
            (
                "1 cell; expected 5, as in the header; "
                "separate the cells with commas, not semicolons"
            ),
        ),
        ("# repeated", "1 cell; expected 5, as in the header; comments go above the header"),
        ('TP1,20,"0.5,0,0', "not CSV: unexpected end of data"),
    ],
)
def test_a_wrong_number_of_cells_is_refused(tmp_path: Path, row: str, expected: str) -> None:
    data = f"{V_HEADER}\r\nTP6,20,-0.5,0,0\r\n{row}\r\n"
    assert refusal(tmp_path, data) == f", row 3: {expected}"


@pytest.mark.parametrize("data", ["", "\n\n", "# only a comment\n", "\ufeff"])
def test_an_empty_file_is_refused(tmp_path: Path, data: str) -> None:
    assert refusal(tmp_path, data) == ": no header and no rows; expected a header and rows"


def test_a_file_without_rows_is_refused(tmp_path: Path) -> None:
    message = refusal(tmp_path, V_HEADER + "\n\n")
    assert message == ": a header but no rows; expected one row for each dwell"


def test_not_utf8_names_the_line(tmp_path: Path) -> None:
    data = f"{V_HEADER}\nTP1,20,0.5,0,0\nTP2,20 °C,0.5,0,0\n".encode("latin-1")
    assert refusal(tmp_path, data) == ", row 3: not UTF-8; save the file as CSV UTF-8"


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError) as caught:
        read_measurements(tmp_path / "measurements.csv", UNIT)
    assert str(caught.value) == (
        f"{tmp_path}/measurements.csv: cannot be read: no such file or directory; "
        "put the dwells there, as docs/how-to/add-a-unit.md describes"
    )
    with pytest.raises(RefusedError, match="cannot be read: is a directory"):
        read_measurements(tmp_path, UNIT)


# ---- ranges and mistaken units ----


def test_the_declared_range_counts(tmp_path: Path) -> None:
    unit = replace(UNIT, adc=Adc(24, 2.5, -2_000_000, 2_000_001))
    header = V_HEADER.replace("_v", "_code")
    dwells = read(tmp_path, f"{header}\nTP1,20,-2000000,2000001,0\n", unit)
    assert dwells[0].voltage_v.tolist() == [-2_000_000 * 2.5 / 2**23, 2_000_001 * 2.5 / 2**23, 0.0]
    message = refusal(tmp_path, f"{header}\nTP1,20,-2000001,0,0\n", unit)
    assert message == (
        ", row 2, column ux_code: found '-2000001'; expected -2000000 to 2000001, "
        "the range of [adc]; the ADC was saturated, or [adc] does not describe it"
    )
    message = refusal(tmp_path, f"{V_HEADER.replace('_v', '_mv')}\nTP1,20,0,0,596.5\n", unit)
    assert "column uz_mv: found '596.5'; expected -596.0464478 to 596.0467458 mV" in message


@pytest.mark.parametrize(
    ("unit_name", "reading", "remedy"),
    [
        ("mv", "0.54859", "V taken for mV? if they are in V, name the columns ux_v, uy_v, uz_v"),
        ("code", "0.54859", "V taken for codes? if they are in V, name the columns ux_v, uy_v, u"),
        ("v", "0.00054859", "check the unit of the readings and [adc] full_scale_v"),
    ],
)
def test_a_whole_file_too_small_is_refused(
    tmp_path: Path, unit_name: str, reading: str, remedy: str
) -> None:
    header = V_HEADER.replace("_v", f"_{unit_name}")
    message = refusal(tmp_path, f"{header}\nTP5,20,{reading},0,0\nTP6,20,-{reading},0,0\n")
    peak_v = f"{volts(float(reading), unit_name, UNIT.adc):.4g}"
    place = ", columns " + ", ".join(header.split(",")[2:])
    assert message.startswith(
        f"{place}: the largest reading of all is {peak_v} V; expected at least 1/500 of the "
        f"ADC's full scale 2.5 V, 0.005 V; {remedy}"
    )


def test_the_smallest_peak_is_a_five_hundredth(tmp_path: Path) -> None:
    assert len(read(tmp_path, f"{V_HEADER}\nTP5,20,0,-0.005,0\n")) == 1
    assert "0.004999 V" in refusal(tmp_path, f"{V_HEADER}\nTP5,20,0,-0.004999,0\n")


# ---- writing ----


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["TP1", "TP6", "CP4"]),
            st.floats(-200, 400),
            st.floats(-2.49, 2.49).filter(lambda u: abs(u) > 0.01),
            st.floats(-2.49, 2.49),
            st.floats(-2.49, 2.49),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_what_is_written_reads_back_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[str, float, float, float, float]]
) -> None:
    path = tmp_path_factory.mktemp("written") / "measurements.csv"
    write_measurements(path, V_HEADER.split(","), rows, comments=("first", "second, with comma"))
    back = read_measurements(path, UNIT).dwells
    assert [(d.position, d.temp_degc, *d.voltage_v.tolist()) for d in back] == rows
    assert [d.row for d in back] == list(range(4, 4 + len(rows)))


def test_an_interrupted_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "measurements.csv"
    path.write_text("old", encoding="utf-8")
    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", interrupted)
        with pytest.raises(KeyboardInterrupt):
            write_measurements(path, ["a"], [[1.0]])
    assert [entry.name for entry in tmp_path.iterdir()] == ["measurements.csv"]
    assert path.read_text(encoding="utf-8") == "old"


def test_a_folder_in_the_way_is_refused(tmp_path: Path) -> None:
    (tmp_path / "measurements.csv").mkdir()
    with pytest.raises(RefusedError, match=r"measurements\.csv: cannot be written: "):
        write_measurements(tmp_path / "measurements.csv", ["a"], [[1.0]])
    assert [entry.name for entry in tmp_path.iterdir()] == ["measurements.csv"]


@given(st.binary(max_size=120), st.integers(0, 60), st.integers(0, 8))
def test_any_damage_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, damage: bytes, at: int, cut: int
) -> None:
    folder = tmp_path_factory.mktemp("damaged")
    good = f"{V_HEADER}\nTP5,20,0.5,0,0\nTP6,20,-0.5,0,0\n".encode()
    message = ""
    try:
        for dwell in read(folder, good[:at] + damage + good[at + cut :]):
            assert np.all(np.isfinite(dwell.voltage_v))
    except RefusedError as error:
        message = str(error)
    assert message.isprintable()
