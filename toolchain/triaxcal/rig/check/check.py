"""`triaxcal rig check`: whether everything is there, before hours are spent."""

from __future__ import annotations

import time
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import AXES
from triaxcal.rig.bus.frames import ID_MASK, Frames, concatenate, empty
from triaxcal.rig.check.census import Census
from triaxcal.rig.hands.orientation import described, recognised
from triaxcal.rig.samples.samples import (
    BAD_CRC,
    CONFLICT,
    DUPLICATE,
    INVALID,
    LOST_FRAME,
    ORPHAN,
    Samples,
)
from triaxcal.rig.samples.undetected import undetected
from triaxcal.rig.session.engine import Engine, Setup
from triaxcal.rig.sources.source import LogEndedError, Source

_RATE_TOLERANCE = 0.02
"""Of the plan's rate; a few seconds' count is exact to a sample or two."""
_NOISE_MAX_MICRO_G = 2000.0
"""Above this the rig is being shaken: 100 times the noise of a navigation accelerometer at 1 Hz."""
_NOISE_WILD_MICRO_G = 50_000.0
"""Above this no sensor at rest is so noisy: the numbers are not its readings."""
_NOISE_MAX_CODES = 3.0
"""The same where one code is large."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at: good or not, or None for what is said only, and what was found."""

    good: bool | None
    text: str


def collect(source: Source, seconds: float) -> Frames:
    """Frames of the first seconds by their own times.

    Gives up when twice as long has passed, or a log has ended.
    """
    parts: list[Frames] = []
    end = time.monotonic() + 2.0 * seconds
    span_ns = 0
    while span_ns < seconds * 1e9 and time.monotonic() < end:
        try:
            part = source.read()
        except LogEndedError:
            break
        if len(part):
            parts.append(part)
            span_ns = int(part.t_ns[-1]) - int(parts[0].t_ns[0])
    return beginning(concatenate(parts), seconds) if parts else empty()


def beginning(frames: Frames, seconds: float) -> Frames:
    """Frames of the first seconds of these, one at least."""
    return frames.take(frames.t_ns <= frames.t_ns[0] + round(seconds * 1e9))


def judged(frames: Frames) -> Finding:
    """Which frames were judged."""
    if not len(frames):
        return Finding(None, "judged: no frames")
    start = datetime.fromtimestamp(int(frames.t_ns[0]) / 1e9, UTC)
    seconds = (int(frames.t_ns[-1]) - int(frames.t_ns[0])) / 1e9
    text = f"judged: {seconds:.1f} s from {start:%Y-%m-%d %H:%M:%S} UTC, {len(frames)} frames"
    return Finding(None, text)


def findings(setup: Setup, frames: Frames, where: str, notes: list[str]) -> list[Finding]:
    """What the frames of a few seconds show."""
    found = [Finding(False, note) for note in notes]
    found += [Finding(None, text) for text in (*setup.rig.warnings, *undetected(setup.rig))]
    recorded = [w for w in (*setup.rig.axes, setup.rig.temperature) if w is not None]
    found += [Finding(None, f"{w.label}: {w.none_said}") for w in recorded if w.none_said]
    if not len(frames):
        return [*found, Finding(False, f"{where}: no frames at all")]
    plan = setup.plan
    samples = setup.decoder().feed(frames)
    census = Census(setup.rig)
    census.add(frames)
    found += [Finding(False, text) for text in census.faults()]
    found += _bus(setup, frames, samples)
    if setup.rig.serial is not None or setup.rig.rate is not None:
        found.append(_identity(setup, frames, where, samples))
    if len(samples.number) < plan.rate_hz:
        counts = f"{len(frames)} frames, {len(samples.number)} samples"
        text = f"{counts}: wrong rig description, or another rig"
        return [*found, Finding(False, text)]
    return found + _samples(setup, samples)


def _bus(setup: Setup, frames: Frames, samples: Samples) -> list[Finding]:
    kinds = samples.trouble
    errors = int(frames.is_error.sum())
    counts = (
        ("frames with a wrong CRC or length", int((kinds == BAD_CRC).sum())),
        ("frames without their partner", int((kinds == ORPHAN).sum())),
        ("samples sent twice", int((kinds == DUPLICATE).sum())),
        ("values that are no numbers", int((kinds == INVALID).sum())),
        ("frames lost by counters of other messages", int((kinds == LOST_FRAME).sum())),
        ("samples with an old counter and new values (two nodes?)", int((kinds == CONFLICT).sum())),
        ("error frames", errors),
        ("jumps of the counters (two nodes with one ID?)", int(samples.jump.sum())),
    )
    ids = np.unique(frames.can_id[~frames.is_error])
    mine = [use.layout.mine(ids) for use in setup.rig.messages.values()]
    strange = [int(i) & ID_MASK for i in ids[~np.logical_or.reduce(mine)]]
    found = [Finding(count == 0, f"{count} {name}") for name, count in counts]
    names = ", ".join(f"0x{i:X}" for i in strange[:8])
    return [*found, Finding(True, f"IDs that are not the rig's: {names or 'none'}")]


def _identity(setup: Setup, frames: Frames, where: str, samples: Samples) -> Finding:
    rig = setup.rig
    for what, said, name in (
        (rig.serial, samples.serials, "serial number"),
        (rig.rate, samples.rates, "rate"),
    ):
        if what is not None and not said:
            return Finding(False, f"the rig has not sent its {name} ({what.message})")
    try:
        Engine(setup, where).feed(frames)
    except RefusedError as refusal:
        return Finding(False, str(refusal))
    serial = (
        f'serial number "{setup.unit.serial}"' if rig.serial is not None else "no serial number"
    )
    return Finding(True, f"{serial}, {setup.plan.rate_hz} Hz")


def _samples(setup: Setup, samples: Samples) -> list[Finding]:
    plan = setup.plan
    seconds = (int(samples.t_ns[-1]) - int(samples.t_ns[0])) / 1e9
    rate = (len(samples.number) - 1) / max(seconds, 1e-9)
    lost = int(samples.number[-1] - samples.number[0]) + 1 - len(samples.number)
    scale = setup.nominal.micro_g_per_code
    seen = recognised(samples.codes.mean(axis=0) - setup.nominal.zero_code, scale)
    codes = samples.temp_code
    temp = setup.unit.temperature_sensor.degc(float(codes.mean())) if len(codes) else None
    return [
        Finding(lost == 0, f"{len(samples.number)} samples, {lost} lost"),
        Finding(abs(rate / plan.rate_hz - 1.0) < _RATE_TOLERANCE, f"{rate:.2f} samples a second"),
        noise(setup, samples),
        Finding(seen is not None, f"position {described(seen) if seen else 'not recognised'}"),
        Finding(temp is not None, f"temperature {temp:.2f} degC" if temp is not None else "none"),
    ]


def noise(setup: Setup, samples: Samples) -> Finding:
    """Noise of samples, two or more: from 0 to what a unit at rest has."""
    scale = np.abs(setup.nominal.micro_g_per_code)
    # Differences of neighbours: a drift does not enter.
    sd = np.sqrt(np.mean(np.diff(samples.codes, axis=0) ** 2, axis=0) / 2.0) * scale
    noise_max = np.maximum(_NOISE_MAX_MICRO_G, _NOISE_MAX_CODES * scale)
    stuck = [a for a, v, fine in zip(AXES, sd, setup.nominal.fine, strict=True) if fine and v == 0]
    text = "noise " + ", ".join(f"{axis} {v:.0f}" for axis, v in zip(AXES, sd, strict=True))
    text += " micro-g"
    wild = [axis for axis, v in zip(AXES, sd, strict=True) if v > _NOISE_WILD_MICRO_G]
    if stuck:
        text += f": {', '.join(stuck)} always the same code, a stuck axis or another signal"
    if wild:
        text += (
            f": {', '.join(wild)} jump from sample to sample; is the byte order, the place or the "
            "sign of the signal another one than the bus description says?"
        )
    return Finding(not stuck and bool((sd < noise_max).all()), text)
