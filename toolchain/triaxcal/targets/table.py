"""The matrix as text and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence

from triaxcal import __version__
from triaxcal.base.screentext import table
from triaxcal.targets.cores.core import COMPILERS, VECTORS
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.matrix import (
    FAILED,
    NOT_DONE,
    PASSED,
    Outcome,
)

FORMAT = 2


def counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Builds by status."""
    return {s: sum(o.status == s for o in outcomes) for s in (PASSED, FAILED, NOT_DONE)}


def matrix_table(outcomes: Sequence[Outcome]) -> str:
    """A row for each shape and arithmetic, a column for each core: passed of all."""
    names = [core.name for core in CORES]
    rows = []
    keys = dict.fromkeys((o.build.case.name, o.build.toolset.arithmetic) for o in outcomes)
    for shape, arithmetic in keys:
        row = [
            o for o in outcomes
            if o.build.case.name == shape and o.build.toolset.arithmetic == arithmetic
        ]  # fmt: skip
        cells = [_cell([o for o in row if o.build.toolset.core is core]) for core in CORES]
        rows.append([shape, arithmetic, *cells])
    head = ["shape", "arithmetic", *names]
    return "\n".join([*table(head, rows, left=(0, 1)), "", *_summary(outcomes)])


def _cell(outcomes: Sequence[Outcome]) -> str:
    if not outcomes:
        return "-"
    found = counts(outcomes)
    text = f"{found[PASSED]}/{len(outcomes)}"
    return text + (" FAILED" if found[FAILED] else " undone" if found[NOT_DONE] else "")


def _summary(outcomes: Sequence[Outcome]) -> list[str]:
    found = counts(outcomes)
    fewer = [f" ({c.vectors} on {c.name})" for c in CORES if c.vectors != VECTORS]
    passed = (
        f"{found[PASSED]} of {len(outcomes)} builds passed ({', '.join(COMPILERS)}), each with "
        f"{VECTORS} vectors{''.join(fewer)} through the generated routine, the loaded image and "
        f"the reference"
    )
    lines = [passed]
    lines += [f"FAILED {o.build.label}: {o.detail}" for o in outcomes if o.status == FAILED]
    reasons = dict.fromkeys(o.detail for o in outcomes if o.status == NOT_DONE)
    for reason in reasons:
        number = sum(o.detail == reason for o in outcomes)
        lines.append(f"not done, {number} builds: {reason}")
    return lines


def matrix_json(outcomes: Sequence[Outcome]) -> str:
    """Every build with its status."""
    document = {
        "format": FORMAT,
        "triaxcal": __version__,
        "counts": counts(outcomes),
        "builds": [
            {
                "shape": o.build.case.name,
                "core": o.build.toolset.core.label,
                "compiler": o.build.toolset.compiler,
                "optimisation": o.build.toolset.optimisation,
                "arithmetic": o.build.toolset.arithmetic,
                "vectors": o.build.toolset.core.vectors,
                "status": o.status,
                "detail": o.detail,
            }
            for o in outcomes
        ],
    }
    return json.dumps(document, indent=1) + "\n"
