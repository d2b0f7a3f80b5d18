"""Noise at rest: coefficients cover the truth, and agree with an Allan deviation made elsewhere."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from performance_cases import noise
from triaxcal import study_noise as study_file
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.model.types import FloatArray
from triaxcal.noise.coefficients import KINDS, Coefficient, NoiseKind, allan_variance, coefficients
from triaxcal.noise.spectrum import spectrum
from triaxcal.noise.study import study_noise

STEP_S = 0.1
LAYOUT = """[recording]
file = "rest.csv"
acceleration = ["x", "y", "z"]
acceleration_unit = "mg"
time = "t"
"""


def of(found: tuple[Coefficient, ...], symbol: str) -> Coefficient:
    return next(c for c in found if c.kind.symbol == symbol)


def signal(seed: int, count: int, N: float, B: float, K: float) -> FloatArray:
    return noise(count, STEP_S, (N, B, K), np.random.default_rng(seed))


def covered(seeds: range, count: int, truth: dict[str, float]) -> dict[str, int]:
    hits = dict.fromkeys(truth, 0)
    for seed in seeds:
        found = coefficients(spectrum(signal(seed, count, *truth.values()), STEP_S))
        for symbol, value in truth.items():
            hits[symbol] += of(found, symbol).low <= value <= of(found, symbol).high
    return hits


@pytest.mark.long
def test_intervals_cover_the_truth() -> None:
    """12 series: at 95 %, 8 or fewer covered have a chance of 2e-3 each; the seeds are fixed."""
    for symbol, hits in covered(range(12), 8192, {"N": 30.0, "B": 8.0, "K": 0.5}).items():
        assert hits > 8, symbol


@pytest.mark.long
def test_intervals_cover_the_truth_often() -> None:
    """100 series: at 95 %, 86 or fewer have a chance of 5e-4 each."""
    for symbol, hits in covered(range(100), 20000, {"N": 30.0, "B": 8.0, "K": 2.0}).items():
        assert hits > 86, symbol


def test_what_is_not_there_is_not_determined() -> None:
    found = coefficients(spectrum(30.0 * np.random.default_rng(3).standard_normal(8192), STEP_S))
    assert of(found, "N").value == pytest.approx(30.0 * math.sqrt(STEP_S), rel=0.05)
    for symbol in "QBKR":
        assert not of(found, symbol).determined
        assert of(found, symbol).high > 0.0


@pytest.mark.parametrize("kind", [k for k in KINDS if k.symbol in "NBK"], ids=lambda k: k.symbol)
def test_density_and_allan_variance_belong_together(kind: NoiseKind) -> None:
    """s^2(tau) = 4 int S(f) sin^4(pi f tau) / (pi f tau)^2 df, S two-sided, by trapezia.

    The tail above 2000 / tau has less than 1 / (2 pi^2 2000) of N^2 / tau.
    """
    tau = 3.0
    f = np.geomspace(1e-7, 2000.0 / tau, 200_001)
    y = (2.0 * np.pi * f) ** kind.power * np.sin(np.pi * f * tau) ** 4 / (np.pi * f * tau) ** 2
    expected = 4.0 * float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(f)))
    assert float(allan_variance(kind, np.array(tau))) == pytest.approx(expected, rel=3e-4)


def test_the_allan_deviation_is_that_of_its_definition() -> None:
    pytest.importorskip("allantools")
    values = signal(1, 3000, 30.0, 8.0, 0.5)
    rest = np.stack([values, values[::-1], values], axis=1)
    curve = study_noise("rest.csv", rest, STEP_S).axes[0].allan
    assert curve is not None
    for tau, found in zip(curve.tau_s, curve.deviation, strict=True):
        m = round(tau / STEP_S)
        means = np.array([values[k : k + m].mean() for k in range(len(values) - m + 1)])
        expected = math.sqrt(0.5 * np.mean((means[m:] - means[:-m]) ** 2))
        assert found == pytest.approx(expected, rel=1e-9)
    assert (curve.low < curve.deviation).all()
    assert (curve.deviation < curve.high).all()


def test_without_allantools_the_coefficients_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    from triaxcal.base import extras

    monkeypatch.setattr(extras.importlib.util, "find_spec", lambda _name: None)
    rest = np.random.default_rng(1).standard_normal((1000, 3))
    found = study_noise("rest.csv", rest, STEP_S)
    assert found.axes[0].allan is None
    assert found.axes[2].of("N").determined
    assert "missing packages: allantools" in found.findings[0]
    assert "triaxcal[noise]" in found.findings[0]


def test_too_short_and_dead_outputs_are_refused() -> None:
    rest = np.random.default_rng(1).standard_normal((1000, 3))
    with pytest.raises(RefusedError, match=r"100 s long; expected 900 s for an averaging time of"):
        study_noise("rest.csv", rest, STEP_S, 100.0)
    rest[:, 1] = 2.0
    with pytest.raises(RefusedError, match="output y has the same value throughout"):
        study_noise("rest.csv", rest, STEP_S)


def write(folder: Path, time: FloatArray, values: FloatArray) -> tuple[Path, Path]:
    rows = np.column_stack([time, values])
    np.savetxt(folder / "rest.csv", rows, delimiter=",", header="t,x,y,z", comments="", fmt="%.9g")
    (folder / "layout.toml").write_text(LAYOUT)
    return folder / "rest.csv", folder / "layout.toml"


def test_a_file_by_the_api_and_the_command(tmp_path: Path) -> None:
    time = np.arange(4000) * STEP_S
    values = np.random.default_rng(1).standard_normal((4000, 3)) + np.array([0.0, 0.0, 1000.0])
    file, layout = write(tmp_path, time, values)
    found = study_file(file, layout).result.axes[1].of("N")
    # 1 mg a sample; the relative standard deviation of sigma is 1 / sqrt(2 * 4000).
    assert found.value == pytest.approx(1e-3 * math.sqrt(STEP_S), rel=0.06)
    options = ["--layout", str(layout), "--tau", "40"]
    done = CliRunner().invoke(main, ["noise", str(file), *options])
    assert done.exit_code == 0, done.output
    assert "velocity random walk N" in done.output
    assert "micro-g/sqrt(Hz)" in done.output


def test_gaps_and_uneven_clocks(tmp_path: Path) -> None:
    time = np.arange(4000) * STEP_S
    values = np.random.default_rng(1).standard_normal((4000, 3))
    time[1000:] += 7.0
    values[3000, 1] = np.nan
    found = study_file(*write(tmp_path, time, values)).result
    assert found.duration_s == pytest.approx(200.0)
    words = " ".join(found.findings)
    assert "1 row without all readings left out" in words
    assert "2 gaps in time, the first before" in words
    assert "50 % of the samples" in words
    uneven = np.cumsum(np.random.default_rng(2).uniform(0.05, 0.14, 4000))
    with pytest.raises(RefusedError, match="expected samples at even times"):
        study_file(*write(tmp_path, uneven, values))
    with pytest.raises(RefusedError, match="samples without a gap; expected 256 at least"):
        study_file(*write(tmp_path, time[:200], values[:200]))


def test_a_unit_on_a_tilter_has_no_layout(tmp_path: Path) -> None:
    """Its recordings of tests are read by the report."""
    path = tmp_path / "unit.toml"
    path.write_text('[test.night]\nkind = "rest"\n', encoding="utf-8")
    with pytest.raises(RefusedError, match=r"no table \[recording\].*are for triaxcal report"):
        study_file(tmp_path / "rest.csv", path)
