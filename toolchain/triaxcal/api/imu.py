"""`read_imu`, `fit_imu`, `ImuCalibration`, `load_imu`: the same for a whole IMU."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.api.arguments import refuse_other_length, temperatures
from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.progress import Progress
from triaxcal.base.publish import renew
from triaxcal.delivery.imu import ImuC, ImuDelivery, deliver_described
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.imumodel import model_of_states
from triaxcal.dynamic.layout import Layout
from triaxcal.model.methods.imu import ImuModel
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

FORMAT = 1
"""Of the calibration.json that `load_imu` reads."""
_DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


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
    document : dict
        calibration.json.
    """

    def __init__(self, document: dict[str, Any], delivery: ImuDelivery | None = None) -> None:
        self.document = document
        self.serial: str = document["serial"]
        self.reference_degc = float(document["reference_degc"])
        limits = document.get("range_degc")  # files of triaxcal 0.1.0 have none
        self.range_degc = limits and (float(limits[0]), float(limits[1]))
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

        return cls(calibration_document(delivery.done, delivery.inputs_sha256), delivery)

    def __repr__(self) -> str:
        return f"<triaxcal.ImuCalibration {self.serial}, {len(self.states)} states>"

    @cached_property
    def layout(self) -> Layout:
        """Blocks of states that were on."""
        blocks = (b for name in self.document["blocks"] for b in EXTENSIONS[name].blocks)
        return Layout((*BASE, *blocks))

    @cached_property
    def _model(self) -> ImuModel:
        gravity = float(self.document["local_gravity_m_per_s2"])
        anywhere = (self.reference_degc - 1.0, self.reference_degc + 1.0)
        return model_of_states(self.layout, self._p, self.reference_degc, gravity, anywhere)

    @property
    def verdict(self) -> str:
        """How consistent recording and model are, by the innovations, in words."""
        return str(self.document["innovations"]["verdict"])

    def constants(self, temp_degc: Any = None) -> ImuConstants:
        """Constants at temperatures; None is `reference_degc`.

        Raises
        ------
        RefusedError
            For a temperature that is no number, or outside of `range_degc`.
        """
        temp = self._temperature(temp_degc)
        (K, U0), (L, W0) = (
            unpack_constants(triad.constants_at(temp))
            for triad in (self._model.accel, self._model.gyro)
        )
        return ImuConstants(K, U0 * STANDARD_GRAVITY_M_PER_S2, L, W0, self._model.g_sensitivity)

    def apply(
        self, force_m_per_s2: Any, rate_rad_per_s: Any, temp_degc: Any = None
    ) -> tuple[FloatArray, FloatArray]:
        """Compensated specific force in m/s^2 and rate in rad/s, by the fitted model, in floats.

        Parameters
        ----------
        force_m_per_s2, rate_rad_per_s : array_like, shape (3,) or (n, 3)
            Readings, axes x, y, z.
        temp_degc : array_like, shape () or (n,), or None
            None is `reference_degc`.

        Raises
        ------
        RefusedError
            For another shape, a number that is not finite, or a temperature out of `range_degc`.
        """
        force = finite("force_m_per_s2", force_m_per_s2, 3)
        rate = finite("rate_rad_per_s", rate_rad_per_s, 3)
        if force.shape != rate.shape:
            raise RefusedError(
                "rate_rad_per_s", f"found the shape {rate.shape}", expected=f"{force.shape}"
            )
        temp, model = self._temperature(temp_degc), self._model
        refuse_other_length(force, temp_degc=temp)
        a = force_from_voltage(model.accel.constants_at(temp), force / STANDARD_GRAVITY_M_PER_S2)
        w = force_from_voltage(model.gyro.constants_at(temp), rate) - a @ model.g_sensitivity.T
        return a * STANDARD_GRAVITY_M_PER_S2, w

    def save(self, path: str | Path) -> Path:
        """Write calibration.json, whole or not at all; `load_imu` reads it."""
        from triaxcal.base.jsontext import json_bytes  # noqa: PLC0415

        target = Path(path)
        renew({target.name: json_bytes(self.document)}, target.parent)
        return target

    def _temperature(self, temp_degc: Any) -> FloatArray:
        if temp_degc is None:
            return np.array(self.reference_degc)
        return temperatures(temp_degc, self.range_degc)

    @property
    def c(self) -> ImuC:
        """The C of both triads, where the unit has [device].

        Raises
        ------
        RefusedError
            Where it has none, or the calibration was loaded.
        """
        if self._delivery is None or self._delivery.c is None:
            raise RefusedError(
                f"IMU {self.serial}",
                "has no C: its unit.toml has no [device], or the calibration was loaded",
                expected="a calibration by fit_imu of a unit with [device]",
            )
        return self._delivery.c


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

    Raises
    ------
    RefusedError
        When the recording cannot be read, or does not determine a calibration.
    """
    return ImuCalibration.of(deliver_described(imu.description, progress))


def load_imu(path: str | Path) -> ImuCalibration:
    """Calibration from the calibration.json of an IMU.

    Raises
    ------
    RefusedError
        When the file cannot be read, or is not that of an IMU.
    """
    try:
        document = json.loads(Path(path).read_bytes())
        if document["kind"] != "dynamic":
            raise KeyError("kind")
        if document["format"] != FORMAT:
            raise RefusedError(
                f"{path}, format", f"found {document['format']!r}", expected=f"{FORMAT}"
            )
        found = ImuCalibration(document)
        _refuse_damage(str(path), found)
    except OSError as error:
        raise refused_by_system(path, "read", error) from error
    except _DAMAGE as error:
        raise RefusedError(
            str(path),
            f"no calibration.json of an IMU: {type(error).__name__} {error}",
            expected="the file that `triaxcal calib` wrote for an IMU",
            remedy="load a triad's calibration with load(path)",
        ) from error
    return found


def _refuse_damage(path: str, found: ImuCalibration) -> None:
    """Refuse states of another layout, and numbers that are none."""
    document, size = found.document, len(found.states)
    for name in document["blocks"]:
        if name not in EXTENSIONS:
            raise RefusedError(
                f"{path}, blocks",
                f"found {name!r}",
                expected=f"some of {', '.join(EXTENSIONS.names)}",
            )
    names = [state.name for state in found.layout.states]
    if [row["name"] for row in document["states"]] != names:
        raise RefusedError(
            f"{path}, states",
            "not the states of its blocks, in their order",
            expected=f"{len(names)} states, {names[0]} to {names[-1]}",
        )
    numbers: dict[str, Any] = {
        "states": [(s.value, s.sd) for s in found.states.values()],
        "covariance": found.covariance,
        "reference_degc": found.reference_degc,
        "local_gravity_m_per_s2": float(document["local_gravity_m_per_s2"]),
        "range_degc": found.range_degc or 0.0,
    }
    for key, value in numbers.items():
        if not np.isfinite(value).all():
            raise RefusedError(f"{path}, {key}", "a number is not finite", expected="numbers")
    if found.covariance.shape != (size, size):
        raise RefusedError(
            f"{path}, covariance",
            f"found the shape {found.covariance.shape}",
            expected=f"({size}, {size})",
        )
