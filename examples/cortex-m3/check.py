"""Runs the firmware in QEMU and compares what it prints with the host's own reference C.

The reference (firmware_ref/triax_ref.c) is compiled with the host's gcc and reads the same image:
another program on another machine must give the same integers. Only Python's standard library.
"""

import ctypes
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
REFERENCE = HERE.parents[1] / "firmware_ref"
SECONDS = 120


def samples() -> list[tuple[int, list[int]]]:
    """Read the samples out of main.c."""
    names = {"INT32_MAX": str(2**31 - 1), "INT32_MIN": str(-(2**31))}
    rows = re.findall(r"\{(-?\d+), \{([^}]*)\}\}", (HERE / "main.c").read_text())
    return [(int(t), [int(names.get(c, c)) for c in raw.split(", ")]) for t, raw in rows]


def expected(image: bytes) -> list[str]:
    """Lines that the firmware must print."""
    lines = ["calibration loaded", "damaged copy refused"]
    vectors = samples()
    with tempfile.TemporaryDirectory() as name:
        library = Path(name) / "reference.so"
        sources = [str(REFERENCE / f) for f in ("triax_ref.c", "triax_ref_image.c")]
        subprocess.run(["gcc", "-O2", "-shared", "-fPIC", *sources, "-o", library], check=True)
        reference = ctypes.CDLL(str(library))
        n = len(vectors)
        temp = (ctypes.c_int32 * n)(*(t for t, _ in vectors))
        raw = (ctypes.c_int32 * (3 * n))(*(c for _, codes in vectors for c in codes))
        accel, status = (ctypes.c_int32 * (3 * n))(), (ctypes.c_uint32 * n)()
        size = ctypes.c_size_t(len(image))
        if reference.triax_ref_batch(image, size, ctypes.c_size_t(n), temp, raw, accel, status):
            sys.exit("check: the reference refused the image")
    for i in range(n):
        a = accel[3 * i : 3 * i + 3]
        lines.append(f"{a[0]} {a[1]} {a[2]} status {status[i]}")
    return [*lines, "done"]


def main() -> None:
    """Compare, and tell the first difference."""
    generated, qemu, firmware = sys.argv[1:]
    command = [
        qemu, "-M", "mps2-an385", "-nographic", "-monitor", "none", "-serial", "stdio",
        "-semihosting-config", "enable=on,target=native", "-kernel", firmware,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=True)
    found = done.stdout.splitlines()
    wanted = expected((Path(generated) / "triax_calib.bin").read_bytes())
    for line, (f, w) in enumerate(zip(found, wanted, strict=False), 1):
        if f != w:
            sys.exit(f"check: line {line}: the firmware printed '{f}', expected '{w}'")
    if len(found) != len(wanted):
        sys.exit(f"check: the firmware printed {len(found)} lines, expected {len(wanted)}")
    print(f"check: {len(found)} lines as expected")


if __name__ == "__main__":
    main()
