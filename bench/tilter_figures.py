"""Figures 5 and 6 of the tilter's paper (P1) by simulation of its conditions, and this program's.

Each simulated unit has the published constants at -40, +20 and +70 degC. Between them its constants
follow the quadratic through the three, and what a quadratic leaves out: a cubic and a quartic that
vanish there. It is measured on a tilter whose faces are out by 20 arcsec, with a voltmeter of 10
microvolt, and checked at T0, at -10 and at +45 degC in six positions tilted by 25 deg.

The paper's models: two straight segments (4), (12); method 1 corrects the constants, method 2 adds
(8), with the sign that removes the error. This program: what it chooses by itself, from the same
three temperatures and from seven.

    python bench/tilter_figures.py [units] [picture.svg]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import triaxcal
from triaxcal.model.methods.compensation import compensate
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.report.pictures.line_plot import COLOURS, Line, Panel, line_plot
from triaxcal.simulation.published import CONSTANTS, TABLES, TABLES_FILE, TEMPERATURES

UNIT = Path(__file__).parent.parent / "units" / "AT-CHERNIAK"
T0, ARCSEC = 20.0, np.pi / 180.0 / 3600.0
THREE = (-40.0, 20.0, 70.0)
SEVEN = (-40.0, -25.0, 0.0, 20.0, 35.0, 55.0, 70.0)
CHECKED = (-10.0, 45.0)
BEYOND = (0.4, 0.15)
"""Sizes of cubic and quartic against the quadratic, standard deviations."""
FACES_ARCSEC, VOLTMETER_V = 20.0, 1e-5


def published() -> tuple[FloatArray, FloatArray]:
    """Temperatures (3,) and constants (3, 12) of the paper's tables 1 and 2."""
    table = TABLES.read(UNIT / TABLES_FILE)["constants"]
    columns = [[float(v) for v in table[key]] for key in CONSTANTS]
    return np.array(table[TEMPERATURES]), np.array(columns).T


class Device:
    """A unit with a truth of its own."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        temps, constants = published()
        self.quadratic = np.polyfit(temps - T0, constants, 2)
        bend = self.quadratic[0] * self.random.standard_normal((2, 12)) * np.array(BEYOND)[:, None]
        self.bend, self.zeros = bend, temps

    def constants(self, temp: float) -> FloatArray:
        """True constants, (12,), at a temperature."""
        x = (temp - T0) / 55.0
        vanishing = np.prod(temp - self.zeros) / 55.0
        curve = np.array([(temp - T0) ** n for n in (2, 1, 0)]) @ self.quadratic
        result: FloatArray = curve + vanishing * (self.bend[0] + self.bend[1] * x)
        return result

    def read(self, force: FloatArray, temp: float) -> FloatArray:
        """Outputs (n, 3) in V, read by the voltmeter."""
        c = self.constants(temp)
        exact = force @ c[:9].reshape(3, 3).T + c[9:]
        return exact + VOLTMETER_V * self.random.standard_normal(exact.shape)


def check_forces() -> FloatArray:
    """Six check positions: each axis up and down, tilted by 25 deg towards the next."""
    c, s = np.cos(np.radians(25.0)), np.sin(np.radians(25.0))
    rows = []
    for k in range(3):
        for sign in (1.0, -1.0):
            row = np.zeros(3)
            row[k], row[(k + 1) % 3] = sign * c, s
            rows.append(row)
    return np.array(rows)


def measured(device: Device, temps: tuple[float, ...]) -> dict[str, list[object]]:
    """Six positions at each temperature; each face has one tilt for all of them."""
    faces = np.array(list(TEST_POSITIONS.values()), dtype=np.float64)
    off = FACES_ARCSEC * ARCSEC * np.random.default_rng(7).standard_normal((6, 3))
    force = faces + np.cross(off, faces)
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    columns: dict[str, list[object]] = {
        k: [] for k in ("position", "temp_degc", "ux_v", "uy_v", "uz_v")
    }
    for temp in temps:
        volts = device.read(force, temp)
        for name, row in zip(TEST_POSITIONS, volts, strict=True):
            for key, value in zip(columns, (name, temp, *row), strict=True):
                columns[key].append(value)
    return columns


def fitted(device: Device, temps: tuple[float, ...], **thermal: object) -> triaxcal.Calibration:
    """This program's calibration."""
    unit = triaxcal.Unit(
        "FIG",
        serial="FIG",
        adc={"bits": 32, "full_scale_v": 2.5},
        temperature_sensor={"degc_per_code": 0.0078125},
        site={"local_gravity_m_per_s2": 9.80665},
        thermal={"t0_degc": T0, **thermal},
        fit={"estimator": "equation-10"},
    )
    return triaxcal.fit(unit, measured(device, temps))


def errors(device: Device) -> dict[str, FloatArray]:
    """|a| - g in mg at the six positions, by line of the figures and temperature."""
    two = fitted(device, THREE, model="piecewise-linear", knots_degc=list(THREE))
    own = {"three": fitted(device, THREE), "seven": fitted(device, SEVEN)}
    additive = compensate(
        two.fitted.calibration.thermal, "additive-simplified", (-40.0, 70.0), 2.5, 1.0
    )
    K0, U0 = two.constants(T0)
    at_t0 = np.concatenate([K0.ravel(), U0])
    found = {"T0": _error(force_from_voltage(at_t0, device.read(check_forces(), T0)))}
    for temp in CHECKED:
        volts = device.read(check_forces(), temp)
        K, U = two.constants(temp)
        lines = {
            "uncompensated": force_from_voltage(at_t0, volts),
            "method 1": force_from_voltage(np.concatenate([K.ravel(), U]), volts),
            "method 2": additive.evaluate(volts, temp),
            **{name: cal.apply(volts, temp) for name, cal in own.items()},
        }
        found |= {f"{temp:g} {name}": _error(force) for name, force in lines.items()}
    return found


def _error(force: FloatArray) -> FloatArray:
    result: FloatArray = (np.linalg.norm(force, axis=-1) - 1.0) * 1e3
    return result


def picture(found: dict[str, FloatArray]) -> bytes:
    """Both figures for one unit."""
    x = np.arange(1.0, 7.0)
    names = {"uncompensated": 0, "method 1": 1, "method 2": 3, "three": 2, "seven": 2}
    labels = {
        "three": "ours, 3 temperatures",
        "seven": "ours, 7 temperatures",
        "method 1": "paper, method 1",
        "method 2": "paper, method 2",
    }
    panels = []
    for temp in CHECKED:
        lines = [
            Line(
                labels.get(n, n),
                COLOURS[c],
                x,
                found[f"{temp:g} {n}"],
                dashed=n in {"three", "method 2"},
            )
            for n, c in names.items()
        ]
        lines.append(Line("at T0", "#777777", x, found["T0"], dashed=True))
        panels.append(Panel(f"{temp:g} degC: |a| - g, mg", "check position", lines))
    return line_plot("Check positions of the tilter, one simulated unit", panels)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    found = [errors(Device(seed)) for seed in range(count)]
    for key in found[0]:
        values = np.array([np.abs(row[key]) for row in found])
        worst = values.max(axis=1)
        print(
            f"{key:22s} rms {np.sqrt(np.mean(values**2)):.3f} mg; largest of six, median unit "
            f"{np.median(worst):.3f}, 95 % of units {np.quantile(worst, 0.95):.3f}"
        )
    for temp in CHECKED:
        for method in ("method 1", "method 2", "three", "seven"):
            ratio = [
                np.abs(row[f"{temp:g} uncompensated"]).max()
                / np.abs(row[f"{temp:g} {method}"]).max()
                for row in found
            ]
            print(f"{temp:g} degC, {method}: median {np.median(ratio):.1f} times better")
    if len(sys.argv) > 2:
        Path(sys.argv[2]).write_bytes(picture(found[0]))


if __name__ == "__main__":
    main()
