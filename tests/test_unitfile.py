from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from strategies import unit_names
from triaxcal.base.errors import RefusedError
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.folder import check_unit_name, find_unit, list_units
from triaxcal.unit.limits import Limits
from triaxcal.unit.priors import Priors
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.thermometer import TemperatureSensor

REPO = Path(__file__).parent.parent
MINIMAL = """\
format = 1
serial = "SN-1"
[adc]
bits = 24
full_scale_v = 2.5
[temperature_sensor]
degc_per_code = 0.0078125
[site]
local_gravity_m_per_s2 = 9.80665
[thermal]
t0_degc = 20
"""


def make_unit(units_dir: Path, text: str, name: str = "U-1") -> Path:
    folder = units_dir / name
    folder.mkdir(parents=True)
    (folder / "unit.toml").write_text(text, encoding="utf-8")
    return folder


def refusal(units_dir: Path, text: str) -> str:
    folder = make_unit(units_dir, text)
    with pytest.raises(RefusedError) as caught:
        read_unit(folder)
    message = str(caught.value)
    assert message.startswith(str(folder / "unit.toml"))
    assert "\n" not in message
    return message.removeprefix(str(folder / "unit.toml"))


def with_lines(*lines: str) -> str:
    """The minimal file with lines put into the tables they name, as "[adc] bits = 8"."""
    text = MINIMAL
    for line in lines:
        table, _, setting = line.rpartition("] ")
        key = setting.split(" =")[0]
        header = f"{table}]\n" if table else ""
        text = re.sub(rf"(?m)^{key} = .*\n", "", text)
        if header and header in text:
            text = text.replace(header, f"{header}{setting}\n")
        else:
            text = text + f"{header}{setting}\n" if header else f"{setting}\n{text}"
    return text


def test_defaults(tmp_path: Path) -> None:
    assert read_unit(make_unit(tmp_path, MINIMAL)) == UnitDescription(
        name="U-1",
        serial="SN-1",
        adc=Adc(24, 2.5, -(2**23), 2**23 - 1),
        temperature_sensor=TemperatureSensor(0.0078125, 0.0),
        gravity_g=1.0,
        t0_degc=20.0,
        range_degc=None,
        polarity=None,
        estimator="auto",
        thermal=ThermalChoice("auto"),
        method="matrix",
        output_q=24,
        model_error_max_micro_g=None,
        limits=Limits(3e-4, 10e-4),
    )


def test_priors_and_terms_are_read(tmp_path: Path) -> None:
    unit = read_unit(
        make_unit(
            tmp_path,
            with_lines("[priors] scale_factor = 0.008", '[firmware] terms = "own-squares"'),
        )
    )
    assert unit.priors == Priors(scale_factor=0.008)
    assert (unit.priors.cross_term_rad, unit.priors.own_square_g_per_g2) == (0.010, 0.005)
    assert unit.firmware_terms == "own-squares"


def test_format_1_stays_readable() -> None:
    assert read_unit(REPO / "tests/formats/unit-v1") == UnitDescription(
        name="unit-v1",
        serial="OLD-0001",
        adc=Adc(16, 4.096, -30000, 30001),
        temperature_sensor=TemperatureSensor(0.0625, -50.0),
        gravity_g=9.81 / 9.80665,
        t0_degc=21.5,
        range_degc=(-30.0, 60.0),
        polarity=(1, 1, -1),
        estimator="half-sum",
        thermal=ThermalChoice("piecewise-linear", {"knots_degc": (0.0, 21.5, 40.0)}),
        method="additive-first-order",
        output_q=20,
        model_error_max_micro_g=2.5,
        limits=Limits(1e-4, 2e-3),
    )


def test_every_shipped_unit_is_readable() -> None:
    imus = {"IMU-SIM"}  # the unit.toml of a turntable: dynamic/unit.py reads it
    names = sorted(set(list_units(REPO / "units")) - imus)
    assert {"AT-CHERNIAK", "AT-SIM"} <= set(names)
    assert [read_unit(REPO / "units" / name).name for name in names] == names


def test_byte_order_mark_and_crlf_are_read(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, "")
    (folder / "unit.toml").write_bytes(
        b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode("utf-8")
    )
    assert read_unit(folder).serial == "SN-1"


def test_order_belongs_to_the_polynomial(tmp_path: Path) -> None:
    text = with_lines('[thermal] model = "polynomial"', "[thermal] order = 3")
    assert read_unit(make_unit(tmp_path, text)).thermal == ThermalChoice("polynomial", {"order": 3})


REFUSED_VALUES = [
    ("[adc] bits = 7", "found 7; expected a whole number from 8 to 32"),
    ("[adc] bits = 33", "found 33; expected a whole number from 8 to 32"),
    ("[adc] bits = true", "found true; expected a whole number from 8 to 32"),
    ("[adc] bits = 24.0", "found 24.0; expected a whole number from 8 to 32"),
    ('[adc] bits = "24"', "found '24'; expected a whole number from 8 to 32"),
    ("[adc] full_scale_v = 0", "found 0; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = 2500", "found 2500; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = nan", "found NaN; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = inf", "found Infinity; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = 1e999", "found 1E+999; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = true", "found true; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = []", "found []; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = {}", "found a table; expected a number from 0.001 to 100"),
    ("[adc] full_scale_v = 2024-02-29", "found 2024-02-29; expected a number from 0.001 to 100"),
    (
        "[adc] code_min = -8388609",
        "found -8388609; expected a whole number from -8388608 to 8388607",
    ),
    ("[adc] code_max = 8388608", "found 8388608; expected a whole number from -8388608 to 8388607"),
    (
        "[adc] code_min = 8388607",
        "found 8388607; expected code_min below code_max, which are 8388607 and 8388607",
    ),
    (
        "[adc] code_max = -8388608",
        "found -8388608; expected code_min below code_max, which are -8388608 and -8388608",
    ),
    ("[temperature_sensor] degc_per_code = 0", "found 0; expected a number from 1e-06 to 10"),
    (
        "[temperature_sensor] degc_at_zero = 1e5",
        "found 1E+5; expected a number from -10000 to 10000",
    ),
    ("[site] local_gravity_m_per_s2 = 1", "found 1; expected a number from 9.7 to 9.9"),
    ("[thermal] t0_degc = 500", "found 500; expected a number from -200 to 400"),
    ("[compensation] output_q = 31", "found 31; expected a whole number from 8 to 30"),
    ("[compensation] output_q = 7", "found 7; expected a whole number from 8 to 30"),
    (
        "[compensation] model_error_max_micro_g = 0",
        "found 0; expected a number from 0.001 to 1e+06",
    ),
    ("[priors] cross_term_rad = 0", "found 0; expected a number from 1e-07 to 1"),
    ("[priors] own_square_g_per_g2 = -0.005", "found -0.005; expected a number from 1e-09 to 1"),
    (
        '[firmware] terms = "own-square"',
        (
            "found 'own-square' (did you mean \"own-squares\"?); "
            'expected one of "auto", "linear", "own-squares", "quadratic"'
        ),
    ),
    ("[limits] at_t0_g = -3e-4", "found -0.0003; expected a number from 1e-09 to 1"),
    ("[limits] over_range_g = 2", "found 2; expected a number from 1e-09 to 1"),
    (
        "[thermal] range_degc = [70, -40]",
        "found [70, -40]; expected a list of 2 rising numbers from -200 to 400",
    ),
    (
        "[thermal] range_degc = [-40, 70, 80]",
        "found [-40, 70, 80]; expected a list of 2 rising numbers from -200 to 400",
    ),
    (
        "[thermal] range_degc = [-40, nan]",
        "found [-40, NaN]; expected a list of 2 rising numbers from -200 to 400",
    ),
    (
        "[thermal] range_degc = [false, true]",
        "found [false, true]; expected a list of 2 rising numbers from -200 to 400",
    ),
    ("[sensor] polarity = [1, 1]", "found [1, 1]; expected a list of three signs, each 1 or -1"),
    (
        "[sensor] polarity = [1, 0, 1]",
        "found [1, 0, 1]; expected a list of three signs, each 1 or -1",
    ),
    (
        "[sensor] polarity = [1, true, 1]",
        "found [1, true, 1]; expected a list of three signs, each 1 or -1",
    ),
    ('[sensor] polarity = "+++"', "found '+++'; expected a list of three signs, each 1 or -1"),
    (
        '[fit] estimator = "least-square"',
        (
            "found 'least-square' (did you mean \"least-squares\"?); "
            'expected one of "auto", "equation-10", "least-squares", "half-sum"'
        ),
    ),
    (
        "[compensation] method = 1",
        (
            'found 1; expected one of "matrix", "inverse", "additive", '
            '"additive-simplified", "additive-first-order"'
        ),
    ),
    (
        "serial = 17",
        (
            "found 17; expected text in quotes, 1 to 64 of A-Z a-z 0-9 - _, "
            "the first a letter or digit"
        ),
    ),
    ("description = 1", "found 1; expected text in quotes"),
    (
        'serial = "SN 1"',
        (
            "found 'SN 1'; expected text in quotes, 1 to 64 of A-Z a-z 0-9 - _, "
            "the first a letter or digit"
        ),
    ),
    (
        "[thermal] order = 2",
        (
            'given with model = "auto"; expected it with model = "polynomial" only; '
            "remove it, or choose that model"
        ),
    ),
    ("format = 2", "found 2; expected 1; another format needs a triaxcal that knows it"),
    ("format = true", "found true; expected 1; another format needs a triaxcal that knows it"),
]
REFUSED_KEYS = [
    ("[adc] bit = 24", ': unknown: [adc] bit (did you mean "bits"?)'),
    (
        "[adc] t0_degc = 20",
        ": missing: [thermal] t0_degc; unknown: [adc] t0_degc (it belongs to [thermal])",
    ),
    ("sitee = 1", ': unknown: sitee (did you mean "site"?)'),
    (
        "[adc] format = 1",
        ": missing: format; unknown: [adc] format (it belongs to the top of the file)",
    ),
]


@pytest.mark.parametrize(("line", "expected"), REFUSED_VALUES)
def test_a_wrong_value_is_refused(tmp_path: Path, line: str, expected: str) -> None:
    key = line.split(" =", maxsplit=1)[0]
    assert refusal(tmp_path, with_lines(line)) == f", {key}: {expected}"


@pytest.mark.parametrize(("line", "expected"), REFUSED_KEYS)
def test_a_wrong_key_is_refused(tmp_path: Path, line: str, expected: str) -> None:
    assert refusal(tmp_path, with_lines(line)) == expected


def test_a_value_for_a_table_is_refused(tmp_path: Path) -> None:
    text = "site = 1\n" + MINIMAL.replace("[site]\nlocal_gravity_m_per_s2 = 9.80665\n", "")
    assert refusal(tmp_path, text) == ", site: found 1; expected a table [site]"


def test_missing_and_unknown_keys_are_named_together(tmp_path: Path) -> None:
    text = MINIMAL.replace("serial", "seriel").replace("[site]", "[sight]")
    assert refusal(tmp_path, text) == (
        ": missing: serial, [site] local_gravity_m_per_s2; "
        'unknown: seriel (did you mean "serial"?), sight (did you mean "site"?)'
    )


def test_every_missing_key_is_listed(tmp_path: Path) -> None:
    assert refusal(tmp_path, "") == (
        ": missing: format, serial, [adc] bits, [adc] full_scale_v, "
        "[temperature_sensor] degc_per_code, [site] local_gravity_m_per_s2, [thermal] t0_degc"
    )


@pytest.mark.parametrize("knots", ["[]", "[40, 20]", "[20, 20]", "20", "[20, 401]", '["20"]'])
def test_wrong_knots_are_refused(tmp_path: Path, knots: str) -> None:
    text = with_lines('[thermal] model = "piecewise-linear"', f"[thermal] knots_degc = {knots}")
    message = refusal(tmp_path, text)
    assert message.startswith(", [thermal] knots_degc: found ")
    assert message.endswith("; expected a list of 1 to 64 rising numbers from -200 to 400")


@pytest.mark.parametrize(
    ("model", "key"),
    [
        ("piecewise-linear", "order = 1"),
        ("polynomial", "knots_degc = [20]"),
        ("auto", "knots_degc = [20]"),
    ],
)
def test_a_key_of_the_other_model_is_refused(tmp_path: Path, model: str, key: str) -> None:
    text = with_lines(f'[thermal] model = "{model}"', f"[thermal] {key}")
    assert f'given with model = "{model}"' in refusal(tmp_path, text)


@pytest.mark.parametrize("order", [-1, 10])
def test_a_wrong_order_is_refused(tmp_path: Path, order: int) -> None:
    text = with_lines('[thermal] model = "polynomial"', f"[thermal] order = {order}")
    assert refusal(tmp_path, text) == (
        f", [thermal] order: found {order}; expected a whole number from 0 to 9"
    )


def test_toml_syntax_error_names_the_line(tmp_path: Path) -> None:
    message = refusal(tmp_path, MINIMAL.replace("bits = 24", "bits = "))
    assert "not TOML" in message
    assert "line 4" in message


@pytest.mark.parametrize(
    ("line", "remedy"),
    [
        ("bits = 24,5", "; write a decimal point for the decimal comma"),
        ("bits = -0,0078 # V", "; write a decimal point for the decimal comma"),
        ('bits = "0,5" 3', ""),
        ("bits = [1, 2", ""),
    ],
)
def test_a_decimal_comma_is_named(tmp_path: Path, line: str, remedy: str) -> None:
    message = refusal(tmp_path, MINIMAL.replace("bits = 24", line))
    assert message.partition(")")[2] == remedy


@pytest.mark.parametrize("text", ["x = " + "9" * 5000, "x = 0x" + "f" * 9000, "x = " + "[" * 9999])
def test_toml_bombs_are_refused(tmp_path: Path, text: str) -> None:
    assert len(refusal(tmp_path, f"{text}\n{MINIMAL}")) < 300


def test_a_huge_number_is_refused_shortly(tmp_path: Path) -> None:
    message = refusal(tmp_path, MINIMAL.replace("24", "0x" + "f" * 9000))
    assert message.startswith(", [adc] bits: found a huge number;")


def test_not_utf8_is_refused(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, "")
    (folder / "unit.toml").write_bytes(MINIMAL.encode("utf-16"))
    with pytest.raises(RefusedError, match="byte 0 is not UTF-8; save the file as UTF-8"):
        read_unit(folder)


@given(st.text(max_size=200) | st.text(alphabet='=[]{}"\n.#abits01 ', max_size=60))
def test_any_text_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    folder = tmp_path_factory.mktemp("units") / "U-1"
    folder.mkdir()
    for whole in (text, MINIMAL + text):
        (folder / "unit.toml").write_text(whole, encoding="utf-8")
        message = ""
        try:
            assert read_unit(folder).name == "U-1"
        except RefusedError as error:
            message = str(error)
        assert message.isprintable()


# ---- names of units ----


@given(unit_names())
def test_legal_names_pass(name: str) -> None:
    check_unit_name(name)


@pytest.mark.parametrize(
    "name",
    ["", "a/b", "..", ".", "a b", "-a", "_a", "a.b", "a*/", "a\n", "a\\", 'a"', "é", "a" * 65, "٣"],
)
def test_unfit_names_are_refused(name: str) -> None:
    with pytest.raises(RefusedError, match="expected 1 to 64 of A-Z a-z 0-9 - _") as caught:
        check_unit_name(name)
    assert str(caught.value).isprintable()


def test_a_unit_that_is_not_there_lists_those_that_are(tmp_path: Path) -> None:
    make_unit(tmp_path, MINIMAL, "B-2")
    make_unit(tmp_path, MINIMAL, "A-1")
    (tmp_path / "notes").mkdir()
    listed = f"units in {tmp_path}: A-1, B-2"
    for folder, found in [
        (tmp_path / "C-3", "no such unit"),
        (tmp_path / "notes", "no unit.toml in it"),
        (tmp_path / "C-3" / "x", "no such unit"),
        (tmp_path / "A-1" / "x", "no such unit"),
    ]:
        with pytest.raises(RefusedError) as caught:
            read_unit(folder)
        assert str(caught.value) == f"{folder}: {found}; {listed}"


def test_a_long_list_of_units_is_cut(tmp_path: Path) -> None:
    for n in range(23):
        make_unit(tmp_path, MINIMAL, f"U{n:02d}")
    with pytest.raises(RefusedError, match=r"U00, U01, .*, U19 and 3 more$"):
        find_unit(tmp_path / "none")


def test_the_folder_of_units_is_no_unit(tmp_path: Path) -> None:
    make_unit(tmp_path / "units", MINIMAL, "A-1")
    with pytest.raises(RefusedError, match=r"units: no unit.toml in it; units in .*: A-1"):
        find_unit(tmp_path / "units")


def test_a_near_miss_of_a_units_name_is_named(tmp_path: Path) -> None:
    make_unit(tmp_path / "units", MINIMAL, "AT-SIM")
    make_unit(tmp_path / "units", MINIMAL, "QQ-7")
    with pytest.raises(RefusedError) as caught:
        find_unit(tmp_path / "units" / "at-sm")
    assert str(caught.value) == (
        f'{tmp_path}/units/at-sm: no such unit (did you mean "AT-SIM"?); '
        f"units in {tmp_path}/units: AT-SIM, QQ-7"
    )


def test_no_units_at_all_points_at_the_guide(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="no such unit; `triaxcal init "):
        find_unit(tmp_path / "empty" / "units" / "X")


def test_dots_after_a_folder_are_refused(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, MINIMAL)
    with pytest.raises(RefusedError, match=r"'\.\.' in the name of a unit"):
        find_unit(folder / ".." / "U-1")


def test_a_unit_is_found_from_inside_and_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_unit(tmp_path, MINIMAL)
    monkeypatch.chdir(folder)
    assert read_unit(Path()).name == "U-1"
    assert read_unit(Path("../U-1")).name == "U-1"


# ---- duplicate serials ----


def test_duplicate_serials_name_both_folders(tmp_path: Path) -> None:
    first, second = make_unit(tmp_path, MINIMAL, "A-1"), make_unit(tmp_path, MINIMAL, "B-2")
    with pytest.raises(RefusedError) as caught:
        read_unit(second)
    assert str(caught.value) == (
        f'{second}/unit.toml, serial: "SN-1" is also the serial of {first}; '
        "expected a serial number of its own for each unit; correct one of the two"
    )


def test_a_broken_neighbour_does_not_block(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, MINIMAL, "A-1")
    make_unit(tmp_path, 'serial = "SN-1"\n[[[', "B-2")
    make_unit(tmp_path, 'serial = "SN-10"', "C-3")
    make_unit(tmp_path, '[x]\nserial = "SN-1"', "D-4")
    assert read_unit(folder).serial == "SN-1"


def test_a_neighbour_of_another_format_counts(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, MINIMAL, "A-1")
    make_unit(tmp_path, 'format = 9\nserial = "SN-1"\nnew = true', "B-2")
    with pytest.raises(RefusedError, match="is also the serial of"):
        read_unit(folder)


def test_a_link_to_the_same_unit_is_no_duplicate(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, MINIMAL, "A-1")
    (tmp_path / "LATEST").symlink_to(folder)
    assert read_unit(tmp_path / "LATEST").name == "LATEST"
    assert read_unit(folder).name == "A-1"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_is_refused(tmp_path: Path) -> None:
    folder = make_unit(tmp_path, MINIMAL)
    (folder / "unit.toml").chmod(0)
    with pytest.raises(RefusedError, match="cannot be read: Permission denied"):
        read_unit(folder)


def test_the_sensor_scale() -> None:
    sensor = TemperatureSensor(0.0078125, -50.0)
    assert sensor.degc(9600) == 25.0
    assert sensor.code(25.0) == 9600
    assert Adc(24, 2.5, 0, 1).volts_per_code == 2.5 / 8388608


def test_a_copied_unit_is_told_by_its_serial(tmp_path: Path) -> None:
    """Copying a unit's folder is how most people add one; forgetting the serial is the trap."""
    shutil.copytree(REPO / "units/AT-SIM", tmp_path / "AT-SIM")
    shutil.copytree(REPO / "units/AT-SIM", tmp_path / "AT-NEW")
    with pytest.raises(RefusedError, match=r"AT-NEW/unit.toml, serial: .* of .*AT-SIM"):
        read_unit(tmp_path / "AT-NEW")


# ---- docs/reference/keys.md ----


def test_the_example_of_the_docs_is_read(tmp_path: Path) -> None:
    text = (REPO / "docs/reference/keys.md").read_text(encoding="utf-8")
    example = text.split("```toml\n")[1].split("```")[0]
    assert read_unit(make_unit(tmp_path, example)).serial == "SN-0042"
