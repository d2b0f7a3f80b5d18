"""calibration.json of every kind of unit: what was saved is loaded, and saved again, whole."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, directions, log, write_unit
from test_pair_in_a_unit import coupled, unit_with_pair
from test_pair_on_a_tilter import coupled_unit
from test_rate_term import PER_RATE
from test_rate_term import unit_with as unit_with_rate
from test_tables import AIR, HEADER, rows_of, table, wide

import triaxcal
from builds import UNITS


def spline(folder: Path) -> Path:
    shutil.copytree(UNITS / "AT-SIM", folder)
    path = folder / "unit.toml"
    text = path.read_text(encoding="utf-8")
    asked = text.replace("[thermal]\n", '[thermal]\nmodel = "cubic-spline"\n')
    path.write_text(asked, encoding="utf-8")
    return folder


UNITS_OF: dict[str, Callable[[Path], Path]] = {
    "spline": spline,
    "pair on a tilter": lambda f: coupled_unit(f, 1e-3),
    "pair": lambda f: unit_with_pair(f, log(coupled(directions(20)), sd=0.002)),
    "quadratic": lambda f: write_unit(f, rows_of(wide(), quadratic=3e-4), AIR, header=HEADER),
    "rate": lambda f: unit_with_rate(f, PER_RATE),
    "faces": lambda f: write_unit(f, log(directions(6)), COLUMNS),
    "table": lambda f: write_unit(f, rows_of(table()), AIR, header=HEADER),
}
TERMS = {
    "pair on a tilter": "quadratic",
    "pair": "quadratic",
    "quadratic": "quadratic",
    "rate": "rate",
}


@pytest.mark.parametrize("kind", UNITS_OF)
def test_a_unit_of_each_kind_comes_back_whole(kind: str, tmp_path: Path) -> None:
    made = triaxcal.fit(triaxcal.read_unit(UNITS_OF[kind](tmp_path / "U")))
    terms = made.fitted.calibration.terms
    found = {"quadratic": terms.quadratic_per_g is not None, "rate": terms.rate is not None}
    assert [name for name, there in found.items() if there] == [*filter(None, [TERMS.get(kind)])]
    path = made.save(tmp_path / "calibration.json")
    loaded = triaxcal.load(path)
    assert loaded.save(tmp_path / "again.json").read_bytes() == path.read_bytes()
    temps = np.linspace(*made.range_degc, 5)
    for mine, theirs in zip(loaded.constants(temps), made.constants(temps), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    readings = made.constants(temps)[0] @ [0.6, 0.0, 0.8] + made.constants(temps)[1]
    np.testing.assert_array_equal(
        loaded.apply(readings, temps, 0.01), made.apply(readings, temps, 0.01)
    )
    assert str(loaded.verdict) == str(made.verdict)
    assert loaded.diagnosis == made.diagnosis
    own, stated = (c.fitted.calibration.constants_covariance(temps) for c in (loaded, made))
    # The same numbers in another order of memory are summed in another order: some roundings.
    largest = np.abs(np.nan_to_num(stated)).max()
    np.testing.assert_allclose(own, stated, rtol=0, atol=1e-14 * largest)
