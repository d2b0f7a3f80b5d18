"""Figure 2 of P0 by simulation: residual errors of a triad by axis and temperature, both functions.

Simulated sensors on the paper's 25 positions at five temperatures from -50 to +55 degC, with noise
of 3 micro-g and quadratic terms of 2e-4 to 4e-4 g/g^2, or none. What is plotted are errors at
positions that the fit has not seen.

    python bench/table_figures.py [sensors] [picture.svg]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "family"))
from test_table_terms import T0, TEMPS, Sensor, fitted, rows_of

from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.orientation import AIRCRAFT, gravity_direction
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.report.pictures.line_plot import COLOURS, Line, Panel, line_plot

KINDS = ("linear", "quadratic")


def squares(seed: int, kind: str, folder: Path, *, quadratic: bool) -> FloatArray:
    """Mean squared errors, (temperatures, 3), at 100 unseen positions each."""
    sensor = Sensor(seed, quadratic=quadratic)
    more = f'{T0}[firmware]\nterms = "{kind}"\n'
    calibration = fitted(folder / f"S{seed}{kind}", rows_of(sensor, TEMPS), more)
    found = []
    for temp in TEMPS:
        angles = np.radians(sensor.random.uniform(-30.0, 30.0, (100, 2)))
        at = np.full(100, temp)
        linear = force_from_voltage(calibration.thermal.constants_at(at), sensor.read(angles, at))
        error = calibration.terms.force_g(linear) - gravity_direction(AIRCRAFT, angles)
        found.append(np.mean(error**2, axis=0))
    return np.array(found)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    rms = {}
    for truth in (True, False):
        for kind in KINDS:
            with tempfile.TemporaryDirectory() as folder:
                runs = [squares(n, kind, Path(folder), quadratic=truth) for n in range(count)]
            rms[truth, kind] = np.sqrt(np.mean(runs, axis=0)) * 1e6
            print(f"{'quadratic' if truth else 'linear'} sensor, {kind} function, micro-g:")
            for temp, row in zip(TEMPS, rms[truth, kind], strict=True):
                print(f"  {temp:+.0f} degC  " + "  ".join(f"{v:6.2f}" for v in row))
    if len(sys.argv) > 2:
        x = np.array(TEMPS)
        panels = [
            Panel(
                f"{AXES[i]}: rms of unseen positions, micro-g",
                "degC",
                [
                    Line(
                        f"{kind} function" + ", linear sensor" * (not truth),
                        COLOURS[2 * (not truth) + n],
                        x,
                        rms[truth, kind][:, i],
                        dashed=not truth,
                    )
                    for truth in (True, False)
                    for n, kind in enumerate(KINDS)
                ],
            )
            for i in range(3)
        ]
        Path(sys.argv[2]).write_bytes(line_plot("Both functions by axis and temperature", panels))


if __name__ == "__main__":
    main()
