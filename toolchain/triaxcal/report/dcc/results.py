"""Measurement results of the certificate: method, equipment, conditions, constants."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as ET

import numpy as np

from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.report.dcc.administrative import software
from triaxcal.report.dcc.elements import SI, contact, element, identification, quantity, si, text
from triaxcal.report.passport.content import Passport
from triaxcal.uncertainty.coverage import LEVEL
from triaxcal.unit.equipment import Equipment
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_VOLT = (r"\volt\second\tothe{2}\metre\tothe{-1}", r"\volt")
_ACCELERATION = (r"\one", r"\metre\second\tothe{-2}")
_COUNT = (r"\second\tothe{2}\metre\tothe{-1}", r"\one")
_UNITS = {
    "V": (1.0, _VOLT),
    "mV": (1e-3, _VOLT),
    "count": (1.0, _COUNT),
    "m/s^2": (1.0, _ACCELERATION),
    "g": (STANDARD_GRAVITY_M_PER_S2, _ACCELERATION),
    "mg": (1e-3 * STANDARD_GRAVITY_M_PER_S2, _ACCELERATION),
}
"""Unit of the readings in SI units, and the units of K and U0 then."""
_PER_RATE = r"\metre\second\tothe{-1}\kelvin\tothe{-1}"
_PER_ACCELERATION = r"\second\tothe{2}\metre\tothe{-1}"


def measurement_results(root: ET.Element, p: Passport) -> None:
    """Second ring of the certificate."""
    result = element(element(root, "measurementResults"), "measurementResult")
    text(result, "name", "constants of a triaxial accelerometer over temperature")
    _method(result, p)
    software(element(result, "usedSoftware"))
    _equipment(result, p)
    _conditions(result, p)
    results = element(result, "results")
    # A unit of one temperature has its ends there.
    for temp in dict.fromkeys((p.uncertainty.t0_index, 0, len(p.uncertainty.temps_degc) - 1)):
        _constants(results, p, temp)
    _terms(results, p)
    _metadata(result, p)


def _method(result: ET.Element, p: Passport) -> None:
    method = element(element(result, "usedMethods"), "usedMethod")
    recording = p.delivery.calibration.recording
    tilter = "six positions of a tilter in a thermal chamber"
    poses = "" if recording is None else f"{len(recording.poses.poses)} poses, {recording.route}"
    text(method, "name", poses or tilter)
    text(
        method,
        "description",
        "a = K^-1 (U - U0). K_ij is the output of axis i for unit acceleration along axis j, U0_i "
        "the bias of axis i. Uncertainty by JCGM 100:2008." + _beyond(p),
    )


def _beyond(p: Passport) -> str:
    """What the constants alone do not say."""
    terms, words = p.delivery.calibration.terms, ""
    if terms.quadratic_per_g is not None:
        words += (
            " The result l of this is made a = l + Q p(l), with the products p of its components; "
            "no uncertainty of Q is stated here."
        )
    if terms.rate is not None:
        low, high = terms.rate.range_k_per_s
        words += (
            " To K^-1 (U - U0) a term of the rate of temperature is added, for rates from "
            f"{low:g} to {high:g} K/s; no uncertainty of it is stated here."
        )
    return words


def _equipment(result: ET.Element, p: Passport) -> None:
    if not p.delivery.unit.equipment:
        return
    made = element(result, "measuringEquipments")
    for one in p.delivery.unit.equipment:
        _instrument(made, one)


def _instrument(parent: ET.Element, one: Equipment) -> None:
    made = element(parent, "measuringEquipment")
    text(made, "name", one.name)
    stated = [
        f"calibrated {one.calibrated or 'on a day that is not stated'}",
        f"next calibration due {one.due or 'on a day that is not stated'}",
        f"traceable to {one.traceable_to or 'what is not stated'}",
    ]
    text(made, "description", "; ".join(stated))
    if one.manufacturer is not None:
        contact(made, "manufacturer", one.manufacturer)
    if one.model is not None:
        element(made, "model", one.model)
    known = [
        ("manufacturer", one.serial, "serial number"),
        ("other", one.certificate, "number of its calibration certificate"),
    ]
    if any(value is not None for _, value, _ in known):
        listed = element(made, "identifications")
        for issuer, value, name in known:
            if value is not None:
                identification(listed, issuer, value, name)


def _conditions(result: ET.Element, p: Passport) -> None:
    made, measured = element(result, "influenceConditions"), p.delivery.unit.measured
    gravity = p.delivery.unit.gravity_g * STANDARD_GRAVITY_M_PER_S2
    condition = element(made, "influenceCondition")
    text(condition, "name", "local gravity")
    quantity(element(condition, "data"), f"{gravity:.9g}", r"\metre\second\tothe{-2}")
    for name, limits, unit in (
        ("temperature of the room", measured.ambient_degc, r"\degreecelsius"),
        ("relative humidity of the room", measured.humidity_percent, r"\percent"),
        ("pressure of the air", measured.pressure_hpa, r"\hecto\pascal"),
    ):
        if limits is not None:
            condition = element(made, "influenceCondition")
            text(condition, "name", name)
            data = element(condition, "data")
            for end, value in zip(("lowest", "highest"), limits, strict=True):
                quantity(data, f"{value:.12g}", unit, end)


def _metadata(result: ET.Element, p: Passport) -> None:
    """Rig, place and day of the measurements, where they are stated."""
    rows = list(_metadata_rows(p))
    if not rows:
        return
    made = element(result, "measurementMetaData")
    for name, words in rows:
        row = element(made, "metaData")
        text(row, "name", name)
        text(row, "declaration", words)


def _metadata_rows(p: Passport) -> Iterator[tuple[str, str]]:
    measured = p.delivery.unit.measured
    for name, value in (
        ("rig", measured.rig),
        ("place of the measurements", measured.place),
        ("day of the measurements", measured.date),
    ):
        if value is not None:
            yield name, str(value)


def _constants(results: ET.Element, p: Passport, temp: int) -> None:
    temp_degc = float(p.uncertainty.temps_degc[temp])
    values = p.delivery.calibration.thermal.constants_at(temp_degc)
    budgets = [p.uncertainty.constant_budget(c, temp) for c in range(12)]
    numbers = _list(results, f"constants at {temp_degc:g} degrees Celsius", CONSTANT_NAMES)
    size, (of_gain, of_bias) = _UNITS[p.delivery.calibration.reading_unit]
    scale = size * np.array([1.0 / STANDARD_GRAVITY_M_PER_S2] * 9 + [1.0] * 3)
    si(numbers, "valueXMLList", _decimals(values * scale))
    si(numbers, "unitXMLList", [of_gain] * 9 + [of_bias] * 3)
    expanded = ET.SubElement(numbers, f"{{{SI}}}expandedUncXMLList")
    found = np.array([b.expanded for b in budgets]) * scale
    si(expanded, "uncertaintyXMLList", _decimals(found))
    si(expanded, "coverageFactorXMLList", [f"{b.factor:.3f}" for b in budgets])
    si(expanded, "coverageProbabilityXMLList", [f"{LEVEL:g}"])


def _terms(results: ET.Element, p: Passport) -> None:
    """What is beyond the constants: Q of a = l + Q p(l), and the term of the rate."""
    terms = p.delivery.calibration.terms
    if terms.quadratic_per_g is not None:
        names = tuple(f"Q_{axis}_{product}" for axis in AXES for product in PRODUCT_NAMES)
        numbers = _list(results, "quadratic terms at every temperature", names)
        values = terms.quadratic_per_g.reshape(-1) / STANDARD_GRAVITY_M_PER_S2
        si(numbers, "valueXMLList", _decimals(values))
        si(numbers, "unitXMLList", [_PER_ACCELERATION] * len(names))
    if terms.rate is not None:
        names = tuple(f"rate_{axis}" for axis in AXES)
        numbers = _list(results, "term of the rate of temperature, for 1 K/s", names)
        values = terms.rate.offset_g_s_per_k * STANDARD_GRAVITY_M_PER_S2
        si(numbers, "valueXMLList", _decimals(values))
        si(numbers, "unitXMLList", [_PER_RATE] * len(names))


def _list(results: ET.Element, title: str, names: tuple[str, ...]) -> ET.Element:
    """List of numbers with labels, of a result of its own."""
    result = element(results, "result")
    text(result, "name", title)
    made = element(element(result, "data"), "quantity")
    text(made, "name", ", ".join(names))
    numbers = ET.SubElement(made, f"{{{SI}}}realListXMLList")
    si(numbers, "labelXMLList", names)
    return numbers


def _decimals(values: FloatArray) -> list[str]:
    return [f"{value:.12g}" for value in values.tolist()]
