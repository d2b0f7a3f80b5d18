"""Two sensors under one ID: what nobody may average."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rig_cases import rig_of, short_setup

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.samples.samples import CONFLICT, DUPLICATE, SampleDecoder
from triaxcal.rig.session.blocks import BlockBuilder
from triaxcal.rig.session.engine import Engine
from triaxcal.rig.session.faults import fault
from triaxcal.rig.session.reasons import Why, because

DBC = """VERSION ""
NS_ :
BS_:
BU_: E
BO_ 256 IMU: 8 E
 SG_ X : 0|16@1- (0.001,0) [0|0] "g" E
 SG_ Y : 16|16@1- (0.001,0) [0|0] "g" E
 SG_ Z : 32|16@1- (0.001,0) [0|0] "g" E
 SG_ Count : 48|8@1+ (1,0) [0|0] "" E
"""
RATE = 50


def described(folder, bus=""):
    (folder / "imu.dbc").write_text(DBC)
    path = folder / "rig.toml"
    path.write_text(
        f'format = 1\n[rig]\nfile = "imu.dbc"\n{bus}[signals]\nx = "IMU.X"\ny = "IMU.Y"\n'
        'z = "IMU.Z"\n[message.IMU]\ncounter = "Count"\n'
    )
    return read_description(path)


def sent(z, seconds=4, late_ns=0, channel="", count=None):
    """Frames of a node at rest whose z is a number and a flicker of one code."""
    n = seconds * RATE
    counter = np.arange(n) % 256 if count is None else np.full(n, count)
    data = np.zeros((n, 8), np.uint8)
    data[:, 4:6] = (z + np.arange(n) % 2).astype("<i2")[:, None].view(np.uint8)
    data[:, 6] = counter
    t_ns = np.arange(n) * 10**9 // RATE + late_ns
    same = np.full(n, 8, np.uint8), np.zeros(n, np.bool_)
    frames = Frames(t_ns, np.full(n, 256, np.uint32), *same, data)
    return replace(frames, channel=np.full(n, channel.encode()))


def merged(*nodes):
    columns = [np.concatenate(c) for c in zip(*(n.columns for n in nodes), strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return Frames(*(c[order] for c in columns))


def blocks_of(rig, frames):
    decode, build = SampleDecoder(rig, RATE), BlockBuilder(RATE, (-(2**15), 2**15 - 1))
    return build.feed(decode.feed(frames))


@pytest.mark.parametrize("late_ns", [200_000, 9_000_000])
def test_equal_counters_with_other_values_are_a_conflict(tmp_path, late_ns):
    rig = described(tmp_path)
    both = merged(sent(1000), sent(1026, late_ns=late_ns))
    found = SampleDecoder(rig, RATE).feed(both)
    assert (found.trouble == CONFLICT).sum() == 4 * RATE
    assert (found.trouble == DUPLICATE).sum() == 0
    blocks = blocks_of(rig, both)
    plan = short_setup(tmp_path, rate=RATE).plan
    for before, block in pairwise(blocks):
        assert fault(block, before, plan).why is Why.CONFLICT
    assert len(blocks) > 3


def test_frames_that_are_truly_sent_twice_are_no_conflict(tmp_path):
    rig = described(tmp_path)
    found = SampleDecoder(rig, RATE).feed(merged(sent(1000), sent(1000, late_ns=200_000)))
    assert found.trouble.tolist() == [DUPLICATE] * 4 * RATE
    np.testing.assert_array_equal(found.number, np.arange(4 * RATE))
    assert not found.jump.any()


def test_a_conflict_across_two_batches_is_found(tmp_path):
    rig = described(tmp_path)
    both = merged(sent(1000), sent(1026, late_ns=200_000))
    decode = SampleDecoder(rig, RATE)
    parts = [decode.feed(both.take(slice(i, i + 1))) for i in range(len(both))]
    assert sum(int((p.trouble == CONFLICT).sum()) for p in parts) == 4 * RATE


def test_a_counter_that_stands_still_is_reported_and_time_goes_on(tmp_path):
    blocks = blocks_of(described(tmp_path), sent(1000, count=7))
    assert [b.index for b in blocks] == [0, 1, 2]
    assert [b.trouble.conflicts for b in blocks] == [RATE - 1, RATE, RATE]
    text = str(because(Why.CONFLICT, count=RATE))
    assert "two nodes send under the rig's IDs, or the counter does not count" in text


def test_one_id_on_two_channels_is_refused_by_name(tmp_path):
    both = merged(sent(1000, channel="can0"), sent(1026, late_ns=9_000_000, channel="can1"))
    with pytest.raises(RefusedError) as refusal:
        SampleDecoder(described(tmp_path), RATE).feed(both)
    assert "IMU: ID 0x100 comes on several channels: can0, can1" in str(refusal.value)
    assert 'channel = "can0"' in str(refusal.value)
    decode = SampleDecoder(described(tmp_path), RATE)
    for i in range(4):
        decode.feed(both.take(slice(i, i + 1)))
    with pytest.raises(RefusedError, match="several channels"):
        decode.feed(both.take(slice(4, 5)))


def test_one_line_of_a_log_with_another_channel_is_no_second_sensor(tmp_path):
    frames = sent(1000, channel="can0")
    channel = frames.channel.copy()
    channel[50] = b"ca0"
    found = SampleDecoder(described(tmp_path), RATE).feed(replace(frames, channel=channel))
    assert len(found.number) == 4 * RATE


@pytest.mark.parametrize(("channel", "z"), [("can0", 1000), ("can1", 1026)])
def test_a_channel_may_be_chosen(tmp_path, channel, z):
    both = merged(sent(1000, channel="can0"), sent(1026, late_ns=9_000_000, channel="can1"))
    found = SampleDecoder(described(tmp_path, f'channel = "{channel}"\n'), RATE).feed(both)
    assert set(found.codes[:, 2].tolist()) == {z, z + 1}
    assert len(found.trouble) == 0


def test_a_cable_that_changed_over_is_no_second_sensor(tmp_path):
    after = replace(sent(1000, channel="can1"), t_ns=sent(1000).t_ns + 9 * 10**9)
    found = SampleDecoder(described(tmp_path), RATE).feed(merged(sent(1000, channel="can0"), after))
    assert len(found.number) == 8 * RATE


def test_repeats_are_counted_in_the_evidence(tmp_path):
    setup = short_setup(tmp_path, layout="fd")
    rig = rig_of(setup, "duplicate@2.2:6")
    engine = Engine(setup, "test")
    engine.feed(concatenate([rig.advance() for _ in range(5)]))
    assert (engine.session.repeated, engine.session.invalid) == (6, 0)
