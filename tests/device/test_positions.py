"""A flashed device in its check positions, its record, and what passport and certificate state."""

from __future__ import annotations

import datetime
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest

pytest.importorskip("pyxcp")
pytest.importorskip("can")

from click.testing import CliRunner

import triaxcal
from builds import UNITS
from device.atsim import Bench, bench_of_at_sim, codes
from device.bridge import bridged, linked
from device.node import Node, build_node
from triaxcal.api.device import verify_at_positions
from triaxcal.base.errors import RefusedError
from triaxcal.batch.plan import plan_work
from triaxcal.cli.main import main
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.device import positions as walked
from triaxcal.device.compare import Samples
from triaxcal.device.positions import Expected, at_positions
from triaxcal.device.record import DeviceRecord, read_record, record_bytes, record_path
from triaxcal.device.unit import flash, require_in_use
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.files import all_files
from triaxcal.report.passport.content import passport
from triaxcal.report.passport.document import passport_json
from triaxcal.report.passport.page import passport_html
from triaxcal.report.series.unit import make_unit
from triaxcal.unit.certificate import CertificateDetails

pytestmark = pytest.mark.long

DAY = datetime.date(2026, 3, 30)
TILT = float(np.tan(np.radians(25)))
DIRECTIONS = {
    "CP1": (TILT, 0, 1), "CP2": (0, -1, TILT), "CP3": (TILT, 0, -1),
    "CP4": (0, 1, TILT), "CP5": (-1, TILT, 0), "CP6": (1, TILT, 0),
}  # fmt: skip


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = bench_of_at_sim(tmp_path_factory.mktemp("AT-SIM"))
    with linked(made.node) as link:
        flash(link, made.file.read_bytes(), "a file")
    return made


@pytest.fixture
def target(bench: Bench, tmp_path: Path) -> Path:
    """The delivery in place."""
    folder = tmp_path / "build" / "AT-SIM"
    folder.mkdir(parents=True)
    for name, content in all_files(bench.delivery).items():
        (folder / name).write_bytes(content)
    return folder


def refused(do: Callable[[], object]) -> str:
    with pytest.raises(RefusedError) as caught:
        do()
    text = str(caught.value)
    assert "\n" not in text
    return text


def turning(bench: Bench, gravity_g: float | None = None) -> Callable[[str, str], None]:
    def place(position: str, why: str) -> None:
        assert why == ""
        bench.turn(*DIRECTIONS[position], gravity_g=gravity_g)

    return place


def verified(bench: Bench, target: Path, count: int = 6) -> DeviceRecord:
    with linked(bench.node) as link:
        return verify_at_positions(link, bench.delivery, target, count, 32, turning(bench), day=DAY)


def test_the_record_and_the_passport(bench: Bench, target: Path) -> None:
    record = verified(bench, target)
    assert record == read_record(record_path(target))
    written = json.loads((target.parent / "AT-SIM.device.json").read_bytes())
    assert written["format"] == 1
    assert written["image_sha256"] == hashlib.sha256(bench.file.read_bytes()).hexdigest()
    assert (written["serial"], written["date"], written["firmware"]) == (
        "AT-SIM-001", "2026-03-30", "xcp-node 1",
    )  # fmt: skip
    assert written["largest_difference_lsb"] == 0
    assert [p["position"] for p in written["positions"]] == list(DIRECTIONS)
    for p in written["positions"]:
        wanted = np.array(DIRECTIONS[p["position"]])
        wanted = wanted / np.linalg.norm(wanted) * bench.gravity_g
        # Uniform noise of 40 codes of 24 bits: some micro-g in the mean.
        np.testing.assert_allclose(p["mean_g"], wanted, atol=2e-5)
        assert abs(p["error_g"]) < 2e-5
        assert p["error_g"] == np.linalg.norm(p["mean_g"]) - bench.gravity_g
        assert p["samples"] == 32
    stated = json.loads((target / "passport.json").read_bytes())["device"]
    assert stated.pop("of_this_delivery") is True
    assert {"format": 1, **stated} == written
    page = (target / "passport.html").read_text(encoding="utf-8")
    assert "2026−03−30" not in page
    assert "<td>device AT-SIM-001, 2026-03-30, xcp-node 1: 192 samples, " in page
    assert "<li>the device itself: serial number AT-SIM-001, 2026-03-30</li>" in page
    assert "largest difference 0 LSB; | |a| − g | at most" in page
    assert "at 6 check positions (limit " in page


def test_calibrating_again_keeps_it(bench: Bench, tmp_path: Path) -> None:
    build = tmp_path / "build"
    triaxcal.deliver(UNITS / "AT-SIM", build)
    assert json.loads((build / "AT-SIM" / "passport.json").read_bytes())["device"] is None
    record = verified(bench, build / "AT-SIM", 2)
    before = {p.name: p.read_bytes() for p in (build / "AT-SIM").iterdir()}
    triaxcal.deliver(UNITS / "AT-SIM", build)
    assert {p.name: p.read_bytes() for p in (build / "AT-SIM").iterdir()} == before
    # A series states it too.
    (order,) = plan_work([UNITS / "AT-SIM"], build).orders
    made = make_unit(order)
    assert made.files["passport.json"] == before["passport.json"]
    # Of another delivery: not counted.
    other = replace(record, image_sha256="0" * 64)
    record_path(build / "AT-SIM").write_bytes(record_bytes(other))
    triaxcal.deliver(UNITS / "AT-SIM", build)
    stated = json.loads((build / "AT-SIM" / "passport.json").read_bytes())["device"]
    assert stated["of_this_delivery"] is False
    page = (build / "AT-SIM" / "passport.html").read_text(encoding="utf-8")
    assert (
        "not counted: the record of 2026-03-30 is of another delivery (image SHA-256 0000" in page
    )
    assert "<li>the C on a device of this unit: the record of 2026-03-30 is of another" in page


def test_the_certificate(bench: Bench, target: Path) -> None:
    details = CertificateDetails(
        identifier="K-1", country="UA", laboratory="Lab", city="Kyiv", signer="S", customer="C",
        manufacturer="M", begin=DAY, end=DAY,
    )  # fmt: skip
    record = verified(bench, target, 3)
    text = certificate_xml(passport(bench.delivery, {}, record), details).decode()
    assert "verified on device AT-SIM-001, 2026-03-30, xcp-node 1: 96 samples" in text
    assert "at 3 check positions" in text
    other = passport(bench.delivery, {}, replace(record, image_sha256="1" * 64))
    without = certificate_xml(passport(bench.delivery, {}), details)
    assert certificate_xml(other, details) == without
    assert b"verified on device" not in without


def unchanged(target: Path, do: Callable[[], object]) -> str:
    before = {p: p.read_bytes() for p in target.iterdir()}
    text = refused(do)
    assert {p: p.read_bytes() for p in target.iterdir()} == before
    assert not record_path(target).exists()
    return text


def test_a_length_beyond_the_limit(bench: Bench, target: Path) -> None:
    place = turning(bench, bench.gravity_g * 1.01)
    with linked(bench.node) as link:
        text = unchanged(
            target, lambda: verify_at_positions(link, bench.delivery, target, 2, 32, place)
        )
    errors = re.search(r"beyond the limit: CP1 \+([0-9.]+) mg, CP2 \+([0-9.]+) mg; expected", text)
    assert errors is not None
    # 1 % of g, and the noise.
    assert [float(e) for e in errors.groups()] == pytest.approx(
        [10 * bench.gravity_g] * 2, abs=0.02
    )
    # With the gravity of a place where it is right, in m/s^2.
    there = bench.gravity_g * 1.01 * 9.80665
    with linked(bench.node) as link:
        record = verify_at_positions(link, bench.delivery, target, 2, 32, place, there)
    assert record.gravity_m_per_s2 == pytest.approx(there)


def test_an_earlier_record_stays(bench: Bench, target: Path) -> None:
    verified(bench, target, 2)
    before = record_path(target).read_bytes(), (target / "passport.json").read_bytes()
    place = turning(bench, bench.gravity_g * 1.01)
    with linked(bench.node) as link:
        text = refused(lambda: verify_at_positions(link, bench.delivery, target, 2, 32, place))
    assert text.endswith(
        "nothing was written; the earlier record, of 2026-03-30, stays, and so does the passport"
    )
    assert (record_path(target).read_bytes(), (target / "passport.json").read_bytes()) == before


def test_a_delivery_that_is_not_there(bench: Bench, target: Path) -> None:
    (target / "triax_calib.bin").write_bytes(b"other")
    assert "expected the files of AT-SIM as it is now; run `triaxcal calib` first" in unchanged(
        target, lambda: verified(bench, target)
    )


def test_a_device_with_another_serial_number(bench: Bench, target: Path, tmp_path: Path) -> None:
    folder = bench.file.parent
    from builds import Built

    built = Built(bench.delivery.plan, folder, None)  # type: ignore[arg-type]
    program = build_node(built, tmp_path / "other", '-DNODE_SERIAL="SN-9"')
    other = Bench(Node(program, bench.node.flash, bench.node.samples), bench.file, bench.delivery)
    text = unchanged(target, lambda: verified(other, target))
    assert "the device has the serial number SN-9; expected AT-SIM-001, that of AT-SIM" in text
    with linked(other.node) as link:
        image = bench.file.read_bytes()
        assert "serial number SN-9" in refused(lambda: require_in_use(link, image, "AT-SIM"))


# ---- what is no rest in a new position ----


class Placed:
    """The samples of each call, by their specific forces; and why each place was asked for."""

    name = "a bus"

    def __init__(self, bench: Bench, monkeypatch: pytest.MonkeyPatch, *forces: np.ndarray) -> None:
        self.bench, self.forces, self.asked = bench, list(forces), []
        monkeypatch.setattr(walked, "take_samples", lambda _link, _count: self._samples())

    def _samples(self) -> Samples:
        force = np.atleast_2d(self.forces.pop(0))
        parts = [codes(self.bench.delivery, f * self.bench.gravity_g) for f in force]
        temp = np.concatenate([t for t, _ in parts])
        raw = np.concatenate([r for _, r in parts])
        accel, status = python_routine(self.bench.delivery.plan)(temp, raw)
        return Samples(temp, np.zeros_like(temp), raw, accel, status)

    def walk(self, *names: str) -> list[str]:
        unit, plan = self.bench.delivery.unit, self.bench.delivery.plan
        expected = Expected(
            python_routine(plan), plan.shape.output_q, unit.gravity_g, float, lambda _: 1e-3
        )
        place = lambda name, why: self.asked.append((name, why))  # noqa: E731
        return [p.position for p in at_positions(self, expected, names, 10, place)]  # type: ignore[arg-type]


X, Y, Z = np.eye(3)


def test_it_moved(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    turned = np.array([np.sin(2e-3), 0, np.cos(2e-3)])
    placed = Placed(bench, monkeypatch, np.array([Z, turned]), Z, Y)
    assert placed.walk("CP1", "CP2") == ["CP1", "CP2"]
    why = placed.asked[1][1]
    assert why.startswith("it moved by ")
    # 2 mg, less what chance may do.
    assert 1.5 < float(why.split()[3]) < 2.1
    assert [name for name, _ in placed.asked] == ["CP1", "CP1", "CP2"]


def test_the_same_position_twice(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    near = np.array([np.sin(0.1), 0, np.cos(0.1)])
    placed = Placed(bench, monkeypatch, Z, near, X)
    assert placed.walk("CP1", "CP2") == ["CP1", "CP2"]
    assert placed.asked[2] == ("CP2", "it is 5.7 deg from its position at CP1")
    placed = Placed(bench, monkeypatch, Z, *[Z] * 5)
    text = refused(lambda: placed.walk("CP1", "CP2"))
    assert text.startswith("a bus, CP2: it is 0 deg from its position at CP1, 5 times; expected")


def test_a_bit_that_differs_and_a_status(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    placed = Placed(bench, monkeypatch, Z)
    good = placed._samples()
    good.accel[7, 2] -= 3
    monkeypatch.setattr(walked, "take_samples", lambda _link, _count: good)
    text = refused(lambda: placed.walk("CP1"))
    assert text.startswith("a bus, CP1: 1 of 64 samples differ, by 3 LSB at most; sample 7, ")
    cold = np.full(64, bench.delivery.plan.temp_min_code - 1, np.int32)
    answer = python_routine(bench.delivery.plan)(cold, good.raw)
    flagged = Samples(cold, good.rate, good.raw, *answer)
    monkeypatch.setattr(walked, "take_samples", lambda _link, _count: flagged)
    assert "64 of 64 samples have a status other than 0" in refused(lambda: placed.walk("CP1"))


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"{}", b'{"format": 2}', b'{"format": 1, "unit": "A"}', b"\xff\xfe"],
)
def test_what_is_no_record(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "AT-SIM.device.json"
    path.write_bytes(content)
    text = refused(lambda: read_record(path))
    assert text.startswith(f"{path}: no record of a device: ")
    assert text.endswith("remove it, and verify the device again")
    assert read_record(tmp_path / "none.json") is None


def test_the_command(bench: Bench, target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def prompt(text: str, **_: object) -> str:
        asked.append(text)
        bench.turn(*DIRECTIONS[f"CP{len(asked)}"])
        return ""

    monkeypatch.setattr(click, "prompt", prompt)
    with bridged(bench.node) as bus:
        arguments = ["--bus", bus, "--build", str(target.parent), "--positions", "2"]
        done = CliRunner().invoke(
            main,
            ["device", "verify", str(UNITS / "AT-SIM"), *arguments, "--samples", "16"],
            catch_exceptions=False,
        )
    assert asked[1] == "Put the unit in check position CP2, at rest, then press Enter"
    told = " ".join(done.output.split())
    assert "node 0x650: verified on device AT-SIM-001, 20" in told
    assert "32 samples, largest difference 0 LSB" in told
    assert "CP2 " in told
    record = read_record(record_path(target))
    assert record is not None
    assert len(record.positions) == 2


def test_a_passport_without_a_device_says_so(bench: Bench) -> None:
    made = passport(bench.delivery, {})
    assert json.loads(passport_json(made))["device"] is None
    page = passport_html(made).decode()
    assert "not verified on a device (triaxcal device verify)" in page
    assert "<li>the C on a device of this unit</li>" in page
