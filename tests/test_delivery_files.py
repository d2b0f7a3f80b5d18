"""The files of a delivery: the same bytes everywhere, valid, and of one another."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from triaxcal import __version__
from triaxcal.codegen.identity import IDENTITY_SIZE, Identity, identity_of
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.outputs.image import IMAGE_FILE
from triaxcal.codegen.tryout import model_error_g
from triaxcal.delivery.order import ERROR_SHARE
from triaxcal.delivery.unit import Delivery
from triaxcal.model.metrological import exact_gain_and_offset, worst_force_error_g
from triaxcal.report.files import all_files

UNITS = Path(__file__).parent.parent / "units"


@pytest.fixture(scope="module")
def files(delivered: dict[str, Delivery]) -> dict[str, dict[str, bytes]]:
    return {name: all_files(d) for name, d in delivered.items()}


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_another_delivery_elsewhere_gives_the_same_bytes(
    files: dict[str, dict[str, bytes]], tmp_path: Path, unit: str
) -> None:
    """Another process, folder, clock zone, locale, hash seed and number of threads."""
    elsewhere = tmp_path / "an other place"
    shutil.copytree(UNITS / unit, elsewhere / unit)
    environment = {
        **os.environ,
        "TZ": "Pacific/Kiritimati",
        "LC_ALL": "C",
        "PYTHONHASHSEED": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "TMPDIR": str(tmp_path),
    }
    command = [sys.executable, "-m", "triaxcal", "calib", f"./{unit}", "--build", "out"]
    done = subprocess.run(
        command, cwd=elsewhere, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    written = {p.name: p.read_bytes() for p in (elsewhere / "out" / unit).iterdir()}
    assert set(written) == set(files[unit])
    for name, content in files[unit].items():
        assert written[name] == content, name
    assert sorted(p.name for p in elsewhere.iterdir()) == sorted([unit, "out"])
    assert [p.name for p in (elsewhere / "out").iterdir()] == [unit]


def strict_json(content: bytes) -> dict[str, object]:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    document = json.loads(content.decode("utf-8"), parse_constant=refuse)
    assert isinstance(document, dict)
    return document


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_json_files_are_valid_and_their_hashes_match(
    files: dict[str, dict[str, bytes]], delivered: dict[str, Delivery], unit: str
) -> None:
    verification = strict_json(files[unit]["verification.json"])
    calibration = strict_json(files[unit]["calibration.json"])
    inputs = hashlib.sha256(
        b"".join(
            hashlib.sha256((UNITS / unit / name).read_bytes()).digest()
            for name in ("unit.toml", "measurements.csv")
        )
    ).hexdigest()
    for document in (verification, calibration):
        assert document["format"] == 1
        assert document["unit"] == unit
        assert document["inputs_sha256"] == inputs
    hashes = verification["files_sha256"]
    assert isinstance(hashes, dict)
    assert set(hashes) == {
        "triax_calib.h", "triax_calib.c", "triax_comp.h", "triax_comp.c", "triax_calib.bin",
        "triax_selftest.h", "triax_selftest.c",
    }  # fmt: skip
    for name, digest in hashes.items():
        assert digest == hashlib.sha256(files[unit][name]).hexdigest()
    header = files[unit]["triax_calib.h"].decode()
    assert f"inputs sha256 {inputs[:16]}" in header
    check, bound = verification["cross_check"], verification["arithmetic_bound"]
    assert isinstance(check, dict)
    assert isinstance(bound, dict)
    assert check["mismatches"] == 0
    assert sum(check["vectors"].values()) == delivered[unit].check.total > 2_000_000
    assert bound["largest_seen_lsb"] <= bound["lsb"] <= 1.0
    assert bound["g"] == bound["lsb"] * 2.0**-24
    assert max(bound["per_axis_lsb"]) == bound["lsb"]


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_curves_in_calibration_json_give_the_model_again(
    files: dict[str, dict[str, bytes]], delivered: dict[str, Delivery], unit: str
) -> None:
    document = strict_json(files[unit]["calibration.json"])
    model = document["thermal_model"]
    assert isinstance(model, dict)
    thermal = delivered[unit].calibration.thermal
    for temp in (-40.0, -12.5, 20.0, 61.0, 70.0):
        inner = model["breaks_degc"][1:-1]
        s = sum(temp >= b for b in inner)
        dt = temp - model["origins_degc"][s]
        rows = model["coefficients"][s]
        values = [sum(c * dt**n for n, c in enumerate(row)) for row in rows]
        # Another order of the same additions: a few roundings of constants below 1.
        assert np.abs(np.array(values) - thermal.constants_at(temp)).max() <= 1e-15


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_c_and_image_hold_the_same_constants(
    files: dict[str, dict[str, bytes]], delivered: dict[str, Delivery], unit: str
) -> None:
    text = files[unit]["triax_calib.c"].decode()
    body = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL).split("calib_constants = ")[1]
    in_c = [int(n) for n in re.findall(r"-?\b\d+\b", body)]
    image = files[unit][IMAGE_FILE][:-IDENTITY_SIZE]
    assert image == image_bytes(delivered[unit].plan)
    assert in_c == list(struct.unpack(f"<{len(image) // 4}i", image))[15:-1]


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_the_image_says_whose_it_is(
    files: dict[str, dict[str, bytes]], delivered: dict[str, Delivery], unit: str
) -> None:
    made = delivered[unit]
    sensor = made.unit.temperature_sensor
    assert identity_of(files[unit][IMAGE_FILE]) == Identity(
        serial=made.unit.serial,
        date="" if made.unit.measured.date is None else str(made.unit.measured.date),
        inputs_sha256=made.inputs_sha256,
        generator=__version__,
        axes="",
        degc_per_code=sensor.degc_per_code,
        degc_at_zero=sensor.degc_at_zero,
    )


@pytest.mark.parametrize("unit", ["AT-CHERNIAK", "AT-SIM"])
def test_stated_model_error_is_that_of_the_planned_functions(
    delivered: dict[str, Delivery], unit: str
) -> None:
    """Measured again from the compensation itself, at every code, over the raw box."""
    delivery = delivered[unit]
    temps = delivery.plan.temp_codes * delivery.unit.temperature_sensor.degc_per_code
    adc = delivery.unit.adc
    expected = worst_force_error_g(
        delivery.firmware.compensation.gain_and_offset(temps),
        exact_gain_and_offset(delivery.calibration.thermal.constants_at(temps)),
        max(-adc.code_min, adc.code_max) * adc.volts_per_code,
    ).max()
    found = model_error_g(delivery.unit, delivery.calibration.thermal, delivery.plan)
    assert found == delivery.model_error_g
    total = found + delivery.bound.lsb * 2.0**-delivery.plan.shape.output_q
    assert delivery.firmware.error_g == total
    # The plan's functions are the same polynomials about another origin: 1e-15 of 2 g/V x 2.5 V.
    assert abs(found - expected) <= 1e-13
    assert delivery.firmware.functions.share <= ERROR_SHARE
