"""`triaxcal rig fil --bus`: a node that runs elsewhere, asked, or with a sensor of its own."""

from __future__ import annotations

import contextlib
import itertools
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from click.testing import CliRunner
from rig_cases import BENCH, bench_unit, dbc, short_setup

from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.cli.rig_fil import build_node, firmware_in_the_loop, node_on
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.rig.bus.frames import Frames, concatenate, empty
from triaxcal.rig.description.identity import serial_crc
from triaxcal.rig.node import fil
from triaxcal.rig.node.fil import vectors
from triaxcal.rig.node.listen import Pairing, listen
from triaxcal.rig.sources.busport import BusPort
from triaxcal.rig.sources.port import SocketPort

CHANNELS = itertools.count()
ROWS, RATE = 300, "2000"


@pytest.fixture(scope="module")
def delivery() -> Delivery:
    return deliver(BENCH)


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory, delivery: Delivery) -> Path:
    folder = tmp_path_factory.mktemp("node")
    return build_node(folder, delivery.files, short_setup(folder))


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory, delivery: Delivery) -> Path:
    """Rows of which each has another temperature, some out of the range."""
    plan = delivery.plan
    temps, raw = vectors(64 * ROWS, (plan.temp_min_code, plan.temp_max_code), 5)
    path = tmp_path_factory.mktemp("sensor") / "samples.bin"
    path.write_bytes(np.column_stack([temps, raw[:ROWS]]).astype("<i4").tobytes())
    return path


@contextlib.contextmanager
def on_virtual_bus(
    node: Path, *sensor: str, fault: Callable[[Frames], Frames] = lambda frames: frames
) -> Iterator[str]:
    """The node as a process of its own; its socket's frames go to a virtual bus, and back."""
    channel = f"fil-{next(CHANNELS)}"
    stop = threading.Event()
    with can.Bus(interface="virtual", channel=channel) as bus, node_on(node, *sensor) as link:
        there, here = BusPort(bus, channel), SocketPort(link)

        def carry() -> None:
            while not stop.is_set():
                there.send(fault(here.receive(0.002)))
                here.send(there.receive(0.002))

        thread = threading.Thread(target=carry, daemon=True)
        thread.start()
        try:
            yield f"virtual:{channel}"
        finally:
            stop.set()
            thread.join(10)


def test_a_node_on_a_bus_is_asked(node: Path, tmp_path: Path) -> None:
    with on_virtual_bus(node) as bus:
        done = firmware_in_the_loop(short_setup(tmp_path), 1000, bus, 3)
    assert (done.samples, done.lost) == (1000, 0)


def test_a_node_with_its_own_sensor(node: Path, sensor: Path, tmp_path: Path) -> None:
    with on_virtual_bus(node, str(sensor), RATE) as bus:
        done = firmware_in_the_loop(short_setup(tmp_path), ROWS, bus, 0, own_sensor=True)
    assert (done.samples, done.lost) == (ROWS, 0)


@pytest.mark.long
def test_lost_frames_are_counted(node: Path, sensor: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)

    def losing(frames: Frames) -> Frames:
        return frames.take(rng.random(len(frames)) > 0.02)

    with on_virtual_bus(node, str(sensor), RATE, fault=losing) as bus:
        done = firmware_in_the_loop(short_setup(tmp_path), ROWS, bus, 0, own_sensor=True)
    assert done.samples == ROWS
    # A sample has six frames: 11 % of them lose one.
    assert 0.05 * ROWS < done.lost < 0.25 * ROWS


@pytest.mark.long
def test_the_command(node: Path, sensor: Path) -> None:
    with on_virtual_bus(node, str(sensor), RATE) as bus:
        arguments = ["--unit", str(BENCH), "--bus", bus, "--listen", "--samples", "50"]
        done = CliRunner().invoke(main, ["rig", "fil", *arguments], catch_exceptions=False)
    assert done.output.startswith("50 samples bit for bit, ")
    alone = CliRunner().invoke(main, ["rig", "fil", "--unit", str(BENCH), "--listen"])
    assert "--listen needs the --bus that the node is on" in alone.output


# ---- by hand-made frames ----


class Played:
    """A port on which frames come once, and then none."""

    def __init__(self, *frames: Frames) -> None:
        self.frames = list(frames)

    def send(self, frames: Frames) -> None:
        raise AssertionError(len(frames))

    def receive(self, _wait_s: float) -> Frames:
        return self.frames.pop(0) if self.frames else empty()


def one(name: str, **values: int) -> Frames:
    layout = dbc().messages[name]
    every = dict.fromkeys((s for s in layout.signals if s != "Crc"), 0) | values
    return layout.frames({s: np.array([v]) for s, v in every.items()}, np.zeros(1, np.int64))


def results(sequence: int, accel: tuple[int, int, int], *status: int) -> list[Frames]:
    each = status if len(status) == 3 else status * 3
    return [
        one(f"COMP_{axis}", Sequence=sequence, Accel=a, Status=s)
        for axis, a, s in zip("XYZ", accel, each, strict=True)
    ]


def sample(sequence: int, x: int, y: int, z: int) -> list[Frames]:
    return [
        one("RIG_XY", Sequence=sequence, AccelX=x, AccelY=y),
        one("RIG_Z", Sequence=sequence, AccelZ=z),
    ]


def paired(*frames: Frames) -> Pairing:
    pairing = Pairing(dbc(), bench_unit().serial)
    for frame in frames:
        pairing.feed(frame)
    return pairing


def test_a_sample_has_the_last_temperature_before_it() -> None:
    frames = [
        *sample(1, 9, 9, 9),  # no temperature yet
        one("RIG_TEMP", TempCode=-5),
        *sample(2, 10, -20, 30),
        one("RIG_TEMP", Sequence=1, TempCode=77),
        *results(2, (1, 2, 3), 4),
        *sample(3, 1, 1, 1),
        *results(3, (-1, -2, -3), 0),
        one("RIG_TEMP", Sequence=2, TempCode=78),
    ]
    wanted = [(-5, (10, -20, 30), [1, 2, 3], [4, 4, 4]), (77, (1, 1, 1), [-1, -2, -3], [0, 0, 0])]
    for batches in (frames, [concatenate(frames)]):
        pairing = paired(*batches)
        assert pairing.whole == wanted
        assert (pairing.seen, pairing.lost, pairing.spoiled) == (2, 0, 0)


def test_a_late_result_of_another_turn() -> None:
    """The result of a sample that was lost does not complete the one of 256 samples before."""
    old = [*sample(7, 1, 1, 1), *results(7, (1, 1, 1), 0)[:2]]
    between = [f for k in range(8, 40) for f in (*sample(k, 2, 2, 2), *results(k, (2, 2, 2), 0))]
    pairing = paired(one("RIG_TEMP", TempCode=1), *old, *between, *results(7, (3, 3, 3), 0))
    pairing.feed(one("RIG_TEMP", Sequence=1, TempCode=1))
    assert {w[1] for w in pairing.whole} == {(2, 2, 2)}
    assert (len(pairing.whole), pairing.lost) == (32, 1)


def test_a_lost_temperature() -> None:
    """Its successor's counter tells: what was measured between is not compared."""
    pairing = paired(
        one("RIG_TEMP", Sequence=254, TempCode=1),
        *sample(1, 1, 2, 3),
        *results(1, (0, 0, 0), 0),
        one("RIG_TEMP", Sequence=255, TempCode=2),
        *sample(2, 1, 2, 3),
        one("RIG_TEMP", Sequence=1, TempCode=4),
        *results(2, (0, 0, 0), 0),
        *sample(3, 1, 2, 3),
        *results(3, (0, 0, 0), 0),
    )
    assert [w[0] for w in pairing.whole] == [1]
    assert (pairing.seen, pairing.lost) == (3, 1)


def test_can_fd_has_everything_in_one_frame() -> None:
    fd = one("RIG_FD", Sequence=0x1FE, AccelX=-(2**31), AccelY=5, AccelZ=6, TempCode=7)
    pairing = paired(fd, *results(0xFE, (1, 2, 3), 0))
    assert pairing.whole == [(7, (-(2**31), 5, 6), [1, 2, 3], [0, 0, 0])]


def test_frames_that_do_not_belong_together() -> None:
    spoiled = one("RIG_Z", Sequence=1, AccelZ=3)
    spoiled.data[0, 3] ^= 1
    pairing = paired(
        one("RIG_TEMP", TempCode=1),
        sample(1, 1, 2, 3)[0],
        spoiled,
        *results(1, (0, 0, 0), 0),
        sample(2, 1, 2, 3)[0],
        sample(3, 1, 2, 3)[1],
    )
    assert (pairing.whole, pairing.seen, pairing.spoiled) == ([], 0, 1)
    assert pairing.lost == 2


def refused(*frames: Frames, samples: int = 1, routine=None) -> str:
    with pytest.raises(RefusedError) as caught:
        listen(Played(*frames), dbc(), samples, routine, bench_unit().serial)
    return str(caught.value)


def test_one_bit_is_noticed(delivery: Delivery) -> None:
    routine = python_routine(delivery.plan)
    temp, raw = (
        np.array([delivery.plan.temp_min_code], np.int32),
        np.array([[10, -20, 30]], np.int32),
    )
    accel, status = routine(temp, raw)
    x, y, z = accel[0].tolist()
    before = [one("RIG_TEMP", TempCode=int(temp[0])), *sample(2, 10, -20, 30)]
    after = one("RIG_TEMP", Sequence=1, TempCode=0)
    good = [*before, *results(2, (x, y, z), int(status[0])), after]
    done = listen(Played(*good), dbc(), 1, routine, bench_unit().serial)
    assert done.samples == 1
    text = refused(*before, *results(2, (x, y ^ 1, z), int(status[0])), after, routine=routine)
    assert text.startswith(
        f"sample 0: temp_code {temp[0]}, raw_code [10, -20, 30]: the node answers"
    )
    text = refused(*before, *results(2, (x, y, z), int(status[0]) ^ 4), after, routine=routine)
    assert "status 4; expected" in text
    text = refused(*before, *results(2, (x, y, z), 0, 0, 1), after, routine=routine)
    assert text.startswith("sample 0: the results of a sample differ in status")


def test_another_unit_is_refused() -> None:
    serial = bench_unit().serial
    paired(one("RIG_IDENT", SerialCrc=serial_crc(serial), RateHz=100))
    with pytest.raises(RefusedError, match="RIG_IDENT: the node has a serial number with the CRC"):
        paired(one("RIG_IDENT", SerialCrc=serial_crc("OTHER"), RateHz=100))


def test_a_node_that_sends_no_results(monkeypatch: pytest.MonkeyPatch) -> None:
    from triaxcal.rig.node import listen as module

    monkeypatch.setattr(module, "ANSWER_S", 0.05)
    text = refused(one("RIG_TEMP", TempCode=1), *sample(1, 1, 2, 3))
    assert text.startswith("the node: 1 samples, 0 of them with results, and no more for 0.05 s; ")
    assert text.endswith("leave --listen out")


def test_a_bus_without_a_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fil, "ANSWER_S", 0.05)
    with pytest.raises(RefusedError, match="sample 0: the node has not answered"):
        firmware_in_the_loop(short_setup(tmp_path), 10, f"virtual:fil-{next(CHANNELS)}", 1)
