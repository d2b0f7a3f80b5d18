"""atheris targets: the readers of a unit's files raise RefusedError or nothing.

python fuzz/parsers.py unit.toml|measurements.csv [libFuzzer's options]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["triaxcal"]):
    from triaxcal.base.errors import RefusedError
    from triaxcal.readings.measurements import read_measurements
    from triaxcal.unit.description import read_unit

UNIT = b"""format = 1
serial = "FUZZ-1"
[adc]
bits = 24
full_scale_v = 2.5
[temperature_sensor]
degc_per_code = 0.0078125
[site]
local_gravity_m_per_s2 = 9.8111
[thermal]
t0_degc = 20
"""


def main() -> None:
    """Fuzz the reader that the first argument names."""
    file = sys.argv.pop(1)
    folder = Path(tempfile.mkdtemp(prefix="triaxcal-fuzz-")) / "FUZZ"
    folder.mkdir()
    (folder / "unit.toml").write_bytes(UNIT)
    unit = read_unit(folder)

    def one(data: bytes) -> None:
        (folder / file).write_bytes(data)
        try:
            if file == "unit.toml":
                read_unit(folder)
            else:
                read_measurements(folder / file, unit)
        except RefusedError as refusal:
            if "\n" in str(refusal):
                raise AssertionError(f"a refusal of several lines: {refusal}") from refusal

    atheris.Setup(sys.argv, one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
