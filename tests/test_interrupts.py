"""examples/double-buffer: an interrupt at any basic block sees the constants of one moment."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from builds import Built
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.image import image_bytes

EXAMPLE = Path(__file__).parent.parent / "examples" / "double-buffer"
RAW = (1_000_000, -2_000_000, 3_000_000)

# gcc calls __sanitizer_cov_trace_pc at every basic block of what is compiled for it: the interrupt.
HARNESS = """
#include <stdio.h>
#include <stdlib.h>
#include "accelerometer.h"
#include "triax_calib.h"

void __sanitizer_cov_trace_pc(void);

static int enabled;
static long interrupts;

#ifdef ONE_STATE
static triax_state_t only;
static uint32_t only_status;
void accelerometer_start(int32_t t) { only_status = triax_set_temperature(&only, &TRIAX_CALIB, t); }
void accelerometer_set_temperature(int32_t t) { accelerometer_start(t); }
uint32_t accelerometer_sample(const int32_t raw_code[3], int32_t accel[3])
{
    return only_status | triax_apply(&only, raw_code, accel);
}
uint32_t accelerometer_load(const uint8_t *file, size_t size) { (void)file; (void)size; return 0u; }
#endif

void __sanitizer_cov_trace_pc(void)
{
    const int32_t raw[3] = {RAW_CODES};
    int32_t accel[3];
    uint32_t status;
    if (!enabled) {
        return;
    }
    enabled = 0;
    status = accelerometer_sample(raw, accel);
    printf("%d %d %d %u\\n", (int)accel[0], (int)accel[1], (int)accel[2], (unsigned)status);
    interrupts++;
    enabled = 1;
}

int main(int argc, char **argv)
{
    static uint8_t image[65536];
    int i;
    FILE *file = fopen(argv[1], "rb");
    const size_t size = fread(image, 1, sizeof image, file);
    fclose(file);
    accelerometer_start(atoi(argv[2]));
    enabled = 1;
    for (i = 3; i < argc; i++) {
        accelerometer_set_temperature(atoi(argv[i]));
    }
    image[40] ^= 1u;
    if (accelerometer_load(image, size) == TRIAX_STATUS_OK) {
        return argc == 0;
    }
    image[40] ^= 1u;
    (void)accelerometer_load(image, size);
    enabled = 0;
    return interrupts > 100 ? 0 : 3;
}
"""


def samples(
    b: Built, tmp_path: Path, image: bytes, temps: list[int], *flags: str
) -> set[tuple[int, ...]]:
    """Every answer that the interrupt gave, as x, y, z, status."""
    main, file, program = tmp_path / "main.c", tmp_path / "image.bin", tmp_path / "program"
    main.write_text(HARNESS.replace("RAW_CODES", ", ".join(map(str, RAW))))
    file.write_bytes(image)
    include = [f"-I{b.folder}", f"-I{EXAMPLE}"]
    objects = []
    traced = [b.folder / "triax_comp.c", b.folder / "triax_calib.c"]
    if not flags:
        traced.append(EXAMPLE / "accelerometer.c")
    for source in [*traced, main]:
        made = tmp_path / f"{source.stem}.o"
        trace = ["-fsanitize-coverage=trace-pc"] if source in traced else []
        command = ["gcc", "-std=c99", "-O0", *flags, *trace, *include, "-c", str(source)]
        subprocess.run([*command, "-o", str(made)], check=True)
        objects.append(str(made))
    subprocess.run(["gcc", *objects, "-o", str(program)], check=True)
    told = subprocess.run(
        [str(program), str(file), *map(str, temps)], capture_output=True, text=True, check=True
    )
    return {tuple(map(int, line.split())) for line in told.stdout.splitlines()}


@pytest.fixture(scope="module")
def unit(built: dict[str, Built]) -> Built:
    return built["direct-checked"]


def answers(b: Built, temps: list[int]) -> set[tuple[int, ...]]:
    temp = np.array(temps, np.int32)
    raw = np.tile(np.array(RAW, np.int32), (len(temps), 1))
    accel, status = python_routine(b.plan)(temp, raw)
    return {(*row, int(s)) for row, s in zip(accel.tolist(), status, strict=True)}


def test_an_interrupt_sees_the_constants_of_one_temperature(unit: Built, tmp_path: Path) -> None:
    """While the temperature changes, a damaged image is refused and a good one is loaded."""
    low, high = unit.plan.temp_min_code, unit.plan.temp_max_code
    temps = [low, high, (low + high) // 2, high + 1]
    found = samples(unit, tmp_path, image_bytes(unit.plan), temps)
    assert found == answers(unit, temps)


def test_one_state_alone_would_be_torn(unit: Built, tmp_path: Path) -> None:
    """That the interrupts come where it matters: without the second state they see mixtures."""
    low, high = unit.plan.temp_min_code, unit.plan.temp_max_code
    found = samples(unit, tmp_path, image_bytes(unit.plan), [low, high], "-DONE_STATE")
    assert found - answers(unit, [low, high])
