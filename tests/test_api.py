"""The public API, as a notebook and a plant's own program use it."""

from __future__ import annotations

import csv
import importlib
import json
import os
import pickle
import pkgutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import triaxcal
from builds import UNITS
from family.family_cases import COLUMNS, directions, log, write_unit
from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.readings.measurements_csv import rows_of
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS

OLD = Path(__file__).parent / "formats" / "calibration-v0.1.0" / "calibration.json"


@pytest.fixture(scope="module")
def unit() -> triaxcal.Unit:
    return triaxcal.read_unit(UNITS / "AT-SIM")


@pytest.fixture(scope="module")
def cal(unit: triaxcal.Unit) -> triaxcal.Calibration:
    return triaxcal.fit(unit)


@pytest.fixture(scope="module")
def fw(cal: triaxcal.Calibration) -> triaxcal.Firmware:
    return triaxcal.firmware(cal)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> triaxcal.Calibration:
    folder = tmp_path_factory.mktemp("recorded") / "U"
    write_unit(folder, log(directions(14)), recording=COLUMNS)
    return triaxcal.fit(triaxcal.read_unit(folder))


def columns() -> dict[str, list[Any]]:
    text = (UNITS / "AT-SIM" / "measurements.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    return {
        name: [row[name] if name == "position" else float(row[name]) for row in rows]
        for name in rows[0]
    }


class Frame:
    """What a data frame is to its callers: names of columns, and each by its name."""

    def __init__(self, data: dict[str, list[Any]]) -> None:
        self.columns, self._data = list(data), data

    def __getitem__(self, name: str) -> list[Any]:
        return self._data[name]


# ---- from readings to constants ----


def test_constants_broadcast_over_temperature(cal: triaxcal.Calibration) -> None:
    K, U0 = cal.constants(20.0)
    assert (K.shape, U0.shape) == ((3, 3), (3,))
    many = cal.constants([[-40.0, 20.0], [0.0, 70.0]])
    assert (many[0].shape, many[1].shape) == ((2, 2, 3, 3), (2, 2, 3))
    np.testing.assert_array_equal(many[0][0, 1], K)


def test_apply_undoes_the_metrological_model(cal: triaxcal.Calibration) -> None:
    random = np.random.default_rng(0)
    force, temp = random.uniform(-1, 1, (50, 3)), random.uniform(*cal.range_degc, 50)
    K, U0 = cal.constants(temp)
    found = cal.apply(np.einsum("nij,nj->ni", K, force) + U0, temp)
    # K is well conditioned (below 1.1), so a few roundings of doubles are all that is left.
    np.testing.assert_allclose(found, force, rtol=0, atol=1e-14)
    one = cal.apply((K[0] @ force[0] + U0[0]).tolist(), float(temp[0]))
    np.testing.assert_allclose(one, force[0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("kind", ["mapping", "frame", "structured"])
def test_readings_from_a_program_give_the_constants_of_the_file(
    unit: triaxcal.Unit, cal: triaxcal.Calibration, kind: str
) -> None:
    data = columns()
    given: Any = data
    if kind == "frame":
        given = Frame(data)
    if kind == "structured":
        types = [(n, "U4" if n == "position" else "f8") for n in data]
        given = np.array(list(zip(*data.values(), strict=True)), dtype=types)
    found = triaxcal.fit(unit, given)
    temps = np.linspace(*cal.range_degc, 7)
    for mine, theirs in zip(found.constants(temps), cal.constants(temps), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_a_recording_from_a_program_gives_the_constants_of_the_file(tmp_path: Path) -> None:
    write_unit(tmp_path / "U", log(directions(12)), recording=COLUMNS)
    unit = triaxcal.read_unit(tmp_path / "U")
    rows = np.loadtxt(tmp_path / "U" / "log.csv", delimiter=",", skiprows=1)
    given = dict(zip(("t", "ax", "ay", "az"), rows.T, strict=True))
    found, of_file = triaxcal.fit(unit, given), triaxcal.fit(unit)
    for mine, theirs in zip(found.constants(20.0), of_file.constants(20.0), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert triaxcal.load(found.save(tmp_path / "c.json")).serial == found.serial
    with pytest.raises(triaxcal.RefusedError, match="readings: no column 'az'"):
        triaxcal.fit(unit, {name: values for name, values in given.items() if name != "az"})


def test_a_unit_from_arguments_is_the_unit_of_the_file(
    unit: triaxcal.Unit, cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    made = triaxcal.Unit(
        "AT-SIM",
        serial="AT-SIM-001",
        adc={"bits": 24, "full_scale_v": 2.5},
        temperature_sensor={"degc_per_code": 0.0078125},
        site={"local_gravity_m_per_s2": unit.description.gravity_g * 9.80665},
        thermal={"t0_degc": np.float64(20)},
        sensor={"polarity": np.array([1, 1, 1])} if unit.description.polarity else {},
    )
    assert made.description.adc == unit.description.adc
    found = triaxcal.fit(made, columns())
    np.testing.assert_array_equal(found.constants(20.0)[0], cal.constants(20.0)[0])
    assert triaxcal.read_unit(made.write(tmp_path / "AT-SIM").parent).toml == made.toml
    with pytest.raises(triaxcal.RefusedError, match="is there already"):
        made.write(tmp_path / "AT-SIM")


def test_uncertainty_is_that_of_the_passport(cal: triaxcal.Calibration) -> None:
    done = cal.fitted
    temps = np.array([-40.0, 20.0, 55.0])
    whole = uncertainty(done.unit, done.measurements, done.calibration, None, temps)
    for d in (0, 17, 101):
        budget = cal.uncertainty(55.0, 3.0 * DIRECTIONS[d], "a_y")
        # Two ways to one sum of squares: as a table over directions, and line by line.
        assert budget.expanded == pytest.approx(float(whole.force_u[2, d, 1]), rel=1e-9)
    assert "a_y at 55" in budget.quantity


def test_a_budget_is_a_table_of_a_screen(cal: triaxcal.Calibration) -> None:
    budget = cal.uncertainty(20.0)
    head, names, *rows = repr(budget).splitlines()
    assert head == (f"{budget.quantity}: +-{budget.expanded:.3g} g (95 %, k = {budget.factor:.2f})")
    assert names.split() == ["source", "size", "unit", "gives,", "g", "share"]
    assert [row.split("  ")[1] for row in rows] == [
        line.source.key.replace("_", " ") for line in budget.lines
    ]
    assert max(map(len, [head, names, *rows])) <= 80
    assert repr(budget) == str(budget)


def test_verdict_and_diagnosis(unit: triaxcal.Unit, cal: triaxcal.Calibration) -> None:
    assert cal.verdict.passed
    assert [t.dwells for t in cal.verdict.tested] == [6, 36, 0, 66, 30, 6, 72]
    assert repr(cal.verdict) == str(cal.verdict)
    assert repr(cal.diagnosis) == str(cal.diagnosis)
    assert str(cal.verdict).startswith("passed\nresidual at T0: 0.00135")
    assert [c.label for c in cal.diagnosis.candidates if c.chosen] == ["polynomial of order 3"]
    strict = triaxcal.Unit("U", serial="1", **_tables(unit), limits={"over_range_g": 1e-6})
    failed = triaxcal.fit(strict, columns())
    assert not failed.verdict.passed
    assert failed.verdict.refusal is not None
    assert failed.verdict.refusal.expected == "at most 0.001 mg (limits.over_range_g)"
    with pytest.raises(triaxcal.RefusedError, match="times the limit"):
        triaxcal.firmware(failed)


def _tables(unit: triaxcal.Unit) -> dict[str, Any]:
    d = unit.description
    return {
        "adc": {"bits": d.adc.bits, "full_scale_v": d.adc.full_scale_v},
        "temperature_sensor": {"degc_per_code": d.temperature_sensor.degc_per_code},
        "site": {"local_gravity_m_per_s2": d.gravity_g * 9.80665},
        "thermal": {"t0_degc": d.t0_degc},
    }


# ---- saved and loaded ----


@pytest.mark.parametrize("name", ["cal", "recorded"])
def test_what_was_saved_is_loaded_whole(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    made: triaxcal.Calibration = request.getfixturevalue(name)
    path = made.save(tmp_path / "calibration.json")
    loaded = triaxcal.load(path)
    temps = np.linspace(*made.range_degc, 5)
    for mine, theirs in zip(loaded.constants(temps), made.constants(temps), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    at = float(temps[2])
    assert loaded.uncertainty(at).expanded == made.uncertainty(at).expanded
    assert str(loaded.verdict) == str(made.verdict)
    assert loaded.diagnosis.findings == made.diagnosis.findings
    assert triaxcal.firmware(loaded).files == triaxcal.firmware(made).files
    assert loaded.save(tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_a_file_of_version_0_1_0_has_its_constants() -> None:
    old, new = triaxcal.load(OLD), triaxcal.fit(triaxcal.read_unit(UNITS / "AT-CHERNIAK"))
    np.testing.assert_array_equal(old.constants(33.0)[0], new.constants(33.0)[0])
    np.testing.assert_array_equal(
        old.apply([0.5, 0.1, 0.2], 33.0), new.apply([0.5, 0.1, 0.2], 33.0)
    )
    for asked in (triaxcal.firmware, lambda c: c.verdict, lambda c: c.uncertainty(20.0)):
        with pytest.raises(triaxcal.RefusedError, match=r"written by triaxcal 0\.1\.0"):
            asked(old)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "cannot be read: no such file or directory"),
        ("{", "not JSON"),
        ("[]", "format: missing; expected 1"),
        ('{"format": 2}', "format: found 2; expected 1"),
        ('{"format": 1, "kind": "dynamic"}', "kind: the calibration of a whole IMU; expected that"),
        ('{"format": 1, "unit": "U"}', "damaged, or no calibration.json: KeyError 'thermal_model'"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: str | None, told: str) -> None:
    path = tmp_path / "calibration.json"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.load(path)
    assert told in str(refusal.value)


def _edited(cal: triaxcal.Calibration, path: Path, edit: Callable[[Any], object]) -> Path:
    document = json.loads(cal.save(path).read_bytes())
    edit(document)
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_a_candidate_of_an_unknown_function_does_not_matter(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    path = tmp_path / "calibration.json"
    _edited(cal, path, lambda d: d["candidates"][0]["shape"].update(function="akima"))
    loaded = triaxcal.load(path)
    assert loaded.fitted.calibration.candidates[0].shape is None
    again = triaxcal.load(loaded.save(tmp_path / "again.json"))
    assert [c.label for c in again.diagnosis.candidates] == [
        c.label for c in cal.diagnosis.candidates
    ]
    assert triaxcal.firmware(again).files == triaxcal.firmware(cal).files


def test_constants_of_an_unknown_function_are_read(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    path = tmp_path / "calibration.json"
    _edited(cal, path, lambda d: d["fit"]["calibration"]["shape"].update(function="akima"))
    loaded = triaxcal.load(path)
    np.testing.assert_array_equal(loaded.constants(33.0)[0], cal.constants(33.0)[0])
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.firmware(loaded)
    assert str(refusal.value) == (
        f"{path}: its thermal function 'akima' is unknown here: only the constants were read; "
        "expected a calibration.json with its fit; calibrate the unit again"
    )


DAMAGED: dict[str, tuple[Callable[[Any], object], str]] = {
    "no number in a curve": (
        lambda d: d["thermal_model"]["coefficients"][0][3].__setitem__(1, None),
        "thermal_model: a number is not finite; expected numbers",
    ),
    "infinite term": (
        lambda d: d.update(rate_term={"offset_g_s_per_k": [1e999, 0, 0], "range_k_per_s": [0, 1]}),
        "rate_term: a number is not finite; expected numbers",
    ),
    "another value at T0": (
        lambda d: d["at_t0"].__setitem__(0, d["at_t0"][0] + 1e-9),
        (
            "at_t0: not the values of the curves in thermal_model at t0_degc; expected the file as "
            "`triaxcal calib` wrote it"
        ),
    ),
    "another serial": (
        lambda d: d.update(serial="X"),
        "serial: found 'X'; expected 'AT-SIM-001' of unit_toml",
    ),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_file_that_contradicts_itself_is_refused(
    name: str, cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    edit, expected = DAMAGED[name]
    path = _edited(cal, tmp_path / "calibration.json", edit)
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.load(path)
    assert str(refusal.value) == f"{path}, {expected}"


def test_the_curves_that_everyone_reads_are_computed_with(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    def double_slopes(document: Any) -> None:
        for row in document["thermal_model"]["coefficients"][0]:
            row[1] *= 2

    path = _edited(cal, tmp_path / "calibration.json", double_slopes)
    loaded = triaxcal.load(path)
    thermal = loaded.fitted.calibration.thermal
    np.testing.assert_array_equal(loaded.constants(33.0)[0].ravel(), thermal.constants_at(33.0)[:9])
    assert not np.array_equal(loaded.constants(33.0)[0], cal.constants(33.0)[0])


def test_a_truncated_file_is_refused_at_every_length(
    cal: triaxcal.Calibration, tmp_path: Path
) -> None:
    whole = cal.save(tmp_path / "calibration.json").read_bytes()
    cut = tmp_path / "cut.json"
    # But for the line break at its end, every byte belongs to the document.
    for length in range(0, len(whole) - 2, 997):
        cut.write_bytes(whole[:length])
        with pytest.raises(triaxcal.RefusedError):
            triaxcal.load(cut)


# ---- the device's bits ----


def test_the_integers_are_the_bits_of_the_compiled_c(fw: triaxcal.Firmware) -> None:
    random = np.random.default_rng(1)
    anything = (-(2**31), 2**31 - 1)
    shape, plan = fw.plan.shape, fw.plan
    raw = np.concatenate(
        [
            random.integers(shape.raw_min, shape.raw_max, (60_000, 3), endpoint=True),
            random.integers(*anything, (40_000, 3), endpoint=True),
        ]
    )
    temp = np.concatenate(
        [
            random.integers(plan.temp_min_code, plan.temp_max_code, 60_000, endpoint=True),
            random.integers(*anything, 40_000, endpoint=True),
        ]
    )
    accel, status = fw.apply(raw, temp)
    with fw.compiled() as c:
        compiled = c.apply(raw, temp)
    np.testing.assert_array_equal(accel, compiled[0])
    np.testing.assert_array_equal(status, compiled[1])
    good = status == 0
    assert good.sum() >= 60_000
    error_lsb = np.abs(accel[good] - fw.model(raw, temp)[good] / fw.lsb_g)
    # The float model itself rounds: 1e-6 LSB is far beyond some 2^-53 of 1 g in 2^24 LSB.
    assert 0.3 < error_lsb.max() <= fw.bound.lsb + 1e-6


def test_the_c_is_written_whole(fw: triaxcal.Firmware, tmp_path: Path) -> None:
    paths = fw.write(tmp_path / "out")
    assert {p.name for p in paths} == {
        "triax_comp.h", "triax_comp.c", "triax_calib.h", "triax_calib.c", "triax_calib.bin",
        "triax_selftest.h", "triax_selftest.c",
    }  # fmt: skip
    assert all(p.read_bytes() == fw.files[p.name] for p in paths)


def test_deliver_does_what_the_command_does(tmp_path: Path, cal: triaxcal.Calibration) -> None:
    done = triaxcal.deliver(UNITS / "AT-SIM", tmp_path)
    assert done.folder == tmp_path / "AT-SIM"
    assert {p.name for p in done.folder.iterdir()} == set(done.files)
    assert done.summary.startswith("unit            AT-SIM")
    loaded = triaxcal.load(done.folder / "calibration.json")
    np.testing.assert_array_equal(loaded.constants(20.0)[0], cal.constants(20.0)[0])
    assert (
        triaxcal.firmware(loaded).files["triax_calib.bin"]
        == (done.folder / "triax_calib.bin").read_bytes()
    )


# ---- what a notebook gets wrong ----

WRONG: dict[str, tuple[Callable[[triaxcal.Calibration, triaxcal.Firmware], object], str]] = {
    "two columns": (lambda c, _: c.apply([1, 2], 20.0), "readings: found the shape (2,)"),
    "scalar": (lambda c, _: c.apply(1.0, 20.0), "readings: found the shape ()"),
    "nan": (lambda c, _: c.apply([[0, 0, float("nan")]], 20), "readings[0, 2]: found nan"),
    "text": (lambda c, _: c.apply(["a", "b", "c"], 20), "readings: found an array of <U1"),
    "uneven lists": (lambda c, _: c.apply([[1, 2, 3], [4]], 20), "readings: no array"),
    "other length": (lambda c, _: c.apply(np.ones((3, 3)), [20, 21]), "temp_degc: found the shape"),
    "outside": (lambda c, _: c.constants([20, 200]), "temp_degc[1]: found 200 degC; expected"),
    "no temperature": (lambda c, _: c.constants(float("inf")), "temp_degc: found inf"),
    "huge direction": (lambda c, _: c.uncertainty(20, (1e300, 1e300, 0)), "direction: found"),
    "no direction": (lambda c, _: c.uncertainty(20, (0, 0, 0)), "direction: found (0, 0, 0)"),
    "two temperatures": (lambda c, _: c.uncertainty([20, 30]), "temp_degc: found the shape (2,)"),
    "masked": (lambda c, _: c.apply(np.ma.masked_less([1, -1, 1], 0), 20), "found masked values"),
    "float32": (lambda _, f: f.apply(np.full((1, 3), 2**31, np.float32), 0), "found 2147483648.0"),
    "no quantity": (lambda c, _: c.uncertainty(20, quantity="a"), "expected one of a_x, a_y, a_z"),
    "overflow": (lambda _, f: f.apply([[2**31, 0, 0]], 0), "raw_codes[0, 0]: found 2147483648"),
    "huge": (lambda _, f: f.apply([[2**70, 0, 0]], 0), "raw_codes: found an array of object"),
    "half a code": (lambda _, f: f.apply([[0.5, 0, 0]], 0), "raw_codes[0, 0]: found 0.5"),
    "nan code": (lambda _, f: f.apply([[0, 0, 0]], [float("nan")]), "temp_codes[0]: found nan"),
    "one row": (
        lambda _, f: f.apply([1, 2, 3], 0),
        "raw_codes: found the shape (3,); expected (n, 3), one row a reading",
    ),
    "two columns of codes": (
        lambda _, f: f.apply([[1, 2]], 0),
        "raw_codes: found the shape (1, 2); expected (n, 3), one row a reading",
    ),
    "codes' length": (lambda _, f: f.apply([[1, 2, 3]], [1, 2]), "temp_codes: found the shape"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_arguments_are_named(
    name: str, cal: triaxcal.Calibration, fw: triaxcal.Firmware
) -> None:
    call, told = WRONG[name]
    with pytest.raises(triaxcal.RefusedError) as refusal:
        call(cal, fw)
    assert told in str(refusal.value)
    assert refusal.value.place
    assert refusal.value.expected


def _changed(name: str, value: Any) -> dict[str, list[Any]]:
    data = columns()
    data[name] = [*data[name][:3], value, *data[name][4:]]
    return data


def test_where_nothing_can_be_written_another_folder_is_advised(
    cal: triaxcal.Calibration, fw: triaxcal.Firmware, tmp_path: Path
) -> None:
    missing, mine = tmp_path / "no" / "x.json", tmp_path / "mine.txt"
    mine.write_text("mine", encoding="utf-8")
    with pytest.raises(triaxcal.RefusedError) as refusal:
        cal.save(missing)
    assert str(refusal.value) == (
        f"{missing}: cannot be written: no such file or directory; make its folder, or name "
        "another folder"
    )
    with pytest.raises(triaxcal.RefusedError) as refusal:
        fw.write(tmp_path)
    assert str(refusal.value) == (
        f"{tmp_path}: holds 'mine.txt', which no delivery has; expected only what an earlier run "
        "wrote: the folder is replaced as a whole; move it away, or name another folder"
    )


def test_a_series_is_refused_when_it_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(triaxcal.RefusedError, match="found 0; expected 1 to 9999 units"):
        triaxcal.simulate_series(UNITS / "AT-SIM", tmp_path, 0)
    (tmp_path / "AT-SIM-0002").mkdir()
    with pytest.raises(triaxcal.RefusedError, match="AT-SIM-0002: exists already; remove it"):
        triaxcal.simulate_series(UNITS / "AT-SIM", tmp_path, 2)
    assert [p.name for p in triaxcal.simulate_series(UNITS / "AT-SIM", tmp_path / "n", 1)] == [
        "AT-SIM-0001"
    ]


@pytest.mark.parametrize(
    ("readings", "told"),
    [
        ([1, 2, 3], "readings: a list has no columns"),
        ({}, "missing column: position"),
        ({**columns(), "more": [1.0] * 78}, "readings, columns: unknown column: 'more'"),
        ({**columns(), "count": [1.0]}, "rows; expected one length for all"),
        ({**columns(), "count": 100}, "rows; expected one length for all"),
        (_changed("ux_code", float("nan")), "readings, row 4, column ux_code: found 'nan'"),
        (_changed("ux_code", "x"), "readings, row 4, column ux_code: found 'x'"),
        (_changed("temp_code", 1e9), "expected -200 to 400 degC"),
    ],
)
def test_wrong_columns_are_named(unit: triaxcal.Unit, readings: Any, told: str) -> None:
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.fit(unit, readings)
    assert told in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: triaxcal.Unit("a b", serial="1"), "expected 1 to 64 of A-Z"),
        (lambda: triaxcal.Unit("U", serial="1"), "Unit('U'): missing: [adc] bits"),
        (lambda: triaxcal.Unit("U", serial="1", adc={"bits": float("nan")}), "adc.bits: found nan"),
        (lambda: triaxcal.read_unit("nowhere/U"), "nowhere/U: no such unit"),
    ],
)
def test_wrong_units_are_named(make: Callable[[], object], told: str) -> None:
    with pytest.raises(triaxcal.RefusedError) as refusal:
        make()
    assert told in str(refusal.value)


def test_a_refusal_crosses_processes() -> None:
    refusal = triaxcal.RefusedError("place", "found", expected="this", remedy="do that")
    copied = pickle.loads(pickle.dumps(refusal))
    assert str(copied) == str(refusal) == "place: found; expected this; do that"
    assert (copied.place, copied.remedy) == ("place", "do that")


# ---- the door itself ----


def test_importing_triaxcal_imports_nothing_else() -> None:
    code = (
        "import sys; before = set(sys.modules); import triaxcal; print(set(sys.modules) - before)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(eval(done.stdout))
    assert "numpy" not in loaded
    assert {name for name in loaded if name.startswith("triaxcal")} == {"triaxcal"}


def _modules() -> Iterator[str]:
    for found in pkgutil.walk_packages(triaxcal.__path__, "triaxcal."):
        if not found.name.endswith("__main__"):
            yield found.name


def test_no_module_takes_the_place_of_a_public_name() -> None:
    tops = {name.split(".")[1] for name in _modules()}
    assert not tops & set(triaxcal.__all__)
    for name in triaxcal.__all__:
        assert getattr(triaxcal, name) is not None
    assert set(dir(triaxcal)) == set(triaxcal.__all__)
    with pytest.raises(AttributeError):
        triaxcal.nothing  # noqa: B018


@pytest.mark.parametrize("name", [n for n in triaxcal.__all__ if n != "__version__"])
def test_every_public_name_is_documented(name: str) -> None:
    member = getattr(triaxcal, name)
    assert member.__doc__
    module = importlib.import_module(member.__module__)
    assert getattr(module, name) is member


def test_a_unit_file_that_changed_after_it_was_read_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "AT-SIM"
    folder.mkdir()
    for name in ("unit.toml", "measurements.csv"):
        (folder / name).write_bytes((UNITS / "AT-SIM" / name).read_bytes())
    unit = triaxcal.read_unit(folder)
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    (folder / "unit.toml").write_text(text.replace("AT-SIM-001", "OTHER"), encoding="utf-8")
    with pytest.raises(triaxcal.RefusedError, match=r"unit\.toml: changed while it was read"):
        triaxcal.fit(unit)
    assert triaxcal.fit(triaxcal.read_unit(folder)).serial == "OTHER"


def test_units_and_calibrations_cannot_be_changed(cal: triaxcal.Calibration) -> None:
    with pytest.raises(AttributeError):
        cal.range_degc = (-400.0, 1000.0)  # type: ignore[misc]
    assert cal.unit is not None
    with pytest.raises(AttributeError):
        cal.unit.serial = "X"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: triaxcal.fit("units/AT-SIM"), "unit: found a str; expected a Unit"),
        (lambda: triaxcal.firmware("x"), "calibration: found a str; expected a Calibration"),
        (lambda: triaxcal.calibrate_series(["units"], jobs=0), "jobs: found 0; expected 1 or more"),
    ],
)
def test_wrong_kinds_of_arguments_are_named(call: Callable[[], object], told: str) -> None:
    with pytest.raises(triaxcal.RefusedError) as refusal:
        call()
    assert told in str(refusal.value)


def test_nothing_but_a_file_is_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(RefusedError) as refusal:
        renew({"pipe": b"new"}, tmp_path)
    assert str(refusal.value) == (
        f"{pipe}: is no regular file; expected a file, or nothing there; name another file"
    )
    assert pipe.is_fifo()


def test_masked_readings_are_refused() -> None:
    columns = {
        "position": [1, 2],
        "temp_degc": [20.0, 20.0],
        "ux_v": [0.1, 0.2],
        "uy_v": [0.1, 0.2],
    }
    masked = np.ma.array([0.1, 0.2], mask=[False, True])
    with pytest.raises(RefusedError) as refusal:
        rows_of({**columns, "uz_v": masked})
    assert str(refusal.value) == (
        "readings, column uz_v: found masked values; expected a number in each row; "
        "leave out the rows that are masked"
    )
