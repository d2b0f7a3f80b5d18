"""The image: the constants for a unit in the field."""

from triaxcal.codegen.identity import with_identity
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.names import names_of
from triaxcal.codegen.outputs.output import Job, Output

IMAGE_FILE = "triax_calib.bin"


def _files(job: Job) -> dict[str, bytes]:
    content = with_identity(image_bytes(job.plan), job.sensor, job.provenance)
    return {names_of(job.plan).file(IMAGE_FILE): content}


ENTRY = Output(
    "image",
    "calibration image",
    "The constants as a file that the C loads, and whose they are.",
    _files,
    rank=2,
)
