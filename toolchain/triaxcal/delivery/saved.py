"""calibration.json: a calibration for machines, and back again. docs has the layout.

The keys of format 1 are for anybody. `fit` is what triaxcal itself needs besides to go on where the
fit ended: the unit's description, the readings, and the rest of the calibration.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal import __version__
from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.jsontext import json_bytes
from triaxcal.base.plaindata import Custom, plain, rebuilt
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.order import Functions
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.curves import PiecewisePolynomial, ThermalModel, relative_coefficients
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.terms import NO_TERMS, PRODUCT_NAMES, RateTerm, Terms
from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import unit_of_text

FORMAT = 1
_ELSEWHERE = (
    "serial", "estimator", "range_degc", "points", "parameter_covariance", "covariance_source",
    "candidates", "selection_reason",
)  # fmt: skip
"""Parts of a `Calibration` that keys of format 1 hold, under its own names."""
_CURVES = ("thermal", "terms", "reading_unit")
"""Those that they hold in another form."""


def _shape_data(shape: ThermalShape) -> dict[str, Any]:
    rest = {"t0_degc": shape.t0_degc, "ends_degc": shape.ends_degc, **shape.settings}
    return {"function": shape.name, **plain(rest)}


def _shape(data: Mapping[str, Any]) -> ThermalShape | None:
    if data["function"] not in THERMAL_FUNCTIONS:
        return None
    ends = np.unique(np.array(data["ends_degc"], dtype=np.float64))
    function = THERMAL_FUNCTIONS[data["function"]]
    settings = {key.name: data[key.name] for key in function.keys if key.name in data}
    (shape,) = function.stated(settings, ends, float(data["t0_degc"]))
    return shape


_CUSTOM: Custom = {ThermalShape: (_shape_data, _shape)}


@dataclass(frozen=True)
class Saved:
    """What a calibration.json holds.

    Attributes
    ----------
    source : str
        The file, for messages.
    fitted : Fitted or None
        None where the file has the curves alone, or its thermal function is unknown here.
    without_fit : str
        Why `fitted` is None.
    """

    source: str
    serial: str
    thermal: ThermalModel
    terms: Terms
    range_degc: tuple[float, float]
    reading_unit: str
    fitted: Fitted | None
    without_fit: str = ""

    @staticmethod
    def of(fitted: Fitted, source: str = "") -> Saved:
        """A fit as it would be read from its file."""
        c = fitted.calibration
        return Saved(source, c.serial, c.thermal, c.terms, c.range_degc, c.reading_unit, fitted)


def calibration_json(fitted: Fitted, functions: Functions | None = None) -> bytes:
    """Constants, curves, covariance and provenance; file-formats.md has the layout.

    `functions` are those of the firmware that it is delivered with.
    """
    calibration = fitted.calibration
    curves = calibration.thermal.curves
    document = {
        **header(fitted),
        "constants": list(CONSTANT_NAMES),
        "units": [calibration.gain_unit] * 9 + [calibration.reading_unit] * 3,
        "estimator": calibration.estimator,
        "thermal_model": {
            "kind": calibration.shape.name,
            "label": calibration.shape.label,
            "t0_degc": calibration.thermal.t0_degc,
            "breaks_degc": list(curves.breaks_degc),
            "origins_degc": list(curves.origins_degc),
            "coefficients": curves.coefficients.tolist(),
        },
        "temperature_coefficients": plain(relative_coefficients(calibration.thermal)),
        "range_degc": list(calibration.range_degc),
        "at_t0": calibration.thermal.constants_at(calibration.thermal.t0_degc).tolist(),
        "points": plain(calibration.points),
        "parameter_covariance": plain(calibration.parameter_covariance),
        "covariance_source": calibration.covariance_source,
        "covariance_contains": "the noise of the calibration readings alone; rig, gravity, "
        "thermometer and thermal model are in passport.json",
        "candidates": plain(calibration.candidates, _CUSTOM),
        "selection_reason": calibration.selection_reason,
        **_beyond_the_tilter(calibration),
        **({} if functions is None else {"compensation": functions.document()}),
        "fit": _state(fitted),
    }
    return json_bytes(document)


def _beyond_the_tilter(calibration: Calibration) -> dict[str, Any]:
    """Quadratic terms, and what a recording's poses say; nothing where there are none."""
    found: dict[str, Any] = {}
    if calibration.terms.quadratic_per_g is not None:
        found["quadratic_terms"] = {
            "products": list(PRODUCT_NAMES),
            "per_g": calibration.terms.quadratic_per_g.tolist(),
        }
    rate = calibration.terms.rate
    if rate is not None:
        found["rate_term"] = {
            "offset_g_s_per_k": rate.offset_g_s_per_k.tolist(),
            "range_k_per_s": list(rate.range_k_per_s),
        }
    recording = calibration.recording
    if calibration.inputs:
        found["inputs"] = list(calibration.inputs)
    if calibration.update is not None:
        found["update"] = plain(calibration.update)
    if calibration.notes:
        found["findings"] = list(calibration.notes)
    if recording is not None:
        found["recording"] = {
            "poses": len(recording.poses.poses),
            "refused": [{"line": r.line, "reason": r.reason} for r in recording.poses.refused],
            "route": recording.route,
            "rms_g": recording.rms_g,
            "rms_per_degree_of_freedom_g": recording.rms_free_g if recording.checked else None,
            "held_out_g": recording.held_out_g,
            "left_out_length_g": recording.left_out_length_g,
            "condition_number": plain(recording.condition),
            "constants": plain(recording.shares),
            "findings": list(recording.findings),
        }
    return found


def header(fitted: Fitted) -> dict[str, Any]:
    """What every JSON file of a unit begins with."""
    return {
        "format": FORMAT,
        "triaxcal": __version__,
        "unit": fitted.unit.name,
        "serial": fitted.unit.serial,
        "inputs_sha256": fitted.inputs_sha256,
    }


def _state(fitted: Fitted) -> dict[str, Any]:
    """Without the path of the folder: equal inputs give equal bytes wherever they lie."""
    found, measurements = fitted.calibration, fitted.measurements
    if found.recording is not None:
        # Where samples were still is of no use without the samples.
        poses = found.recording.poses
        poses = replace(poses, stillness=None, source=Path(poses.source).name)
        found = replace(found, recording=replace(found.recording, poses=poses))
    skipped = (*_ELSEWHERE, *_CURVES)
    rest = {key: value for key, value in plain(found, _CUSTOM).items() if key not in skipped}
    return {
        "unit_toml": fitted.unit.toml,
        "adc": plain(fitted.unit.adc),
        "measurements": plain(replace(measurements, source=Path(measurements.source).name)),
        "calibration": rest,
    }


def read_saved(path: Path) -> Saved:
    """What a calibration.json holds.

    Raises
    ------
    RefusedError
        When the file cannot be read, is no calibration.json, or is of a later format.
    """
    try:
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise refused_by_system(path, "read", error, expected="a calibration.json") from error
    except (ValueError, RecursionError) as error:
        raise RefusedError(
            str(path), f"not JSON: {error}", expected="a calibration.json"
        ) from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        found = document.get("format") if isinstance(document, dict) else None
        raise RefusedError(
            f"{path}, format",
            "missing" if found is None else f"found {found!r}",
            expected=f"{FORMAT}",
            remedy="give a calibration.json of a tilter's or a recording's calibration; another "
            "format needs a triaxcal that knows it",
        )
    if document.get("kind") == "dynamic":
        raise RefusedError(
            f"{path}, kind",
            "the calibration of a whole IMU",
            expected="that of an accelerometer from a tilter or a recording",
            remedy="of an IMU, Python reads it with triaxcal.load_imu",
        )
    try:
        return _saved(str(path), document)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise RefusedError(
            str(path),
            f"damaged, or no calibration.json: {type(error).__name__} {error}",
            expected="the file as `triaxcal calib` wrote it",
        ) from error


def _saved(source: str, document: Mapping[str, Any]) -> Saved:
    public = _curves(source, document)
    state = document.get("fit")
    if state is None:
        why = "written by triaxcal 0.1.0: it holds the constants, not the fit behind them"
        return replace(public, without_fit=why)
    function = state["calibration"]["shape"]["function"]
    if function not in THERMAL_FUNCTIONS:
        why = f"its thermal function {function!r} is unknown here: only the constants were read"
        return replace(public, without_fit=why)
    held = {key: document[key] for key in _ELSEWHERE}
    if state["calibration"]["recording"] is not None:  # a number that is not finite is null in JSON
        rows = held["candidates"]
        held["candidates"] = [{**r, "condition": _or_infinite(r["condition"])} for r in rows]
    held |= plain({"thermal": public.thermal, "terms": public.terms})
    whole = {**state["calibration"], **held, "reading_unit": public.reading_unit}
    unit = unit_of_text(document["unit"], state["unit_toml"], f"{source}, unit_toml")
    unit = replace(unit, adc=rebuilt(Adc, state["adc"]))
    if unit.serial != public.serial:
        raise RefusedError(
            f"{source}, serial",
            f"found {public.serial!r}",
            expected=f"{unit.serial!r} of unit_toml",
        )
    measurements = rebuilt(MeasurementSet, state["measurements"])
    inputs, calibration = str(document["inputs_sha256"]), rebuilt(Calibration, whole, _CUSTOM)
    fitted = Fitted(unit, measurements, inputs, calibration)
    return Saved.of(fitted, source)


def _or_infinite(condition: float | None) -> float:
    return math.inf if condition is None else condition


def _curves(source: str, document: Mapping[str, Any]) -> Saved:
    """What the keys of format 1 say, without the fit."""

    def numbers(key: str, values: Any) -> FloatArray:
        found = np.array(values, dtype=np.float64)
        if not np.isfinite(found).all():
            raise RefusedError(f"{source}, {key}", "a number is not finite", expected="numbers")
        return found

    model, terms = document["thermal_model"], NO_TERMS
    coefficients = numbers("thermal_model", model["coefficients"])
    breaks, origins = (tuple(map(float, model[k])) for k in ("breaks_degc", "origins_degc"))
    curves = PiecewisePolynomial(breaks, origins, coefficients)
    thermal = ThermalModel(float(model["t0_degc"]), curves)
    if quadratic := document.get("quadratic_terms"):
        terms = replace(terms, quadratic_per_g=numbers("quadratic_terms", quadratic["per_g"]))
    if rate := document.get("rate_term"):
        offset = numbers("rate_term", rate["offset_g_s_per_k"])
        slowest, fastest = map(float, rate["range_k_per_s"])
        terms = replace(terms, rate=RateTerm(offset, (slowest, fastest)))
    low, high = map(float, numbers("range_degc", document["range_degc"]))
    # What other programs read must be what is computed with; a rounding of another machine is far
    # below a part in 10^12 of the largest constant.
    at_t0 = numbers("at_t0", document["at_t0"])
    if np.abs(thermal.constants_at(thermal.t0_degc) - at_t0).max() > 1e-12 * np.abs(at_t0).max():
        raise RefusedError(
            f"{source}, at_t0",
            "not the values of the curves in thermal_model at t0_degc",
            expected="the file as `triaxcal calib` wrote it",
        )
    unit = document["units"][-1]
    return Saved(source, document["serial"], thermal, terms, (low, high), unit, None)
