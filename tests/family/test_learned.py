"""Priors learned from a series of recordings: the scales that the units were drawn with."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import directions, write_unit

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.model.terms import products

ROWS = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "g"'
CROSS, SCALE, OWN = 1.8e-3, 8e-3, 2.7e-3


def series(folder: Path, count: int) -> list[Path]:
    made = []
    for k in range(count):
        random = np.random.default_rng(100 + k)
        cross = np.triu(CROSS * random.standard_normal((3, 3)), 1)
        matrix = np.eye(3) + np.diag(SCALE * random.standard_normal(3)) + cross + cross.T
        Q = np.zeros((3, 6))
        Q[np.arange(3), np.arange(3)] = OWN * random.standard_normal(3)
        force = directions(30, seed=k)
        linear = force
        for _ in range(20):
            linear = force - products(linear) @ Q.T
        readings = linear @ matrix.T + 0.03 * random.standard_normal(3)
        readings += 3e-4 * random.standard_normal(readings.shape)
        made.append(write_unit(folder / f"U{k}", readings, ROWS, header="a,b,c"))
    return made


def test_the_scales_of_a_series_are_found(tmp_path: Path) -> None:
    units = series(tmp_path, 12)
    found = triaxcal.learn_priors(units)
    # 36 numbers show a scale to 12 %; three of that, and what the hyperprior pulls.
    assert found.priors.cross_term_rad == pytest.approx(CROSS, rel=0.4)
    assert found.priors.scale_factor == pytest.approx(SCALE, rel=0.4)
    assert found.priors.own_square_g_per_g2 == pytest.approx(OWN, rel=0.4)
    # There are none: the poses pull down, the hyperprior holds.
    assert found.priors.product_g_per_g2 < 3e-4
    assert found.log_evidence > found.log_evidence_before + 5.0
    assert found.factors["cross_term_rad"] < 1.25
    section = tomllib.loads(found.toml)["priors"]
    assert section["scale_factor"] == pytest.approx(found.priors.scale_factor, rel=0.05)
    result = CliRunner().invoke(main, ["batch", *map(str, units[:3]), "--learn-priors"])
    assert result.exit_code == 0
    assert result.output.startswith("[priors]  # learned from 3 units\ncross_term_rad = ")


def test_a_unit_alone_teaches_no_series(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="1 unit with usable poses; expected two and more"):
        triaxcal.learn_priors(series(tmp_path, 1))
