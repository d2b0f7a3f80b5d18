"""`triaxcal rig fil` on a unit whose device gives angles: they are compared bit for bit too."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rig_cases import BENCH, short_setup
from test_fil_bus import ROWS, Played, on_virtual_bus, one, sample

from triaxcal.base.errors import RefusedError
from triaxcal.cli.rig_fil import build_node, firmware_in_the_loop, node_on, routine_of
from triaxcal.delivery.unit import deliver
from triaxcal.rig.description.dbc import default_dbc, read_dbc
from triaxcal.rig.node import fil
from triaxcal.rig.node.fil import Int32Array, Results, exchange, result_signals, vectors
from triaxcal.rig.node.listen import listen
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.sources.port import SocketPort
from triaxcal.unit.description import read_unit

KINDS = ("zenith-tool-face", "pitch-roll")


def setup_of(folder: Path, kind: str) -> Setup:
    """The unit of the bench with angles of a kind, in `folder`."""
    unit = folder / BENCH.name
    unit.mkdir()
    text = (BENCH / "unit.toml").read_text(encoding="utf-8")
    (unit / "unit.toml").write_text(f'{text}\n[firmware]\nangles = "{kind}"\n', encoding="utf-8")
    (unit / "measurements.csv").write_bytes((BENCH / "measurements.csv").read_bytes())
    setup = short_setup(folder)
    return Setup(unit, read_unit(unit), setup.plan, setup.rig)


@pytest.fixture(scope="module", params=KINDS)
def setup(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return setup_of(tmp_path_factory.mktemp("unit"), request.param)


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory, setup: Setup) -> Path:
    return build_node(tmp_path_factory.mktemp("node"), deliver(setup.folder).files, setup)


def test_angles_bit_for_bit(setup: Setup) -> None:
    done = firmware_in_the_loop(setup, 3000, None, 5)
    assert (done.samples, done.lost) == (3000, 0)


@pytest.mark.parametrize(("column", "bit"), [(3, 31), (4, 0), (None, 6), (None, 7)])
def test_one_bit_of_an_angle_or_of_its_status_is_noticed(
    setup: Setup, node: Path, column: int | None, bit: int
) -> None:
    firmware = deliver(setup.folder).firmware
    right, plan = routine_of(firmware), firmware.plan

    def wrong(temp: Int32Array, raw: Int32Array) -> Results:
        values, status = right(temp, raw)
        if column is None:
            status[17] ^= 1 << bit
        else:
            values[17, column] ^= 1 << bit
        return values, status

    temps, raw = vectors(64, (plan.temp_min_code, plan.temp_max_code), 8)
    dbc = read_dbc(default_dbc(), angles=True)
    with node_on(node) as link, pytest.raises(RefusedError, match=r"^sample 17: temp_code"):
        exchange(SocketPort(link), dbc, temps, raw, wrong)


@pytest.fixture
def sensor(tmp_path: Path, setup: Setup) -> Path:
    plan = deliver(setup.folder).plan
    temps, raw = vectors(64 * ROWS, (plan.temp_min_code, plan.temp_max_code), 5)
    path = tmp_path / "samples.bin"
    path.write_bytes(np.column_stack([temps, raw[:ROWS]]).astype("<i4").tobytes())
    return path


def test_a_node_with_its_own_sensor(setup: Setup, node: Path, sensor: Path) -> None:
    with on_virtual_bus(node, str(sensor), "2000") as bus:
        done = firmware_in_the_loop(setup, ROWS, bus, 0, own_sensor=True)
    assert (done.samples, done.lost) == (ROWS, 0)


def test_a_node_without_angles_is_told(
    setup: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {n: f for n, f in deliver(setup.folder).files.items() if "angles" not in n}
    node = build_node(tmp_path, files, setup)
    monkeypatch.setattr(fil, "ANSWER_S", 0.2)
    dbc = read_dbc(default_dbc(), angles=True)
    temps, raw = np.zeros(1, np.int32), np.zeros((5, 3), np.int32)
    with node_on(node) as link, pytest.raises(RefusedError) as caught:
        exchange(SocketPort(link), dbc, temps, raw, lambda *_: pytest.fail("nothing to compare"))
    assert str(caught.value) == (
        "sample 3: no COMP_ANGLE_0, COMP_ANGLE_1 has come; expected 5 frames within 0.2 s; "
        "send the angles too: rig_node.c with RIG_NODE_ANGLES does"
    )


def test_results_wait_for_the_angles() -> None:
    dbc = read_dbc(default_dbc(), angles=True)
    assert list(result_signals(dbc).values()) == ["Accel"] * 3 + ["Angle"] * 2
    assert list(result_signals(read_dbc(default_dbc())).values()) == ["Accel"] * 3

    def frames() -> Iterator:
        yield one("RIG_TEMP", TempCode=1)
        yield from sample(2, 10, -20, 30)
        for column, (name, signal) in enumerate(result_signals(dbc).items()):
            layout = dbc.messages[name]
            values = {"Sequence": 2, signal: 2**31 + 7 if column > 2 else column, "Status": 64}
            arrays = {s: np.array([v]) for s, v in values.items()}
            yield layout.frames(arrays, np.zeros(1, np.int64))
        yield one("RIG_TEMP", Sequence=1, TempCode=1)

    expected = np.array([[0, 1, 2, 2**31 + 7, 2**31 + 7]]), np.array([64], np.uint32)
    done = listen(Played(*frames()), dbc, 1, lambda *_: expected, read_unit(BENCH).serial)
    assert done.samples == 1


def test_a_dbc_without_angles_is_refused_for_such_a_unit(tmp_path: Path) -> None:
    text = default_dbc().read_text(encoding="utf-8")
    path = tmp_path / "old.dbc"
    path.write_text(text.replace("COMP_ANGLE_1", "OTHER"), encoding="utf-8")
    assert read_dbc(path)
    with pytest.raises(RefusedError, match="missing: message COMP_ANGLE_1; expected the messages"):
        read_dbc(path, angles=True)
