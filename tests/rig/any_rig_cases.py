"""Simulated units for the shipped rig descriptions, and sessions with them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rig_cases import FAST, SHORT_PLAN

from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.simulated.simorders import read_fault
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.simulation.truth import read_truth
from triaxcal.unit.description import read_unit

UNIT = """
format = 1
serial = "{serial}"
[adc]
{adc}
[temperature_sensor]
{sensor}
[site]
local_gravity_m_per_s2 = 9.8111
[thermal]
t0_degc = 20
range_degc = [20, 40]
"""
TRUTH = """
format = 1
[curves]
t0_degc = 20
Kxx = [{k}, 1e-5, 0, 0]
Kxy = [0.001, 0, 0, 0]
Kxz = [-0.002, 0, 0, 0]
Kyx = [0.0015, 0, 0, 0]
Kyy = [{k}, -2e-5, 0, 0]
Kyz = [0.001, 0, 0, 0]
Kzx = [-0.001, 0, 0, 0]
Kzy = [0.002, 0, 0, 0]
Kzz = [{k}, 1e-5, 0, 0]
U0x = [{zero}, 0, 0, 0]
U0y = [{zero}, 0, 0, 0]
U0z = [{zero}, 0, 0, 0]
[noise]
reading_sd_v = {sd}
thermometer_sd_degc = 0.01
dwell_temp_sd_degc = 0.0
[plan]
seed = 1
readings_per_dwell = 100
temperatures_degc = [20]
check_temperatures_degc = []
"""


@dataclass(frozen=True)
class Kind:
    """A simulated unit: its ADC and thermometer, its truth in V, and the largest u(A)."""

    adc: str
    sensor: str
    k: float
    zero: float
    sd: float
    u_max: float = 15.0


OFFSET_BINARY = "bits = 17\ncode_min = 0\ncode_max = 65535\nfull_scale_v = "
FINE_DEGC = "degc_per_code = 0.0078125"
KINDS = {
    "tilter": Kind("bits = 24\nfull_scale_v = 2.5", FINE_DEGC, -0.55, 0.004, 8e-5),
    "tilter-fd": Kind("bits = 24\nfull_scale_v = 2.5", FINE_DEGC, -0.55, 0.004, 8e-5),
    # 0 g is the code 32768, and 1 V stands for 1 g.
    "automotive-imu": Kind(
        OFFSET_BINARY + "8", "degc_per_code = 1\ndegc_at_zero = -50", 1.0, 4.0, 3e-4
    ),
    # An accelerometer session of an IMU: its gyros stand still. 1 V stands for 1 g.
    "can-imu": Kind("bits = 16\nfull_scale_v = 8", FINE_DEGC, 1.0, 0.004, 5e-4),
    # 0 g is the code 32000; one code is 0.01 m/s^2.
    "j1939-inclinometer": Kind(
        OFFSET_BINARY + "66.8281", "degc_per_code = 0.03125\ndegc_at_zero = -273",
        1.0, 320.0 / 9.80665, 2e-3, 100.0,
    ),
    # 1 V stands for 1 m/s^2.
    "canopen-float": Kind("bits = 24\nfull_scale_v = 50", FINE_DEGC, 9.80665, 0.02, 2e-3, 15.0),
}  # fmt: skip


def any_setup(folder: Path, name: str, temps: str = "[20]") -> Setup:
    """Session of a unit that is made for a shipped description."""
    kind, unit = KINDS[name], folder / "AT-0042"
    unit.mkdir(exist_ok=True)
    text = UNIT.format(serial="AT-0042", adc=kind.adc, sensor=kind.sensor)
    (unit / "unit.toml").write_text(text)
    (unit / "truth.toml").write_text(TRUTH.format(**vars(kind)))
    plan = SHORT_PLAN.format(rate=100, layout="classic", temps=temps, take="false")
    plan = plan.replace('layout = "classic"', f'rig = "{name}"')
    plan = plan.replace("u_max_micro_g = 15.0", f"u_max_micro_g = {kind.u_max}")
    if not name.startswith("tilter"):
        plan = plan.replace("volts_per_g = [-0.55, -0.55, -0.55]\n", "")
    (folder / "plan.toml").write_text(plan)
    description = read_unit(unit)
    session = read_plan(folder / "plan.toml", description)
    return Setup(unit, description, session, read_description(session.rig))


def any_rig(setup: Setup, *orders: str, **settings) -> SimulatedRig:
    """The simulated rig of a session."""
    truth, _ = read_truth(setup.folder)
    faults = tuple(read_fault(order) for order in orders)
    return SimulatedRig(
        setup.unit, truth, setup.plan, setup.rig, RigSettings(**{**FAST, **settings}), faults
    )
