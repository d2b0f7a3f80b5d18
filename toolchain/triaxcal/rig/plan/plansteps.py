"""The steps of a plan: positions at temperatures, in their order."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Values, setting
from triaxcal.base.kinds import FLAG, rising, word
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC, PLAUSIBLE_DEGC
from triaxcal.rig.hands.equipment import Equipment
from triaxcal.unit.description import UnitDescription


@dataclass(frozen=True)
class Step:
    """Positions to be measured at one temperature."""

    temp_degc: float
    positions: tuple[str, ...]


@dataclass(frozen=True)
class StepKeys:
    """[steps]: what is measured.

    Attributes
    ----------
    temperatures_degc
        Temperatures at which TP1 to TP6 are measured.
    check_temperatures_degc
        Temperatures at which CP1 to CP6 are measured.
    direction
        Order of the temperatures.
    take_out_of_order
        A position found out of order is taken without asking; always so in a plan that lists units.
    """

    temperatures_degc: tuple[float, ...] = setting(
        rising(*PLAUSIBLE_DEGC, 1, 64), unit="degC", example="[-20, 20, 60]"
    )
    check_temperatures_degc: tuple[float, ...] = setting(
        rising(*PLAUSIBLE_DEGC, 1, 64), (), "degC", words="none", example="[20]"
    )
    direction: str = setting(word(("up", "down")), "up")
    take_out_of_order: bool = setting(FLAG, False)


def refuse_merged(values: Values, temps_degc: tuple[float, ...], tolerance_k: float) -> None:
    """Refuse temperatures that the fit may take for one: each may be missed by `tolerance_k`.

    Raises
    ------
    RefusedError
        Naming two of them.
    """
    least = GROUP_GAP_DEGC + 2.0 * tolerance_k
    for low, high in pairwise(temps_degc):
        if high - low <= least:
            raise RefusedError(
                values.where("temperatures_degc"),
                f"found {low:g} and {high:g} degC",
                expected=f"more than {least:g} K between them: the fit takes readings within "
                f"{GROUP_GAP_DEGC:g} K for one temperature, and tolerance_k permits "
                f"{tolerance_k:g} K on either side",
                remedy="leave one out, or state a smaller [thermal] tolerance_k",
            )


def planned_steps(
    values: Values, steps: StepKeys, unit: UnitDescription, equipment: Equipment
) -> tuple[Step, ...]:
    """Steps in their order.

    Raises
    ------
    RefusedError
        When a temperature is outside the range of the unit, or of the chamber that is set.
    """
    ranges = []
    if unit.range_degc:
        ranges.append(("the unit's range", unit.range_degc, f"range_degc in {unit.source}"))
    if not equipment.chamber_by.by_hand:
        low_high = equipment.chamber.range_degc
        ranges.append(("the chamber's range", low_high, "range_degc in [chamber]"))
    at: dict[float, tuple[str, ...]] = {}
    for name, temps, positions in (
        ("temperatures_degc", steps.temperatures_degc, tuple(TEST_POSITIONS)),
        ("check_temperatures_degc", steps.check_temperatures_degc, CHECK_POSITIONS),
    ):
        for temp in temps:
            for whose, (low, high), where in ranges:
                if not low <= temp <= high:
                    raise RefusedError(
                        values.where(name),
                        f"found {temp:g} degC",
                        expected=f"temperatures of {whose}, {low:g} to {high:g} degC",
                        remedy=f"correct the plan, or {where}",
                    )
            at[temp] = at.get(temp, ()) + positions
    return tuple(Step(temp, at[temp]) for temp in sorted(at, reverse=steps.direction == "down"))
