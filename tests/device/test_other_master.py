"""Tools that are not ours on the node: pya2l reads the A2L, pyxcp's own API measures and changes.

Only what is around them is ours: the A2L, the node, and the flash of the calibration before.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pya2l")
pytest.importorskip("pyxcp")

import pya2l
from click.testing import CliRunner

import triaxcal.device.master  # noqa: F401  pyxcp's import without what it does to the program
from device.atsim import Bench, bench_of_at_sim
from device.bridge import bridged, linked
from triaxcal.cli.main import main
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.delivery.saved import calibration_json
from triaxcal.device.unit import flash, identify

pytestmark = pytest.mark.long

SAMPLES = 40
RAW = ("TRIAX_raw_x", "TRIAX_raw_y", "TRIAX_raw_z")
FORCE = ("TRIAX_accel_x", "TRIAX_accel_y", "TRIAX_accel_z")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = bench_of_at_sim(tmp_path_factory.mktemp("AT-SIM"))
    with linked(made.node) as link:
        flash(link, made.file.read_bytes(), "a file")
    return made


@dataclass
class Described:
    """An A2L as pya2l reads it."""

    session: Any
    xcp: list[Any]

    def epk(self) -> str:
        from pya2l import model

        return str(self.session.query(model.Epk).one().identifier)

    def object(self, name: str) -> Any:
        from pya2l import model

        for kind in (model.Measurement, model.Characteristic):
            found = self.session.query(kind).filter_by(name=name).first()
            if found is not None:
                return found
        raise AssertionError(name)

    def place(self, name: str) -> tuple[int, int]:
        """Address and address extension."""
        found = self.object(name)
        address = found.ecu_address.address if hasattr(found, "ecu_address") else found.address
        return address, found.ecu_address_extension.extension

    def line(self, name: str) -> tuple[float, float]:
        """Slope and intercept of a conversion."""
        from pya2l import model

        conversion = self.object(name).conversion
        if conversion == "NO_COMPU_METHOD":
            return 1.0, 0.0
        method = self.session.query(model.CompuMethod).filter_by(name=conversion).one()
        return method.coeffs_linear.a, method.coeffs_linear.b


@pytest.fixture(scope="module")
def a2l(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> Described:
    from pya2l import model
    from pya2l.aml.ifdata_parser import IfDataParser

    folder = tmp_path_factory.mktemp("a2l")
    (folder / "calibration.json").write_bytes(calibration_json(bench.delivery))
    path = folder / "node.a2l"
    done = CliRunner().invoke(main, ["device", "a2l", str(folder), str(path)])
    assert done.output.split() == [str(path), "written"]
    session = pya2l.import_a2l(str(path), in_memory=True, loglevel="ERROR")
    parser = IfDataParser(session)
    return Described(session, [parser.parse(d.raw)["XCP"] for d in session.query(model.IfData)])


@contextlib.contextmanager
def tool(a2l: Described, bus: str) -> Iterator[Any]:
    """pyxcp as an A2L sets it up, connected."""
    from pyxcp.config import create_application_from_config
    from pyxcp.master import Master

    ids = next(layer["XCP_ON_CAN"][0][1] for d in a2l.xcp for layer in d if "XCP_ON_CAN" in layer)
    can = {
        "interface": "virtual",
        "channel": bus.removeprefix("virtual:"),
        "can_id_master": ids["CAN_ID_MASTER"],
        "can_id_slave": ids["CAN_ID_SLAVE"],
    }
    application = create_application_from_config(
        {"Transport": {"CAN": can}}, log_level=logging.CRITICAL
    )
    with Master("can", config=application) as master:
        master.connect()
        yield master
        master.disconnect()


def poll(master: Any, a2l: Described, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Each signal in turn, sample after sample, as physical values."""
    rows = []
    for _ in range(SAMPLES):
        row = []
        for name in names:
            kind = "<i4" if a2l.object(name).datatype == "SLONG" else "<u4"
            row.append(int(np.frombuffer(master.shortUpload(4, *a2l.place(name)), kind)[0]))
        rows.append(row)
    table = np.array(rows, np.int64).T
    lines = map(a2l.line, names)
    return {
        name: slope * column + intercept
        for name, column, (slope, intercept) in zip(names, table, lines, strict=True)
    }


def sensor(bench: Bench) -> np.ndarray:
    """What the node's sensor gives, shape (64, 4)."""
    return np.fromfile(bench.node.samples, "<i4").reshape(-1, 4)


def test_measured_by_pyxcp_and_read_by_asammdf(
    bench: Bench, a2l: Described, tmp_path: Path
) -> None:
    asammdf = pytest.importorskip("asammdf")
    names = (*FORCE, "TRIAX_temp_code", *RAW, "TRIAX_status")
    with bridged(bench.node) as bus, tool(a2l, bus) as master:
        assert master.identifier(5) == a2l.epk() == "AT-SIM-001 95afbed2f4389778"
        found = poll(master, a2l, names)
    codes = sensor(bench)[:SAMPLES]
    plan, unit = bench.delivery.plan, bench.delivery.firmware.fitted.unit
    accel, status = python_routine(plan)(codes[:, 0].copy(), codes[:, 1:].copy())
    for i, name in enumerate(RAW):
        np.testing.assert_array_equal(found[name], codes[:, 1 + i])
    for i, name in enumerate(FORCE):
        np.testing.assert_array_equal(found[name], accel[:, i] * 2.0**-plan.shape.output_q)
    np.testing.assert_array_equal(found["TRIAX_status"], status)
    degc = codes[:, 0] * unit.temperature_sensor.degc_per_code
    np.testing.assert_allclose(found["TRIAX_temp_code"], degc, rtol=1e-15)

    recorded = asammdf.MDF(version="4.10")
    times = np.arange(SAMPLES) / 100
    recorded.append([asammdf.Signal(found[n], times, name=n, unit="g") for n in names])
    path = recorded.save(tmp_path / "node.mf4")
    recorded.close()
    with asammdf.MDF(path) as read:
        for name in names:
            np.testing.assert_array_equal(read.get(name).samples, found[name])


def test_a_changed_constant_changes_the_output(bench: Bench, a2l: Described) -> None:
    """1 mg more in the offset of x is 1 mg more of x: the codes are linear, each is rounded."""
    name, file = "TRIAX_s0_bx_0", bench.file.read_bytes()
    slope, _ = a2l.line(name)
    step = round(1e-3 / slope)
    with bridged(bench.node) as bus:
        with tool(a2l, bus) as master:
            before = poll(master, a2l, FORCE)
            master.copyCalPage(0, 0, 0, 1)
            master.setCalPage(0x83, 0, 1)
            address, extension = a2l.place(name)
            word = int(np.frombuffer(master.shortUpload(4, address, extension), "<i4")[0])
            assert word == bench.delivery.plan.segments[0].coefficients[3, 0]
            master.setMta(address, extension)
            master.download(np.array([word + step], "<i4").tobytes())
            # The rows of the sensor go on; after the last one comes the first.
            for _ in range(len(sensor(bench)) - SAMPLES + 1):  # of the last one more is read
                master.shortUpload(4, *a2l.place("TRIAX_count"))
            after = poll(master, a2l, FORCE)
            assert master.identifier(5) == "AT-SIM-001 " + "0" * 16
            gain = master.shortUpload(4, address - 4 * 3 * 3 - 4, extension)
            master.setMta(address, extension)
            with pytest.raises(Exception, match="ERR_OUT_OF_RANGE"):
                master.download(np.array([2**31 - 1], "<i4").tobytes())
            assert gain == master.shortUpload(4, address - 4 * 3 * 3 - 4, extension)
            master.setCalPage(0x83, 0, 0)
            again = poll(master, a2l, FORCE)
        lsb = 2.0**-bench.delivery.plan.shape.output_q
        # A code of the result on each side is rounded by half of one.
        more = after[FORCE[0]] - before[FORCE[0]]
        np.testing.assert_allclose(more, step * slope, rtol=0, atol=1.01 * lsb)
        for other in FORCE[1:]:
            np.testing.assert_array_equal(after[other], before[other])
        assert abs(again[FORCE[0]].mean() - before[FORCE[0]].mean()) < 1e-4
    # Flash has the delivery: after a power cycle it is in use.
    with linked(bench.node) as link:
        found = identify(link)
        assert (found.content, found.epk) == (file, a2l.epk())


def test_the_segment_says_which_pages_there_are(bench: Bench, a2l: Described) -> None:
    (segment,) = [layer["SEGMENT"] for d in a2l.xcp for layer in d if "SEGMENT" in layer]
    number, pages, extension = segment[:3]
    assert (number, pages) == (0, 2)
    assert extension == a2l.place("TRIAX_temp_min")[1]
    flash_page, ram_page = (page[0] for page in segment[5]["PAGE"])
    with bridged(bench.node) as bus, tool(a2l, bus) as master:
        address, _ = a2l.place("TRIAX_temp_min")
        for page, protected in ((flash_page, True), (ram_page, False)):
            master.setCalPage(2, number, page)
            value = master.shortUpload(4, address, extension)
            master.setMta(address, extension)
            if protected:
                with pytest.raises(Exception, match="ERR_WRITE_PROTECTED"):
                    master.download(value)
            else:
                master.download(value)
