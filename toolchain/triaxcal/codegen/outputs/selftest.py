"""The self-test: known answers of the unit, for the device to compare with its own."""

from __future__ import annotations

from triaxcal.codegen.outputs.output import Job, Output
from triaxcal.codegen.selftest import render_selftest


def _files(job: Job) -> dict[str, bytes]:
    texts = render_selftest(job.plan, job.provenance)
    return {name: text.encode() for name, text in texts.items()}


ENTRY = Output(
    "selftest",
    "self-test",
    "Known answers of the unit in C99, for the device to compare with its own.",
    _files,
    rank=3,
)
