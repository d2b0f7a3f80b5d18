"""examples/units/triax_units.h against exact fractions."""

from __future__ import annotations

import ctypes
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest

from triaxcal.codegen.compiler import WARNINGS

HEADER = Path(__file__).parents[1] / "examples" / "units"
SOURCE = """#include "triax_units.h"
int32_t mg(int32_t a); int32_t mm(int32_t a); float m(int32_t a);
int32_t mg(int32_t a) { return triax_mg(a); }
int32_t mm(int32_t a) { return triax_mm_per_s2(a); }
float m(int32_t a) { return triax_m_per_s2(a); }
"""


def nearest(value: Fraction) -> int:
    """Halves away from 0."""
    size = int(abs(value) + Fraction(1, 2))
    return size if value >= 0 else -size


@pytest.mark.parametrize("q", [14, 20, 24, 29])
def test_units(q: int, tmp_path: Path) -> None:
    (tmp_path / "units.c").write_text(SOURCE)
    library = tmp_path / "units.so"
    command = ["gcc", *WARNINGS, "-O2", "-shared", "-fPIC", f"-I{HEADER}", f"-DTRIAX_ACCEL_Q={q}"]
    subprocess.run([*command, str(tmp_path / "units.c"), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.m.restype = ctypes.c_float
    half = 2 ** (q - 4) // 125  # near one half of a mg
    for a in (0, 1, -1, half, -half, half + 1, 2**q, -(2**q), 123456789, 2**31 - 1, -(2**31)):
        g = Fraction(a, 2**q)
        assert loaded.mg(a) == nearest(1000 * g)
        assert loaded.mm(a) == nearest(Fraction("9806.65") * g)
        # Three roundings of 2^-24 each.
        assert loaded.m(a) == pytest.approx(float(Fraction("9.80665") * g), rel=3 * 2.0**-24)


def test_a_range_that_int32_does_not_hold_is_refused(tmp_path: Path) -> None:
    (tmp_path / "units.c").write_text(SOURCE)
    for define, said in (("-DTRIAX_ACCEL_Q=13", "more mm/s^2 than"), ("-DX", "triax_comp.h first")):
        command = ["gcc", f"-I{HEADER}", define, "-c", str(tmp_path / "units.c"), "-o", "/dev/null"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert said in done.stderr
