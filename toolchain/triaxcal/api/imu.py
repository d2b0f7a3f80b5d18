"""`read_imu`, `fit_imu`, `ImuCalibration`, `load_imu`: the same for a whole IMU."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.api.arguments import refuse_other_length, temperatures
from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError
from triaxcal.base.plaindata import rebuilt
from triaxcal.base.progress import Progress
from triaxcal.base.publish import renew
from triaxcal.delivery.fittedimu import FittedImu, read_saved_for_c
from triaxcal.delivery.imu import ImuDelivery, fit_described
from triaxcal.delivery.imuc import ImuC, imu_c
from triaxcal.delivery.imuverdict import UNKNOWN, ImuVerdict
from triaxcal.dynamic.blocks import north
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.imumodel import model_of_states
from triaxcal.dynamic.layout import Layout
from triaxcal.model.curves import ThermalModel
from triaxcal.model.methods.imu import ImuModel
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2


@dataclass(frozen=True)
class Imu:
    """One IMU: the description of its unit.toml, and the folder it was read from."""

    description: DynamicDescription
    folder: Path

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.description.name

    @property
    def serial(self) -> str:
        """Serial number."""
        return self.description.serial


@dataclass(frozen=True)
class ImuState:
    """One estimated constant: value and standard deviation in `unit`."""

    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class ImuConstants:
    """Constants of both triads at temperatures of shape (...).

    Attributes
    ----------
    accel_matrix, gyro_matrix : arrays, shape (..., 3, 3)
        K of a reading U = K a + U0: output of axis i for 1 unit along axis j.
    accel_bias_m_per_s2, gyro_bias_rad_per_s : arrays, shape (..., 3)
    g_sensitivity_rad_per_s_per_g : array, shape (3, 3)
        What specific force adds to the compensated rate.
    """

    accel_matrix: FloatArray
    accel_bias_m_per_s2: FloatArray
    gyro_matrix: FloatArray
    gyro_bias_rad_per_s: FloatArray
    g_sensitivity_rad_per_s_per_g: FloatArray


class ImuCalibration:
    """The constants of both triads of an IMU, from one recording.

    Made by `fit_imu` or `load_imu`.

    Attributes
    ----------
    serial : str
    states : dict
        `ImuState` by name, in the order of the filter.
    covariance : array, shape (n, n)
        Of the states, in SI units.
    reference_degc : float
        Temperature of the biases and scales; the others follow the temperature blocks.
    range_degc : tuple of two floats, or None
        Working range; no other temperature is answered. None where no temperature was recorded.
    gyro_range_degc : tuple of two floats, or None
        The same by the gyros' thermometer; None where they have none of their own.
    document : dict
        calibration.json.
    source : str
        Where it was read from, for messages.
    """

    def __init__(
        self, document: dict[str, Any], delivery: ImuDelivery | None = None, source: str = ""
    ) -> None:
        self.document = document
        self.source = source or f"IMU {document['serial']}"
        self.serial: str = document["serial"]
        self.reference_degc = float(document["reference_degc"])
        limits = document.get("range_degc")  # files of triaxcal 0.1.0 have none
        self.range_degc = limits and (float(limits[0]), float(limits[1]))
        limits = document.get("gyro_range_degc")
        self.gyro_range_degc = limits and (float(limits[0]), float(limits[1]))
        self.covariance: FloatArray = np.array(document["covariance"], dtype=np.float64)
        rows = document["states"]
        self.states = {
            s["name"]: ImuState(
                s["value"] / s["si_per_unit"], s["sd"] / s["si_per_unit"], s["unit"]
            )
            for s in rows
        }
        self._p: FloatArray = np.array([s["value"] for s in rows], dtype=np.float64)
        self._delivery = delivery

    @classmethod
    def of(cls, delivery: ImuDelivery) -> ImuCalibration:
        """Calibration of a delivery."""
        from triaxcal.report.dynamic import calibration_document  # noqa: PLC0415

        return cls(calibration_document(delivery), delivery)

    def __repr__(self) -> str:
        return f"<triaxcal.ImuCalibration {self.serial}, {len(self.states)} states>"

    @cached_property
    def layout(self) -> Layout:
        """Blocks of states that were on."""
        blocks = (b for name in self.document["blocks"] for b in EXTENSIONS[name].blocks)
        searched = self.document.get("heading_rad", ()) is None
        return Layout((*BASE, *blocks, *((north.BLOCK,) if searched else ())))

    @cached_property
    def _model(self) -> ImuModel:
        gravity = float(self.document["local_gravity_m_per_s2"])
        anywhere = (self.reference_degc - 1.0, self.reference_degc + 1.0)
        model = model_of_states(self.layout, self._p, self.reference_degc, gravity, anywhere)
        return self._with_curves(model)

    def _with_curves(self, model: ImuModel) -> ImuModel:
        """The model with the curves over temperature that the file has, where it has some."""
        over = self.document.get("over_temperature")
        if over is None:
            return model
        accel, gyro = (rebuilt(ThermalModel, over[triad]) for triad in ("accel", "gyro"))
        return replace(model, accel=accel, gyro=gyro)

    @cached_property
    def verdict(self) -> ImuVerdict:
        """Whether it may be delivered, and whether it has passed."""
        found = self.document.get("verdict")  # earlier files have none
        return UNKNOWN if found is None else rebuilt(ImuVerdict, found)

    @property
    def passed(self) -> bool:
        """Whether every check that was made holds, and nothing is left in doubt."""
        return self.verdict.passed

    def constants(self, temp_degc: Any = None, gyro_temp_degc: Any = None) -> ImuConstants:
        """Constants at temperatures; None is `reference_degc`.

        Where the gyros have a thermometer of their own, theirs are at `gyro_temp_degc`.

        Raises
        ------
        RefusedError
            For a temperature that is no number, or outside of `range_degc`; where one of the two
            is missing.
        """
        temp, gyro_temp = self._temperatures(temp_degc, gyro_temp_degc)
        (K, U0), (L, W0) = (
            unpack_constants(triad.constants_at(t))
            for triad, t in ((self._model.accel, temp), (self._model.gyro, gyro_temp))
        )
        return ImuConstants(K, U0 * STANDARD_GRAVITY_M_PER_S2, L, W0, self._model.g_sensitivity)

    def apply(
        self,
        force_m_per_s2: Any,
        rate_rad_per_s: Any,
        temp_degc: Any = None,
        gyro_temp_degc: Any = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Compensated specific force in m/s^2 and rate in rad/s, by the fitted model, in floats.

        Parameters
        ----------
        force_m_per_s2, rate_rad_per_s : array_like, shape (3,) or (n, 3)
            Readings, axes x, y, z.
        temp_degc : array_like, shape () or (n,), or None
            None is `reference_degc`.
        gyro_temp_degc : array_like, shape () or (n,), or None
            By the gyros' own thermometer, where they have one.

        Raises
        ------
        RefusedError
            For another shape, a number that is not finite, or a temperature out of `range_degc`;
            where one of two temperatures is missing.
        """
        force = finite("force_m_per_s2", force_m_per_s2, 3)
        rate = finite("rate_rad_per_s", rate_rad_per_s, 3)
        if force.shape != rate.shape:
            raise RefusedError(
                "rate_rad_per_s", f"found the shape {rate.shape}", expected=f"{force.shape}"
            )
        temp, gyro_temp = self._temperatures(temp_degc, gyro_temp_degc)
        model = self._model
        refuse_other_length(force, temp_degc=temp, gyro_temp_degc=gyro_temp)
        a = force_from_voltage(model.accel.constants_at(temp), force / STANDARD_GRAVITY_M_PER_S2)
        w = force_from_voltage(model.gyro.constants_at(gyro_temp), rate) - a @ model.g_sensitivity.T
        return a * STANDARD_GRAVITY_M_PER_S2, w

    def save(self, path: str | Path) -> Path:
        """Write calibration.json, whole or not at all; `load_imu` reads it."""
        from triaxcal.base.jsontext import json_bytes  # noqa: PLC0415

        target = Path(path)
        renew({target.name: json_bytes(self.document)}, target.parent)
        return target

    def _temperatures(self, temp_degc: Any, gyro_temp_degc: Any) -> tuple[FloatArray, FloatArray]:
        """Temperatures of both triads."""
        own = self.gyro_range_degc is not None
        if gyro_temp_degc is not None and not own:
            raise RefusedError(
                "gyro_temp_degc", "given", expected="none: both triads have one thermometer"
            )
        if own and (gyro_temp_degc is None) != (temp_degc is None):
            name = "gyro_temp_degc" if gyro_temp_degc is None else "temp_degc"
            raise RefusedError(
                name, "not given", expected="the temperature of each triad: it has a thermometer"
            )
        if temp_degc is None:
            return np.array(self.reference_degc), np.array(self._model.gyro.t0_degc)
        temp = temperatures(temp_degc, self.range_degc)
        return temp, temperatures(gyro_temp_degc, self.gyro_range_degc) if own else temp

    @cached_property
    def fitted(self) -> FittedImu:
        """What the C is made of, where the unit has [device].

        Raises
        ------
        RefusedError
            Where it has none.
        """
        if self._delivery is not None and self._delivery.c is not None:
            return self._delivery.c.fitted
        document = self.document
        saved = read_saved_for_c(self.source, document)
        frame = self.reference_degc, float(document["local_gravity_m_per_s2"])
        range_degc, own = saved.device.range_degc, saved.device.gyro_range
        model = model_of_states(self.layout, self._p, *frame, range_degc, gyro_range_degc=own)
        model = self._with_curves(model)
        inputs, name = str(document["inputs_sha256"]), str(document["unit"])
        return FittedImu(name, self.serial, inputs, self.source, self.layout, model, saved)

    @cached_property
    def c(self) -> ImuC:
        """The C of both triads, proven and checked, where the unit has [device].

        Raises
        ------
        RefusedError
            Where it has none, the verdict refuses, or a compiler is missing.
        """
        if self.verdict.refused:
            raise RefusedError(self.source, f"refused, so there is no C: {self.verdict.refused}")
        if self._delivery is not None and self._delivery.c is not None:
            return self._delivery.c
        return imu_c(self.fitted)


def read_imu(folder: str | Path) -> Imu:
    """IMU in a folder, from its unit.toml with [dynamic].

    Raises
    ------
    RefusedError
        When there is no such unit, or its file breaks a rule.
    """
    return Imu(read_dynamic(Path(folder)), Path(folder))


def fit_imu(imu: Imu, progress: Progress | None = None) -> ImuCalibration:
    """Calibrate an IMU from its recording; with [device], its C is made and checked as well.

    A calibration that its verdict refuses is returned all the same, without C: `verdict` says why.

    Raises
    ------
    RefusedError
        When the recording cannot be read, or does not determine a calibration.
    """
    return ImuCalibration.of(fit_described(imu.description, progress))
