"""All files of a delivery: the firmware's, the results, the picture."""

from __future__ import annotations

from triaxcal.delivery import Delivery
from triaxcal.report.residual_plot import residuals_svg
from triaxcal.report.results import calibration_json, verification_json


def all_files(delivery: Delivery) -> dict[str, bytes]:
    """Name and content of everything that build/<UNIT>/ receives."""
    return {
        **delivery.files,
        "calibration.json": calibration_json(delivery),
        "verification.json": verification_json(delivery),
        "residuals.svg": residuals_svg(delivery),
    }
