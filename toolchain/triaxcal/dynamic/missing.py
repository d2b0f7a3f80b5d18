"""Which effects that are switched off the recording shows.

The sum of squared innovations is a weak test: an effect far below the noise of one block, in step
with the motion for an hour, hardly changes it. So every extension that the recording's columns
allow is switched on for one more pass, about the finished result. If an effect is absent the
estimates of its k states are noise, and p^T P^-1 p is chi-square with k degrees of freedom. Each is
tested beside those that are shown, the strongest first, and with the others absent.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from triaxcal.dynamic.again import extended, task_again
from triaxcal.dynamic.blocks.block import Extension
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.filterpass import EARTH_RATE_RAD_PER_S, run_pass
from triaxcal.dynamic.imumodel import IN_MODEL
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.model.types import FloatArray, IntArray

SIGNIFICANCE = 1e-3
"""Some ten tests on each recording: one false alarm in a hundred recordings."""


HINT_SD = 4.0
HALF_SAMPLE = 0.02
"""Of a sample: how near to a half or a whole one a delay is no accident."""
REVERSED = 0.1
"""Of the Earth's rate: the rest of a unit's errors, and what D cannot take of it."""


@dataclass(frozen=True)
class Effect:
    """An extension that is switched off.

    Attributes
    ----------
    name, title : str
    chi_square : float
        Of its states, beside the effects that are shown.
    states : int
    shown : bool
        Whether the recording shows it beyond `SIGNIFICANCE`.
    hint : str
        A mistake of conventions that looks so; or "".
    alone : float
        Chi-square of its states where no other effect is switched on: by so much it lowers that of
        the innovations.
    moves_sd : float
        By how many of its standard deviations the constant of the C that it moves most would
        change, if this effect alone were switched on.
    moved : str
        Which constant that is.
    """

    name: str
    title: str
    chi_square: float
    states: int
    shown: bool
    hint: str = ""
    alone: float = 0.0
    moves_sd: float = 0.0
    moved: str = ""


def missing_effects(
    recording: ImuRecording,
    result: DynamicResult,
    progress: Callable[[float], None] | None = None,
) -> tuple[Effect, ...]:
    """Test every extension that is off and whose columns are there, the strongest first."""
    candidates = [e for e in EXTENSIONS if _possible(e, recording, result)]
    if not candidates:
        return ()
    added = tuple(block for extension in candidates for block in extension.blocks)
    layout = Layout((*result.layout.blocks, *added))
    known = len(result.layout)
    start, task = extended(result, layout), task_again(recording, result, layout)
    done = run_pass(task, start, first=False, progress=progress)
    covariance = done.root @ done.root.T
    own = {e.name: _places(e, result.layout, layout) for e in candidates}
    tested = _Tested(done.p - start.p, covariance, np.arange(known), own)
    shown = tested.chosen()
    found = []
    for extension in candidates:
        name = extension.name
        value, new, its = tested.beside(name, [other for other in shown if other != name])
        alone, _, _ = tested.beside(name, [])
        moved, moves_sd = _most_moved(result, tested.step_of_constants(name))
        hint = _hint(name, new, its, recording) if name in shown else ""
        about = name, extension.label, value, len(new), name in shown, hint
        found.append(Effect(*about, alone, moves_sd, moved))
    return tuple(sorted(found, key=lambda e: -e.chi_square / e.states))


def _places(extension: Extension, on: Layout, layout: Layout) -> IntArray:
    """Where the states of an extension are that are not on."""
    new = [block for block in extension.blocks if block.name not in on]
    index = np.arange(len(layout))
    return np.concatenate([index[layout.place(block.name)] for block in new])


@dataclass(frozen=True)
class _Tested:
    """Estimates with all effects on, of which some are then taken to be absent.

    Attributes
    ----------
    step : array, shape (n,)
    covariance : array, shape (n, n)
    constants : array
        Places of the states that are on.
    own : dict
        Places of each effect's states.
    """

    step: FloatArray
    covariance: FloatArray
    constants: IntArray
    own: dict[str, IntArray]

    def _only(self, names: list[str]) -> tuple[FloatArray, FloatArray]:
        kept = np.concatenate([self.constants, *(self.own[name] for name in names)])
        return without_others(self.step, self.covariance, kept)

    def beside(self, name: str, others: list[str]) -> tuple[float, FloatArray, FloatArray]:
        """Chi-square, estimate and covariance of an effect's states, only `others` being there."""
        step, covariance = self._only([*others, name])
        new = slice(len(step) - len(self.own[name]), None)
        value = float(step[new] @ np.linalg.solve(covariance[new, new], step[new]))
        return value, step[new], covariance[new, new]

    def step_of_constants(self, name: str) -> FloatArray:
        """By how much one effect would change the constants."""
        return self._only([name])[0][: len(self.constants)]

    def chosen(self) -> list[str]:
        """Effects that are significant beside each other: the strongest, then what is left.

        Several may look alike in a recording (a table has few rates). All of them on, none would
        be significant.
        """
        chosen: list[str] = []
        while len(chosen) < len(self.own):
            chance = {}
            for name, places in self.own.items():
                if name not in chosen:
                    value = self.beside(name, chosen)[0]
                    # Far out the logarithm is -inf for all, and the larger value is the stronger.
                    chance[name] = float(chi2.logsf(value, len(places))), len(places) - value
            strongest = min(chance, key=lambda name: chance[name])
            if chance[strongest][0] > math.log(SIGNIFICANCE):
                break
            chosen.append(strongest)
        return chosen


def without_others(
    step: FloatArray, covariance: FloatArray, kept: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Estimate and covariance of the states `kept` where all others are known to be zero.

    `step`, shape (n,), is the estimate about a reference at which the others are zero.
    """
    others = np.setdiff1d(np.arange(len(step)), kept)
    if len(others) == 0:
        return step[kept], covariance[np.ix_(kept, kept)]
    gain = np.linalg.solve(covariance[np.ix_(others, others)], covariance[np.ix_(others, kept)]).T
    left = covariance[np.ix_(kept, kept)] - gain @ covariance[np.ix_(others, kept)]
    return step[kept] - gain @ step[others], left


def _most_moved(result: DynamicResult, step: FloatArray) -> tuple[str, float]:
    """The constant of the C that a step moves most, and by how many standard deviations."""
    layout = result.layout
    delivered = [b.name for b in layout.blocks if b.name in IN_MODEL]
    places = np.concatenate([np.arange(len(layout))[layout.place(name)] for name in delivered])
    moved = np.abs(step[places]) / result.sd[places]
    worst = int(np.argmax(moved))
    return layout.states[int(places[worst])].name, float(moved[worst])


def _hint(name: str, p: FloatArray, covariance: FloatArray, recording: ImuRecording) -> str:
    """The mistaken convention that gives an effect of just this size; "" if there is none."""
    if name == "delay":
        samples, sd = p[0] * recording.rate_hz, covariance[0, 0] ** 0.5 * recording.rate_hz
        nearest = round(2 * samples) / 2
        if nearest and abs(samples - nearest) < HALF_SAMPLE + HINT_SD * sd:
            return (
                f"{samples:+.2f} samples: check rate_samples and force_samples, and what the time "
                "stamps of both mean"
            )
    if name == "g-drift":
        # D11 = D22 = D33 is a rate about up: there the Earth turns, and the other way if up is down
        common = np.eye(3).ravel() / 3
        rate, sd = common @ p, np.sqrt(common @ covariance @ common)
        earth = EARTH_RATE_RAD_PER_S * np.sin(np.radians(recording.latitude_deg))
        turned_round = abs(rate + 2 * earth) < HINT_SD * sd + REVERSED * abs(earth)
        if turned_round and abs(rate) > HINT_SD * sd:
            return (
                "the Earth turns the other way: check the sign of the forces (at rest the axis "
                "that points up reads +g) and of latitude_deg (north is positive)"
            )
    return ""


def _possible(extension: Extension, recording: ImuRecording, result: DynamicResult) -> bool:
    """Off, an effect of the unit or its place on the table, and with all columns recorded."""
    first = next(iter(recording.pieces()))
    needed = {block.needs for block in extension.blocks} - {""}
    ready = all(getattr(first, name, None) is not None for name in needed)
    on = all(block.name in result.layout for block in extension.blocks)
    # Functions over temperature have linear coefficients in them.
    held = any(not block.shown for block in result.layout.blocks) and "temp_degc" in needed
    # A second triad or a table that is recorded is no effect: its states are its own.
    return ready and not on and not held and not needed & {"force2", "table_angle_rad", "table"}
