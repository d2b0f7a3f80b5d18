"""`triaxcal device` on python-can's virtual bus."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from builds import UNITS
from device.atsim import Bench, bench_of_at_sim
from triaxcal.base.errors import RefusedError
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


def test_a_bus_that_is_none() -> None:
    pytest.importorskip("pyxcp")
    assert "expected a CAN device, or interface:channel" in refused("identify", "--bus", "pcann:X")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    text = refused("flash", tmp_path / "none.bin", "--bus", "can0")
    assert text == f"{tmp_path / 'none.bin'}: cannot be read: no such file or directory"
