"""What the C of an IMU is made of; its calibration.json holds it, so that no new fit is needed."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.plaindata import plain, rebuilt
from triaxcal.codegen.constants import Provenance
from triaxcal.delivery.imuverdict import ImuVerdict
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.device import REQUIRED, Device
from triaxcal.dynamic.imumodel import imu_model, left_out
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.unit import DynamicUnit
from triaxcal.fitting.converter import plain_name
from triaxcal.model.methods.imu import ImuModel

_WIDTH = 96
"""Characters of a line of the header."""


@dataclass(frozen=True)
class SavedForC:
    """What calibration.json says for the C, beside the constants: its key `firmware`.

    Attributes
    ----------
    device : Device
    header : tuple of str
        Lines of the header of the constants.
    axes : tuple of two str
        Columns of raw x, y, z of accelerometer and gyro, with their signs.
    date : str
        Day of the measurements; "" where it is not stated.
    """

    device: Device
    header: tuple[str, ...]
    axes: tuple[str, str]
    date: str


@dataclass(frozen=True)
class FittedImu:
    """A calibrated IMU with [device].

    Attributes
    ----------
    name, serial, inputs_sha256 : str
    source : str
        The file that says what the device is, for messages.
    layout : Layout
        Of the states that were estimated.
    model : ImuModel
        Over the range of the device.
    saved : SavedForC
    """

    name: str
    serial: str
    inputs_sha256: str
    source: str
    layout: Layout = field(repr=False)
    model: ImuModel = field(repr=False)
    saved: SavedForC = field(repr=False)

    @property
    def device(self) -> Device:
        """What the codes of the firmware are."""
        return self.saved.device

    @property
    def left_out(self) -> tuple[str, ...]:
        """Titles of effects that were estimated and that the C does not correct."""
        return left_out(self.layout)

    @property
    def provenances(self) -> tuple[Provenance, Provenance]:
        """Where the constants of accelerometer and gyro come from."""
        saved = self.saved
        accel, gyro = (
            Provenance(self.serial, self.inputs_sha256, saved.header, saved.date, axes)
            for axes in saved.axes
        )
        return accel, gyro


def fitted_imu(done: DynamicUnit, verdict: ImuVerdict, inputs_sha256: str) -> FittedImu:
    """What the C of a dynamic calibration with [device] is made of."""
    unit, layout, device = done.unit, done.result.layout, done.unit.device
    assert device is not None
    model = imu_model(done.result, device.range_degc, done.over, device.gyro_range)
    saved = saved_for_c(done, device, verdict)
    return FittedImu(unit.name, unit.serial, inputs_sha256, str(unit.path), layout, model, saved)


def saved_for_c(done: DynamicUnit, device: Device, verdict: ImuVerdict) -> SavedForC:
    """What calibration.json says for the C."""
    low, high = device.range_degc
    accel, gyro = device.accel_adc, device.gyro_adc
    gyro_deg_per_s = math.degrees(gyro.full_scale_v)
    header = (
        f"both triads from {done.unit.recording_words}, {low:g} to {high:g} degC",
        f"accelerometer code: {accel.bits} bits for {accel.full_scale_v:.9g} g full scale",
        *_own_thermometer(device),
        f"gyro code: {gyro.bits} bits for {gyro_deg_per_s:.9g} deg/s full scale",
        *turned_columns(done.unit),
        *(f"not corrected: {title}" for title in left_out(done.result.layout)),
        *_unknown_temperature(done),
        *_verdict_lines(verdict),
    )
    columns = _signed_columns(done.unit)
    axes = ", ".join(columns["force"][0]), ", ".join(columns["rate"][0])
    date = done.unit.measured.date
    return SavedForC(device, header, axes, "" if date is None else date.isoformat())


def _own_thermometer(device: Device) -> tuple[str, ...]:
    if not device.two_thermometers:
        return ()
    low, high = device.gyro_range
    return (f"the gyro has a thermometer of its own: {low:g} to {high:g} degC by it",)


def _unknown_temperature(done: DynamicUnit) -> tuple[str, ...]:
    if done.recorded_degc is not None:
        return ()
    return ("no temperature was recorded: it is not shown that the constants hold at others",)


def _verdict_lines(verdict: ImuVerdict) -> list[str]:
    """The verdict, and what was held against each limit."""
    lines = [f"verdict: {verdict.words}", *map(str, verdict.checks), *verdict.notes]
    return [line for text in lines for line in textwrap.wrap(text, _WIDTH, subsequent_indent="  ")]


def turned_columns(unit: DynamicDescription) -> list[str]:
    """Columns of both triads, where a sign is turned: the constants belong to the turned codes."""
    return [
        f"raw x, y, z of the {name}: columns {', '.join(columns)}; - is -code"
        for name, (columns, turned) in _signed_columns(unit).items()
        if turned
    ]


def _signed_columns(unit: DynamicDescription) -> dict[str, tuple[list[str], bool]]:
    """Columns of force and rate with the signs of the axes, and whether one is turned."""
    found = {}
    for quantity in (q for q in unit.quantities if q.name in ("force", "rate")):
        turned = (quantity.convert(np.ones((1, 3)))[0] < 0.0).tolist()
        columns = [
            f"{'-' * minus}{plain_name(str(column))}"
            for column, minus in zip(quantity.columns, turned, strict=True)
        ]
        found[quantity.name] = columns, any(turned)
    return found


def firmware_document(done: DynamicUnit, verdict: ImuVerdict) -> dict[str, Any]:
    """The key `firmware` of calibration.json; nothing where there is no [device]."""
    device = done.unit.device
    if device is None:
        return {}
    found = plain(saved_for_c(done, device, verdict))
    if device.angles is None:
        del found["device"]["angles"]
    return {"firmware": found}


def read_saved_for_c(source: str, document: Mapping[str, Any]) -> SavedForC:
    """What a calibration.json says for the C.

    Raises
    ------
    RefusedError
        When it says nothing, or it is damaged.
    """
    found = document.get("firmware")
    if found is None:
        raise RefusedError(
            f"{source}, firmware",
            "missing: unit.toml has no [device], or an earlier triaxcal wrote the file",
            expected="the calibration of an IMU with [device]: " + ", ".join(REQUIRED),
            remedy="add it (docs/how-to/imu.md) and run `triaxcal calib` again",
        )
    try:
        return rebuilt(SavedForC, found)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RefusedError(
            f"{source}, firmware",
            f"damaged: {type(error).__name__} {error}",
            expected="the file as `triaxcal calib` wrote it",
        ) from error
