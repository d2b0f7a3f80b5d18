"""Samples and blocks: every loss counted, whatever the batches."""

from __future__ import annotations

import numpy as np
import pytest
from rig_cases import rig_of, short_setup

from triaxcal.rig.bus.frames import concatenate
from triaxcal.rig.samples.join import AgeJoin, Part
from triaxcal.rig.samples.samples import BAD_CRC, DUPLICATE, ORPHAN
from triaxcal.rig.session.blocks import BlockBuilder


def frames_of_seconds(setup, seconds, *orders):
    rig = rig_of(setup, *orders)
    return concatenate([rig.advance() for _ in range(seconds)])


def decoder(setup):
    return setup.decoder()


@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_every_code_arrives(tmp_path, layout):
    setup = short_setup(tmp_path, layout=layout)
    rig, again = rig_of(setup), rig_of(setup)
    samples = decoder(setup).feed(rig.advance())
    t_s = np.arange(100) / 100
    codes = again._codes(again._force(t_s), again._temperatures(), t_s)
    np.testing.assert_array_equal(samples.codes, codes)
    np.testing.assert_array_equal(samples.number, np.arange(100))
    assert not samples.jump.any()
    assert len(samples.trouble) == 0


@pytest.mark.parametrize("layout", ["classic", "fd"])
@pytest.mark.parametrize("first", [1, 250])
@pytest.mark.parametrize("lost", [1, 2, 50, 255, 256, 257, 512, 1000])
def test_losses_are_counted_exactly_even_of_a_whole_turn(tmp_path, layout, first, lost):
    setup = short_setup(tmp_path, layout=layout)
    frames = frames_of_seconds(setup, 20)
    samples = decoder(setup).feed(frames)
    start, end = samples.t_ns[first], samples.t_ns[first + lost]
    # The frames of a classic sample lie within 0.15 ms before its time.
    slack = 1_000_000
    kept = frames.take((frames.t_ns < start - slack) | (frames.t_ns >= end - slack))
    after = decoder(setup).feed(kept)
    assert not after.jump.any()
    np.testing.assert_array_equal(
        after.number, np.delete(samples.number, slice(first, first + lost))
    )


@pytest.mark.parametrize("layout", ["classic", "fd"])
@pytest.mark.parametrize("seed", range(4))
def test_blocks_do_not_depend_on_the_batches(tmp_path, layout, seed):
    setup = short_setup(tmp_path, layout=layout)
    orders = ("lose@2.5:7", "duplicate@3.2:9", "bitflip@4.1:5", "error@5.5:3", "twonodes@6:1:2",
              "gone@10.3:1:2")  # fmt: skip
    frames = frames_of_seconds(setup, 16, *orders)
    rng = np.random.default_rng(seed)

    def blocks(cuts):
        decode, build = decoder(setup), BlockBuilder(setup.plan.rate_hz, (-(2**23), 2**23 - 1))
        found = []
        for start, end in zip([0, *cuts], [*cuts, len(frames)], strict=True):
            found += build.feed(decode.feed(frames.take(slice(start, end))))
        return found

    cuts = sorted(rng.integers(0, len(frames), 200).tolist())
    assert blocks(cuts) == blocks([])
    assert len(blocks([])) >= 10


@pytest.mark.parametrize(
    ("order", "kind", "count"),
    [("bitflip@2.2:6", BAD_CRC, 6), ("duplicate@2.2:1", ORPHAN, 1), ("lose@2.2:1", ORPHAN, 1)],
)
def test_troubles_are_counted(tmp_path, order, kind, count):
    setup = short_setup(tmp_path)
    samples = decoder(setup).feed(frames_of_seconds(setup, 4, order))
    assert int((samples.trouble == kind).sum()) == count


def test_samples_sent_twice_are_dropped(tmp_path):
    setup = short_setup(tmp_path, layout="fd")
    clean = decoder(setup).feed(frames_of_seconds(setup, 4))
    samples = decoder(setup).feed(frames_of_seconds(setup, 4, "duplicate@2.2:6"))
    np.testing.assert_array_equal(samples.number, clean.number)
    np.testing.assert_array_equal(samples.codes, clean.codes)
    assert int((samples.trouble == DUPLICATE).sum()) == 6


def test_a_restarted_rig_is_a_jump(tmp_path):
    setup = short_setup(tmp_path)
    samples = decoder(setup).feed(frames_of_seconds(setup, 9, "gone@2.2:1:3"))
    assert samples.jump.sum() == 1


def test_sums_are_exact_for_wide_codes(tmp_path):
    setup = short_setup(tmp_path, layout="fd")
    samples = decoder(setup).feed(frames_of_seconds(setup, 3))
    wide = samples.codes * 250  # near the ends of 32 bits
    wide[::2] *= -1
    object.__setattr__(samples, "codes", wide)
    block = BlockBuilder(100, (-(2**31), 2**31 - 1)).feed(samples)[0]
    exact = [int(v) for v in wide[:100, 2]]
    assert block.total[2] == sum(exact)
    n = len(exact)
    variance = (sum(v * v for v in exact) * n - sum(exact) ** 2) / (n * (n - 1))
    assert block.variance[2] == variance


def test_a_clock_that_is_set_back_makes_no_old_axis_young():
    """Axes joined by age: the other message is silent since an hour before the clock's step."""

    def part(places, seconds):
        t_ns = np.array([round(s * 1e9) for s in seconds], np.int64)
        codes = np.arange(len(places))
        return Part(np.array(places), t_ns, None, None, None, (codes,), None)

    join = AgeJoin(1, 0.02)
    early = join.feed([part([0], [7200.0]), part([1], [7200.005])])
    assert early.place.tolist() == [1]
    late = join.feed([part([], []), part([2, 3], [3600.005, 3600.015])])
    assert late.place.tolist() == []
    assert late.orphans.tolist() == [2, 3]
