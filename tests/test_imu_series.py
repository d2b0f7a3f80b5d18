"""IMUs in a series: made beside accelerometers, kept, refused in one line, shown on the page."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import triaxcal
from batch_workers import record
from test_series_page import Page
from triaxcal.api.series import calibrate_series
from triaxcal.batch.order import filled
from triaxcal.batch.plan import plan_work
from triaxcal.batch.run import Series
from triaxcal.batch.statistics import FEWEST_UNITS, alike, outliers, quantities
from triaxcal.report.series.page import series_files
from triaxcal.report.series.unit import make_unit
from triaxcal.simulation.unit import write_simulated_unit

UNITS = Path(__file__).parents[1] / "units"


def change(path: Path, **words: str) -> None:
    text = path.read_text(encoding="utf-8")
    for old, new in words.items():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def simulated(folder: Path, seed: int) -> Path:
    """An IMU with a recording of less than five minutes, without C."""
    shutil.copytree(UNITS / "IMU-SIM", folder, ignore=shutil.ignore_patterns("recording.csv"))
    change(folder / "imu_truth.toml", **{"minutes_per_axis = 4": "minutes_per_axis = 1.5"})
    change(folder / "unit.toml", **{"IMU-SIM-001": f"S-{seed}"})
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    (folder / "unit.toml").write_text(text[: text.index("[device]")], encoding="utf-8")
    write_simulated_unit(folder, seed)
    return folder


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path], triaxcal.SeriesResult]:
    base = tmp_path_factory.mktemp("series")
    units = [simulated(base / "units" / f"IMU-{seed}", seed) for seed in (1, 4, 5)]
    # Degrees taken for radians.
    change(units[2] / "unit.toml", **{'"deg/s"': '"rad/s"'})
    shutil.copytree(UNITS / "AT-CHERNIAK", base / "units" / "AT-CHERNIAK")
    units.append(base / "units" / "AT-CHERNIAK")
    return base, units, calibrate_series(units, base / "build", jobs=2)


def test_imus_are_made_beside_accelerometers(
    ran: tuple[Path, list[Path], triaxcal.SeriesResult], tmp_path: Path
) -> None:
    base, units, done = ran
    assert done.total == 4
    assert list(done.refused) == ["IMU-5"]
    assert "\n" not in done.refused["IMU-5"]
    assert "degrees taken for radians?" in done.refused["IMU-5"]
    assert "4 units: 2 passed, 1 not shown, 1 refused" in done.summary
    # The files are those of the single command, to the byte.
    triaxcal.deliver(units[0], tmp_path)
    names = {p.name for p in (tmp_path / "IMU-1").iterdir()}
    assert names == {p.name for p in (base / "build" / "IMU-1").iterdir()}
    for name in names:
        made = (base / "build" / "IMU-1" / name).read_bytes()
        assert made == (tmp_path / "IMU-1" / name).read_bytes()


def test_the_page_links_imus_and_the_json_has_their_states(
    ran: tuple[Path, list[Path], triaxcal.SeriesResult],
) -> None:
    base, _, done = ran
    page = Page(done.page.read_text(encoding="utf-8"))
    rows = {row[0]: row for row in page.rows[1:]}
    assert rows["IMU-1"][1:8] == ["S-1", "IMU", "passed", "", "", "", "31 states"]
    assert rows["IMU-5"][3].startswith("refused")
    links = {a["href"] for tag, a in page.tags if tag == "a"}
    assert {"./IMU-1/dynamic.html", "./AT-CHERNIAK/passport.html"} <= links
    document = json.loads((base / "build" / "series.json").read_bytes())
    (imu,) = [r for r in document["records"] if r["unit"] == "IMU-4"]
    saved = triaxcal.load_imu(base / "build" / "IMU-4" / "calibration.json")
    # The Earth's rate, which is a state where no heading was found, is not the unit's.
    names = [name for name in saved.states if name not in {"u1", "u2"}]
    assert [s["name"] for s in imu["states"]] == names
    for state in imu["states"]:
        assert state["value"] == pytest.approx(saved.states[state["name"]].value, rel=1e-12)
        assert state["sd"] == pytest.approx(saved.states[state["name"]].sd, rel=1e-12)
    shown = {d["quantity"]: d for d in document["distributions"] if d["units"] == 2}
    assert len(shown) == 31
    other = triaxcal.load_imu(base / "build" / "IMU-1" / "calibration.json")
    ends = sorted(c.states["nu0_3"].value for c in (saved, other))
    drift = shown["drift of gyro z"]
    assert [drift["min"], drift["max"]] == pytest.approx(ends, rel=1e-12)


def test_what_is_unchanged_is_kept_and_a_recording_that_grows_is_made_again(
    ran: tuple[Path, list[Path], triaxcal.SeriesResult],
) -> None:
    base, units, _ = ran
    # The page may be renewed by `triaxcal verify`.
    (base / "build" / "IMU-1" / "dynamic.html").write_text("renewed", encoding="utf-8")
    work = plan_work(units, base / "build")
    assert [o.name for o in work.orders] == ["IMU-5"]
    with (units[1] / "recording.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    work = plan_work(units, base / "build")
    assert sorted(o.name for o in work.orders) == ["IMU-4", "IMU-5"]


def test_an_order_that_was_sent_is_made_without_the_folder(
    ran: tuple[Path, list[Path], triaxcal.SeriesResult], tmp_path: Path
) -> None:
    base, units, _ = ran
    (order,) = plan_work([units[0]], tmp_path).orders
    sent = filled(order)
    assert set(sent.inputs) == {"unit.toml", "recording.csv"}
    outcome = make_unit(replace(sent, folder="/nowhere/IMU-1"))
    assert outcome.refusal == ""
    built = (base / "build" / "IMU-1" / "calibration.json").read_bytes()
    assert outcome.files["calibration.json"] == built


# ---- statistics and page, on records drawn from a seed ----


def imu_record(name: str, values: np.ndarray, blocks: list[str]) -> dict[str, Any]:
    states = [
        {"name": f"s{k}", "label": f"bias of accelerometer {'xyz'[k]}", "block": "biases",
         "unit": "mm/s^2", "value": float(value), "sd": 0.11}
        for k, value in enumerate(values)
    ]  # fmt: skip
    return {
        "unit": name, "serial": name, "kind": "IMU", "rig": None, "date": None, "result": "passed",
        "verdict": "consistent", "reference_degc": 20.0, "range_degc": None, "blocks": blocks,
        "chi_square_per_freedom": 1.0, "states": states,
    }  # fmt: skip


def page_of(records: list[dict[str, Any]]) -> tuple[str, dict[str, Any]]:
    series = Series({r["unit"]: {"record": r} for r in records}, {}, made=len(records))
    files = series_files(series)
    return files["series.html"].decode(), json.loads(files["series.json"])


def test_an_imu_far_from_the_others_is_found() -> None:
    rng = np.random.default_rng(3)
    drawn = [imu_record(f"I-{k:03d}", rng.normal(0, 5, 3), []) for k in range(FEWEST_UNITS)]
    assert outliers(drawn, quantities(drawn)) == []
    drawn[7]["states"][1]["value"] += 100.0
    text, document = page_of(drawn)
    (far,) = document["outliers"]
    assert (far["unit"], far["quantity"]) == ("I-007", "bias of accelerometer y")
    assert far["of_unit"] == "mm/s²"
    assert "sd 0.11 mm/s²" in text
    assert "Against the limits" not in text
    assert "Runs of the rig" not in text
    assert "Series · IMUs<" in text


def test_imus_of_other_states_and_accelerometers_are_not_compared() -> None:
    records = [
        imu_record("A", np.zeros(3), []), imu_record("B", np.zeros(2), ["delay"]),
        imu_record("C", np.ones(3), []), record("T"),
    ]  # fmt: skip
    assert [[r["unit"] for r in group] for group in alike(records)] == [["A", "C"], ["T"], ["B"]]
    text, _ = page_of(records)
    assert "Series · triaxial accelerometers and IMUs" in text
    assert "2 IMUs, extensions: none" in text
    assert "1 IMU, extensions: delay" in text


# ---- units whose recording is a log of CAN frames ----


@pytest.mark.parametrize("table", ["recording", "dynamic"])
def test_the_descriptions_of_a_log_s_bus_go_with_its_unit(tmp_path: Path, table: str) -> None:
    folder = tmp_path / "units" / "CAN"
    (folder / "rig").mkdir(parents=True)
    shutil.copytree(UNITS / "IMU-SIM", folder, dirs_exist_ok=True)
    (folder / "imu_truth.toml").unlink()
    change(folder / "unit.toml", **{'recording = "recording.csv"': 'recording = "frames.log"'})
    change(folder / "unit.toml", **{"[dynamic]": '[dynamic]\nrig = "rig/rig.toml"'})
    if table == "recording":
        text = 'serial = "C"\n[recording]\nfile = "frames.log"\nrig = "rig/rig.toml"\n'
        (folder / "unit.toml").write_text(text, encoding="utf-8")
    (folder / "frames.log").touch()
    rig = '[rig]\nfile = "imu.dbc"\nmore_files = ["../warm.dbc"]\n'
    (folder / "rig" / "rig.toml").write_text(rig, encoding="utf-8")
    for name in ("rig/imu.dbc", "warm.dbc"):
        (folder / name).touch()
    if table == "dynamic":
        assert "outside of the unit's folder" in plan_work([folder], tmp_path).refused[0].refusal
    change(folder / "rig" / "rig.toml", **{"../warm.dbc": "imu.dbc"})
    (order,) = plan_work([folder], tmp_path).orders
    assert order.files == ("unit.toml", "frames.log", "rig/rig.toml", "rig/imu.dbc")
    with (folder / "rig" / "imu.dbc").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert plan_work([folder], tmp_path).orders[0].key != order.key
