"""Units on a tilter with one fault each, by exact physics: nothing here is the package's model.

Curves over temperature are exponentials, arctangents and bumps, placements are rotation matrices,
noise is drawn reading by reading only where clipping needs it. Dates are the order of the rows:
tests heating, then checks cooling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.description import UnitDescription, unit_of_text

ARC = np.pi / 180 / 3600
FORCE = {
    "TP1": (0, 0, 1), "TP2": (0, -1, 0), "TP3": (0, 0, -1),
    "TP4": (0, 1, 0), "TP5": (-1, 0, 0), "TP6": (1, 0, 0),
}  # fmt: skip
NAMES = tuple(FORCE)
TEMPS = {3: (-30.0, 20.0, 65.0), 5: (-30.0, 0.0, 20.0, 45.0, 65.0),
         9: (-40.0, -25.0, -10.0, 5.0, 20.0, 35.0, 50.0, 60.0, 70.0)}  # fmt: skip
CHECKS = {3: (-5.0, 42.0), 5: (-15.0, 10.0, 33.0, 55.0),
          9: (-33.0, -17.0, -3.0, 12.0, 27.0, 42.0, 55.0, 65.0)}  # fmt: skip
SENSITIVITY = 0.5


@dataclass
class Bench:
    """One unit, the rig, and every dwell as it is measured."""

    rng: np.random.Generator
    temps: tuple[float, ...]
    checks: tuple[float, ...]
    bump_g: float = 0.0
    squareness: float = 15 * ARC
    noise: float = 1.0
    volts: float = SENSITIVITY
    info: dict[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        rng = self.rng
        self.sd = rng.uniform(20e-6, 60e-6)
        self.tilt = rng.uniform(3, 10) * ARC
        self.seats = rng.normal(0, self.squareness, (6, 3))
        scale = np.exp(rng.uniform(np.log(0.5), np.log(2)))
        self.b = rng.normal(0, 1, (3, 4)) * (0.03, 5e-3, 2e-3 * scale, 1e-3 * scale)
        own, cross = (0.01, 5e-3, 1e-3 * scale), (0.01, 1e-4, 4e-5 * scale)
        self.k = rng.normal(0, 1, (3, 3, 3)) * np.where(np.eye(3)[:, :, None] > 0, own, cross)
        self.bend = rng.uniform(-self.bump_g, self.bump_g, 3)
        self.bend_at = rng.uniform(-10, 50)
        self.rows: list[dict[str, object]] = []
        self._measure()

    def bias(self, temp: float) -> np.ndarray:
        x = (temp - 20) / 50
        shape = np.array([1.0, x, np.exp(0.8 * x) - 1 - 0.8 * x, np.arctan(1.5 * x) - x])
        return self.b @ shape + self.bend * np.exp(-0.5 * ((temp - self.bend_at) / 12) ** 2)

    def gain(self, temp: float) -> np.ndarray:
        x = (temp - 20) / 50
        return np.eye(3) + self.k @ np.array([1.0, x, np.exp(0.7 * x) - 1 - 0.7 * x])

    def _measure(self) -> None:
        for block, temp in enumerate(self.temps):
            for order, name in enumerate(NAMES):
                turn = self.seats[order] + self.rng.normal(0, self.tilt, 3)
                self._add(name, temp, rotation(turn) @ FORCE[name], block, order)
        for block, temp in enumerate(reversed(self.checks), len(self.temps)):
            for order, name in enumerate(NAMES):
                up = np.array(FORCE[name], dtype=float)
                side = np.cross(up, self.rng.normal(0, 1, 3))
                side /= np.linalg.norm(side)
                tilt = np.radians(25 + self.rng.normal(0, 0.5))
                force = np.cos(tilt) * up + np.sin(tilt) * side
                self._add(name.replace("TP", "CP"), temp, force, block, order)

    def _add(self, name: str, temp: float, force: np.ndarray, block: int, order: int) -> None:
        true = temp + self.rng.normal(0, 0.06)
        self.rows.append(
            {"name": name, "true": true, "temp": true, "force": force, "block": block,
             "order": order, "extra": np.zeros(3)}
        )  # fmt: skip

    def output(self, row: dict[str, object]) -> np.ndarray:
        """In g, without noise."""
        temp, force = row["true"], row["force"]
        return self.bias(temp) + self.gain(temp) @ force + row["extra"]

    def outputs(self) -> np.ndarray:
        return np.array([self.output(r) for r in self.rows])

    def tests(self) -> list[dict[str, object]]:
        return [r for r in self.rows if r["name"][0] == "T"]

    def of_block(self, block: int) -> list[dict[str, object]]:
        return [r for r in self.rows if r["block"] == block]

    @property
    def blocks(self) -> int:
        return len(self.temps) + len(self.checks)


Fault = Callable[[Bench, float], None]
"""Changes the rows before they are read; or puts a function of outputs into `info["after"]`."""


def rotation(v: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(v)
    if angle == 0:
        return np.eye(3)
    k = v / angle
    S = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * S + (1 - np.cos(angle)) * S @ S


def direction(bench: Bench, size: float, count: int = 3) -> np.ndarray:
    """A random vector whose largest component is `size`."""
    v = bench.rng.normal(0, 1, count)
    return v / np.abs(v).max() * size


def after(change: Callable[[np.ndarray, Bench], np.ndarray]) -> Fault:
    def fault(bench: Bench, _size: float) -> None:
        bench.info["after"] = change

    return fault


def fault_none(_bench: Bench, _size: float) -> None:
    pass


def fault_dwell(bench: Bench, size: float) -> None:
    row = bench.rows[bench.rng.integers(len(bench.rows))]
    axis = bench.rng.integers(3)
    if row["name"][0] == "C":  # a check feels what lies along the force
        axis = int(np.abs(row["force"]).argmax())
    row["extra"] = row["extra"] + np.eye(3)[axis] * size * bench.rng.choice([-1, 1])
    bench.info["rows"] = [bench.rows.index(row)]


def fault_dwells(bench: Bench, size: float) -> None:
    for _ in range(bench.rng.integers(2, 5)):
        fault_dwell(bench, size * bench.rng.uniform(0.8, 1.5))


def fault_misplaced(bench: Bench, size: float) -> None:
    name = NAMES[bench.rng.integers(6)]
    level = [k for k in range(3) if FORCE[name][k] == 0]
    turn = np.zeros(3)
    turn[level] = direction(bench, size, 2)
    for row in bench.rows:
        if row["name"] == name:
            row["force"] = rotation(turn) @ row["force"]
    bench.info["place"] = name


def _swap(a: str, b: str, rows: list[dict[str, object]]) -> None:
    for row in rows:
        row["name"] = {a: b, b: a}.get(row["name"], row["name"])


def fault_exchanged(bench: Bench, _size: float) -> None:
    a, b = (NAMES[k] for k in bench.rng.permutation(6)[:2])
    every = bench.rng.random() < 0.5
    rows = bench.rows if every else bench.of_block(bench.rng.integers(len(bench.temps)))
    _swap(a, b, rows)


def fault_half_turn(bench: Bench, _size: float) -> None:
    axis = bench.rng.integers(3)
    every = bench.rng.random() < 0.5
    rows = bench.tests() if every else bench.of_block(bench.rng.integers(len(bench.temps)))
    turned = np.where(np.arange(3) == axis, 1.0, -1.0)
    for row in rows:
        row["force"] = row["force"] * turned


def fault_polarity(bench: Bench, _size: float) -> None:
    signs = np.ones(3)
    signs[bench.rng.integers(3)] = -1
    bench.info["after"] = lambda outputs, _bench: outputs * signs


def fault_own_square(bench: Bench, size: float) -> None:
    k2 = direction(bench, size)
    for row in bench.rows:
        row["extra"] = row["extra"] + bench.gain(row["true"]) @ (k2 * row["force"] ** 2)


def fault_hysteresis(bench: Bench, size: float) -> None:
    bias = direction(bench, size)
    for row in bench.rows:
        if row["name"][0] == "C":
            row["extra"] = row["extra"] + bias


def fault_step(bench: Bench, size: float) -> None:
    first = bench.rng.integers(1, bench.blocks)
    if first == len(bench.temps) and len(bench.checks):
        first -= 1  # tests against checks is hysteresis
    bias = direction(bench, size)
    for row in bench.rows:
        if row["block"] >= first:
            row["extra"] = row["extra"] + bias


def fault_sign(bench: Bench, _size: float) -> None:
    blocks = [b for b in range(bench.blocks) if bench.of_block(b)[0]["true"] < -3]
    for row in bench.of_block(blocks[bench.rng.integers(len(blocks))]):
        row["temp"] = -row["temp"]


def fault_unsigned(bench: Bench, _size: float) -> None:
    for row in bench.rows:
        if row["temp"] < -3:
            row["temp"] += 256


def fault_unit(bench: Bench, _size: float) -> None:
    kelvin = bench.rng.random() < 0.5
    every = bench.rng.random() < 0.5
    rows = bench.rows if every else bench.of_block(bench.rng.integers(len(bench.temps)))
    for row in rows:
        row["temp"] = row["temp"] + 273.15 if kelvin else row["temp"] * 1.8 + 32


def fault_blocks(bench: Bench, _size: float) -> None:
    count = len(bench.temps)
    a, b = bench.rng.permutation(count)[:2]
    first, second = bench.of_block(a), bench.of_block(b)
    for one, other in zip(first, second, strict=True):
        one["temp"], other["temp"] = other["temp"], one["temp"]


def fault_lag(bench: Bench, size: float) -> None:
    shape = np.exp(-np.arange(6) / 2.5)
    slope = max(
        np.abs(bench.output({**r, "true": r["true"] + 1}) - bench.output(r)).max()
        for r in bench.tests()
    )
    lag = min(size / slope, 15.0)
    for row in bench.rows:
        sign = 1 if row["name"][0] == "T" else -1
        row["true"] = row["true"] + sign * lag * shape[row["order"]]


def fault_drift(bench: Bench, size: float) -> None:
    axis, count = bench.rng.integers(3), len(bench.rows)
    for k, row in enumerate(bench.rows):
        row["extra"] = row["extra"] + np.eye(3)[axis] * size * (2 * k / (count - 1) - 1)


def fault_settling(bench: Bench, size: float) -> None:
    """All biases relax after switching on: most in the first quarter of the rows."""
    bias = direction(bench, size)
    for k, row in enumerate(bench.rows):
        row["extra"] = row["extra"] + bias * np.exp(-4.0 * k / len(bench.rows))


def fault_dead(bench: Bench, _size: float) -> None:
    axis = bench.rng.integers(3)

    def change(outputs: np.ndarray, _bench: Bench) -> np.ndarray:
        outputs[:, axis] = 0.01
        return outputs

    bench.info["after"] = change


def fault_copied(bench: Bench, _size: float) -> None:
    a, b = bench.rng.permutation(3)[:2]
    bench.info["copied"] = (a, b)


def fault_saturated(bench: Bench, size: float) -> None:
    axis, sign = bench.rng.integers(3), bench.rng.choice([-1, 1])
    own = [sign * bench.output(r)[axis] for r in bench.tests() if sign * r["force"][axis] > 0.5]
    bench.info["clip"] = (axis, sign, min(own) - size)


def fault_scatter(bench: Bench, _size: float) -> None:
    bench.info["stated"] = bench.rng.choice([0.1, 10.0])


def fault_gain(bench: Bench, _size: float) -> None:
    bench.volts *= bench.rng.choice([0.5, 2.0])


def fault_mounting(bench: Bench, _size: float) -> None:
    turn = rotation(direction(bench, np.radians(bench.rng.uniform(8, 80))))
    for row in bench.rows:
        row["force"] = turn @ row["force"]


def fault_left_handed(bench: Bench, _size: float) -> None:
    a, b = bench.rng.permutation(3)[:2]
    order = np.arange(3)
    order[[a, b]] = order[[b, a]]
    bench.info["after"] = lambda outputs, _bench: outputs[:, order]


def fault_squareness(bench: Bench, size: float) -> None:
    for name in NAMES:
        turn = bench.rng.normal(0, 1, 3) * max(size, 1e-3)
        for row in bench.rows:
            if row["name"] == name:
                row["force"] = rotation(turn) @ row["force"]


def fault_curve(bench: Bench, size: float) -> None:
    bend, at = direction(bench, size), bench.rng.uniform(-5, 45)
    for row in bench.rows:
        row["extra"] = row["extra"] + bend * np.exp(-0.5 * ((row["true"] - at) / 8) ** 2)


def fault_other_squares(bench: Bench, size: float) -> None:
    k = direction(bench, size)
    for row in bench.rows:
        row["extra"] = row["extra"] + k * row["force"][[1, 2, 0]] ** 2


def fault_gain_step(bench: Bench, size: float) -> None:
    axis = bench.rng.integers(3)
    for row in bench.rows:
        if len(bench.temps) - 2 <= row["block"] < len(bench.temps):
            row["extra"] = row["extra"] + np.eye(3)[axis] * size * row["force"][axis]


def fault_one_gain(bench: Bench, size: float) -> None:
    for row in bench.of_block(bench.rng.integers(len(bench.temps))):
        row["extra"] = row["extra"] + size * row["force"]


FAULTS: dict[str, Fault] = {
    name.removeprefix("fault_"): value
    for name, value in list(globals().items())
    if name.startswith("fault_")
}
"""By the name of the fault; `CAUSE_OF` says which cause is right."""
CAUSE_OF = {
    **{name: name for name in FAULTS},
    "sign": "block_temperature",
    "unsigned": "block_temperature",
    "unit": "block_temperature",
    "blocks": "exchanged_blocks",
    "gain_step": "block_gain",
    "one_gain": "block_gain",
    "settling": "drift",
}
WITHOUT_SIZE = {
    "exchanged", "half_turn", "polarity", "sign", "unsigned", "unit", "blocks", "dead", "copied",
    "scatter", "gain", "mounting", "left_handed",
}  # fmt: skip
"""Faults of one size."""
NEEDS_CHECKS = {
    "hysteresis", "drift", "settling", "cubes", "drift_and_dwell", "exchange_and_hysteresis",
}  # fmt: skip
"""Without check dwells these are a part of the curves of one rising pass, whatever the method."""


# ---- what no cause of the list is


def unlisted_two(bench: Bench, size: float) -> None:
    fault_misplaced(bench, size)
    fault_own_square(bench, size)


def unlisted_noisy(bench: Bench, size: float) -> None:
    for row in bench.rows:
        row["extra"] = row["extra"] + bench.rng.standard_t(3, 3) * size


def unlisted_one_bias(bench: Bench, size: float) -> None:
    """A jump of bias and gain at one temperature, in one output."""
    axis = bench.rng.integers(3)
    bias, gain = direction(bench, size, 2)
    for row in bench.of_block(bench.rng.integers(len(bench.temps))):
        row["extra"] = row["extra"] + np.eye(3)[axis] * (bias + gain * row["force"][axis])


def unlisted_outliers(bench: Bench, size: float) -> None:
    """A quarter of all dwells are wrong, each in its own way."""
    for row in bench.rows:
        if bench.rng.random() < 0.25:
            row["extra"] = row["extra"] + direction(bench, size * bench.rng.uniform(0.5, 2.0))


def unlisted_growing_cross(bench: Bench, size: float) -> None:
    """A cross sensitivity that grows with the time of measuring."""
    a, b = bench.rng.permutation(3)[:2]
    for k, row in enumerate(bench.rows):
        change = size * k / len(bench.rows) * row["force"][b]
        row["extra"] = row["extra"] + np.eye(3)[a] * change


def unlisted_supply(bench: Bench, size: float) -> None:
    """All sensitivities step between two dates: another supply voltage."""
    first = bench.rng.integers(1, bench.blocks)
    for row in bench.rows:
        if row["block"] >= first:
            row["extra"] = row["extra"] + size * row["force"]


def unlisted_steps(bench: Bench, size: float) -> None:
    """Outputs in coarse steps, with too little noise to smooth them."""
    step = 2.0 * size
    bench.info["after"] = lambda outputs, _bench: np.round(outputs / step) * step


def unlisted_cubes(bench: Bench, size: float) -> None:
    """Own-axis cubes: six positions take them for gain, check dwells do not."""
    k3 = direction(bench, size)
    for row in bench.rows:
        row["extra"] = row["extra"] + k3 * row["force"] ** 3


def unlisted_bending_rig(bench: Bench, size: float) -> None:
    """One face of the rig tilts in proportion to the temperature."""
    name = NAMES[bench.rng.integers(6)]
    turn = direction(bench, size)
    for row in bench.rows:
        if row["name"] == name:
            row["force"] = rotation(turn * (row["true"] - 20.0) / 40.0) @ row["force"]


def unlisted_drift_and_dwell(bench: Bench, size: float) -> None:
    fault_drift(bench, size)
    fault_dwell(bench, 2.0 * size)


def unlisted_sign_and_square(bench: Bench, size: float) -> None:
    fault_sign(bench, size)
    fault_own_square(bench, size)


def unlisted_exchange_and_hysteresis(bench: Bench, size: float) -> None:
    fault_exchanged(bench, size)
    fault_hysteresis(bench, size)


UNLISTED: dict[str, Fault] = {
    name.removeprefix("unlisted_"): value
    for name, value in list(globals().items())
    if name.startswith("unlisted_")
}

_TOML = """format = 1
serial = "{name}"
[adc]
bits = 24
full_scale_v = 5.0
[temperature_sensor]
degc_per_code = 0.0078125
[site]
local_gravity_m_per_s2 = 9.80665
[thermal]
t0_degc = 20
{more}"""


def read(bench: Bench, more: str = "") -> tuple[UnitDescription, MeasurementSet]:
    """The unit and its rows as the package reads them."""
    unit = unit_of_text("SIM", _TOML.format(name="SIM", more=more), "unit.toml")
    count = 400
    outputs = bench.outputs()
    noise = bench.rng.normal(0, bench.sd * bench.noise, outputs.shape)
    if "clip" in bench.info:
        axis, sign, level = bench.info["clip"]
        one = bench.rng.normal(0, bench.sd * bench.noise * np.sqrt(count), (len(outputs), count))
        clipped = np.minimum(sign * outputs[:, axis, None] + one, level).mean(axis=1)
        outputs = outputs + noise
        outputs[:, axis] = sign * clipped
    else:
        outputs = bench.info.get("after", lambda o, _b: o)(outputs, bench) + noise
    if "copied" in bench.info:
        a, b = bench.info["copied"]
        outputs[:, a] = outputs[:, b]
    sd = bench.sd * np.sqrt(count) * bench.info.get("stated", 1.0) * bench.volts
    dwells = tuple(
        Dwell(k + 2, r["name"], r["temp"], bench.volts * u, count, np.full(3, sd))
        for k, (r, u) in enumerate(zip(bench.rows, outputs, strict=True))
    )
    return unit, MeasurementSet("measurements.csv", dwells)


def simulated(
    fault: str, size_g: float, seed: int, temps: int = 5, *, checks: bool = True, more: str = "",
    **bench: float,
) -> tuple[UnitDescription, MeasurementSet, Bench]:  # fmt: skip
    """A unit with a fault of a size, as it is read."""
    rng = np.random.default_rng([seed, sum(map(ord, fault)), temps, int(checks)])
    made = Bench(rng, TEMPS[temps], CHECKS[temps] if checks else (), **bench)
    {**FAULTS, **UNLISTED}[fault](made, size_g)
    unit, measurements = read(made, more)
    return unit, measurements, made
