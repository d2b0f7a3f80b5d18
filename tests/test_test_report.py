"""The test report: what it states covers the truth; what was not measured says why."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from performance_cases import (
    T0,
    TEST,
    UNIT,
    UP,
    Campaign,
    truths,
    voltage,
    write_campaign,
    write_measurements,
)
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import judge
from triaxcal.model.types import FloatArray
from triaxcal.performance.figures import Chapter, Figure
from triaxcal.performance.testreport import UnitReport, make_report
from triaxcal.report.testreport.document import report_json
from triaxcal.report.testreport.page import report_html
from triaxcal.report.testreport.text import report_text
from triaxcal.unit.description import unit_of_text

SMALL = Campaign(
    runs=3,
    temps_degc=(-20.0, 20.0, 60.0),
    switched=1,
    on_s=1500.0,
    rest_s=200.0,
    cycle_k_per_min=4.0,
    cycle_rate_hz=0.2,
)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Fitted, Path]:
    folder = tmp_path_factory.mktemp("units") / "C"
    write_campaign(folder, 11, SMALL)
    return triaxcal.fit(triaxcal.read_unit(folder)).fitted, folder


def reported(fitted: Fitted, folder: Path | None, tests: str) -> UnitReport:
    """Report of the unit with other tests in its unit.toml."""
    start = fitted.unit.toml.partition("\n[test.")[0]
    unit = unit_of_text("C", f"{start}\n{tests}", "unit.toml")
    done = replace(fitted, unit=unit)
    return make_report(done, judge(done), folder, "ieee-1293")


def stated(kind: str, more: str = "", file: str = "t.csv", temperature: bool = True) -> str:
    text = TEST.format(name="t", kind=kind, file=file, more=more)
    return text if temperature else text.replace('temperature = "temp"\n', "")


def write(path: Path, time: FloatArray, extra: FloatArray, temp: FloatArray | float = T0) -> None:
    """Readings of z up with a disturbance (n, 3) in micro-g."""
    degc = np.broadcast_to(np.asarray(temp, dtype=np.float64), time.shape)
    volts = voltage(np.array([0.0, 0.0, 1.0]) + extra * 1e-6, degc)
    rows = np.column_stack([time, volts, degc])
    np.savetxt(path, rows, delimiter=",", header="t,ux,uy,uz,temp", comments="", fmt="%.10g")


def white(count: int, seed: int = 0) -> FloatArray:
    return 25.0 * np.random.default_rng(seed).standard_normal((count, 3))


@pytest.mark.long
def test_figures_cover_the_truth_of_a_small_campaign(fitted: tuple[Fitted, Path]) -> None:
    """One seed, three axes: that many misses of 95 % intervals have a chance below 1e-3."""
    done, folder = fitted
    report = make_report(done, judge(done), folder, "ieee-1293")
    missed: dict[str, int] = {}
    for (key, axis), value in truths(SMALL).items():
        figure = report.of(key, axis)
        if figure.measured:
            missed[key] = missed.get(key, 0) + (not figure.covers(value))
    assert {"bias", "hysteresis", "noise_N", "warm_up_time_constant", "runs_bias"} <= set(missed)
    assert sum(missed.values()) <= 8
    assert (
        report.of("switching", "x").why == "[test.on] has one switching-on: two at least are needed"
    )
    assert set(report.files) == {
        "test.on: on0.csv", "test.rest: rest.csv", "test.cycle: cycle.csv",
    }  # fmt: skip


@pytest.mark.slow
def test_figures_cover_the_truth_of_many_campaigns(tmp_path: Path) -> None:
    """12 campaigns of ten runs, 36 values a figure: at 95 %, 28 or fewer have a chance of 2e-4."""
    truth, hits = Campaign(), {}
    wanted = truths(truth)
    for seed in range(12):
        folder = tmp_path / f"C{seed}"
        write_campaign(folder, seed, truth)
        result = triaxcal.make_test_report(triaxcal.read_unit(folder)).result
        for (key, axis), value in wanted.items():
            hits.setdefault(key, []).append(result.of(key, axis).covers(value))
    for key, found in hits.items():
        assert sum(found) > len(found) * 28 / 36 - 1, key


# ---- what was not measured says why ----

EVEN = np.arange(600) * 1.0


def power_on(path: Path) -> None:
    write(path, EVEN, white(600) + 900.0 * np.exp(-EVEN / 60.0)[:, None])


def cycle(path: Path, ways: int = 2) -> None:
    up = np.linspace(-20.0, 60.0, 2000)
    temp = np.concatenate([up, up[::-1]][:ways])
    write(path, np.arange(len(temp)) * 1.0, white(len(temp)), temp)


def with_gap(path: Path) -> None:
    write(path, np.where(EVEN < 300.0, EVEN, EVEN + 50.0), white(600))


def uneven(path: Path) -> None:
    write(path, np.cumsum(np.random.default_rng(1).uniform(0.3, 1.7, 600)), white(600))


def late(path: Path) -> None:
    write(path, EVEN, white(600) + 900.0 * np.exp(-(EVEN + 100.0) / 60.0)[:, None])


BAD = [
    ("power-on", "", power_on, "warm_up_amplitude", "does not tell when the unit was"),
    ("power-on", "first_sample_s = 100", late, "warm_up_amplitude",
     "the first sample is 100 s after switching on, and output x has a time constant of 6"),
    ("power-on", "first_sample_s = 0", power_on, "switching", "has one switching-on: two at least"),
    ("rest", "longest_tau_s = 100", power_on, "noise_N", "600 s long; expected 900 s"),
    ("rest", "", uneven, "noise_B", "expected samples at even times"),
    ("hysteresis", "", lambda p: cycle(p, 1), "hysteresis", "only heating; expected 5 degC"),
    ("hysteresis", "", power_on, "hysteresis", "the temperature stays within 0 degC"),
    ("rest", 'acceleration_unit = "mV"', power_on, "noise_N",
     "a mean |a| of 0.01275 g; expected about 1 g of a unit at rest; check acceleration"),
    ("rest", 'acceleration_unit = "m/s^2"', power_on, "noise_N",
     "readings in m/s^2, and the unit is calibrated in V"),
]  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_test_that_cannot_be_used_says_why(
    fitted: tuple[Fitted, Path],
    tmp_path: Path,
    case: tuple[str, str, Callable[[Path], None], str, str],
) -> None:
    kind, more, made, key, why = case
    made(tmp_path / "t.csv")
    report = reported(fitted[0], tmp_path, stated(kind, more))
    figure = report.of(key)
    assert not figure.measured
    assert why in figure.why
    assert "\n" not in figure.why
    assert f"not measured: {figure.why}" in report_text(report)


def test_a_recording_that_ends_too_early(fitted: tuple[Fitted, Path], tmp_path: Path) -> None:
    extra = 25.0 * np.random.default_rng(0).standard_normal((600, 3)) * 0.1
    write(tmp_path / "t.csv", EVEN, extra + 900.0 * np.exp(-EVEN / 400.0)[:, None])
    report = reported(fitted[0], tmp_path, stated("power-on", "first_sample_s = 0"))
    assert "599 s long, and output x has a time constant of" in report.of("warm_up_settling").why


def test_absent_temperature_file_and_folder(fitted: tuple[Fitted, Path], tmp_path: Path) -> None:
    cycle(tmp_path / "t.csv")
    without = reported(fitted[0], tmp_path, stated("hysteresis", temperature=False))
    assert "[test.t] temperature: missing; expected its column" in without.of("hysteresis").why
    absent = reported(fitted[0], tmp_path, stated("rest", file="absent.csv"))
    assert "absent.csv: cannot be read: no such file or directory" in absent.of("noise_N").why
    assert "[test.t] file" in absent.of("noise_N").why
    nowhere = reported(fitted[0], None, stated("rest"))
    assert "the unit has no folder to read it from" in nowhere.of("noise_N").why


def test_gaps_and_missing_readings_are_reported(
    fitted: tuple[Fitted, Path], tmp_path: Path
) -> None:
    with_gap(tmp_path / "t.csv")
    lines = (tmp_path / "t.csv").read_text().splitlines()
    lines[10] = lines[10].replace(lines[10].split(",")[1], "nan")
    (tmp_path / "t.csv").write_text("\n".join(lines))
    report = reported(fitted[0], tmp_path, stated("rest"))
    (chapter,) = (c for c in report.chapters if c.key == "noise")
    words = " ".join(chapter.notes)
    assert "1 row without all readings left out" in words
    assert "the longest stretch without one is used" in words
    assert report.of("noise_N", "z").measured
    on = reported(fitted[0], tmp_path, stated("power-on", "first_sample_s = 0"))
    words = " ".join(on.chapters[2].notes)
    assert "1 gap in time, the longest 51 s, the first before" in words


def test_a_unit_that_has_not_passed_says_so(tmp_path: Path) -> None:
    """Constants that do not change with temperature, of a unit whose do."""
    units = Path(__file__).parent.parent / "units/AT-SIM"
    text = (units / "unit.toml").read_text(encoding="utf-8")
    (tmp_path / "R").mkdir()
    (tmp_path / "R/measurements.csv").write_bytes((units / "measurements.csv").read_bytes())
    text = text.replace("t0_degc = 20", 't0_degc = 20\nmodel = "polynomial"\norder = 0')
    (tmp_path / "R/unit.toml").write_text(text + '\n[vibration.a]\ndirection = "z"\ngrms = 1\n')
    done = triaxcal.make_test_report(triaxcal.read_unit(tmp_path / "R"))
    assert "verdict   refused" in done.summary
    assert "has not passed: refused" in done.files["report.html"].decode()
    assert "the C was not run: " in done.summary
    assert done.result.of("vibration_linear", "z").measured


def test_temperatures_outside_of_the_range_are_not_compensated(
    fitted: tuple[Fitted, Path], tmp_path: Path
) -> None:
    write(tmp_path / "t.csv", EVEN, white(600) + 900.0 * np.exp(-EVEN / 60.0)[:, None], 75.0)
    report = reported(fitted[0], tmp_path, stated("power-on", "first_sample_s = 0"))
    assert report.of("warm_up_amplitude", "x").measured
    assert not any(f.key.endswith("_compensated") for f in report.chapters[2].figures)
    assert "75 to 75 degC, not within the calibrated -20 to 60" in report.chapters[2].notes[0]


def test_keys_of_tests_are_checked() -> None:
    text = (Path(__file__).parent.parent / "units/AT-SIM/unit.toml").read_text(encoding="utf-8")
    for more, found in (
        (stated("warm-up"), "kind: found 'warm-up'"),
        (stated("rest", 'file = "../x.csv"').replace('file = "t.csv"\n', ""), "file: found"),
        ('[test.t]\nkind = "rest"\n', "missing: [test.t] file, [test.t] acceleration"),
        (stated("power-on", "first_sample_s = -1"), "first_sample_s: found -1"),
        ("[report]\ninput_range_g = 0\n", "input_range_g: found 0"),
    ):
        with pytest.raises(RefusedError) as refusal:
            unit_of_text("AT-SIM", f"{text}\n{more}", "unit.toml")
        assert found in str(refusal.value)


# ---- the page, the JSON, the command ----


def test_page_and_json_of_a_unit_without_tests(tmp_path: Path) -> None:
    units = Path(__file__).parent.parent / "units"
    done = CliRunner().invoke(
        main, ["report", str(units / "AT-SIM"), "--standard", "ieee-1293", "--build", str(tmp_path)]
    )
    assert done.exit_code == 0, done.output
    assert "bias K0" in done.output
    assert "no [test.NAME] of kind power-on in unit.toml" in " ".join(done.output.split())
    document = json.loads((tmp_path / "reports/AT-SIM/report.json").read_text(encoding="utf-8"))
    assert document["format"] == 1
    assert document["standard"] == "ieee-1293"
    keys = [c["key"] for c in document["chapters"]]
    assert keys == [
        "equation", "repeatability", "warm_up", "hysteresis", "temperature", "noise", "composite",
        "vibration",
    ]  # fmt: skip
    figures = [f for c in document["chapters"] for f in c["figures"]]
    for figure in figures:
        assert figure["measured"] == (figure["not_measured_because"] == "")
        assert figure["how"] or not figure["measured"]
    page = (tmp_path / "reports/AT-SIM/report.html").read_text(encoding="utf-8")
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    assert "<script" not in page
    assert page.count("not measured: ") == sum(not f["measured"] for f in figures)
    unknown = CliRunner().invoke(main, ["report", str(units / "AT-SIM"), "--standard", "iso"])
    assert isinstance(unknown.exception, triaxcal.UsageError)
    assert "expected one of ieee-1293" in str(unknown.exception)


def test_hostile_names_are_escaped(fitted: tuple[Fitted, Path], tmp_path: Path) -> None:
    power_on(tmp_path / "<b>&.csv")
    tests = stated("power-on", "first_sample_s = 0", file="<b>&.csv")
    tests += '\n[nonlinearity]\nhow = "<script>x</script>"\ncube = [1, 1, 1]\ncube_sd = [1, 1, 1]\n'
    page = report_html(reported(fitted[0], tmp_path, tests)).decode()
    assert "<b>&" not in page
    assert "<script" not in page
    assert "&lt;script&gt;x&lt;/script&gt;" in page


@pytest.mark.parametrize(
    ("terms", "lacking"),
    [
        (("own_square", "cube"), "; not in it, because not measured: odd square; grows beyond 1 g"),
        (("own_square", "odd_square"), "; not in it, because not measured: cube; grows beyond 1 g"),
        (("own_square", "odd_square", "cube"), ""),
    ],
)
def test_composite_error_names_the_terms_that_it_lacks(
    fitted: tuple[Fitted, Path], terms: tuple[str, ...], lacking: str
) -> None:
    """And none that the same report states."""
    tests = '[report]\ninput_range_g = 5\n[nonlinearity]\nhow = "centrifuge"\n'
    tests += "".join(f"{term} = [3, 2, 1]\n{term}_sd = [1, 1, 1]\n" for term in terms)
    figure = reported(fitted[0], None, tests).of("composite_compensated", "x")
    assert figure.how.partition(" g; ")[2] == f"up to 5 g{lacking}"


def test_a_transient_within_the_band_settles_at_once(
    fitted: tuple[Fitted, Path], tmp_path: Path
) -> None:
    power_on(tmp_path / "t.csv")
    more = "first_sample_s = 0\nsettled_within_micro_g = 1e5"
    report = reported(fitted[0], tmp_path, stated("power-on", more, temperature=False))
    settling = report.of("warm_up_settling", "x")
    assert (settling.value, settling.low, settling.high) == (0.0, None, None)
    assert settling.how.endswith(": the transient stays within the band")
    assert json.loads(report_json(report))["unit"] == "C"


def test_every_text_of_a_chapter_is_escaped(fitted: tuple[Fitted, Path]) -> None:
    """By the environment of the pages, whatever a template forgets."""
    evil = "<script>x</script>"
    figure = Figure(evil, evil, evil, evil, 1.0, 0.0, 2.0, evil)
    chapter = Chapter(evil, evil, evil, (figure,), (evil,))
    report = replace(reported(fitted[0], None, ""), chapters=(chapter,), files={evil: evil})
    page = report_html(report).decode()
    assert "<script" not in page
    assert page.count("&lt;script&gt;x&lt;/script&gt;") == 10


@pytest.mark.long
def test_own_squares_of_a_tilter_and_their_rectification(tmp_path: Path) -> None:
    """A unit with squares of its own: the C removes them, the report predicts with and without."""
    K2 = np.array([300.0, -200.0, 400.0])
    rows = ["position,temp_degc,ux_v,uy_v,uz_v"]
    random = np.random.default_rng(1)
    for temp in (-40.0, 0.0, 20.0, 70.0):
        for name, up in UP.items():
            force = np.array(up, dtype=np.float64)
            volts = voltage((force + K2 * 1e-6 * force**2)[None], np.array([temp]))[0]
            volts = volts + 0.55 * 0.3e-6 * random.standard_normal(3)
            rows.append(f"{name},{temp}," + ",".join(f"{v:.12f}" for v in volts))
    (tmp_path / "C").mkdir()
    (tmp_path / "C" / "measurements.csv").write_text("\n".join(rows) + "\n")
    shaken = "\n[vibration.d]\ndirection = [1, 1, 1]\ngrms = 0.5\nsine_g = 0.8\n"
    text = UNIT.format(seed=1).replace("bits = 32", "bits = 28") + shaken
    (tmp_path / "C" / "unit.toml").write_text(text)
    report = triaxcal.make_test_report(triaxcal.read_unit(tmp_path / "C")).result
    mean_square = 0.5**2 + 0.8**2 / 2.0
    for axis, true in zip("xyz", K2, strict=True):
        assert report.of("own_square", axis).covers(true)
        assert report.of("vibration_linear", axis).covers(true * mean_square / 3.0)
        left = report.of("vibration_compensated", axis)
        c = report.of("vibration_c", axis)
        assert c.value is not None
        assert left.covers(c.value)
        # Without the squares the C would be off by more than ten times what is left.
        assert abs(c.value) < 0.1 * abs(true) * mean_square / 3.0


def test_jumps_several_files_and_dead_outputs(fitted: tuple[Fitted, Path], tmp_path: Path) -> None:
    spiked = white(600)
    spiked[300] += 1e5
    write(tmp_path / "t.csv", EVEN, spiked)
    report = reported(fitted[0], tmp_path, stated("rest"))
    words = " ".join(next(c for c in report.chapters if c.key == "noise").notes)
    assert (
        "output x jumps by more than 8 standard deviations, 2 in all, first after sample 300"
        in words
    )
    write(tmp_path / "t2.csv", EVEN, white(600))
    two = reported(fitted[0], tmp_path, stated("rest", file="t*.csv"))
    assert "2 files; expected one file of a test of kind rest" in two.of("noise_N").why
    write(tmp_path / "t.csv", EVEN, 0.0 * white(600))
    dead = reported(fitted[0], tmp_path, stated("power-on", "first_sample_s = 0"))
    assert "output x has the same value throughout" in dead.of("warm_up_amplitude").why


@pytest.mark.long
def test_days_come_from_the_history(tmp_path: Path) -> None:
    """Five calibrations a year apart; the interval of 9 degrees of freedom holds the truth."""
    folder = tmp_path / "D"
    (folder / "history").mkdir(parents=True)
    (folder / "unit.toml").write_text(UNIT.format(seed=3) + "\n[measured]\ndate = 2026-03-30\n")
    truth, random = Campaign(runs=1), np.random.default_rng(2)
    for year in (2022, 2023, 2024, 2025, 2026):
        write_measurements(folder, truth, random)
        if year < 2026:
            old = folder / "history" / f"{year}-03-30.csv"
            (folder / "measurements.csv").rename(old)
    report = triaxcal.make_test_report(triaxcal.read_unit(folder)).result
    figure = report.of("days_bias")
    assert figure.how == "5 calibrations over 4 years, about a straight line"
    assert figure.covers(truth.run_bias)
    assert report.of("days_scale").covers(truth.run_scale_ppm)
