"""Blocks of a unit at rest, made straight from Gaussian noise; shared with bench/rig_stillness."""

from __future__ import annotations

import numpy as np

from triaxcal.rig.plan.plan import Stillness
from triaxcal.rig.session.blocks import Block, Trouble
from triaxcal.rig.session.stillness import make_reference, motion, refusals

SETTINGS = Stillness()
RATE = 100
SD_MICRO_G = 20.0 * np.sqrt(RATE / 2.0)  # 20 micro-g per root hertz
MICRO_G_PER_CODE = np.array([-0.54, -0.54, -0.54])


def blocks_of(rng, seconds, added_micro_g=None, sd=SD_MICRO_G):
    """Blocks of white noise about constant codes; `added_micro_g` (seconds * RATE,) on x."""
    micro_g = sd * rng.standard_normal((seconds * RATE, 3))
    if added_micro_g is not None:
        micro_g[:, 0] += added_micro_g
    codes = np.rint(np.array([1e4, 2e4, -1.8e6]) + micro_g / MICRO_G_PER_CODE)
    shaped = codes.reshape(seconds, RATE, 3)
    totals = shaped.sum(axis=1).astype(np.int64)
    variances = shaped.var(axis=1, ddof=1)
    return [
        Block(
            i, i * 10**9, RATE, 0, tuple(map(int, totals[i])),
            tuple(map(float, variances[i])), 0, (False,) * 3, 0, 0, 2560.0, Trouble(),
        )
        for i in range(seconds)
    ]  # fmt: skip


def reference(seed=99):
    found = make_reference(blocks_of(np.random.default_rng(seed), SETTINGS.reference_s), SETTINGS)
    assert not isinstance(found, int)
    return found


START = SETTINGS.clean_blocks + SETTINGS.settle_s
TOTAL = START + SETTINGS.average_s + SETTINGS.guard_s
WINDOW = slice(START, START + SETTINGS.average_s)


def verdict(rng, ref, added=None, sd=SD_MICRO_G):
    """Why one dwell is refused, from the first clean block to the last of the guard."""
    blocks = blocks_of(rng, TOTAL, added, sd)
    previous = None
    for block in blocks:
        moved = motion(block, previous, ref, SETTINGS, MICRO_G_PER_CODE)
        if moved:
            return [str(moved)]
        previous = block
    return list(map(str, refusals(blocks, WINDOW, ref, SETTINGS, MICRO_G_PER_CODE)))


def seconds():
    return np.arange(TOTAL * RATE) / RATE - START  # 0 where averaging starts


def slip(rng, micro_g):
    """A step at any moment of the averaging."""
    return micro_g * (seconds() >= rng.uniform(0.0, SETTINGS.average_s))


def creep(micro_g, tau_s):
    return micro_g * -np.expm1(-(seconds() + START) / tau_s)
