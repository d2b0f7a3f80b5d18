"""[vibration.NAME] of unit.toml: spectra for which the rectification is predicted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, each_of, setting
from triaxcal.base.kinds import Kind, number, rising
from triaxcal.model.positions import AXES

VIBRATION_TABLE = "vibration"
_HZ, _DENSITY = number(1e-3, 1e6), number(0.0, 1e6)


def _direction(value: object) -> tuple[float, float, float]:
    if isinstance(value, str):
        k = AXES.index(value)
        return (float(k == 0), float(k == 1), float(k == 2))
    items = [number(-1e6, 1e6).parse(v) for v in value] if isinstance(value, list) else []
    length = math.sqrt(math.fsum(v * v for v in items))
    if len(items) != 3 or not length:
        raise ValueError
    x, y, z = (v / length for v in items)
    return x, y, z


DIRECTION = Kind(
    '"x", "y", "z", or a list of three numbers',
    _direction,
    {
        "anyOf": [
            {"enum": list(AXES)},
            {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
        ]
    },
    example='"z"',
)


def _force(value: object) -> tuple[float, float, float]:
    items = [number(-1e4, 1e4).parse(v) for v in value] if isinstance(value, list) else []
    x, y, z = items
    return x, y, z


FORCE = Kind(
    "a list of three numbers from -1e4 to 1e4",
    _force,
    {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
    example="[0, 0, 1]",
)


def _points(value: object) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list) or not 2 <= len(value) <= 200:
        raise ValueError
    points = []
    for point in value:
        if not isinstance(point, list) or len(point) != 2:
            raise ValueError
        points.append((_HZ.parse(point[0]), _DENSITY.parse(point[1])))
    if not all(a[0] < b[0] for a, b in pairwise(points)):
        raise ValueError
    if not all(d > 0.0 for _, d in points):
        raise ValueError
    return tuple(points)


POINTS = Kind(
    "a list of 2 to 200 points [Hz, g^2/Hz], frequencies rising, densities above 0",
    _points,
    {
        "type": "array",
        "items": {
            "type": "array",
            "items": {"type": "number"},
            "minItems": 2,
            "maxItems": 2,
        },
        "minItems": 2,
        "maxItems": 200,
    },
    example="[[20, 0.01], [80, 0.04], [350, 0.04], [2000, 0.007]]",
)


@dataclass(frozen=True, kw_only=True)
class Vibration:
    """[vibration.NAME]: a vibration for which `triaxcal report` predicts the shift of the bias.

    Attributes
    ----------
    direction
        Along which the unit is shaken, in its own axes; a list is normalised.
    psd
        One-sided spectral density of the random part, straight between its points on scales of
        powers of ten.
    grms
        Of the random part: alone, flat over `band_hz`; with `psd`, its points are scaled to it.
    band_hz
        Of `grms` without `psd`.
    sine_g
        Amplitude of a sine.
    sine_hz
        Its frequency.
    static_g
        Specific force while it is shaken.
    """

    direction: tuple[float, float, float] = setting(DIRECTION)
    psd: tuple[tuple[float, float], ...] | None = setting(POINTS, None, "Hz, g^2/Hz")
    grms: float | None = setting(number(1e-6, 1e4), None, "g", example="6.06")
    band_hz: tuple[float, ...] = setting(rising(1e-3, 1e6, 2, 2), (20.0, 2000.0), "Hz")
    sine_g: float | None = setting(number(1e-6, 1e4), None, "g", example="2")
    sine_hz: float = setting(number(1e-3, 1e6), 100.0, "Hz")
    static_g: tuple[float, float, float] | None = setting(
        FORCE, None, "g", words="local gravity along +z"
    )

    @property
    def points(self) -> tuple[tuple[float, float], ...]:
        """Points of the density, scaled to `grms`; empty without a random part."""
        if self.psd is None:
            if self.grms is None:
                return ()
            low, high = self.band_hz
            flat = self.grms**2 / (high - low)
            return ((low, flat), (high, flat))
        if self.grms is None:
            return self.psd
        scale = self.grms**2 / area(self.psd)
        return tuple((f, d * scale) for f, d in self.psd)

    @property
    def random_g2(self) -> float:
        """Mean square of the random part."""
        return area(self.points) if self.points else 0.0

    @property
    def mean_square_g2(self) -> float:
        """Of all of it, along `direction`."""
        return self.random_g2 + (self.sine_g or 0.0) ** 2 / 2.0

    @property
    def highest_hz(self) -> float:
        """Highest frequency in it."""
        top = self.points[-1][0] if self.points else 0.0
        return max(top, self.sine_hz if self.sine_g else 0.0)


VIBRATION = TableKeys.of(Vibration)


def area(points: tuple[tuple[float, float], ...]) -> float:
    """Mean square of a density that is straight between points on scales of powers of ten.

    Between two points d = d1 (f / f1)^s; its integral is d1 f1 ((f2 / f1)^(s + 1) - 1) / (s + 1),
    and d1 f1 ln(f2 / f1) where s is -1.
    """
    total = 0.0
    for (f1, d1), (f2, d2) in pairwise(points):
        width = math.log(f2 / f1)
        rise = math.log(d2 / d1) + width  # (s + 1) ln(f2 / f1)
        total += d1 * f1 * width * (math.expm1(rise) / rise if abs(rise) > 1e-12 else 1.0)
    return total


def stated_vibrations(tables: Mapping[str, Values]) -> dict[str, Vibration]:
    """Vibrations of a file by name.

    Raises
    ------
    RefusedError
        When a value is wrong, or a table states neither a random part nor a sine.
    """
    found = {}
    for name, values in each_of(tables, VIBRATION_TABLE).items():
        vibration = values.record(Vibration)
        if not vibration.mean_square_g2:
            raise RefusedError(
                f"{values.file}, [{values.name}]",
                "no vibration",
                expected="psd, grms or sine_g",
            )
        found[name] = vibration
    return found
