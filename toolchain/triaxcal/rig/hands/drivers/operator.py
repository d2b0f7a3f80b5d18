"""A person sets the chamber and turns the tilter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from triaxcal.base.errors import RefusedError
from triaxcal.rig.hands.instrument import OPERATOR, Driver


@dataclass(frozen=True)
class _Nothing:
    """No keys."""


def _open(_settings: object, _timeout_s: float) -> NoReturn:
    raise RefusedError(
        'driver "operator"',
        "a person does this",
        expected="a driver in [chamber] and in [positioner]",
        remedy="name the drivers in the plan, or run without --unattended",
    )


ENTRY = Driver(OPERATOR, "operator", "A person, led by the screen.", _Nothing, _open, rank=10)
