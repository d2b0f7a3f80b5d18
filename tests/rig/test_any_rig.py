"""Rigs of other makers: what the simulated ones send by cantools, and whole sessions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from any_rig_cases import KINDS, any_rig, any_setup
from rig_cases import play

from recordings import recording
from triaxcal.rig.bus.frames import ID_MASK, Frames, concatenate
from triaxcal.rig.check.check import findings
from triaxcal.rig.description.busfile import read_bus_file
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.logs.logfile import read_frames
from triaxcal.rig.samples.samples import (
    BAD_CRC,
    DUPLICATE,
    INVALID,
    LOST_FRAME,
    ORPHAN,
    SampleDecoder,
)
from triaxcal.rig.session.blocks import BlockBuilder
from triaxcal.rig.session.engine import Engine

NAMES = sorted(KINDS)


def sent(setup, seconds, *orders):
    rig = any_rig(setup, *orders)
    return concatenate([rig.advance() for _ in range(seconds)])


def by_cantools(rig, frames, label, scaling):
    """Numbers of one signal in the order of the frames."""
    message_name, signal = label.split(".")
    use = rig.messages[message_name]
    (message,) = (
        m for f in rig.bus_files for m in read_bus_file(f).database.messages
        if m.name == message_name
    )  # fmt: skip
    mine = use.layout.mine(frames.can_id)
    rows = (row.tobytes() for row in frames.data[mine][:, : message.length])
    found = (message.decode(row, decode_choices=False, scaling=scaling) for row in rows)
    return [numbers[signal] for numbers in found if signal in numbers]


@pytest.mark.parametrize("name", NAMES)
def test_samples_are_what_cantools_decodes(tmp_path, name):
    setup = any_setup(tmp_path, name)
    frames = sent(setup, 3)
    raw = SampleDecoder(setup.rig, 100).feed(frames)
    assert len(raw.number) == 300
    assert len(raw.trouble) == 0
    for axis, what in enumerate(setup.rig.axes):
        expected = by_cantools(setup.rig, frames, what.label, scaling=what.as_value)
        assert raw.codes[:, axis].tolist() == expected
    what = setup.rig.temperature
    expected = by_cantools(setup.rig, frames, what.label, scaling=what.as_value)
    # A temperature before the first sample belongs to none.
    assert len(expected) - len(raw.temp_code) <= 1
    assert raw.temp_code.tolist() == expected[-len(raw.temp_code) :]


@pytest.mark.parametrize("name", NAMES)
def test_the_codes_are_those_of_the_unit(tmp_path, name):
    """Physical values by cantools in g, against the nominal meaning of the codes."""
    setup = any_setup(tmp_path, name)
    frames = sent(setup, 2)
    codes = setup.decoder().feed(frames).codes
    nominal = setup.nominal
    units = {"g": 1.0, "m/s^2": 1 / 9.80665}
    for axis, what in enumerate(setup.rig.axes):
        if what.unit not in units:
            continue
        force_g = np.array(by_cantools(setup.rig, frames, what.label, scaling=True), float)
        mine = (codes[:, axis] - nominal.zero_code[axis]) * nominal.micro_g_per_code[axis] * 1e-6
        np.testing.assert_allclose(mine, force_g * units[what.unit], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_blocks_of_any_rig_do_not_depend_on_the_batches(tmp_path, name):
    setup = any_setup(tmp_path, name)
    orders = ("lose@2.5:7", "duplicate@3.2:9", "bitflip@4.1:5", "error@5.5:3", "twonodes@6:1:2")
    frames = sent(setup, 12, *orders)
    rng = np.random.default_rng(5)

    def blocks(cuts):
        decode, build = setup.decoder(), BlockBuilder(100, (-(2**31), 2**31))
        found = []
        for start, end in zip([0, *cuts], [*cuts, len(frames)], strict=True):
            found += build.feed(decode.feed(frames.take(slice(start, end))))
        return found

    whole = blocks([])
    for _ in range(3):
        cuts = sorted(rng.integers(0, len(frames), 150).tolist())
        assert blocks(cuts) == whole
    assert blocks(list(range(1, len(frames)))) == whole
    assert len(whole) >= 8


@pytest.mark.parametrize("name", NAMES)
def test_check_says_what_it_sees_and_what_it_cannot(tmp_path, name):
    setup = any_setup(tmp_path, name)
    found = findings(setup, sent(setup, 5), "bus", [])
    assert [f.text for f in found if f.good is False] == []
    notes = [f.text for f in found if f.good is None]
    assert bool(notes) == (not name.startswith("tilter"))
    assert "position TP1 (+Z up)" in [f.text for f in found]


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_a_whole_session_of_every_shipped_rig(tmp_path, name):
    setup = any_setup(tmp_path, name, temps="[20, 40]")
    rig = any_rig(setup)
    engine = Engine(setup, "test")
    play(rig, engine.feed, engine.session)
    assert len(engine.session.accepted) == 12
    kind, adc = KINDS[name], setup.unit.adc
    for (_, position), dwell in engine.session.accepted.items():
        if position == "TP1":
            # z up: U = K g + U0, of which K changes by 1e-5 V/g per K at most.
            up_v = dwell.mean_code[2] * adc.volts_per_code
            assert up_v == pytest.approx(kind.k * 9.8111 / 9.80665 + kind.zero, abs=1e-3)


# ---- losses ----


@pytest.mark.parametrize("lost", [1, 5, 15, 16, 17, 40])
def test_counters_of_four_bits_count_losses_of_whole_turns(tmp_path, lost):
    """By the time of arrival: a turn of 16 is 160 ms."""
    setup = any_setup(tmp_path, "automotive-imu")
    frames = sent(setup, 6)
    whole = SampleDecoder(setup.rig, 100).feed(frames)
    slack = 1_000_000
    start, end = whole.t_ns[200] - slack, whole.t_ns[200 + lost] - slack
    kept = frames.take((frames.t_ns < start) | (frames.t_ns >= end))
    found = SampleDecoder(setup.rig, 100).feed(kept)
    assert found.number.tolist() == np.delete(whole.number, slice(200, 200 + lost)).tolist()
    assert not found.jump.any()


def test_one_frame_of_three_lost_leaves_two_without_partner(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    frames = sent(setup, 3)
    found = SampleDecoder(setup.rig, 100).feed(frames.take(np.arange(len(frames)) != 100))
    assert len(found.number) == 299
    assert (found.trouble == ORPHAN).sum() == 2
    assert np.diff(found.number).max() == 2


def test_frames_of_a_sample_may_come_in_any_order(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    frames = sent(setup, 2)
    whole = SampleDecoder(setup.rig, 100).feed(frames)
    rng = np.random.default_rng(2)
    order = np.concatenate([3 * i + rng.permutation(3) for i in range(len(frames) // 3)])
    mixed = SampleDecoder(setup.rig, 100).feed(frames.take(order))
    np.testing.assert_array_equal(mixed.codes, whole.codes)
    assert len(mixed.trouble) == 0


def test_without_counters_only_a_gap_is_a_loss(tmp_path):
    setup = any_setup(tmp_path, "canopen-float")
    frames = sent(setup, 6)
    (use,) = (u for n, u in setup.rig.messages.items() if n == "TPDO2")
    mine = np.flatnonzero(use.layout.mine(frames.can_id))
    one = np.delete(np.arange(len(frames)), mine[100])
    assert np.diff(SampleDecoder(setup.rig, 100).feed(frames.take(one)).number).max() == 1
    gap = np.delete(np.arange(len(frames)), slice(mine[100] - 1, mine[140] - 1))
    found = SampleDecoder(setup.rig, 100).feed(frames.take(gap))
    assert np.diff(found.number).max() == 41


def test_a_partner_that_is_too_old_is_not_used(tmp_path):
    setup = any_setup(tmp_path, "canopen-float")
    frames = sent(setup, 2)
    xy = np.flatnonzero(setup.rig.messages["TPDO1"].layout.mine(frames.can_id))
    found = SampleDecoder(setup.rig, 100).feed(
        frames.take(np.delete(np.arange(len(frames)), xy[50]))
    )
    assert len(found.number) == 199
    assert found.trouble.tolist() == [ORPHAN]
    assert found.trouble_number.tolist() == [49]


def test_two_nodes_without_counters_are_seen_by_the_rate(tmp_path):
    setup = any_setup(tmp_path, "j1939-inclinometer")
    found = SampleDecoder(setup.rig, 100).feed(sent(setup, 6, "twonodes@2:1:3"))
    assert found.jump.sum() > 100
    assert not found.jump[:200].any()


def test_lost_frames_of_messages_that_number_no_samples_are_counted(tmp_path):
    setup = any_setup(tmp_path, "tilter")
    frames = sent(setup, 4)
    temps = np.flatnonzero(setup.rig.messages["RIG_TEMP"].layout.mine(frames.can_id))
    kept = np.delete(np.arange(len(frames)), temps[[7, 8, 20]])
    found = SampleDecoder(setup.rig, 100).feed(frames.take(kept))
    assert found.trouble.tolist() == [LOST_FRAME] * 3
    assert len(found.temp_code) == 37


def test_flipped_bits_are_found_where_there_is_a_crc(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    found = SampleDecoder(setup.rig, 100).feed(sent(setup, 4, "bitflip@2.2:6"))
    assert (found.trouble == BAD_CRC).sum() == 6
    assert (found.trouble == DUPLICATE).sum() == 0


# ---- values that are none ----


def test_j1939_not_available_is_no_number(tmp_path):
    setup = any_setup(tmp_path, "j1939-inclinometer")
    frames = sent(setup, 2)
    at = np.flatnonzero(setup.rig.messages["ACS"].layout.mine(frames.can_id))
    data = frames.data.copy()
    data[at[10], :2] = 0xFF, 0xFF  # not available
    data[at[20], 2:4] = 0x00, 0xFE  # error
    data[at[30], 2:4] = 0xFF, 0xFA  # the largest value
    marked = Frames(frames.t_ns, frames.can_id, frames.length, frames.fd, data)
    found = SampleDecoder(setup.rig, 100).feed(marked)
    assert len(found.number) == 198
    assert (found.trouble == INVALID).sum() == 2
    assert 0xFAFF in found.codes


def test_floats_that_are_no_numbers_are_not_used(tmp_path):
    setup = any_setup(tmp_path, "canopen-float")
    frames = sent(setup, 2)
    at = np.flatnonzero(setup.rig.messages["TPDO2"].layout.mine(frames.can_id))
    data = frames.data.copy()
    data[at[10], :4] = np.array([np.nan], "<f4").view(np.uint8)
    data[at[20], 4:] = np.array([np.inf], "<f4").view(np.uint8)
    marked = Frames(frames.t_ns, frames.can_id, frames.length, frames.fd, data)
    found = setup.decoder().feed(marked)
    assert len(found.number) == 199
    assert len(found.temp_code) == 199
    assert np.isfinite(found.codes).all()
    assert np.isfinite(found.temp_code).all()
    assert (found.trouble == INVALID).sum() == 2


def test_a_status_that_is_not_good_marks_the_second(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    found = setup.decoder().feed(sent(setup, 4, "status@2:5:1"))
    assert found.status[:200].tolist() == [0] * 200
    assert found.status[200:300].tolist() == [5] * 100


# ---- a real log ----


REAL = """
format = 1
[rig]
file = "{dbc}"
[signals]
x = "gnss_imu.AccelerationX"
y = "gnss_imu.AccelerationY"
z = "gnss_imu.AccelerationZ"
[message.gnss_imu]
status = "ImuValid"
status_good = [1]
"""


def test_a_real_log_gives_the_published_means(tmp_path):
    """CSS Electronics' public recording; the means are an independent decoder's."""
    folder = recording("css_canedge")
    path = tmp_path / "rig.toml"
    path.write_text(REAL.format(dbc=folder / "canmod-gps.dbc"))
    rig = read_description(path)
    assert [axis.unit for axis in rig.axes] == ["m/s^2"] * 3
    decode = SampleDecoder(rig, 100)
    parts = [decode.feed(p.frames) for p in read_frames(next(folder.glob("*.log")))]
    codes = np.concatenate([p.codes for p in parts])
    status = np.concatenate([p.status for p in parts])
    assert len(codes) == 29965
    assert not status.any()
    values = codes * [axis.step for axis in rig.axes] + [axis.zero for axis in rig.axes]
    np.testing.assert_allclose(values.mean(axis=0), [-0.4992, -0.1973, 10.5012], atol=5e-5, rtol=0)
    assert {int(i) & ID_MASK for i in [rig.messages["gnss_imu"].layout.can_id]} == {9}


# ---- a sensor whose code is larger than its noise ----


@pytest.mark.long
@pytest.mark.parametrize("noise_code", [0.05, 0.3])
def test_a_session_with_noise_below_one_code_has_an_honest_u(tmp_path, monkeypatch, noise_code):
    kind = KINDS["j1939-inclinometer"]
    code_g = 0.01 / 9.80665
    monkeypatch.setitem(
        KINDS, "j1939-inclinometer", replace(kind, sd=noise_code * code_g, u_max=400.0)
    )
    setup = any_setup(tmp_path, "j1939-inclinometer")
    assert setup.nominal.fine == (False, False, False)
    engine = Engine(setup, "test")
    play(any_rig(setup), engine.feed, engine.session)
    u_code = np.array([d.u_code for d in engine.session.accepted.values()])
    limit_code = 1.0 / np.sqrt(12.0)
    assert u_code.max() <= 1.02 * limit_code
    assert np.median(u_code) > (0.9 if noise_code == 0.05 else 0.2) * limit_code
