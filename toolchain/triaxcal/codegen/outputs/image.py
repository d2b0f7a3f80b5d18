"""The image: the constants for a unit in the field."""

from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.names import names_of
from triaxcal.codegen.outputs.output import Output

IMAGE_FILE = "triax_calib.bin"
ENTRY = Output(
    "image",
    "calibration image",
    "The constants as a file that the reference C loads.",
    lambda job: {names_of(job.plan).file(IMAGE_FILE): image_bytes(job.plan)},
    rank=2,
)
