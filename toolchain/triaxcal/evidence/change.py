"""Constants that change within a recording, at one moment or slowly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import chi2

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.survey import Survey
from triaxcal.evidence.case import Case
from triaxcal.evidence.chance import largest
from triaxcal.evidence.heldout import HeldOut
from triaxcal.evidence.stretches import at_rest
from triaxcal.evidence.suspect import Suspect, innovations_again
from triaxcal.model.types import FloatArray

JUMP_SD = 6.0
"""Of the noise of means at rest: a smaller jump is not tried."""
CHANCE, BIASES = 1e-6, 6
"""The gyros' readings at rest change with the Earth's rate too: new biases have to lower the
chi-square by more than chance does."""
FEWEST = 10
"""Windows on each side of a jump."""


@dataclass(frozen=True)
class Jump:
    """A change of the gyros' readings at rest.

    Attributes
    ----------
    from_s, at_s : float
        End of the last window at rest before it, start of the first after it.
    rate : array, shape (3,)
        rad/s: mean after it less mean before it.
    drifts : bool
        Whether a straight line over the recording explains the readings better than a jump.
    """

    from_s: float
    at_s: float
    rate: FloatArray
    drifts: bool = False

    @property
    def words(self) -> str:
        """As the end of "constants ..."."""
        size = f"{float(np.degrees(np.abs(self.rate).max())):.3g} deg/s"
        if self.drifts:
            return (
                f"that drift: the gyros at rest change slowly, by {size} between the means before "
                f"and after {self.at_s:.1f} s"
            )
        return (
            f"that change at {self.at_s:.1f} s, where the gyros at rest jump by {size}: two units, "
            "a restart, a shock or another temperature"
        )

    @property
    def remedy(self) -> str:
        """What to do about it."""
        if self.drifts:
            return (
                "let the unit warm up before it is recorded, or record its temperature and switch "
                'on "gyro-thermal" and "accelerometer-thermal"'
            )
        return "calibrate each part alone"


class Change:
    """Constants that change: two units, a restart, another mounting of a sensor, a slow drift."""

    name = "a change of the constants"

    def of(self, case: Case, _held: HeldOut | None, /) -> Suspect | None:
        """New biases at the largest jump of the gyros at rest, or each part alone."""
        jump = largest_jump(case.result.survey, case.noise)
        if jump is None:
            return None
        biases = _new_biases(case, jump)
        words, remedy = jump.words, jump.remedy
        only_biases = Suspect(f"biases {words}", remedy, biases, None, True, rival=True)
        if biases[0] <= largest(biases[1]):
            gain = case.result.passes[-1].chi_square - biases[0]
            return only_biases if gain > chi2.isf(CHANCE, BIASES) else None
        result = case.result
        blocks = case.chosen_blocks
        degc = result.frame.reference_degc
        try:
            parts = halves(case.recording, case.noise, blocks, jump.at_s, degc)
        except RefusedError:
            return only_biases
        chi = sum(part.passes[-1].chi_square for part in parts)
        freedom = sum(part.passes[-1].freedom for part in parts)
        return Suspect(f"constants {words}", remedy, (chi, freedom), None, True)


def _new_biases(case: Case, jump: Jump) -> tuple[float, int]:
    """Innovations of one more pass with new biases of both triads after a jump."""
    layout = case.result.layout
    places = [layout.place(name) for name in ("accelerometer-bias", "gyro-bias")]
    index = np.concatenate([np.arange(len(layout))[place] for place in places])
    return innovations_again(case, cuts_s=(jump.from_s, jump.at_s), renewed=index)


def halves(
    recording: ImuRecording, noise: DataSheet, blocks: tuple[StateBlock, ...], at_s: float,
    reference_degc: float,
) -> tuple[DynamicResult, DynamicResult]:  # fmt: skip
    """What is before a time and what is after it, each as a recording.

    Raises
    ------
    RefusedError
        As `calibrate_dynamic`.
    """
    samples = recording.all()
    cut = int((samples.time_s < at_s).sum())
    early, late = (
        calibrate_dynamic(
            replace(recording, pieces=partial(_one, own), starts_s=()), noise, blocks,
            reference_degc=reference_degc,
        )
        for own in (samples[:cut], samples[cut:])
    )  # fmt: skip
    return early, late


def _one(samples: ImuSamples) -> tuple[ImuSamples, ...]:
    return (samples,)


def largest_jump(found: Survey, noise: DataSheet) -> Jump | None:
    """Where the gyros' means at rest change most, over the windows at rest; None for a small one.

    The two means before and after each window differ by noise of N^2 (1/T1 + 1/T2) an axis. A slow
    drift makes them differ as well. What each of the two explains of the squares decides.
    """
    windows = found.windows
    still = np.flatnonzero(at_rest(found))
    if len(still) < 2 * FEWEST:
        return None
    length = windows.duration_s[still]
    turned = np.cumsum(windows.rate[still] * length[:, None], axis=0)
    before_s = np.cumsum(length)
    k = np.arange(FEWEST, len(still) - FEWEST)
    t1, t2 = before_s[k - 1][:, None], (before_s[-1] - before_s[k - 1])[:, None]
    jump = (turned[-1] - turned[k - 1]) / t2 - turned[k - 1] / t1
    size = (jump**2).sum(axis=1) / (noise.rate_density**2 * (1 / t1 + 1 / t2))[:, 0]
    best = int(np.argmax(size))
    if size[best] < JUMP_SD**2:
        return None
    last, first = still[k[best] - 1], still[k[best]]
    from_s = float(windows.start_s[last] + windows.duration_s[last])
    drifts = _line(windows.start_s[still], windows.rate[still], length, noise) > float(size[best])
    return Jump(from_s, float(windows.start_s[first]), jump[best], drifts)


def _line(time_s: FloatArray, rate: FloatArray, length_s: FloatArray, noise: DataSheet) -> float:
    """Chi-square that a straight line takes from rates (w, 3); a window's variance is N^2 / T."""
    since = time_s - np.average(time_s, weights=length_s)
    weight = (length_s * since)[:, None] / noise.rate_density**2
    return float((((weight * rate).sum(axis=0)) ** 2).sum() / (weight[:, 0] @ since))
