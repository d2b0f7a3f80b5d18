"""The pair at the dividing head: positions typed, piped, or appended to a file."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from test_cross_coupling import THETA, readings

import triaxcal
from triaxcal.cli.main import main

ROWS = np.column_stack([np.degrees(THETA), *readings(0, 1e-7, 10.0)])
LINES = [f"{t:g} {a:.10f} {b:.10f}" for t, a, b in ROWS]


def live(*more: str, lines: list[str] | None = None) -> Result:
    """The command with --live and lines on its standard input."""
    text = "\n".join(LINES if lines is None else lines) + "\n"
    return CliRunner().invoke(main, ["crosscoupling", "--live", *more], input=text)


def test_the_estimate_stands_after_each_position_and_the_study_at_the_end(tmp_path: Path) -> None:
    saved = tmp_path / "pair.csv"
    result = live("--save", str(saved))
    assert result.exit_code == 0, result.output
    shown = result.stdout.splitlines()
    assert shown[0] == "1: at least 7 more for an estimate"
    assert shown[8].endswith("4 more to know the noise")
    enough = [line.split(":")[0] for line in shown[:28] if line.endswith("ENOUGH")]
    assert enough[0] == "22"
    # What is saved gives the same as what was typed.
    again = CliRunner().invoke(main, ["crosscoupling", str(saved)])
    assert result.stdout.endswith(again.stdout)
    last = triaxcal.cross_coupling(saved).result
    assert f"KipA {last.values[4] * 1e6:.3f} (sd {last.sd[4] * 1e6:.2g})" in shown[27]


def test_a_target_decides_what_is_enough() -> None:
    shown = live("--target", "1.15e-7").stdout.splitlines()
    enough = [line.split(":")[0] for line in shown[:28] if line.endswith("ENOUGH")]
    assert int(enough[0]) > 22
    assert "target 0.115e-6 not yet reached" in shown[20]
    assert not any("ENOUGH" in line for line in live("--target", "1e-8").stdout.splitlines())


def test_a_line_that_is_no_position_is_refused_and_the_next_is_taken() -> None:
    lines = LINES.copy()
    lines.insert(3, "44 -0.7")
    lines.insert(5, "57 -5.341 8.224")
    lines.insert(7, "# a break")
    result = live(lines=lines)
    assert result.exit_code == 0
    assert 'line: "44 -0.7"; expected theta_deg a_g b_g' in result.stderr
    assert "position 5: A reads -5.341 at 57 deg; expected about -0.545 g" in result.stderr
    assert result.stdout.endswith(live().stdout.split("\n\n", 1)[1])


def test_undo_takes_the_last_position_back() -> None:
    odd = f"{ROWS[20, 0]} {ROWS[20, 1] + 1e-4} {ROWS[20, 2]}"
    wrong = [*LINES[:20], odd, "undo", *LINES[20:]]
    result, plain = live(lines=wrong), live()
    assert "sd from the others: measure it again" in result.stdout
    assert result.stdout.splitlines()[-12:] == plain.stdout.splitlines()[-12:]


def test_standard_deviations_of_the_readings_are_used_from_the_first_residual() -> None:
    result = live(lines=[f"{line} 1e-7 1e-7" for line in LINES])
    assert "times what the stated sd of A and B explain" in result.stdout
    assert "(sd " in result.stdout.splitlines()[8]


def test_a_growing_file_is_followed(tmp_path: Path) -> None:
    file = tmp_path / "head.csv"
    file.write_text("theta_deg,a_g,b_g\n", encoding="utf-8")
    rows = [",".join(line.split()) for line in LINES]

    def measure() -> None:
        for n in range(0, 28, 4):
            with file.open("a", encoding="utf-8") as stream:
                # A row may be seen before its end is written.
                stream.write("\n".join(rows[n : n + 4])[:-3])
                stream.flush()
                time.sleep(0.02)
                stream.write("\n".join(rows[n : n + 4])[-3:] + "\n")

    rig = threading.Thread(target=measure)
    rig.start()
    result = CliRunner().invoke(main, ["crosscoupling", "--live", str(file), "--idle", "1.5"])
    rig.join()
    assert result.exit_code == 0, result.output
    assert result.stdout == live().stdout


def test_too_few_positions_end_in_a_refusal_and_bad_options_too(tmp_path: Path) -> None:
    few = live(lines=LINES[:4])
    assert few.exit_code == 1
    assert isinstance(few.exception, triaxcal.RefusedError)
    assert "the positions: 4 positions; expected at least 10" in str(few.exception)
    missing = CliRunner().invoke(main, ["crosscoupling"])
    assert missing.exit_code == 2
    assert "Missing argument 'FILE', or option '--live'." in missing.output
    absent = CliRunner().invoke(main, ["crosscoupling", "--live", str(tmp_path / "none")])
    assert isinstance(absent.exception, triaxcal.RefusedError)


def test_the_other_mounting_gives_kio() -> None:
    shown = live("--mounting", "output").stdout
    assert "KioA" in shown
    assert "Kip" not in shown
    with pytest.raises(triaxcal.RefusedError, match='mounting: "sideways"'):
        triaxcal.LivePair(mounting="sideways")
    pair = triaxcal.LivePair()
    with pytest.raises(triaxcal.RefusedError, match="position 1: sd 0, 1; expected two numbers"):
        pair.take(*ROWS[0], 0.0, 1.0)
    assert pair.rows == ()
    assert pair.undo() is None


def test_standard_deviations_in_a_file_come_in_pairs_above_0(tmp_path: Path) -> None:
    file = tmp_path / "pair.csv"

    def told(head: str, more: str) -> str:
        rows = [",".join(line.split()) + more for line in LINES]
        file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
        with pytest.raises(triaxcal.RefusedError) as refusal:
            triaxcal.cross_coupling(file)
        return str(refusal.value)

    assert "column sd_a_g: the standard deviation of one" in told("theta_deg,a_g,b_g,sd_a_g", ",1")
    head = "theta_deg,a_g,b_g,sd_a_g,sd_b_g"
    assert "column sd_b_g: 0; expected a number above 0" in told(head, ",1e-7,0")


def test_standard_deviations_come_with_all_positions_or_with_none() -> None:
    pair = triaxcal.LivePair()
    pair.take(*ROWS[0], 1e-7, 1e-7)
    with pytest.raises(triaxcal.RefusedError, match="position 2: without standard deviations"):
        pair.take(*ROWS[1])
    pair.undo()
    pair.take(*ROWS[0])
    with pytest.raises(triaxcal.RefusedError, match="position 2: with standard deviations"):
        pair.take(*ROWS[1], 1e-7, 1e-7)
    with pytest.raises(triaxcal.RefusedError, match="theta_deg"):
        pair.take(float("nan"), *ROWS[1][1:])
    with pytest.raises(triaxcal.RefusedError, match="sd inf, 1"):
        triaxcal.LivePair().take(*ROWS[0], float("inf"), 1.0)
    assert pair.rows == (tuple(ROWS[0]),)
