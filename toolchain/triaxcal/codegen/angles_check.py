"""The generated triax_angles against Python's integer model, bit for bit, and against atan2."""

from __future__ import annotations

import ctypes
import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.angles import GeneratedAngles
from triaxcal.codegen.routines import Int32Array
from triaxcal.fixedpoint.angles import TURN, AnglesPlan, angles
from triaxcal.fixedpoint.angles_proof import AnglesBound, prove_angles
from triaxcal.fixedpoint.arithmetic import INT32_MAX, INT32_MIN
from triaxcal.model.orientation import angles_from_force
from triaxcal.model.types import FloatArray, IntArray

SEED = 20130531
RANDOM_VECTORS = 20_000
_PER_RADIAN = TURN / (2.0 * np.pi)
FLOAT_UNITS = 1e-5
"""What `exact_units` may be off: a few roundings of 2^-53 of half a turn are 2e-6 units."""


@dataclass(frozen=True)
class AnglesCheck:
    """Result of a check that found no difference.

    Attributes
    ----------
    vectors : dict
        Number of vectors by set.
    largest_units : tuple of two floats
        Largest error seen of each angle, in 2^-32 turn.
    bound : AnglesBound
        The proven one.
    """

    vectors: dict[str, int]
    largest_units: tuple[float, float]
    bound: AnglesBound

    @property
    def total(self) -> int:
        """Vectors in all."""
        return sum(self.vectors.values())


def angle_vectors(plan: AnglesPlan, count: int = RANDOM_VECTORS) -> dict[str, Int32Array]:
    """Triads (n, 3): edges, 1 g and about it, near each axis, every size, any int32."""
    rng = np.random.Generator(np.random.PCG64(SEED))
    unit = rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    size = 2.0**plan.output_q * rng.uniform(0.9, 1.1, (count, 1))
    near = unit * np.exp2(rng.uniform(-plan.output_q, 0.0, (count, 3)))
    anything = rng.integers(INT32_MIN, INT32_MAX, (count, 3), dtype=np.int32, endpoint=True)
    return {
        "edges": _edges(plan),
        "about 1 g": _int32(unit * size),
        "near an axis": _int32(near * size),
        "every size": anything >> rng.integers(0, 31, (count, 1), dtype=np.int32),
        "random int32": anything,
    }


def _edges(plan: AnglesPlan) -> Int32Array:
    """All triads of 0, 1, and values about powers of two, 1 g among them."""
    sizes = {1, 2, 3, (1 << plan.output_q) + 1}
    sizes |= {1 << k for k in (8, 16, plan.output_q, 29, 30, 31)}
    sizes |= {(1 << k) - 1 for k in (29, 30, 31)}
    both = {s * v for v in sizes for s in (1, -1)} | {0}
    values = sorted(v for v in both if INT32_MIN <= v <= INT32_MAX)
    return np.array(list(itertools.product(values, repeat=3)), dtype=np.int32)


def _int32(values: FloatArray) -> Int32Array:
    return np.rint(values).clip(INT32_MIN, INT32_MAX).astype(np.int32)


def check_angles(plan: AnglesPlan, library: ctypes.CDLL) -> AnglesCheck:
    """Run the compiled routine and Python's model on every vector.

    Raises
    ------
    RefusedError
        At the first difference, or where an error is above the proven bound.
    """
    generated, bound = GeneratedAngles(library, plan), prove_angles()
    limit = np.array([float(u) for u in bound.units]) + FLOAT_UNITS
    sets, worst = angle_vectors(plan), np.zeros(2)
    for name, accel in sets.items():
        found, expected = generated.run(accel), angles(plan, accel.astype(np.int64))
        differs = (found[0] != expected[0]).any(axis=1) | (found[1] != expected[1])
        if differs.any():
            i = int(differs.argmax())
            raise _refusal(name, accel[i], found, expected, i)
        worst = np.maximum(worst, errors_units(plan, accel, found[0]).max(axis=0))
    if (worst > limit).any():
        raise RefusedError(
            "triax_angles",
            f"angles are {worst[0]:.2f} and {worst[1]:.2f} units off",
            expected=f"at most the proven {limit[0]:.2f} and {limit[1]:.2f}",
            remedy="the proof is wrong: this is a fault in triaxcal, report it",
        )
    seen = (float(worst[0]), float(worst[1]))
    return AnglesCheck({name: len(accel) for name, accel in sets.items()}, seen, bound)


def _refusal(
    name: str,
    accel: Int32Array,
    found: tuple[npt.NDArray[np.integer], ...],
    expected: tuple[npt.NDArray[np.integer], ...],
    i: int,
) -> RefusedError:
    words = [f"{a[i].tolist()} status {s[i]}" for a, s in (found, expected)]
    return RefusedError(
        f"cross-check of triax_angles, vector {i} of '{name}'",
        f"accel {accel.tolist()}: generated C gives {words[0]}",
        expected=words[1],
        remedy="do not use this build, report it",
    )


def exact_units(plan: AnglesPlan, accel: Int32Array) -> FloatArray:
    """The angles of triads (n, 3) by atan2 in doubles, within `FLOAT_UNITS`, shape (n, 2)."""
    return angles_from_force(plan.choice.kind, accel.astype(np.float64)) * _PER_RADIAN


def errors_units(plan: AnglesPlan, accel: Int32Array, found: IntArray) -> FloatArray:
    """Size of the error of each angle, shape (n, 2); 0 where the angle does not exist."""
    error = found - exact_units(plan, accel)
    error = np.abs((error + TURN / 2) % TURN - TURN / 2)
    across = accel[:, :2] if plan.zenith else accel[:, 1:]
    error[~accel.any(axis=1), 0] = 0.0
    error[~across.any(axis=1), 1] = 0.0
    return error
