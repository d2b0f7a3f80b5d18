"""`triaxcal simulate --series`: folders of many units that differ as a production does.

Each unit's truth is the template's with every constant drawn about it; the units of a run are
measured in one day on one rig, which moves after some days. The same template, number and seed
give the same bytes.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.model.metrological import BIASES, CONSTANT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.simulation.truth import (
    TRUTH_FILE,
    Plan,
    Spread,
    Truth,
    check_seed,
    read_spread,
    read_truth,
)
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.unit.description import read_unit
from triaxcal.unit.folder import UNIT_FILE

COUNT_MAX = 9999
FIRST_DAY = datetime.date(2026, 1, 5)
"""Of the simulated runs, one a day: a date of the simulation's own, not of the clock."""
_STREAM = 4
_OWN_AXIS = (0, 4, 8)
_SERIAL = re.compile(r'(?m)^serial\s*=\s*"[^"]*"')


def write_series(template: Path, into: Path, count: int, seed: int = 1) -> Iterator[Path]:
    """Write `count` unit folders <template's name>-0001 ... into `into`.

    Everything is checked at the call; each folder is given when it is written.

    Raises
    ------
    RefusedError
        When the template has no truth.toml with a table [series], or a folder exists already.
    """
    check_seed(seed, "seed")
    if not 1 <= count <= COUNT_MAX:
        raise RefusedError("--series", f"found {count}", expected=f"1 to {COUNT_MAX} units")
    description = read_unit(template)
    truth, plan = read_truth(template)
    spread = read_spread(template)
    if description.measured.run is not None:
        raise RefusedError(
            f"{template / UNIT_FILE}, [measured]",
            "given",
            remedy="remove it: each unit gets its own",
        )
    folders = _new_folders(into, template.absolute().name, count)
    text = (template / UNIT_FILE).read_text(encoding="utf-8")
    return _written(folders, text, (truth, plan, spread), seed)


def _written(
    folders: list[Path], text: str, model: tuple[Truth, Plan, Spread], seed: int
) -> Iterator[Path]:
    """Folders as they are written, of the template's `text` of unit.toml and its truth."""
    truth, plan, spread = model
    for k, folder in enumerate(folders):
        run = k // spread.units_per_run
        day = FIRST_DAY + datetime.timedelta(days=run)
        rng = np.random.Generator(np.random.PCG64([seed, _STREAM, k]))
        coefficients = drawn(truth.constants.curves.coefficients[0], spread, rng)
        own = _SERIAL.sub(f'serial = "{folder.name}"', text, count=1)
        own += f'\n[measured]\nrig = "simulated"\ndate = {day.isoformat()}\n'
        seeds = seed * (COUNT_MAX + 1) + k, seed + run // spread.runs_between_moves
        try:
            folder.mkdir(parents=True)
            (folder / UNIT_FILE).write_text(own, encoding="utf-8")
            own_truth = truth_text(truth, plan, coefficients, *seeds)
            (folder / TRUTH_FILE).write_text(own_truth, encoding="utf-8")
        except OSError as error:
            raise refused_by_system(folder, "written", error) from error
        write_simulated_unit(folder)
        yield folder


def _new_folders(into: Path, name: str, count: int) -> list[Path]:
    """Folders of the units; refuses when one of them exists."""
    folders = [into / f"{name}-{k:04d}" for k in range(1, count + 1)]
    there = next(filter(Path.exists, folders), None)
    if there is not None:
        raise RefusedError(str(there), "exists already", remedy="remove it, or name another folder")
    return folders


def drawn(coefficients: FloatArray, spread: Spread, rng: np.random.Generator) -> FloatArray:
    """One unit's coefficients (12, 4) about the template's."""
    draws = rng.standard_normal(coefficients.shape)
    result = coefficients * (1.0 + spread.temperature_sd_ratio * draws)
    size = np.full(12, spread.cross_axis_sd_v_per_g)
    size[list(BIASES)] = spread.bias_sd_v
    for c in _OWN_AXIS:
        size[c] = spread.scale_sd_ratio * abs(float(coefficients[c, 0]))
    result[:, 0] = coefficients[:, 0] + size * draws[:, 0]
    return result


def truth_text(truth: Truth, plan: Plan, coefficients: FloatArray, seed: int, rig_seed: int) -> str:
    """A truth.toml that gives these numbers back to the last bit."""
    curves = "\n".join(
        f"{name} = {[float(c) for c in row]}"
        for name, row in zip(CONSTANT_NAMES, coefficients, strict=True)
    )
    wrong = "\n".join(f"{name} = {value!r}" for name, value in asdict(truth.imperfections).items())
    return f"""# One unit of a simulated series; docs/reference/keys.md explains every key.
format = 1

[curves]
t0_degc = {truth.constants.t0_degc!r}
{curves}

[noise]
reading_sd_v = {truth.reading_sd_v!r}
thermometer_sd_degc = {truth.thermometer_sd_degc!r}
dwell_temp_sd_degc = {truth.dwell_temp_sd_degc!r}

[plan]
seed = {seed}
rig_seed = {rig_seed}
readings_per_dwell = {plan.readings_per_dwell}
temperatures_degc = {list(plan.temperatures_degc)}
check_temperatures_degc = {list(plan.check_temperatures_degc)}

[imperfections]
{wrong}
"""
