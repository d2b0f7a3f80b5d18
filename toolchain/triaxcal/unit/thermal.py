"""[thermal] of unit.toml: T0, the working range, and the thermal function."""

from __future__ import annotations

from dataclasses import dataclass, field

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import interval, number
from triaxcal.model.thermal.registry import AUTO, THERMAL_FUNCTIONS, owners, thermal_keys
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC, Settings

T0_TOLERANCE_DEGC = 2.0
"""A dwell this near to T0 counts as one at T0."""


def near_t0(temp_degc: float, t0_degc: float) -> bool:
    """Whether a dwell counts as one at T0."""
    return abs(temp_degc - t0_degc) <= T0_TOLERANCE_DEGC


@dataclass(frozen=True)
class Temperatures:
    """[thermal]: temperature.

    Attributes
    ----------
    t0_degc
        T0, the reference temperature.
    range_degc
        Working temperature range; outside it the firmware clamps and flags.
    """

    t0_degc: float = setting(number(*PLAUSIBLE_DEGC), unit="degC", example="20")
    range_degc: tuple[float, float] | None = setting(
        interval(*PLAUSIBLE_DEGC),
        None,
        "degC",
        words="the fitted dwells' range, outward in steps of 0.1, at most 0.5 beyond the outer "
        "temperatures",
        example="[-40, 85]",
    )


@dataclass(frozen=True)
class ThermalChoice:
    """Which thermal functions to fit; `model` "auto" tries them all on held-out data.

    `settings` are the values of the function's own keys.
    """

    model: str
    settings: Settings = field(default_factory=dict)


def thermal_table() -> TableKeys:
    """Keys of [thermal], with those of every thermal function."""
    return TableKeys.of(Temperatures).but(*thermal_keys())


def thermal_choice(values: Values) -> ThermalChoice:
    """Thermal function of a table [thermal].

    Raises
    ------
    RefusedError
        For a wrong value, and for a key of another function.
    """
    model, *settings = thermal_keys()
    name = values[model]
    keys = () if name == AUTO else THERMAL_FUNCTIONS[name].keys
    for other in settings:
        if other.name in values and other.name not in {own.name for own in keys}:
            models = " or ".join(f'"{f.name}"' for f in owners(other.name))
            raise RefusedError(
                values.where(other.name),
                f'given with model = "{name}"',
                expected=f"it with model = {models} only",
                remedy="remove it, or choose that model",
            )
    return ThermalChoice(name, {own.name: values[own] for own in keys})
