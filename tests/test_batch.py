"""A series: restart, refusals, workers that die, this machine's cores and a real Dask cluster."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest
from click.testing import CliRunner

import batch_workers
from triaxcal.base.errors import RefusedError
from triaxcal.batch import journal
from triaxcal.batch.cluster import connect
from triaxcal.batch.local import run_local
from triaxcal.batch.order import Make, Order, Outcome, filled
from triaxcal.batch.plan import Work, plan_work
from triaxcal.batch.run import Series, run_series
from triaxcal.batch.toolchain import _toolchain, toolchain
from triaxcal.cli.batch import batch
from triaxcal.readings.format import FORMATS, Source
from triaxcal.report.series.unit import make_unit

ROOT = Path(__file__).resolve().parents[1]
TESTS = Path(__file__).parent
UNITS = Path(__file__).parents[1] / "units"


def units(folder: Path, count: int, content: str = "rows") -> Path:
    for k in range(1, count + 1):
        unit = folder / f"U-{k}"
        unit.mkdir(parents=True)
        (unit / "unit.toml").write_text(f'format = 1\nserial = "S-{k}"\n', encoding="utf-8")
        (unit / "measurements.csv").write_text(content, encoding="utf-8")
    return folder


def run(
    folder: Path, build: Path, make: Make = batch_workers.made, jobs: int = 2
) -> tuple[Work, Series, list[Outcome]]:
    told: list[Outcome] = []
    work = plan_work(folder.iterdir(), build)
    series = run_series(
        work,
        build,
        make,
        lambda m, orders: run_local(m, orders, jobs),
        sometimes=(),
        report=told.append,
    )
    return work, series, told


def test_what_is_done_and_unchanged_is_not_done_again(tmp_path: Path) -> None:
    folder, build = units(tmp_path / "units", 4), tmp_path / "build"
    work, series, told = run(folder, build)
    assert (len(work.orders), series.made, len(told)) == (4, 4, 4)
    assert run(folder, build)[1].made == 0
    # An input changes, an output is damaged, an output is lost, the journal's last line is torn.
    (folder / "U-1" / "measurements.csv").write_text("other rows", encoding="utf-8")
    (build / "U-2" / "calibration.json").write_text("damaged", encoding="utf-8")
    (build / "U-3" / "calibration.json").unlink()
    lines = (build / journal.JOURNAL_FILE).read_bytes().splitlines(keepends=True)
    torn = next(line for line in lines if b'"unit": "U-4"' in line)
    rest = [line for line in lines if line is not torn]
    (build / journal.JOURNAL_FILE).write_bytes(b"".join(rest) + torn[: len(torn) // 2])
    again, _, _ = run(folder, build)
    assert sorted(o.name for o in again.orders) == ["U-1", "U-2", "U-3", "U-4"]
    assert run(folder, build)[1].made == 0


def test_only_what_changed_is_made(tmp_path: Path) -> None:
    folder, build = units(tmp_path / "units", 3), tmp_path / "build"
    run(folder, build)
    (folder / "U-3" / "unit.toml").write_text('format = 1\nserial = "T-3"\n', encoding="utf-8")
    work, series, _ = run(folder, build)
    assert [o.name for o in work.orders] == ["U-3"]
    assert sorted(series.entries) == ["U-1", "U-2", "U-3"]


def test_another_toolchain_makes_everything_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, build = units(tmp_path / "units", 2), tmp_path / "build"
    run(folder, build)
    monkeypatch.setattr("triaxcal.batch.plan.toolchain", lambda: "another")
    assert len(plan_work(folder.iterdir(), build).orders) == 2


def test_the_toolchain_is_another_with_other_packages_or_entries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shipped = toolchain()
    assert toolchain() == shipped
    with FORMATS.added(replace(FORMATS["text"], name="toy", open=lambda _path, _layout: Source())):
        added = toolchain()
    found = metadata.version
    for package in ("scipy", "rosbags"):
        _toolchain.cache_clear()
        version = {package: "0.0.1"}
        monkeypatch.setattr(metadata, "version", lambda p, v=version: v.get(p) or found(p))
        assert toolchain() not in (shipped, added)
    monkeypatch.undo()
    _toolchain.cache_clear()
    assert added != shipped == toolchain()


def test_a_file_that_verify_renews_is_no_damage(tmp_path: Path) -> None:
    build = tmp_path / "build"
    outcome = Outcome("U-1", "k", "", {"verification.json": b"1", "triax_comp.c": b"2"}, {})
    (build / "U-1").mkdir(parents=True)
    for name, content in outcome.files.items():
        (build / "U-1" / name).write_bytes(content)
    entry = journal.entry_of(outcome)
    (build / "U-1" / "verification.json").write_bytes(b"with the tools' findings")
    assert journal.intact(build, entry)
    (build / "U-1" / "triax_comp.c").write_bytes(b"3")
    assert not journal.intact(build, entry)


def test_two_units_with_one_serial_are_refused_and_the_others_made(tmp_path: Path) -> None:
    folder, build = units(tmp_path / "units", 3), tmp_path / "build"
    (folder / "U-3" / "unit.toml").write_text('format = 1\nserial = "S-1"\n', encoding="utf-8")
    _, series, _ = run(folder, build)
    assert sorted(series.entries) == ["U-2"]
    assert sorted(series.refused) == ["U-1", "U-3"]
    assert series.refused["U-1"] == (
        f'{folder}/U-1/unit.toml, serial: "S-1" is also the serial of {folder}/U-3; '
        "expected a serial of its own for each unit; correct one of the two"
    )


def test_a_neighbour_that_was_not_named_counts(tmp_path: Path) -> None:
    folder, build = units(tmp_path / "units", 2), tmp_path / "build"
    (folder / "U-2" / "unit.toml").write_text('format = 1\nserial = "S-1"\n', encoding="utf-8")
    work = plan_work([folder / "U-1"], build)
    assert "is also the serial of" in work.refused[0].refusal


def test_one_name_in_two_folders(tmp_path: Path) -> None:
    one, two = units(tmp_path / "a", 1), units(tmp_path / "b", 1)
    (two / "U-1" / "unit.toml").write_text('format = 1\nserial = "T"\n', encoding="utf-8")
    work = plan_work([one / "U-1", two / "U-1"], tmp_path / "build")
    assert not work.orders
    assert '"U-1" is also the name of' in work.refused[0].refusal


def test_a_refused_unit_does_not_stop_the_others(tmp_path: Path) -> None:
    folder, build = units(tmp_path / "units", 4), tmp_path / "build"
    (folder / "U-2" / "measurements.csv").write_text("refuse", encoding="utf-8")
    (folder / "U-4" / "measurements.csv").unlink()
    _, series, told = run(folder, build)
    assert sorted(series.entries) == ["U-1", "U-3"]
    assert series.refused["U-2"] == f"{folder}/U-2: as asked"
    assert "U-4/measurements.csv: cannot be read: no such file" in series.refused["U-4"]
    assert len(told) == 4
    # Refused units are tried again.
    assert [o.name for o in run(folder, build)[0].orders] == ["U-2"]


def test_units_of_a_worker_that_dies_are_made_again(tmp_path: Path) -> None:
    folder = units(tmp_path / "units", 5, str(tmp_path / "mark"))
    _, series, told = run(folder, tmp_path / "build", batch_workers.dies_once)
    assert (tmp_path / "mark").read_text() == "dead"
    assert sorted(series.entries) == [f"U-{k}" for k in range(1, 6)]
    assert sorted(o.name for o in told) == sorted(series.entries)


def test_a_unit_that_workers_die_on_is_refused_and_the_others_made(tmp_path: Path) -> None:
    folder = units(tmp_path / "units", 5)
    _, series, _ = run(folder, tmp_path / "build", batch_workers.always_dies)
    assert sorted(series.entries) == ["U-1", "U-3", "U-4", "U-5"]
    assert list(series.refused) == ["U-2"]
    assert "the worker process died on it twice" in series.refused["U-2"]


# ---- the command ----


def triaxcal(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "triaxcal", *map(str, arguments)],
        cwd=cwd, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """AT-CHERNIAK, made by `calib`, and beside it one that is refused."""
    folder = tmp_path_factory.mktemp("bench")
    shutil.copytree(ROOT / "units" / "AT-CHERNIAK", folder / "units" / "AT-CHERNIAK")
    shutil.copytree(ROOT / "units" / "AT-CHERNIAK", folder / "units" / "BROKEN")
    path = folder / "units" / "BROKEN" / "unit.toml"
    path.write_text(path.read_text().replace('"AT-CHERNIAK"', '"BROKEN"'), encoding="utf-8")
    rows = folder / "units" / "BROKEN" / "measurements.csv"
    rows.write_text(rows.read_text().replace("TP3,70", "TP4,70"), encoding="utf-8")
    (folder / "units" / "notes.txt").write_text("a stray file", encoding="utf-8")
    done = triaxcal("calib", "units/AT-CHERNIAK", "--build", "one", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_batch_gives_what_calib_gives(bench: Path) -> None:
    command = ["batch", *sorted((bench / "units").iterdir()), "--build", "many", "--jobs", "1"]
    done = triaxcal(*command, cwd=bench)
    assert done.returncode == 1
    assert content(bench / "many" / "AT-CHERNIAK") == content(bench / "one" / "AT-CHERNIAK")
    assert sorted(p.name for p in (bench / "many").iterdir()) == [
        "AT-CHERNIAK", "series.html", "series.json", "series.jsonl",
    ]  # fmt: skip
    assert "2 units: 0 passed, 1 not shown, 1 refused" in done.stdout
    lines = done.stderr.splitlines()
    assert len(lines) == 3
    assert lines[0].endswith("notes.txt: a file, not a unit's folder; skipped")
    # The place is the unit's own, not the worker's.
    assert lines[1].startswith(f"refused  {bench}/units/BROKEN/measurements.csv, rows")
    assert "TP4 twice at one temperature" in lines[1]
    assert lines[2].startswith("triaxcal: batch: 1 of 2 units refused; see above or many/series")
    found = json.loads((bench / "many" / "series.json").read_text())
    assert (found["units"], found["made"], list(found["refused"])) == (2, 1, ["BROKEN"])
    again = triaxcal(*command, cwd=bench)
    assert "1 were done and unchanged" in " ".join(again.stdout.split())


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "nonsense://x:1", "tcp://127.0.0.1", "tcp://127.0.0.1:x"]
)
def test_a_scheduler_that_is_not_there(address: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(RefusedError) as refusal:
        connect(address)
    line = str(refusal.value)
    assert line.startswith(f"--scheduler {address}: no scheduler answers there (")
    assert line.endswith(
        "expected a running Dask scheduler, as tcp://host:8786; start it, or leave the option out "
        "to use this machine's cores"
    )


def test_distributed_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RefusedError, match=r"distributed is missing; install it: .*pip install"):
        connect("tcp://127.0.0.1:9")


def test_usage(tmp_path: Path) -> None:
    for arguments in (["--jobs", "0"], ["--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"], []):
        done = CliRunner().invoke(batch, [*arguments, *([str(tmp_path)] if arguments else [])])
        assert done.exit_code == 2


# ---- a real cluster ----


@contextmanager
def cluster(count: int = 2) -> Iterator[str]:
    path = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, str(TESTS / "batch_cluster.py"), str(count)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env=os.environ | {"PYTHONPATH": path},
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.stdin.close()
        process.wait(60)
        process.stdout.close()


KILLED = """
import sys
from pathlib import Path
import batch_workers
from triaxcal.batch.cluster import connect, run_cluster
from triaxcal.batch.plan import plan_work
from triaxcal.batch.run import run_series

client = connect(sys.argv[1])
folder, build = Path(sys.argv[2]), Path(sys.argv[3])
work = plan_work(folder.iterdir(), build)
series = run_series(
    work, build, getattr(batch_workers, sys.argv[4]),
    lambda m, o: run_cluster(client, m, o), sometimes=(), report=lambda outcome: None,
)
print(sorted(series.entries), series.refused)
client.close()
"""


def test_a_real_cluster(bench: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with cluster() as address:
        done = triaxcal(
            "batch", "units/AT-CHERNIAK", "--build", "far", "--scheduler", address, cwd=bench
        )
        assert done.returncode == 0, done.stderr
        assert content(bench / "far" / "AT-CHERNIAK") == content(bench / "one" / "AT-CHERNIAK")
        # A worker dies in the middle: its units are made by the other.
        folder = units(tmp_path / "units", 5, str(tmp_path / "mark"))
        killed = subprocess.run(
            [sys.executable, "-c", KILLED, address, str(folder), str(tmp_path / "b"), "dies_once"],
            capture_output=True, text=True, check=False, timeout=120,
            env=os.environ | {"PYTHONPATH": str(TESTS)},
        )  # fmt: skip
        assert (tmp_path / "mark").exists(), killed.stderr
        assert killed.stdout.strip() == "['U-1', 'U-2', 'U-3', 'U-4', 'U-5'] {}", killed.stderr


def test_a_cluster_that_is_lost_is_told_in_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    for k in range(1, 9):
        unit = tmp_path / "units" / f"U-{k}"
        shutil.copytree(ROOT / "units" / "AT-CHERNIAK", unit)
        text = (unit / "unit.toml").read_text(encoding="utf-8")
        (unit / "unit.toml").write_text(text.replace('"AT-CHERNIAK"', f'"U-{k}"'), "utf-8")
    with cluster(1) as address:
        process = subprocess.Popen(
            [sys.executable, "-m", "triaxcal", "batch", *sorted((tmp_path / "units").iterdir()),
             "--build", str(tmp_path / "b"), "--scheduler", address],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        while process.poll() is None and not (tmp_path / "b" / "series.jsonl").exists():
            time.sleep(0.02)
    # The cluster has ended with the block. The first unit is kept.
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    (line,) = errors.splitlines()
    assert re.fullmatch(
        r"triaxcal: --scheduler: the cluster was lost \(\w+\); run again when it is back: units "
        r"that were made are kept",
        line,
    )
    assert (tmp_path / "b" / "U-1" / "triax_comp.c").exists()


def test_a_cluster_without_workers_is_told(bench: Path) -> None:
    pytest.importorskip("distributed")
    with cluster(0) as address:
        done = triaxcal("batch", "units/AT-CHERNIAK", "--scheduler", address, cwd=bench)
    assert done.returncode == 1
    assert "the scheduler has no workers; start some: dask worker" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def interrupted(orders: list[Order], after: int) -> Iterator[Outcome]:
    """The runner's outcomes, and Ctrl-C once `after` of them have come."""
    for count, outcome in enumerate(run_local(batch_workers.made, orders, 1), start=1):
        yield outcome
        if count == after:
            raise KeyboardInterrupt


def test_an_interrupt_is_told_and_the_next_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, build = units(tmp_path / "units", 4), tmp_path / "build"
    arguments = [*(str(p) for p in sorted(folder.iterdir())), "--build", str(build)]
    with monkeypatch.context() as patch:
        patch.setattr(
            "triaxcal.api.series.run_local", lambda _make, orders, *_: interrupted(orders, 2)
        )
        with pytest.raises(RefusedError) as stopped:
            batch.main(arguments, standalone_mode=False)
    assert str(stopped.value) == (
        "batch: interrupted; 2 of 4 units are done; run it again to go on"
    )
    work, series, _ = run(folder, build)
    assert len(work.done) == 2
    assert sorted(series.entries) == ["U-1", "U-2", "U-3", "U-4"]


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_while_workers_start_is_one_line(bench: Path, tmp_path: Path, times: int) -> None:
    """A terminal interrupts all of its processes, those as well that do not ignore it yet.

    What a script starts in the background ignores SIGINT, and so would the tests' own children.
    """
    heeding = ["env", "--default-signal=INT", sys.executable, "-m", "triaxcal"]
    process = subprocess.Popen(
        [*heeding, "batch", "units/AT-CHERNIAK", "--build", str(tmp_path)],
        cwd=bench, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    while process.poll() is None and not is_worker_of(process.pid):
        pass
    os.killpg(process.pid, signal.SIGINT)
    assert process.stderr is not None
    lines = [process.stderr.readline()]
    if times == 2:
        os.killpg(process.pid, signal.SIGINT)
    lines += process.communicate(timeout=120)[1].splitlines()
    assert process.returncode == 1
    assert lines == [
        "interrupted: finishing 1 unit under way; interrupt again to stop at once\n",
        f"triaxcal: batch: interrupted; {2 - times} of 1 units are done; run it again to go on",
    ]
    assert (tmp_path / "AT-CHERNIAK").exists() == (times == 1)


def is_worker_of(parent: int) -> bool:
    """Whether a worker of that process has been started; it may have done nothing yet."""
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            status = (entry / "stat").read_text(encoding="utf-8")
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if status[status.rindex(")") + 2 :].split()[1] == str(parent) and b"spawn_main" in command:
            return True
    return False


def test_a_simulated_imu_without_its_recording_is_skipped_and_a_real_one_refused(
    tmp_path: Path,
) -> None:
    """A stray file is no unit of the series."""
    folder = units(tmp_path / "units", 1)
    for name in ("SIM", "REAL"):
        shutil.copytree(
            UNITS / "IMU-SIM", folder / name, ignore=shutil.ignore_patterns("recording.csv")
        )
        text = (folder / name / "unit.toml").read_text(encoding="utf-8")
        (folder / name / "unit.toml").write_text(text.replace("IMU-SIM-001", name), "utf-8")
    (folder / "REAL" / "imu_truth.toml").unlink()
    (folder / "notes.txt").touch()
    work, series, _ = run(folder, tmp_path / "build")
    assert series.skipped == {
        "SIM": "a simulated IMU without its recording, which "
        f"triaxcal simulate {folder / 'SIM'} makes"
    }
    assert len(work.skipped) == 2
    assert list(series.entries) == ["U-1"]
    assert series.refused["REAL"].startswith(
        f"{folder}/REAL/recording.csv: cannot be read: no such file or directory"
    )
    assert "\n" not in series.refused["REAL"]


@pytest.mark.parametrize("where", ["../recording.csv", "/absolute/recording.csv"])
def test_an_imu_s_recording_that_lies_elsewhere_is_refused(tmp_path: Path, where: str) -> None:
    folder = tmp_path / "units"
    shutil.copytree(UNITS / "IMU-SIM", folder / "A")
    text = (folder / "A" / "unit.toml").read_text(encoding="utf-8")
    (folder / "A" / "unit.toml").write_text(text.replace("recording.csv", where), "utf-8")
    (folder / "A" / "imu_truth.toml").unlink()
    (outcome,) = plan_work([folder / "A"], tmp_path / "build").refused
    assert "recording.csv lies outside of the unit's folder; expected a file" in outcome.refusal


def test_what_is_written_on_paper_does_not_stop_a_unit(tmp_path: Path) -> None:
    """[passport] is not in the hash of the inputs, but the passport is made anew."""
    shutil.copytree(UNITS / "AT-CHERNIAK", tmp_path / "units" / "AT-CHERNIAK")
    unit, build = tmp_path / "units" / "AT-CHERNIAK", tmp_path / "build"
    before = plan_work([unit], build).orders[0].key
    with (unit / "unit.toml").open("a", encoding="utf-8") as file:
        file.write('\n[passport]\nlanguages = ["en", "de"]\n')
    (order,) = plan_work([unit], build).orders
    assert order.key != before
    outcome = make_unit(order)
    assert outcome.refusal == ""
    assert "passport.de.html" in outcome.files


def test_a_unit_of_several_recordings_brings_them_all(tmp_path: Path) -> None:
    folder = tmp_path / "units" / "HAND"
    folder.mkdir(parents=True)
    (folder / "unit.toml").write_text('serial = "H-1"\n[recording]\nfile = ["b.csv", "a*.csv"]\n')
    for name in ("a1.csv", "a2.csv", "b.csv", "c.csv"):
        (folder / name).write_text("ax,ay,az\n")
    (order,) = plan_work([folder], tmp_path / "build").orders
    assert order.files == ("unit.toml", "b.csv", "a1.csv", "a2.csv")


def test_a_unit_of_a_recording_brings_its_recording(tmp_path: Path) -> None:
    folder = tmp_path / "units" / "HAND"
    folder.mkdir(parents=True)
    (folder / "unit.toml").write_text('serial = "H-1"\n[recording]\nfile = "poses.csv"\n')
    (folder / "poses.csv").write_text("ax,ay,az\n")
    (order,) = plan_work([folder], tmp_path / "build").orders
    assert order.files == ("unit.toml", "poses.csv")
    assert set(filled(order).inputs) == {"unit.toml", "poses.csv"}


def test_a_recording_outside_of_the_unit_s_folder_is_not_sent(tmp_path: Path) -> None:
    folder = tmp_path / "units" / "HAND"
    folder.mkdir(parents=True)
    (tmp_path / "poses.csv").write_text("mine\n")
    (folder / "unit.toml").write_text(
        f'serial = "H-1"\n[recording]\nfile = "{tmp_path / "poses.csv"}"\n'
    )
    (order,) = plan_work([folder], tmp_path / "build").orders
    assert order.files == ("unit.toml",)
    outcome = make_unit(replace(order, inputs={**filled(order).inputs, "../poses.csv": b"other"}))
    assert "lies outside of the unit's folder" in outcome.refusal
    assert (tmp_path / "poses.csv").read_text() == "mine\n"


def test_a_recording_in_a_subfolder_goes_with_its_unit(tmp_path: Path) -> None:
    folder = tmp_path / "units" / "HAND"
    (folder / "data").mkdir(parents=True)
    (folder / "unit.toml").write_text('serial = "H-1"\n[ recording ]\nfile = "data/x.csv"\n')
    (folder / "data" / "x.csv").write_text("ax,ay,az\n")
    (order,) = plan_work([folder], tmp_path / "build").orders
    outcome = make_unit(filled(order))
    assert "unit.toml" in outcome.refusal  # of the keys that this unit lacks
    assert "fault" not in outcome.refusal


def test_a_word_in_a_comment_makes_no_imu(tmp_path: Path) -> None:
    folder = units(tmp_path / "units", 1)
    (unit,) = folder.iterdir()
    with (unit / "unit.toml").open("a") as file:
        file.write("# no [dynamic] here\n")
    work = plan_work([unit], tmp_path / "build")
    assert (len(work.orders), work.skipped) == (1, [])


@pytest.mark.parametrize("table", ["dynamic", "recording"])
def test_a_file_that_is_not_toml_is_refused_and_the_others_made(tmp_path: Path, table: str) -> None:
    folder, build = units(tmp_path / "units", 3), tmp_path / "build"
    (folder / "U-2" / "unit.toml").write_text(f"[{table}\n", encoding="utf-8")
    _, series, _ = run(folder, build)
    assert sorted(series.entries) == ["U-1", "U-3"]
    assert series.refused["U-2"].startswith(f"{folder}/U-2/unit.toml: not TOML: ")


def real_unit(folder: Path) -> Order:
    """AT-CHERNIAK in a series of its own."""
    shutil.copytree(UNITS / "AT-CHERNIAK", folder / "AT-CHERNIAK")
    (order,) = plan_work([folder / "AT-CHERNIAK"], folder / "build").orders
    return order


def append_line(path: Path) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write("\n")


def test_a_unit_that_changes_while_the_series_runs_is_refused(tmp_path: Path) -> None:
    order = real_unit(tmp_path)
    sent = filled(order)
    append_line(tmp_path / "AT-CHERNIAK" / "unit.toml")
    text = f"{tmp_path}/AT-CHERNIAK: its files changed while the series ran; run again"
    (outcome,) = run_local(make_unit, [order], 1)
    assert outcome.refusal == text
    with pytest.raises(RefusedError) as refusal:
        filled(order)
    assert str(refusal.value) == text
    # What was sent before is made.
    assert make_unit(sent).refusal == ""
    (tmp_path / "AT-CHERNIAK" / "measurements.csv").unlink()
    (outcome,) = run_local(make_unit, [order], 1)
    assert outcome.refusal == (
        f"{tmp_path}/AT-CHERNIAK/measurements.csv: cannot be read: no such file or directory; "
        "put it there, or correct its name in unit.toml"
    )


def test_a_worker_here_reads_the_unit_s_own_folder(tmp_path: Path) -> None:
    order = real_unit(tmp_path)
    here, sent = make_unit(order), make_unit(filled(order))
    assert not order.inputs  # a recording of gigabytes is not sent through a pipe
    assert here == sent
    assert here.refusal == ""


def test_a_recording_that_is_a_folder(tmp_path: Path) -> None:
    folder = tmp_path / "units" / "HAND"
    (folder / "bag" / "more").mkdir(parents=True)
    (folder / "unit.toml").write_text('serial = "H-1"\n[recording]\nfile = "bag"\n')
    (folder / "bag" / "metadata.yaml").write_text("a")
    (folder / "bag" / "more" / "x.db3").write_text("b")
    (order,) = plan_work([folder], tmp_path / "build").orders
    inputs = filled(order).inputs
    assert sorted(inputs) == ["bag/metadata.yaml", "bag/more/x.db3", "unit.toml"]
    assert inputs["bag/more/x.db3"] == b"b"
    (folder / "bag" / "more" / "x.db3").rename(folder / "bag" / "more" / "y.db3")
    with pytest.raises(RefusedError, match="its files changed while the series ran"):
        filled(order)
