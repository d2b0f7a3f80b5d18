"""`check` and `update` on simulated units: false alarms, what is found, coverage of intervals.

    python bench/field.py --units 200
    python bench/field.py --units 200 --tilter

A unit is drawn from the default priors, own-axis squares and products included, and calibrated from
24 poses of |a| = g. Then its sensor ages, and a field log of 6 to 12 poses is recorded: the six
faces first, or random directions, in turn. With --tilter the units are those of
tests/diagnosis_units.py, five temperatures, and the log is recorded at one temperature. Nothing of
the package's own simulation is used.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

import triaxcal
from diagnosis_units import Bench, simulated
from triaxcal.api.field import InTheField
from triaxcal.delivery.fitted import Fitted
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.framefree import NAMES, frame_free, frame_free_slopes
from triaxcal.model.terms import products
from triaxcal.model.types import FloatArray
from triaxcal.unit.priors import Priors

NOISE_G = 3e-4
"""Of each reading of a pose's mean, at the factory as in the field."""
POSES = 24
BIAS_G, SCALE, AXES_RAD = 2e-3, 5e-4, 2e-4
"""Standard deviations of the drift that is stated."""
SOUND_LOGS = 5
"""Of each unit, for the false alarms."""
LIMITS_G = 0.02
UNIT = triaxcal.Unit(
    "F-1",
    serial="F-1",
    site={"local_gravity_m_per_s2": 9.80665},
    recording={
        "file": "log.csv",
        "rows": "poses",
        "acceleration": ["x", "y", "z"],
        "acceleration_unit": "g",
    },
)


@dataclass(frozen=True)
class Sensor:
    """U = K l + U0, with the force a = l + Q p(l)."""

    K: FloatArray
    U0: FloatArray
    Q: FloatArray

    def readings(self, force: FloatArray) -> FloatArray:
        """Of forces (n, 3)."""
        linear = force
        for _ in range(20):
            linear = force - products(linear) @ self.Q.T
        result: FloatArray = linear @ self.K.T + self.U0
        return result

    def nine(self) -> FloatArray:
        """Constants that no rotation of the frame changes."""
        return frame_free(np.concatenate([self.K.ravel(), self.U0]))


def drawn(random: np.random.Generator) -> Sensor:
    """A sensor of the default priors."""
    p = Priors()
    cross = p.cross_term_rad * random.standard_normal(3)
    S = np.diag(1.0 + p.scale_factor * random.standard_normal(3))
    for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), cross, strict=True):
        S[i, j] = S[j, i] = value
    Q = p.product_g_per_g2 * random.standard_normal((3, 6))
    Q[np.arange(3), np.arange(3)] = p.own_square_g_per_g2 * random.standard_normal(3)
    gain = 1.0 + 0.05 * random.standard_normal()
    return Sensor(gain * S, p.bias_g * random.standard_normal(3), Q)


def aged(sensor: Sensor, random: np.random.Generator, times: float) -> Sensor:
    """Drift of the stated standard deviations, times a factor."""
    S = np.diag(1.0 + times * SCALE * random.standard_normal(3))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        S[i, j] = S[j, i] = times * AXES_RAD / 2.0 * random.standard_normal()
    bias = sensor.K @ (times * BIAS_G * random.standard_normal(3))
    return replace(sensor, K=sensor.K @ S, U0=sensor.U0 + bias)


def directions(count: int, random: np.random.Generator, *, faces: bool) -> FloatArray:
    """Unit vectors (count, 3)."""
    free = random.standard_normal((count, 3))
    free /= np.linalg.norm(free, axis=1, keepdims=True)
    return np.concatenate([np.eye(3), -np.eye(3), free])[:count] if faces else free


def columns(
    sensor: Sensor, poses: FloatArray, random: np.random.Generator
) -> dict[str, FloatArray]:
    """Readings of poses with noise."""
    readings = sensor.readings(poses) + NOISE_G * random.standard_normal(poses.shape)
    return dict(zip("xyz", readings.T, strict=True))


def of_bias(sensor: Sensor, axis: int, size: float) -> Sensor:
    """One output's bias moved by `size` g."""
    U0 = sensor.U0.copy()
    U0[axis] += size * np.linalg.norm(sensor.K[axis])
    return replace(sensor, U0=U0)


def of_scale(sensor: Sensor, axis: int, size: float) -> Sensor:
    """One output's scale changed by `size`."""
    K = sensor.K.copy()
    K[axis] *= 1.0 + size
    return replace(sensor, K=K)


def another(_: Sensor, seed: int, __: float) -> Sensor:
    """Another unit of the same type."""
    return drawn(np.random.default_rng(10**6 + seed))


CHANGES: dict[str, tuple[Callable[[Sensor, int, float], Sensor], float, str]] = {
    "bias 5 mg": (of_bias, 5e-3, "the bias of {} changed"),
    "bias 20 mg": (of_bias, 20e-3, "the bias of {} changed"),
    "bias 100 mg": (of_bias, 100e-3, "the bias of {} changed"),
    "scale 1 %": (of_scale, 1e-2, "the scale of {} changed"),
    "another unit": (another, 0.0, "or it is another unit"),
}
"""How a sensor changes, by how much, and the words that are right."""


def units(count: int) -> Iterator[tuple[int, np.random.Generator, Sensor, triaxcal.Calibration]]:
    """Units with their sensors and calibrations; without those whose squares the C cannot hold."""
    seeds = iter(range(10 * count))
    while count:
        seed = next(seeds)
        random = np.random.default_rng(seed)
        sensor = drawn(random)
        poses = directions(POSES, random, faces=True)
        cal = triaxcal.fit(UNIT, columns(sensor, poses, random))
        try:
            triaxcal.firmware(cal)
        except triaxcal.RefusedError:
            continue
        yield seed, random, sensor, cal
        count -= 1


def field_log(sensor: Sensor, seed: int, random: np.random.Generator) -> dict[str, FloatArray]:
    """A log of 6 to 12 poses."""
    poses = directions(6 + seed % 7, random, faces=seed % 2 == 0)
    return columns(sensor, poses, random)


class Checks:
    """What `check` says of sound units and of changed ones."""

    def __init__(self) -> None:
        self.chances: list[float] = []
        self.found: Counter[str] = Counter()
        self.only: Counter[str] = Counter()
        self.among: Counter[str] = Counter()
        self.units = 0

    def add(
        self, seed: int, random: np.random.Generator, sensor: Sensor, cal: triaxcal.Calibration
    ) -> None:
        """One unit."""
        self.units += 1
        for k in range(SOUND_LOGS):
            found = cal.check(field_log(sensor, seed + k, random)).result
            self.chances.append(found.chance if found.within_limits else 0.0)
        axis = seed % 3
        for name, (change, size, words) in CHANGES.items():
            which = seed if change is another else axis
            sign = 1.0 if seed % 2 else -1.0
            log = field_log(change(sensor, which, sign * size), seed, random)
            found = cal.check(log).result
            told = [e.words for e in found.explanations] + list(found.suspicions)
            right = [words.format("xyz"[axis]) in t for t in told]
            self.found[name] += not found.passed
            self.only[name] += right == [True]
            self.among[name] += any(right)

    def report(self) -> Iterator[str]:
        """Lines of the table."""
        chances = np.array(self.chances)
        alarms = ", ".join(
            f"{np.mean(chances < level):.2%} below {level:g}" for level in (0.05, 0.01, 1e-3)
        )
        yield f"check, {len(chances)} sound logs of {self.units} units: {alarms}"
        yield f"{'change':14s}  failed  named alone  among those named"
        for name in CHANGES:
            shares = [100 * c[name] / self.units for c in (self.found, self.only, self.among)]
            yield f"{name:14s}  {shares[0]:5.1f} %  {shares[1]:9.1f} %  {shares[2]:9.1f} %"


class Updates:
    """Coverage of the nine constants after an update, and the error of |a| before and after."""

    def __init__(self, times: float) -> None:
        self.times = times
        self.inside: list[FloatArray] = []
        self.errors: list[tuple[float, float]] = []
        self.refused: Counter[str] = Counter()

    def add(
        self, seed: int, random: np.random.Generator, sensor: Sensor, cal: triaxcal.Calibration
    ) -> None:
        """One unit."""
        now = aged(sensor, random, self.times)
        try:
            found = cal.update(
                field_log(now, seed, random),
                bias_drift_mg=1e3 * BIAS_G,
                scale_drift_ppm=1e6 * SCALE,
                axes_drift_micro_rad=1e6 * AXES_RAD,
            ).result
        except triaxcal.RefusedError as refusal:
            self.refused["contradicts" if "contradict" in refusal.found else "too little"] += 1
            return
        self.inside.append(np.abs(found.after - now.nine()) < 1.96 * found.sd_after)
        asked = directions(40, random, faces=False)
        rms = [
            1e3 * float(np.sqrt(np.mean((np.linalg.norm(force, axis=1) - 1.0) ** 2)))
            for force in (
                c.terms.force_g(
                    (now.readings(asked) - c.thermal.constants_at(20.0)[9:])
                    @ np.linalg.inv(c.thermal.constants_at(20.0)[:9].reshape(3, 3)).T
                )
                for c in (cal.fitted.calibration, found.calibration)
            )
        ]
        self.errors.append((rms[0], rms[1]))

    def report(self) -> Iterator[str]:
        """Lines of the table."""
        inside, errors = np.array(self.inside), np.array(self.errors)
        before, after = np.sqrt(np.mean(errors**2, axis=0))
        kinds = ("sensitivity", "angle", "bias")
        each = ", ".join(
            f"{kind} {100 * inside[:, [n.startswith(kind) for n in NAMES]].mean():.1f} %"
            for kind in kinds
        )
        yield (
            f"update, {self.times:g} times the stated drift: {len(inside)} of "
            f"{len(inside) + self.refused.total()} units updated, refused {dict(self.refused)}"
        )
        yield f"  95 % intervals hold {100 * inside.mean():.1f} % ({each})"
        yield (
            f"  |a| - g at random orientations {before:.2f} mg rms before, {after:.2f} mg after; "
            f"larger than before in {int((errors[:, 1] > errors[:, 0]).sum())} units"
        )


class Done(InTheField):
    """A tilter's calibration of which only the fit is there."""

    def __init__(self, fitted: Fitted) -> None:
        self._fitted = fitted

    @property
    def fitted(self) -> Fitted:
        """The fit."""
        return self._fitted


TILTER_DRIFT_G = 0.5e-3
TILTER_TEMPS = (-20.0, 20.0, 55.0)
"""The log is recorded at the one of the middle."""


def tilter(seed: int) -> tuple[Done, Bench, np.random.Generator]:
    """A tilter's unit of five temperatures, whose curves have bumps of up to 0.05 mg."""
    unit, measurements, bench = simulated("none", 0.0, seed, 5, bump_g=0.05e-3)
    fitted = Fitted(unit, measurements, f"{seed}", calibrate(unit, measurements, None))
    return Done(fitted), bench, np.random.default_rng([seed, 5])


def tilter_log(
    bench: Bench, shift: FloatArray, poses: FloatArray, temp: float, random: np.random.Generator
) -> dict[str, object]:
    """Dwells in any orientation, with biases that have moved by `shift` g."""
    outputs = bench.bias(temp) + shift + poses @ bench.gain(temp).T
    outputs = outputs + bench.sd * random.standard_normal(poses.shape)
    sd = np.full((len(poses), 3), bench.sd * 20.0 * bench.volts)
    return {
        "position": [f"CP{1 + k % 6}" for k in range(len(poses))],
        "temp_degc": np.full(len(poses), temp),
        **{f"u{axis}_v": outputs[:, i] * bench.volts for i, axis in enumerate("xyz")},
        "count": np.full(len(poses), 400),
        **{f"sd_u{axis}_v": sd[:, i] for i, axis in enumerate("xyz")},
    }


def tilter_report(count: int) -> Iterator[str]:
    """False alarms of `check` over temperature; coverage of the constants after an update."""
    chances: list[float] = []
    inside: dict[float, list[FloatArray]] = {t: [] for t in TILTER_TEMPS}
    refused = 0
    for seed in range(count):
        done, bench, random = tilter(seed)
        for temp in TILTER_TEMPS:
            poses = directions(6 + seed % 7, random, faces=False)
            log = tilter_log(bench, np.zeros(3), poses, temp, random)
            chances.append(done.check(log).result.chance)
        shift = TILTER_DRIFT_G * random.standard_normal(3)
        poses = directions(6 + seed % 7, random, faces=seed % 2 == 0)
        log = tilter_log(bench, shift, poses, TILTER_TEMPS[1], random)
        try:
            found = done.update(
                log, bias_drift_mg=1e3 * TILTER_DRIFT_G, scale_drift_ppm=1, axes_drift_micro_rad=1
            ).result
        except triaxcal.RefusedError:
            refused += 1
            continue
        after = found.calibration
        assert after.recording is not None
        for temp in TILTER_TEMPS:
            basis = after.shape.basis(temp)
            covariance = np.einsum("p,apbq,q->ab", basis, after.recording.covariance, basis)
            constants = after.thermal.constants_at(temp)
            slopes = frame_free_slopes(constants)
            sd = np.sqrt(np.einsum("ka,ab,kb->k", slopes, covariance, slopes))
            U0 = bench.volts * (bench.bias(temp) + shift)
            truth = frame_free(np.concatenate([bench.volts * bench.gain(temp).ravel(), U0]))
            inside[temp].append(np.abs(frame_free(constants) - truth) < 1.96 * sd)
    found_below = [np.mean(np.array(chances) < level) for level in (0.05, 0.01, 1e-3)]
    alarms = ", ".join(
        f"{share:.2%} below {level:g}"
        for share, level in zip(found_below, (0.05, 0.01, 1e-3), strict=True)
    )
    yield f"tilter, check, {len(chances)} sound logs of {count} units: {alarms}"
    yield f"tilter, update at {TILTER_TEMPS[1]:g} degC: {refused} of {count} refused"
    for temp, each in inside.items():
        share = np.array(each)
        kinds = ", ".join(
            f"{name[:-2]} {100 * share[:, k : k + 3].mean():.1f} %"
            for k, name in ((0, NAMES[0]), (3, "angle x"), (6, NAMES[6]))
        )
        yield f"  at {temp:g} degC 95 % intervals hold {100 * share.mean():.1f} % ({kinds})"


def recorded_report(count: int) -> Iterator[str]:
    """The tables of units from recordings."""
    parts = Checks(), Updates(1.0), Updates(2.0), Updates(0.0)
    for unit in units(count):
        for part in parts:
            part.add(*unit)
    for part in parts:
        yield from part.report()


def main() -> None:
    """Run a campaign and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--tilter", action="store_true")
    given = parser.parse_args()
    started = time.process_time()
    report = tilter_report if given.tilter else recorded_report
    print(*report(given.units), sep="\n")
    print(f"{(time.process_time() - started) / given.units:.2f} s of CPU a unit")


if __name__ == "__main__":
    main()
