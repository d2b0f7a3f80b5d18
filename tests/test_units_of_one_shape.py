"""Two units of one shape in one program: each header takes its own constants, or nothing links."""

from __future__ import annotations

import itertools
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builds import PROVENANCE, write_generated
from plans import GOLDEN
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.names import names_of
from triaxcal.codegen.selftest import render_selftest
from triaxcal.fixedpoint.plan import Plan

STRICT = ("gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
RAW = 1_000_000, -2_000_000, 3_000_000
USER = """
#include "triax_calib.h"
#include "triax_selftest.h"
const char *{unit}_epk(void);
int32_t {unit}_answer(void);
uint32_t {unit}_selftest_answer(void);
const char *{unit}_epk(void) {{ return TRIAX_CALIB_EPK; }}
uint32_t {unit}_selftest_answer(void) {{ return triax_selftest(); }}
int32_t {unit}_answer(void)
{{
    triax_state_t state;
    const int32_t raw[3] = {{1000000, -2000000, 3000000}};
    int32_t accel[3];
    (void)triax_set_temperature(&state, &TRIAX_CALIB, triax_calib_constants.temp_min_code);
    (void)triax_apply(&state, raw, accel);
    return accel[0];
}}
"""
MAIN = """
#include <stdint.h>
#include <stdio.h>
const char *a_epk(void);
int32_t a_answer(void);
uint32_t a_selftest_answer(void);
const char *d_epk(void);
int32_t d_answer(void);
uint32_t d_selftest_answer(void);
int main(void)
{
    printf("%s %ld %lu\\n", a_epk(), (long)a_answer(), (unsigned long)a_selftest_answer());
    printf("%s %ld %lu\\n", d_epk(), (long)d_answer(), (unsigned long)d_selftest_answer());
    return 0;
}
"""


def shifted(plan: Plan) -> Plan:
    """Another unit of the shape: one offset differs."""
    (segment,) = plan.segments
    coefficients = segment.coefficients.copy()
    coefficients[3, 0] += 1 << 20
    return replace(plan, segments=(replace(segment, coefficients=coefficients),))


FIRST = GOLDEN["direct-checked"]
UNITS = {
    "a": (FIRST, replace(PROVENANCE, serial="UNIT-A", inputs_sha256="a" * 64)),
    "d": (shifted(FIRST), replace(PROVENANCE, serial="UNIT-D", inputs_sha256="d" * 64)),
}


def complaint(*arguments: str | Path) -> str:
    """What gcc says where it fails, else ""."""
    done = subprocess.run(
        [*STRICT, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    return done.stderr if done.returncode else ""


def library(folder: Path) -> Path:
    """A static library of a delivery, as a build system makes it."""
    sources = sorted(folder.glob("triax_*.c"))
    for source in sources:
        assert complaint("-c", source, "-o", source.with_suffix(".o")) == ""
    archive = folder / "libtriax.a"
    objects = [source.with_suffix(".o") for source in sources]
    subprocess.run(["ar", "rcs", archive, *objects], check=True)
    return archive


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folder of each unit: its library, and an object of a user of its headers."""
    folders = {}
    for unit, (plan, provenance) in UNITS.items():
        folder = folders[unit] = tmp_path_factory.mktemp(unit)
        write_generated(plan, folder, provenance)
        for name, text in render_selftest(plan, provenance).items():
            (folder / name).write_text(text)
        library(folder)
        user = folder / "user.c"
        user.write_text(USER.format(unit=unit))
        assert complaint("-c", user, "-o", folder / "user.o") == ""
    return folders


def expected_line(unit: str) -> str:
    """By the integer model, not by the C."""
    plan, provenance = UNITS[unit]
    temp = np.array([plan.temp_min_code], np.int32)
    accel, _ = python_routine(plan)(temp, np.array([RAW], np.int32))
    return f"{provenance.serial} {provenance.inputs_sha256[:16]} {accel[0, 0]} 0"


def test_they_have_one_shape_and_different_answers() -> None:
    assert len({names_of(plan).shape for plan, _ in UNITS.values()}) == 1
    assert len({expected_line(unit).split()[2] for unit in UNITS}) == 2


@pytest.mark.parametrize("order", list(itertools.permutations(UNITS)), ids="".join)
@pytest.mark.parametrize("flags", [(), ("-O2", "-flto")], ids=["plain", "flto"])
def test_each_user_gets_the_constants_of_its_header(
    built: dict[str, Path], tmp_path: Path, order: tuple[str, ...], flags: tuple[str, ...]
) -> None:
    main = tmp_path / "main.c"
    main.write_text(MAIN)
    users = [built[unit] / "user.o" for unit in UNITS]
    libraries = [built[unit] / "libtriax.a" for unit in order]
    assert complaint(*flags, main, *users, *libraries, "-o", tmp_path / "program") == ""
    done = subprocess.run([tmp_path / "program"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [expected_line(unit) for unit in UNITS]


@pytest.mark.parametrize(("header", "linked"), list(itertools.permutations(UNITS, 2)))
def test_a_header_with_the_library_of_another_unit_does_not_link(
    built: dict[str, Path], tmp_path: Path, header: str, linked: str
) -> None:
    """As when the first folder to be searched for headers is that of the other unit."""
    main = tmp_path / "main.c"
    main.write_text(
        "#include <stdint.h>\n"
        f"int32_t {header}_answer(void);\nint main(void) {{ return {header}_answer() == 0; }}\n"
    )
    user, archive = built[header] / "user.o", built[linked] / "libtriax.a"
    told = complaint(main, user, archive, "-o", tmp_path / "program")
    assert "undefined reference to `triax_" in told
    for name in ("in_use", "calib_constants", "selftest"):
        assert f"_{header * 8}_{name}" in told


def test_headers_of_two_units_in_one_file_do_not_compile(
    built: dict[str, Path], tmp_path: Path
) -> None:
    both = tmp_path / "both.c"
    for files in itertools.permutations((("a", "selftest"), ("d", "calib"))):
        lines = [f'#include "{built[unit]}/triax_{name}.h"\n' for unit, name in files]
        both.write_text("".join(lines) + "int unused;\n")
        assert "two triax_calib.h of different units" in complaint("-c", both, "-o", "/dev/null")


def test_one_delivery_in_two_libraries_is_one_definition(
    built: dict[str, Path], tmp_path: Path
) -> None:
    """Equal inputs are equal constants: a linker may take either."""
    plan, provenance = UNITS["a"]
    again = tmp_path / "again"
    write_generated(plan, again, provenance)
    main = tmp_path / "main.c"
    main.write_text("#include <stdint.h>\nint32_t a_answer(void);\n"
                    "int main(void) { return a_answer() == 0; }\n")  # fmt: skip
    libraries = [built["a"] / "libtriax.a", library(again)]
    program = tmp_path / "program"
    assert complaint(main, built["a"] / "user.o", *libraries, "-o", program) == ""
    assert subprocess.run([program], check=False).returncode == 0
