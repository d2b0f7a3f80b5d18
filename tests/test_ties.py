"""Routine, constants and image belong together: what is mixed does not compile, link or load."""

from __future__ import annotations

import ctypes
import itertools
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builds import Built, write_generated
from plans import GOLDEN, integer_plan, integer_shape
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.names import names_of
from triaxcal.codegen.routines import Generated, start_generated
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.description import unit_of_text

STRICT = ("gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
BAD_IMAGE = 16
UNIT = Path(__file__).parent.parent / "units" / "AT-SIM" / "unit.toml"

USER = """
#include "{prefix}_calib.h"
int main(void)
{{
    {prefix}_state_t state;
    const int32_t raw[3] = {{1, 2, 3}};
    int32_t out[3];
    return (int)({prefix}_set_temperature(&state, &{PREFIX}_CALIB, 0) |
                 {prefix}_apply(&state, raw, out));
}}
"""


def user(folder: Path, prefix: str = "triax") -> Path:
    path = folder / f"{prefix}_user.c"
    path.write_text(USER.format(prefix=prefix, PREFIX=prefix.upper()))
    return path


def gcc(*arguments: str | Path) -> str:
    """What gcc complains of; "" where it is content."""
    done = subprocess.run(
        [*STRICT, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    return done.stderr if done.returncode else ""


SHAPES = GOLDEN | {
    "direct-other-shift": integer_plan(
        integer_shape(order=2, output_shift=36),
        GOLDEN["direct-checked"].segments[0].coefficients[None].tolist(),
    )
}
"""The last is laid out as the first, word for word; only a shift of its routine differs."""
PAIRS = list(itertools.permutations(SHAPES, 2))


@pytest.fixture(scope="module")
def deliveries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What is delivered for each shape, and its objects: routine, constants and a caller."""
    folders = {name: tmp_path_factory.mktemp(name) for name in SHAPES}
    for name, folder in folders.items():
        write_generated(SHAPES[name], folder)
        for source in (folder / "triax_comp.c", folder / "triax_calib.c", user(folder)):
            assert gcc("-fPIC", "-c", source, "-o", source.with_suffix(".o")) == ""
    return folders


def test_they_are_30_pairs() -> None:
    assert len(PAIRS) == len({(names_of(SHAPES[a]).shape, names_of(SHAPES[b]).shape)
                              for a, b in PAIRS}) == 30  # fmt: skip


@pytest.mark.parametrize(("routine", "header"), PAIRS)
def test_what_was_compiled_for_one_shape_links_to_no_other(
    deliveries: dict[str, Path], tmp_path: Path, routine: str, header: str
) -> None:
    """Two static libraries: in either order, the caller gets its own routine or none."""
    objects = {
        name: [deliveries[name] / f"triax_{n}.o" for n in ("comp", "calib")]
        for name in (routine, header)
    }
    caller = deliveries[header] / "triax_user.o"
    program = tmp_path / "program"
    assert "undefined reference" in gcc(caller, *objects[routine], "-o", program)
    for order in ((header, routine), (routine, header)):
        both = [file for name in order for file in objects[name]]
        assert gcc(caller, *both, "-o", program) == ""
    symbols = subprocess.run(["nm", program], capture_output=True, text=True, check=True).stdout
    assert names_of(SHAPES[header]).linked in symbols


@pytest.mark.parametrize(("routine", "header"), PAIRS)
def test_headers_of_two_shapes_do_not_compile(
    deliveries: dict[str, Path], tmp_path: Path, routine: str, header: str
) -> None:
    shutil.copy(deliveries[header] / "triax_calib.h", tmp_path)
    for file in ("triax_comp.h", "triax_comp.c"):
        shutil.copy(deliveries[routine] / file, tmp_path)
    assert "take all files from one delivery" in gcc("-c", user(tmp_path), "-o", "/dev/null")
    both = tmp_path / "both.c"
    both.write_text(
        f'#include "{deliveries[routine]}/triax_comp.h"\n'
        f'#include "{deliveries[header]}/triax_comp.h"\nint unused;\n'
    )
    assert "two triax_comp.h of different shapes" in gcc("-c", both, "-o", "/dev/null")


@pytest.fixture(scope="module")
def loaders(deliveries: dict[str, Path]) -> dict[str, Callable[[bytes], tuple[int, bytes]]]:
    """For each shape: the status of its loader for an image, and what it left in a buffer."""

    def loader(name: str) -> Callable[[bytes], tuple[int, bytes]]:
        folder, names = deliveries[name], names_of(SHAPES[name])
        library = folder / "loader.so"
        made = gcc("-shared", folder / "triax_comp.o", folder / "triax_calib.o", "-o", library)
        assert made == ""
        function = getattr(ctypes.CDLL(str(library)), f"{names.linked}_calib_load")
        function.restype = ctypes.c_uint32

        def load(image: bytes) -> tuple[int, bytes]:
            buffer = ctypes.create_string_buffer(UNTOUCHED, len(UNTOUCHED))
            return function(buffer, image, ctypes.c_size_t(len(image))), buffer.raw

        return load

    return {name: loader(name) for name in SHAPES}


UNTOUCHED = b"\x55" * 4096
"""As large as any constants of `SHAPES`, or larger."""


@pytest.mark.parametrize(("routine", "image"), PAIRS)
def test_an_image_of_another_shape_and_prefix_is_refused(
    loaders: dict[str, Callable[[bytes], tuple[int, bytes]]], routine: str, image: str
) -> None:
    """And leaves the constants as they were; the routine takes its own, whatever its prefix."""
    other, own = (image_bytes(prefixed(SHAPES[name], "right")) for name in (image, routine))
    assert loaders[routine](other) == (BAD_IMAGE, UNTOUCHED)
    status, left = loaders[routine](own)
    assert status == 0
    assert left != UNTOUCHED


def test_constants_of_two_units_in_one_file_do_not_compile(tmp_path: Path) -> None:
    """Of one shape: the include guard no longer drops the second."""
    plan = next(iter(GOLDEN.values()))
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_generated(plan, tmp_path / name)
    header = tmp_path / "two" / "triax_calib.h"
    text = header.read_text()
    assert text.count("0x01234567u") == 2
    header.write_text(text.replace("0x01234567u", "0x89ABCDEFu"))
    both = tmp_path / "both.c"
    both.write_text('#include "one/triax_calib.h"\n#include "two/triax_calib.h"\nint unused;\n')
    assert "two triax_calib.h of different units" in gcc("-c", both, "-o", "/dev/null")
    both.write_text('#include "one/triax_calib.h"\n#include "one/triax_calib.h"\nint unused;\n')
    assert gcc("-c", both, "-o", "/dev/null") == ""


def prefixed(plan: Plan, prefix: str) -> Plan:
    return replace(plan, prefix=prefix)


@pytest.mark.parametrize("name", ["direct-checked", "inverse-saturating", "direct-quadratic"])
def test_two_sensors_of_one_program_answer_as_each_alone(tmp_path: Path, name: str) -> None:
    """Any shapes, one file that uses both; each as Python, compiled in and from its image."""
    plans = {
        "left": prefixed(GOLDEN[name], "left"),
        "right": prefixed(GOLDEN["direct-checked"], "right"),
    }
    for plan in plans.values():
        write_generated(plan, tmp_path)
    source = tmp_path / "both.c"
    source.write_text('#include "left_calib.h"\n#include "right_calib.h"\nint unused;\n')
    files = [tmp_path / f"{p}_{n}.c" for p in plans for n in ("comp", "calib")]
    assert gcc("-shared", "-fPIC", source, *files, "-o", tmp_path / "both.so") == ""
    rng = np.random.default_rng(1)
    for prefix, plan in plans.items():
        generated = Generated(start_generated(tmp_path, tmp_path, prefix).load())
        temp = rng.integers(plan.temp_min_code - 9, plan.temp_max_code + 9, 4000).astype(np.int32)
        raw = rng.integers(-(2**31), 2**31, (4000, 3)).astype(np.int32)
        accel, status = python_routine(plan)(temp, raw)
        found = generated.run(temp, raw)
        assert np.array_equal(found[0], accel)
        assert np.array_equal(found[1], status)
        loaded, found = generated.run_image(image_bytes(plan), temp, raw)
        assert loaded == 0
        assert np.array_equal(found[0], accel)


def test_a_prefix_changes_names_and_nothing_else(tmp_path: Path, built: dict[str, Built]) -> None:
    plan = prefixed(GOLDEN["direct-checked"], "wing")
    write_generated(plan, tmp_path)
    for file in ("comp.c", "comp.h", "calib.c", "calib.h"):
        text = (tmp_path / f"wing_{file}").read_text()
        default = (built["direct-checked"].folder / f"triax_{file}").read_text()
        for common in ("TRIAX_STATUS", "TRIAX_ARITHMETIC", "TRIAX_CALIB_SECTION"):
            assert text.count(common) == default.count(common)
        renamed = text.replace("wing", "triax").replace("WING", "TRIAX")
        assert renamed == default
    assert image_bytes(plan) == image_bytes(GOLDEN["direct-checked"])


MEMORY = """
#include <stdint.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>
#include "triax_calib.h"

static int32_t answer(void)
{
    triax_state_t state;
    const int32_t raw[3] = {1000000, -2000000, 3000000};
    int32_t accel[3];
    (void)triax_set_temperature(&state, &TRIAX_CALIB, 0);
    (void)triax_apply(&state, raw, accel);
    return accel[0];
}

int main(void)
{
    const int32_t *const word = &triax_calib_constants.segment[0].coefficient[3][0];
    const uintptr_t page = (uintptr_t)word & ~(uintptr_t)(sysconf(_SC_PAGESIZE) - 1);
    const int32_t before = answer();
    if (mprotect((void *)page, (size_t)sysconf(_SC_PAGESIZE), PROT_READ | PROT_WRITE) != 0) {
        return 2;
    }
    *(volatile int32_t *)(uintptr_t)word += 1 << 20;
    printf("%d %d\\n", (int)before, (int)answer());
    return 0;
}
"""


@pytest.mark.parametrize(
    "flags",
    [("-O2",), ("-O2", "-flto"), ("-O3", "-flto"), ("-O3", "-flto", "-fwhole-program")],
    ids=" ".join,
)
def test_a_changed_constant_is_used_under_every_optimisation(
    deliveries: dict[str, Path], tmp_path: Path, flags: tuple[str, ...]
) -> None:
    """As a calibration tool changes it in memory, between two calls of one function."""
    folder = deliveries["direct-checked"]
    source = tmp_path / "memory.c"
    source.write_text(MEMORY)
    files = [source, folder / "triax_comp.c", folder / "triax_calib.c"]
    program = tmp_path / "memory"
    command = ["gcc", "-D_DEFAULT_SOURCE", *flags, f"-I{folder}", *map(str, files)]
    subprocess.run([*command, "-o", str(program)], check=True)
    done = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    before, after = map(int, done.stdout.split())
    assert before != after


def test_a_linker_script_can_place_the_constants(
    deliveries: dict[str, Path], tmp_path: Path
) -> None:
    folder = deliveries["direct-checked"]
    for define, section in (
        ((), ".rodata.triax_calib"),
        (('-DTRIAX_CALIB_SECTION=__attribute__((section(".mine")))',), ".mine"),
    ):
        made = tmp_path / "calib.o"
        assert gcc(*define, "-c", folder / "triax_calib.c", "-o", made) == ""
        told = subprocess.run(["objdump", "-t", made], capture_output=True, text=True, check=True)
        line = next(x for x in told.stdout.splitlines() if x.endswith("calib_constants"))
        assert line.split()[3] == section


@pytest.mark.parametrize(
    "prefix",
    [
        "", "1st", "Left", "a b", "left-accel", "_left", "left_", "left__x", "triax_gyro", "string",
        "memory", "island", "tool", "wcsx", "a" * 21, "sig", "signal_a", "sig_x",
    ],
)  # fmt: skip
def test_a_prefix_that_is_no_good_name_is_refused(prefix: str) -> None:
    text = UNIT.read_text() + f'\n[firmware]\nprefix = "{prefix}"\n'
    with pytest.raises(RefusedError) as refused:
        unit_of_text("AT-SIM", text, "unit.toml")
    assert "[firmware] prefix" in str(refused.value)


def test_a_prefix_is_read() -> None:
    for prefix in ("x", "left_accel", "imu2_a", "s", "i", "to", "sig2", "si", "asig"):
        text = UNIT.read_text() + f'\n[firmware]\nprefix = "{prefix}"\n'
        assert unit_of_text("AT-SIM", text, "unit.toml").prefix == prefix
