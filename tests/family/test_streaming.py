"""Clocks mended, rows left out, a file read in small pieces: what the one reader promises."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, directions, log, write_unit

from triaxcal.base.errors import RefusedError
from triaxcal.poses import stillness
from triaxcal.poses.poses import PoseSet, find_poses
from triaxcal.readings import spool
from triaxcal.readings.formats import text as text_format
from triaxcal.readings.samples import Samples, read_samples
from triaxcal.readings.spool import Spool
from triaxcal.unit.description import read_unit

ROWS = log(directions(12))
READINGS = 'acceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"\n'


def samples_of(folder: Path) -> Samples:
    unit = read_unit(folder)
    assert unit.recording is not None
    return read_samples(folder, unit.recording, unit.temperature_sensor)


def poses_of(folder: Path) -> PoseSet:
    unit = read_unit(folder)
    assert unit.recording is not None
    return find_poses(samples_of(folder), unit.recording)


def stamped(head: str, stamp: Callable[[float], str]) -> str:
    lines = [f"{stamp(t)},{x!r},{y!r},{z!r}" for t, x, y, z in ROWS.tolist()]
    return "\n".join([f"{head},ax,ay,az", *lines])


# ---- clocks ----


def day(t: float) -> str:
    """Time of day of a recording that starts 20 s before midnight."""
    minutes, seconds = divmod((t + 86380.0) % 86400.0, 60.0)
    return f"{int(minutes // 60):02d}:{int(minutes % 60):02d}:{seconds:09.6f}"


@pytest.mark.parametrize(
    ("head", "stamp", "keys", "told"),
    [
        ("t", day, 'time = "t"\ntime_unit = "iso"', "the clock starts again once (midnight)"),
        (
            "t",
            lambda t: str((round(t * 1e6) + 2**32 - 10_000_000) % 2**32),
            'time = "t"\ntime_unit = "us"',
            "the clock starts again once (every 4294.97 s)",
        ),
        (
            "t",
            lambda t: str(round(t * 1e4) % 2**16),
            'time = "t"\ntime_unit = "us"',
            "the clock starts again 7 times (every 0.065536 s)",
        ),
        (
            "s,ns",
            lambda t: f"{1680000000 + int(t)},{round(t % 1.0 * 1e9)}",
            'time = ["s", "ns"]\ntime_unit = ["s", "ns"]',
            "",
        ),
        (
            "d,t",
            lambda t: f"2026-03-{30 + (t >= 20.0)},{day(t)}",
            'time = ["d", "t"]\ntime_unit = "iso"',
            "",
        ),
    ],
    ids=["midnight", "32 bits", "16 bits", "seconds and nanoseconds", "date and time"],
)
def test_clocks_that_start_again_or_have_two_columns(
    tmp_path: Path, head: str, stamp: Callable[[float], str], keys: str, told: str
) -> None:
    found = samples_of(write_unit(tmp_path / "U", stamped(head, stamp), READINGS + keys))
    scale = 0.01 if "0.065536" in told else 1.0  # ten thousandths of a second, called us
    # Stamps are rounded to 1 us at most.
    np.testing.assert_allclose(found.part("time_s"), ROWS[:, 0] * scale, rtol=0, atol=1.01e-6)
    assert np.array_equal(found.part("reading"), ROWS[:, 1:])
    assert [finding.split(":")[0] for finding in found.findings] == [told] * bool(told)


def test_a_pause_across_midnight_is_a_pause(tmp_path: Path) -> None:
    """At 23:00 it stops, at 6:00 it goes on: 7 hours, back by 17 on the clock."""
    row = len(ROWS) // 2
    pause = np.where(np.arange(len(ROWS)) < row, 0.0, 7 * 3600.0)
    lines = [
        f"{day(t - 3600.0 + p)},{x!r},{y!r},{z!r}"
        for (t, x, y, z), p in zip(ROWS.tolist(), pause, strict=True)
    ]
    keys = READINGS + 'time = "t"\ntime_unit = "iso"'
    found = samples_of(write_unit(tmp_path / "U", "\n".join(["t,ax,ay,az", *lines]), keys))
    np.testing.assert_allclose(found.part("time_s"), ROWS[:, 0] + pause, rtol=0, atol=1.01e-6)
    assert found.findings[0].split(":")[0] == "the clock starts again once (midnight)"


def test_a_list_of_units_has_one_for_each_column(tmp_path: Path) -> None:
    keys = READINGS + 'time = "t"\ntime_unit = ["s", "ns"]'
    with pytest.raises(
        RefusedError, match="time_unit: 2 units for 1 columns of time; expected one"
    ):
        read_unit(write_unit(tmp_path / "U", ROWS, keys))


# ---- rows out of order ----


def test_rows_out_of_order_are_left_out_and_reported(tmp_path: Path) -> None:
    rows = ROWS.copy()
    late = np.arange(49, len(rows), 50)
    rows[late, 0] -= 0.03
    found = samples_of(write_unit(tmp_path / "U", rows))
    kept = np.delete(rows, late, axis=0)
    assert np.array_equal(found.part("reading"), np.asarray([[float(f"{v:.9g}") for v in r] for r in
                                                            kept[:, 1:]]))  # fmt: skip
    assert found.findings == (
        f"{len(late)} rows out of order in time left out, by at most 0.01 s, the first is line 51",
    )
    assert len(poses_of(tmp_path / "U").poses) == 12


@pytest.mark.parametrize(
    ("bad", "ahead_s"),
    [([700, 701, 702], 1000.0), (range(9, 700, 40), 10.0), (range(9, 700, 40), 0.03)],
    ids=["three in a row", "single", "by one step and a half"],
)
def test_only_rows_with_a_time_ahead_are_left_out(
    tmp_path: Path, bad: Sequence[int], ahead_s: float
) -> None:
    rows = ROWS[:800].copy()
    rows[list(bad), 0] += ahead_s
    found = samples_of(write_unit(tmp_path / "U", rows))
    # Column 1 counts lines: the header is line 1.
    assert set(range(800)) - set((found.part("row") - 2).ravel().astype(int)) == set(bad)
    assert found.findings[0].startswith(f"{len(bad)} rows out of order in time left out, by at ")


def test_one_stamp_ahead_does_not_cost_all_rows_after_it(tmp_path: Path) -> None:
    rows = ROWS.copy()
    rows[100, 0] = 1e6
    found = samples_of(write_unit(tmp_path / "U", rows))
    assert len(found) == len(rows) - 1
    assert found.findings[0].startswith("1 row out of order in time left out, by at most 1e+06 s")


@pytest.mark.parametrize(("every", "refused"), [(21, False), (19, True)])
def test_more_than_five_per_cent_are_refused(tmp_path: Path, every: int, refused: bool) -> None:
    rows = ROWS.copy()
    rows[every - 1 :: every, 0] -= 0.03
    folder = write_unit(tmp_path / "U", rows)
    if refused:
        with pytest.raises(RefusedError, match=r"expected rising time in all but 5% of the rows"):
            samples_of(folder)
    else:
        samples_of(folder)


# ---- pieces ----


@pytest.mark.parametrize("piece", [1, 7, 100])
def test_pieces_give_what_the_whole_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: int
) -> None:
    rows = ROWS.copy()
    rows[49::50, 0] -= 0.03
    folder = write_unit(tmp_path / "U", rows)
    whole = poses_of(folder)
    monkeypatch.setattr(spool, "PIECE", piece)
    monkeypatch.setattr(text_format, "PIECE", piece)
    parts = poses_of(folder)
    assert parts.findings == whole.findings
    for one, other in zip(parts.poses, whole.poses, strict=True):
        assert (one.line, one.count, one.start_s) == (other.line, other.count, other.start_s)
        # Sums of some hundred readings of 10 m/s^2, added in another order.
        np.testing.assert_allclose(one.reading, other.reading, rtol=0, atol=1e-12)


def test_memory_has_no_more_than_a_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No read of the spool is longer than a piece, and no search than a chunk."""
    folder = write_unit(tmp_path / "U", log(directions(40)))
    monkeypatch.setattr(spool, "PIECE", 64)
    monkeypatch.setattr(spool, "SAMPLED", 512)
    monkeypatch.setattr(stillness, "CHUNK", 400)
    longest = 0
    read = Spool.rows

    def measured(self: Spool, start: int, stop: int) -> np.ndarray:
        nonlocal longest
        longest = max(longest, stop - start)
        return read(self, start, stop)

    monkeypatch.setattr(Spool, "rows", measured)
    assert len(poses_of(folder).poses) == 40
    assert longest <= 400


def test_a_file_that_grows_while_it_is_read_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_unit(tmp_path / "U", ROWS)
    blocks = text_format.TextSource.blocks

    def growing(self: text_format.TextSource, *columns: list[int]) -> Iterator[object]:
        yield from blocks(self, *columns)
        with (folder / "log.csv").open("a", encoding="utf-8") as file:
            file.write("999,0,0,0\n")

    monkeypatch.setattr(text_format.TextSource, "blocks", growing)
    with pytest.raises(
        RefusedError, match=r"log.csv: changed while it was read; expected a record"
    ):
        samples_of(folder)


def test_a_last_line_cut_short_is_reported(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", ROWS)
    path = folder / "log.csv"
    path.write_text(path.read_text(encoding="utf-8").rpartition(",")[0], encoding="utf-8")
    found = samples_of(folder)
    assert found.findings == (f"the last line, {len(ROWS) + 1}, is cut short: left out",)
    assert len(found) == len(ROWS) - 1


def test_a_last_line_without_line_end_is_reported(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", ROWS)
    path = folder / "log.csv"
    path.write_text(path.read_text(encoding="utf-8")[:-3], encoding="utf-8")
    found = samples_of(folder)
    assert found.findings == ("the last line has no line end: it may be cut",)
    assert len(found) == len(ROWS)


def test_two_columns_of_one_name_are_refused_where_they_are_asked_for(tmp_path: Path) -> None:
    text = "t,ax,ay,az,az\n" + "\n".join(
        ",".join(f"{v:.6f}" for v in [*row, row[-1]]) for row in ROWS.tolist()
    )
    folder = write_unit(tmp_path / "U", text)
    with pytest.raises(RefusedError, match=r"2 columns 'az' \(\[recording\] acceleration\)"):
        samples_of(folder)
    numbered = COLUMNS.replace('"ax", "ay", "az"', "2, 3, 4")
    assert len(samples_of(write_unit(tmp_path / "V", text, numbered))) == len(ROWS)
