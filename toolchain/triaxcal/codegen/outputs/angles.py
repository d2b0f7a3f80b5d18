"""The angles: a routine of its own, where [firmware] angles asks for it."""

from __future__ import annotations

from triaxcal.codegen.angles import render_angles
from triaxcal.codegen.names import names_of
from triaxcal.codegen.outputs.output import Job, Output


def _files(job: Job) -> dict[str, bytes]:
    if job.angles is None:
        return {}
    texts = render_angles(job.angles, names_of(job.plan))
    return {name: text.encode() for name, text in texts.items()}


ENTRY = Output(
    "angles",
    "angles",
    "Zenith and tool face, or pitch and roll, from the compensated acceleration, in C99.",
    _files,
    rank=4,
)
