"""What a passport states, before it is laid out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from triaxcal.codegen.names import names_of
from triaxcal.codegen.tryout import Residual
from triaxcal.delivery.causes import DOUBT, causes_of
from triaxcal.delivery.judgement import limits_that_apply
from triaxcal.delivery.posecauses import causes_of_poses, doubtful_poses
from triaxcal.delivery.unit import Delivery
from triaxcal.delivery.verdict import DECISIVE, Verdict, worst
from triaxcal.device.record import DeviceRecord
from triaxcal.report.stated.statements import Caution, cautions
from triaxcal.uncertainty.angles import AngleUncertainty, angle_uncertainty
from triaxcal.uncertainty.budget import Budget
from triaxcal.uncertainty.evaluate import LENGTH, Uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS, in_words
from triaxcal.unit.thermal import near_t0


@dataclass(frozen=True)
class Acceptance:
    """One limit of P1 (13) and how the unit stands to it, all in g.

    Attributes
    ----------
    where : str
        "at T0" or "over the range".
    limit_g, largest_g : float
        The limit, and the largest | |a| - g | at the unit's own dwells.
    uncertainty_g : float
        Expanded uncertainty of |a| in the worst orientation, and temperature.
    cause : str
        The worst source of that uncertainty.
    guard_g : float
        Guard band of the decision rule.
    advice : str
        What would make it smaller.
    unknown : tuple of str
        Sources of which nothing is known, where the rule counts the uncertainty: it is without
        them.
    """

    where: str
    limit_g: float
    largest_g: float
    uncertainty_g: float
    cause: str
    advice: str
    guard_g: float
    unknown: tuple[str, ...] = ()

    @property
    def acceptance_g(self) -> float:
        """Acceptance limit: the limit less the guard band."""
        return self.limit_g - self.guard_g

    @property
    def within(self) -> bool:
        """Whether the limit holds by the decision rule, with what is known of the uncertainty."""
        return self.largest_g + self.guard_g <= self.limit_g

    @property
    def shown(self) -> bool:
        """Whether it does so with nothing unknown that the rule counts."""
        return self.within and not self.unknown

    @property
    def factor(self) -> float:
        """Error and guard band as a multiple of the limit."""
        return (self.largest_g + self.guard_g) / self.limit_g


@dataclass(frozen=True)
class Passport:
    """A delivery with its uncertainty.

    Attributes
    ----------
    tools : mapping
        Section "tools" of verification.json; empty when no tools have been run.
    device : DeviceRecord or None
        The device that was verified last; it may have had another delivery.
    """

    delivery: Delivery
    tools: Mapping[str, Any]
    device: DeviceRecord | None = None

    @property
    def uncertainty(self) -> Uncertainty:
        """Of the unit with its firmware."""
        return self.delivery.firmware.uncertainty

    @property
    def verdict(self) -> Verdict:
        """Of the unit with its firmware."""
        return self.delivery.verdict

    @property
    def languages(self) -> tuple[str, ...]:
        """Languages of its pages; passport.html is in the first."""
        return self.delivery.unit.languages

    @property
    def image(self) -> bytes:
        """The constants as they lie in the unit's flash."""
        return self.delivery.files[names_of(self.delivery.plan).file("triax_calib.bin")]

    @property
    def verified_device(self) -> DeviceRecord | None:
        """The device that was verified with this very delivery."""
        return self.device if self.device is not None and self.device.is_of(self.image) else None

    @cached_property
    def constant_budgets(self) -> tuple[Budget, ...]:
        """Budgets of the twelve constants at T0."""
        u = self.uncertainty
        return tuple(u.constant_budget(c, u.t0_index) for c in range(12))

    @cached_property
    def angles(self) -> AngleUncertainty | None:
        """Uncertainty of the angles of the device, where it makes any and it is known."""
        choice = self.delivery.unit.angles
        if choice is None or not self.verdict.checked:
            return None
        return angle_uncertainty(self.uncertainty, choice)

    @cached_property
    def component_budget(self) -> Budget:
        """Budget of the component of the force that is known worst."""
        temp, direction, component = self.uncertainty.worst_component()
        return self.uncertainty.force_budget(component, temp, DIRECTIONS[direction])

    @property
    def component_orientation(self) -> str:
        """Orientation in which it is, in words."""
        return in_words(DIRECTIONS[self.uncertainty.worst_component()[1]])

    @cached_property
    def length_budget(self) -> Budget:
        """Budget of |a| where it is known worst."""
        temp, direction = self.uncertainty.worst_length()
        return self.uncertainty.force_budget(LENGTH, temp, DIRECTIONS[direction])

    @property
    def length_orientation(self) -> str:
        """Orientation in which it is, in words."""
        return in_words(DIRECTIONS[self.uncertainty.worst_length()[1]])

    @cached_property
    def acceptance(self) -> tuple[Acceptance, ...]:
        """Limits at T0 and over the range, as far as there are dwells to check them on."""
        unit, u = self.delivery.unit, self.uncertainty
        limits, residuals = unit.limits, self.delivery.chosen.residuals
        at_t0 = [r for r in residuals if near_t0(r.dwell.temp_degc, unit.t0_degc)]
        others = [r for r in residuals if not near_t0(r.dwell.temp_degc, unit.t0_degc)]
        worst = int(np.argmax(u.force_u[u.t0_index, :, LENGTH]))
        t0_budget = u.force_budget(LENGTH, u.t0_index, DIRECTIONS[worst])
        return tuple(
            _acceptance(where, limit_g, dwells, budget, limits.guard_g(budget.expanded))
            for where, limit_g, dwells, budget in (
                ("at T0", limits.at_t0_g, at_t0, t0_budget),
                ("over the range", limits.over_range_g, others, self.length_budget),
            )
            if dwells
        )

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Limits that hold in the working range, without a dwell to check them."""
        checked = {a.where for a in self.acceptance}
        needed = limits_that_apply(self.delivery.unit, self.delivery.calibration.range_degc)
        return tuple(where for where in needed if where not in checked)

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """What a reader should know of what the laboratory states."""
        updated = self.delivery.calibration.update is not None
        return cautions(self.delivery.unit, updated=updated)

    @cached_property
    def cause(self) -> str:
        """What would explain the readings, where a dwell is beyond half of its limit; else ""."""
        done = self.delivery
        if done.calibration.recording is not None:
            return self._cause_of_poses
        errors = [t for t in self.verdict.tested if t.what not in DECISIVE]
        if worst(errors) <= DOUBT:
            return ""
        found = causes_of(done.unit, done.measurements, done.calibration)
        return found.sentence if found.clear else ""

    @property
    def _cause_of_poses(self) -> str:
        done = self.delivery
        if not doubtful_poses(done.unit, done.calibration):
            return ""
        found = causes_of_poses(done.unit, done.calibration)
        return found.sentence if found is not None and found.clear else ""

    @property
    def tested(self) -> bool:
        """Whether readings that the fit did not use could contradict it."""
        recording = self.delivery.calibration.recording
        return self.verdict.checked and (recording is None or recording.tested)


def passport(
    delivery: Delivery, tools: Mapping[str, Any], device: DeviceRecord | None = None
) -> Passport:
    """Passport of a delivery; `tools` is the section of that name in verification.json."""
    return Passport(delivery, tools, device)


def _acceptance(
    where: str, limit_g: float, residuals: list[Residual], budget: Budget, guard_g: float
) -> Acceptance:
    worst = next(line for line in budget.lines if line.contribution is not None).source
    largest = max(abs(r.error_g) for r in residuals)
    unknown = tuple(line.source.name for line in budget.unknown if guard_g)
    return Acceptance(
        where, limit_g, largest, budget.expanded, worst.name, worst.advice, guard_g, unknown
    )
