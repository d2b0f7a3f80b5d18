"""Raw and compensated samples of a node beside the integer model, bit for bit."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from triaxcal.base.errors import RefusedError
from triaxcal.device.layout import SAMPLE, SAMPLE_FORMAT, SAMPLE_SIZE
from triaxcal.device.link import Link

Int32Array = npt.NDArray[np.int32]
Routine = Callable[[Int32Array, Int32Array], tuple[Int32Array, npt.NDArray[np.uint32]]]
"""Temperature codes (n,) and raw codes (n, 3) to accelerations (n, 3) and status (n,)."""

_SAMPLE = struct.Struct(SAMPLE_FORMAT)


@dataclass(frozen=True)
class Samples:
    """What a node has measured and compensated.

    Attributes
    ----------
    temp, rate : array of int32, shape (n,)
        Codes of the temperature, and of its rate: 0 without a term in dT/dt.
    raw, accel : array of int32, shape (n, 3)
        Raw codes, and what the node made of them, in 2^-Q g.
    status : array of uint32, shape (n,)
        Status of each sample.
    """

    temp: Int32Array
    rate: Int32Array
    raw: Int32Array
    accel: Int32Array
    status: npt.NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.temp)


@dataclass(frozen=True)
class Agreement:
    """How the samples of a node compare with the integer model.

    Attributes
    ----------
    samples : int
        How many, all different ones.
    differing : int
        Those of which a bit of the result or of the status differs.
    largest_lsb : int
        Largest difference of a component, in 2^-Q g.
    first : str
        The first sample that differs, with both answers; "" where none does.
    flagged : int
        Samples whose status is not 0.
    mean_g : tuple of three floats
        Mean specific force, in g of 9.80665 m/s^2.
    length_error_g : float
        Its length, minus the local gravity.
    length_sd_g : float
        Standard error of that by the scatter of |a|, as if the samples were independent.
    """

    samples: int
    differing: int
    largest_lsb: int
    first: str
    flagged: int
    mean_g: tuple[float, float, float]
    length_error_g: float
    length_sd_g: float

    def refuse_difference(self, place: str) -> None:
        """Refuse samples of which a bit differs; `place` is the node."""
        if self.differing:
            raise RefusedError(
                place,
                f"{self.differing} of {self.samples} samples differ, by {self.largest_lsb} LSB at "
                f"most; {self.first}",
                remedy="the node does not run this unit's triax_comp.c",
            )


def take_samples(link: Link, count: int) -> Samples:
    """Take samples, each a new one.

    Raises
    ------
    RefusedError
        When the node does not answer, or gives the same sample again and again.
    """
    rows: list[tuple[int, ...]] = []
    repeated = 0
    while len(rows) < count:
        row = _SAMPLE.unpack(link.read(SAMPLE, 0, SAMPLE_SIZE))
        if rows and row[0] == rows[-1][0]:
            repeated += 1
            if repeated > 10 * count + 100:
                raise RefusedError(
                    link.name, f"sample {row[0]} again and again", remedy="does the sensor run?"
                )
            continue
        rows.append(row)
    table = np.array(rows, np.int64)
    return Samples(
        table[:, 1].astype(np.int32),
        table[:, 2].astype(np.int32),
        table[:, 3:6].astype(np.int32),
        table[:, 6:9].astype(np.int32),
        table[:, 9].astype(np.uint32),
    )


def _rate(samples: Samples, i: int) -> str:
    return f"rate_code {samples.rate[i]}, " if samples.rate.any() else ""


def compare(samples: Samples, routine: Routine, output_q: int, gravity_g: float = 1.0) -> Agreement:
    """Hold a node's results against the routine's; `output_q` is the Q of its accelerations."""
    accel, status = routine(samples.temp, samples.raw)
    difference = np.abs(accel.astype(np.int64) - samples.accel)
    differs = (difference > 0).any(axis=1) | (status != samples.status)
    first = ""
    if differs.any():
        i = int(differs.argmax())
        first = (
            f"sample {i}, temp_code {samples.temp[i]}, {_rate(samples, i)}raw_code "
            f"{samples.raw[i].tolist()}: "
            f"{samples.accel[i].tolist()} status {samples.status[i]}, "
            f"expected {accel[i].tolist()} status {status[i]}"
        )
    force_g = samples.accel * 2.0**-output_q
    norms = np.linalg.norm(force_g, axis=1)
    x, y, z = force_g.mean(axis=0).tolist()
    n = len(samples)
    return Agreement(
        samples=n,
        differing=int(differs.sum()),
        largest_lsb=int(difference.max()),
        first=first,
        flagged=int((samples.status != 0).sum()),
        mean_g=(x, y, z),
        length_error_g=float(np.linalg.norm((x, y, z))) - gravity_g,
        length_sd_g=float(norms.std(ddof=1)) / float(np.sqrt(n)) if n > 1 else np.nan,
    )
