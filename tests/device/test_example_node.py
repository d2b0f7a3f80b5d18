"""The scripts of examples/xcp-node: the sensor's file, and the node on a bus of python-can."""

from __future__ import annotations

import runpy
import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyxcp")
pytest.importorskip("can")

from click.testing import CliRunner

import triaxcal
from builds import UNITS
from device.atsim import bench_of_at_sim
from device.node import EXAMPLE
from triaxcal.cli.main import main

pytestmark = pytest.mark.long

GRAVITY = "9.8111"
"""local_gravity_m_per_s2 of AT-SIM's unit.toml."""


def test_the_node_of_the_example_is_flashed_and_verified(tmp_path: Path) -> None:
    bench = bench_of_at_sim(tmp_path)
    triaxcal.deliver(UNITS / "AT-SIM", tmp_path / "build")
    calibration, samples = tmp_path / "build" / "AT-SIM" / "calibration.json", bench.node.samples
    samples.unlink()
    runpy.run_path(str(EXAMPLE / "make_samples.py"))["main"](
        str(calibration), GRAVITY, str(samples)
    )
    assert np.fromfile(samples, "<i4").shape == (64 * 4,)
    run = runpy.run_path(str(EXAMPLE / "on_bus.py"))["run"]
    stop, codes = threading.Event(), list[int]()
    files = (str(bench.node.program), str(bench.node.flash), str(samples))
    goes_on = lambda: not stop.is_set()  # noqa: E731
    node = threading.Thread(
        target=lambda: codes.append(run("virtual:example", *files, goes_on=goes_on)), daemon=True
    )
    node.start()
    told = ""
    try:
        for words in (
            ["flash", str(bench.file)],
            ["verify", str(UNITS / "AT-SIM"), "--samples", "64"],
        ):
            arguments = ["device", *words, "--bus", "virtual:example"]
            done = CliRunner().invoke(main, arguments, catch_exceptions=False)
            told += " ".join(done.output.split())
    finally:
        stop.set()
        node.join(10)
    assert codes == [0]
    assert "read back and equal" in told
    # At rest and within the limit: otherwise it would say "every bit verified", or refuse.
    assert "virtual:example, node 0x650: verified on device AT-SIM-001" in told
