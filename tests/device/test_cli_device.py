"""`triaxcal device` on python-can's virtual bus."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from builds import UNITS
from device.atsim import Bench, bench_of_at_sim
from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.cli.main import main


def run(*arguments: str | Path, answer: str = "") -> str:
    done = CliRunner().invoke(
        main, ["device", *map(str, arguments)], input=answer, catch_exceptions=False
    )
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


def refused(*arguments: str | Path) -> str:
    with pytest.raises(RefusedError) as caught:
        run(*arguments)
    return str(caught.value)


def test_missing_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    text = refused("identify", "--bus", "can0")
    assert text.startswith("triaxcal device: missing packages: can, pyxcp; install them: ")
    assert "triaxcal[device]" in text


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    pytest.importorskip("pyxcp")
    return bench_of_at_sim(tmp_path_factory.mktemp("AT-SIM"))


def test_the_whole_way(bench: Bench, tmp_path: Path) -> None:
    from device.bridge import bridged

    read = tmp_path / "read.bin"
    with bridged(bench.node) as name:
        bus = ("--bus", name)
        assert "no calibration: uses that in its program" in run("identify", *bus)
        assert "no calibration in flash" in refused("read", read, *bus)
        assert not read.exists()
        assert "no calibration in flash; expected that of" in refused(
            "verify", UNITS / "AT-SIM", *bus
        )
        told = run("flash", bench.file, *bus)
        assert "triax_calib.bin is in use from slot 0, read back and equal" in told
        told = run("identify", *bus)
        for words in ("AT-SIM-001", "slot 0, store 1", "xcp-node 1", "every CRC is correct"):
            assert words in told
        run("read", read, *bus)
        assert read.read_bytes() == bench.file.read_bytes()
        told = run("verify", UNITS / "AT-SIM", *bus, "--samples", "64")
        assert "verified on device AT-SIM-001" in told
        assert "64, largest difference 0 LSB; 0 with a status other than 0" in told
        error = re.search(
            r"\|a\| - g ([+-][0-9.]+) mg of the mean, standard error ([0-9.]+) mg", told
        )
        assert error is not None
        # Four standard errors, and the digit that is printed.
        assert abs(float(error[1])) <= 4 * float(error[2]) + 1e-3
        told = run("flash", bench.file, *bus, "--power-cycle", answer="\n")
        assert "after the power cycle too" in told


@pytest.fixture(scope="module")
def flashed(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    pytest.importorskip("pyxcp")
    from device.bridge import bridged

    made = bench_of_at_sim(tmp_path_factory.mktemp("flashed"))
    with bridged(made.node) as name:
        run("flash", made.file, "--bus", name)
    return made


def test_a_length_beyond_the_limit_at_rest_is_not_verified(flashed: Bench) -> None:
    from device.bridge import bridged

    flashed.turn(0, 0, 1, gravity_g=flashed.gravity_g - 4.99e-3)
    with bridged(flashed.node) as name:
        text = refused("verify", UNITS / "AT-SIM", "--bus", name)
        there = f"{(flashed.gravity_g - 4.99e-3) * 9.80665:.6f}"
        told = run("verify", UNITS / "AT-SIM", "--bus", name, "--gravity", there)
    error = re.search(r"not verified: \|a\| - g is (-[0-9.]+) mg at rest, every bit", text)
    assert error is not None
    # The noise of the mean is some micro-g.
    assert float(error[1]) == pytest.approx(-4.99, abs=0.02)
    assert "\n" not in text
    assert ": verified on device AT-SIM-001" in told


@pytest.mark.parametrize("steps", ["at random", "slowly"])
def test_a_unit_that_moves_is_compared_but_not_judged(flashed: Bench, steps: str) -> None:
    from device.atsim import ROWS, codes
    from device.bridge import bridged
    from device.node import write_samples

    # Turned by up to 60 degrees about y, in an order that is one turn, or none at all.
    angles = np.radians(np.linspace(0.0, 60.0, ROWS))
    if steps == "at random":
        angles = np.random.default_rng(3).permutation(angles)
    forces = np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)]) * flashed.gravity_g
    found = [codes(flashed.delivery, force) for force in forces]
    write_samples(flashed.node.samples, found[0][0], np.vstack([raw[:1] for _, raw in found]))
    with bridged(flashed.node) as name:
        told = run("verify", UNITS / "AT-SIM", "--bus", name)
    assert ": every bit verified on device AT-SIM-001" in told
    assert "|a| - g not judged: not at rest, the samples scatter by " in told


@pytest.mark.parametrize(("sd_g", "slope_g"), [(1e-5, 0.0), (3e-3, 0.0), (1e-5, 4e-3)])
def test_what_is_rest(sd_g: float, slope_g: float) -> None:
    """White noise is rest, also one larger than the limit of 1 mg; a drift beyond it is not."""
    from triaxcal.device.compare import Samples
    from triaxcal.device.rest import why_not_at_rest

    n = 100
    force_g = np.array([0, 0, 1.0]) + sd_g * np.random.default_rng(2).standard_normal((n, 3))
    force_g[:, 0] += slope_g * np.arange(n) / n
    accel, zero = np.rint(force_g * 2**24).astype(np.int32), np.zeros(n, np.int32)
    samples = Samples(zero, zero, accel, accel, zero.astype(np.uint32))
    why = why_not_at_rest(samples, 24, 1e-3)
    # The standard deviation of an even drift is its length / sqrt(12).
    assert why == ("" if not slope_g else "not at rest, the samples scatter by 1.16 mg")


def test_damaged_flash_is_not_blank_flash(bench: Bench, tmp_path: Path) -> None:
    """One bit of the constants in a slot, or in both, beside flash that was never written."""
    from dataclasses import replace

    from device.bridge import bridged

    node = replace(bench.node, flash=tmp_path / "flash.bin")
    with bridged(node) as name:
        run("flash", bench.file, "--bus", name)
    one = bytearray(node.flash.read_bytes())
    with bridged(node) as name:
        run("flash", bench.file, "--bus", name)
    both = bytearray(node.flash.read_bytes())
    for content, slots, words in (
        (one, [0], "a damaged calibration in slot 0, slot 1 is blank"),
        (both, [0, 1], "damaged calibrations in both slots"),
    ):
        for slot in slots:
            content[slot * len(content) // 2 + 100] ^= 1
        node.flash.write_bytes(content)
        with bridged(node) as name:
            told = run("identify", "--bus", name)
            assert f"flash {words}: uses that in its program" in told
            text = refused("verify", UNITS / "AT-SIM", "--bus", name)
            assert f"{words} in flash; expected that of AT-SIM" in text
            assert "slot 0" in run("flash", bench.file, "--bus", name)
            assert "every CRC is correct" in run("identify", "--bus", name)


def test_nobody_answers_the_prompt_for_a_power_cycle(flashed: Bench) -> None:
    from device.bridge import bridged

    with bridged(flashed.node) as name:
        with pytest.raises(RefusedError) as caught:
            run("flash", flashed.file, "--bus", name, "--power-cycle")
        assert "every CRC is correct" in run("identify", "--bus", name)
    assert str(caught.value).startswith(
        "--power-cycle: nobody has answered; expected Enter, at a terminal or piped; "
        "the new calibration is stored, was read back, and is in use"
    )


def test_piped_prompts_have_a_line_each() -> None:
    from triaxcal.cli.devicehands import ask_for_position

    with CliRunner().isolation(input="\n\n") as (out, *_):
        ask_for_position("CP1", "")
        ask_for_position("CP2", "it moved")
        lines = [line for line in out.getvalue().decode().splitlines() if line]
    words = "in check position CP{}, at rest, then press Enter"
    assert lines == ["Put the unit " + words.format(1), "it moved. Put the unit " + words.format(2)]


AN_ID = "expected 0 to 0x7ff, or a 29-bit id with bit 31 set"
COMMANDS = {
    "identify": ["identify", "--bus", "virtual:ids"],
    "read": ["read", "found.bin", "--bus", "virtual:ids"],
    "flash": ["flash", "none.bin", "--bus", "virtual:ids"],
    "verify": ["verify", UNITS / "AT-SIM", "--bus", "virtual:ids"],
    "a2l": ["a2l", UNITS / "AT-SIM", "none.a2l"],
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("option", "value", "found"),
    [
        ("--request-id", "0x800", f"0x800; {AN_ID}: 0x80000800"),
        ("--response-id", "0x1fffffff", f"0x1fffffff; {AN_ID}: 0x9fffffff"),
        ("--response-id", "0xa0000000", f"0xa0000000; {AN_ID}"),
        ("--request-id", "-1", f"-0x1; {AN_ID}"),
        ("--response-id", "0x650", "0x650; expected another id than --request-id"),
    ],
)  # fmt: skip
def test_what_is_no_can_id(command: str, option: str, value: str, found: str) -> None:
    with pytest.raises(UsageError) as caught:
        run(*COMMANDS[command], option, value)
    assert str(caught.value) == f"{option}: found {found}"


def test_29_bits_reach_the_bus(capfd: pytest.CaptureFixture[str]) -> None:
    """0x80000650 is the frame 0x650 of 29 bits, for which the bus has a listener of its own."""
    can = pytest.importorskip("can")
    pytest.importorskip("pyxcp")
    with can.Bus(interface="virtual", channel="ids-29") as bus:
        ids = ("--request-id", "0x80000650", "--response-id", "0x80000651")
        assert "no answer" in refused("identify", "--bus", "virtual:ids-29", *ids)
        message = bus.recv(1)
    assert (message.arbitration_id, message.is_extended_id) == (0x650, True)
    assert "properly shut down" not in capfd.readouterr().err


def test_a_bus_that_is_none() -> None:
    pytest.importorskip("pyxcp")
    assert "expected a CAN device, or interface:channel" in refused("identify", "--bus", "pcann:X")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    text = refused("flash", tmp_path / "none.bin", "--bus", "can0")
    assert text == f"{tmp_path / 'none.bin'}: cannot be read: no such file or directory"
