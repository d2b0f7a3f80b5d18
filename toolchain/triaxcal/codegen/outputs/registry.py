"""The outputs that there are."""

from __future__ import annotations

from triaxcal.base.registry import Registry
from triaxcal.codegen.outputs.output import Job, Output

OUTPUTS = Registry("output", "triaxcal.codegen.outputs", Output)


def output_files(job: Job) -> dict[str, bytes]:
    """Name and content of everything that the firmware takes."""
    return {name: content for output in OUTPUTS for name, content in output.files(job).items()}
