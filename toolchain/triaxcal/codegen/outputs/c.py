"""C99: the routine, and the constants of the unit."""

from __future__ import annotations

from triaxcal.codegen.constants import render_constants
from triaxcal.codegen.outputs.output import Job, Output
from triaxcal.codegen.render import render_routine


def _files(job: Job) -> dict[str, bytes]:
    texts = render_routine(job.plan)
    texts |= render_constants(job.plan, job.sensor, job.provenance)
    return {name: text.encode() for name, text in texts.items()}


ENTRY = Output("c", "C99", "The routine in C99 and the constants of the unit.", _files, rank=1)
