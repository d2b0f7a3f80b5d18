"""`triaxcal device` on python-can's virtual bus."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from builds import UNITS, Built
from device.node import Node, build_node, write_samples
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.delivery.unit import deliver


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


@dataclass
class Bench:
    node: Node
    file: Path


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """The node of AT-SIM, at rest with z up, and the file of its calibration."""
    pytest.importorskip("pyxcp")
    folder = tmp_path_factory.mktemp("AT-SIM")
    delivery = deliver(UNITS / "AT-SIM")
    for name, content in delivery.files.items():
        (folder / name).write_bytes(content)
    plan = delivery.plan
    middle = (plan.temp_min_code + plan.temp_max_code) // 2
    # The codes of 1 g along z: the routine is affine in them.
    codes = np.vstack([np.zeros(3), np.eye(3) * 2**20]).astype(np.int32)
    accel, _ = python_routine(plan)(np.full(4, middle, np.int32), codes)
    slopes = (accel[1:] - accel[0].astype(np.int64)).T / 2**20
    up = np.linalg.solve(slopes, np.array([0, 0, 1 << plan.shape.output_q]) - accel[0])
    raw = np.rint(up) + np.random.default_rng(4).integers(-40, 41, (64, 3))
    write_samples(folder / "samples.bin", np.full(64, middle), raw)
    built = Built(plan, folder, None)  # type: ignore[arg-type]
    program = build_node(built, folder / "xcp_node")
    return Bench(
        Node(program, folder / "flash.bin", folder / "samples.bin"), folder / "triax_calib.bin"
    )


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
