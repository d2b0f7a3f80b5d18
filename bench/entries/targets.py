"""Instructions of a call on other cores beside the same in floating point, counted under QEMU."""

from __future__ import annotations

import tempfile
from pathlib import Path

from measuring import UNITS, Bench, Figure, pick

from triaxcal.targets.bench import DOUBLE, FLOAT, Cost, Subject, best_form, cost_of
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import build_plugin
from triaxcal.targets.matrix import PORTABLE
from triaxcal.targets.shapes import CUBIC_LEFT, HIGH, shipped_cases


def measure(size: str) -> list[Figure]:
    counted = [core for core in CORES if core.counted]
    cores = counted[: pick(size, 1, 2, len(counted))]
    cases = {c.name: c for c in shipped_cases(UNITS)}
    found = []
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        plugin = build_plugin(work)
        for core in cores:
            case = cases[HIGH[CUBIC_LEFT] if core.high_multiply else CUBIC_LEFT]
            forms = {"ours": (best_form(core), ""), DOUBLE: (PORTABLE, DOUBLE)}
            forms[FLOAT] = PORTABLE, FLOAT
            costs = {
                kind: cost_of(Subject(case, form, real), core, work / f"{core.name}-{kind}", plugin)
                for kind, (form, real) in forms.items()
            }
            ours = _instructions(costs["ours"])
            found += [
                Figure(_CALLS.format(core.name), ours, "instructions",
                       f"the same in {kind}", _instructions(costs[kind]))
                for kind in (DOUBLE, FLOAT)
            ]  # fmt: skip
    return found


def _instructions(cost: Cost) -> float:
    """Of both calls, the most over the inputs.

    Raises
    ------
    RuntimeError
        When it was not measured.
    """
    if cost.counts is None:
        raise RuntimeError(cost.failure)
    return float(cost.counts.set.most + cost.counts.apply.most)


_CALLS = "set_temperature and apply on {}"
ENTRY = Bench(
    name="targets",
    label="A call on a microcontroller",
    doc="The cubic shape with left-justified codes in its fastest form, beside the same "
    "polynomials, clamping and flags in C double and float. [All cores and "
    "shapes](reference/targets.md#what-a-call-costs).",
    measure=measure,
    figures=tuple(_CALLS.format(core) for core in ("Cortex-M0", "Cortex-M3")),
    sizes="two cores, all with --full",
    rank=70,
)
