"""A tilter rig that does not exist: exact physics, a chamber, noise, frames, faults to order.

Force -> U = K(T) a + U0(T) -> noise -> codes -> frames, sample by sample; the truth is that of
the unit's truth.toml. The same seed and the same orders give the same frames.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.identity import sent_serial
from triaxcal.rig.hands.equipment import POSITIONS
from triaxcal.rig.plan.nominal import coding_of
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.simulated.simfaults import with_frame_faults
from triaxcal.rig.simulated.simframes import FrameMaker
from triaxcal.rig.simulated.simorders import Fault
from triaxcal.simulation.tilts import truth_force_g
from triaxcal.simulation.truth import Truth, codes_of_voltage
from triaxcal.unit.description import UnitDescription

EPOCH_NS = 1_700_000_000 * 10**9
"""When simulated sessions begin."""
_VIBRATION_G = 0.02  # while turning
_CHAMBER_STEPS = 20
"""Of a second, for the chamber's equation of motion."""
_FLICKER_TAU_S = (1.0, 10.0, 100.0)


@dataclass(frozen=True)
class RigSettings:
    """How the simulated rig behaves.

    Attributes
    ----------
    chamber_tau_s, unit_tau_s : float
        Time constants of the chamber after its set point and of the unit after the chamber.
    overshoot : float
        Of the chamber, as a share of a step of its set point; 0 makes it first-order.
    cycle_k, cycle_s : float
        Amplitude and period of the chamber's cycling.
    flicker_micro_g : float
        Standard deviation of each of three slow noises, with correlation times 1, 10, 100 s.
    turn_s : float
        Seconds that a turn of the tilter takes.
    """

    seed: int = 1
    start_degc: float = 20.0
    chamber_tau_s: float = 30.0
    unit_tau_s: float = 80.0
    overshoot: float = 0.0
    cycle_k: float = 0.0
    cycle_s: float = 120.0
    flicker_micro_g: float = 0.0
    turn_s: float = 4.0


class SimulatedRig:
    """One rig; `advance` gives the frames of the next second."""

    def __init__(  # noqa: PLR0917
        self,
        unit: UnitDescription,
        truth: Truth,
        plan: SessionPlan,
        rig: RigDescription,
        settings: RigSettings = RigSettings(),
        faults: tuple[Fault, ...] = (),
    ) -> None:
        self.settings = settings
        self.seconds = 0
        self.position = plan.steps[0].positions[0]
        self.target_degc = settings.start_degc
        self._unit = unit
        self._truth = truth
        self._rate = plan.rate_hz
        self._faults = faults
        self._rng = np.random.Generator(np.random.PCG64(settings.seed))
        self._chamber_degc = self._temp_degc = settings.start_degc
        self._chamber_rate = 0.0
        self._from = truth_force_g(self.position, unit.gravity_g)
        self._turn_at: float | None = None
        self._turn_share = 1.0
        self._rested_since = -math.inf
        self._flicker_g = np.zeros((3, len(_FLICKER_TAU_S)))
        self._serial_is = rig.serial_is
        coding = coding_of(rig, unit)
        self._maker = FrameMaker(rig, self._rate, EPOCH_NS, coding)
        self._second = FrameMaker(rig, self._rate, EPOCH_NS, coding)
        self._second.restart(97, 12345)

    @property
    def temp_degc(self) -> float:
        """True temperature of the unit."""
        return self._temp_degc

    @property
    def chamber_degc(self) -> float:
        """True temperature of the chamber."""
        return self._chamber_degc

    @property
    def turning(self) -> bool:
        """A turn is under way, or has stopped half way."""
        return self._turn_at is not None

    def active(self, kind: str) -> Fault | None:
        """Fault of a kind that is in force now."""
        now = (f for f in self._faults if f.at_s <= self.seconds < f.at_s + f.length_s)
        return next((f for f in now if f.kind == kind), None)

    def turn_to(self, position: str) -> None:
        """Start a turn, unless it is there or on its way."""
        if self.active("astray"):
            position = POSITIONS[(POSITIONS.index(position) + 1) % len(TEST_POSITIONS)]
        if position == self.position and self._turn_share == 1.0:
            return
        self._from = truth_force_g(self.position, self._unit.gravity_g)
        self.position = position
        self._turn_at = float(self.seconds)
        self._turn_share = 0.5 if self.active("halt") else 1.0

    def advance(self) -> Frames:
        """Frames of the next second."""
        t_s = self.seconds + np.arange(self._rate) / self._rate
        force = self._force(t_s)
        temps = self._temperatures()
        codes = self._codes(force, temps, t_s)
        sensor = self._unit.temperature_sensor
        shown = temps[:: max(self._rate // 10, 1)]
        shown = shown + self._truth.thermometer_sd_degc * self._rng.standard_normal(len(shown))
        temp_codes = np.rint((shown - sensor.degc_at_zero) / sensor.degc_per_code).astype(np.int64)
        frames = self._frames(codes, temp_codes, t_s)
        self.seconds += 1
        return frames

    # ---- physics ----

    def _force(self, t_s: FloatArray) -> FloatArray:
        """Specific force of each sample, shape (n, 3), in g."""
        gravity = self._unit.gravity_g
        end = truth_force_g(self.position, gravity)
        force: FloatArray = np.repeat(end[None], len(t_s), axis=0)
        if self._turn_at is not None:
            share = (t_s - self._turn_at) / self.settings.turn_s
            share = np.clip(share, 0.0, self._turn_share)[:, None]
            aside = np.roll(end + self._from, 1) + np.array([0.3, 0.2, 0.1])
            path = (1 - share) * self._from + share * end + np.sin(math.pi * share) * aside
            path *= gravity / np.linalg.norm(path, axis=1)[:, None]
            shaking = (share > 0.0) & (share < self._turn_share)
            path += shaking * _VIBRATION_G * self._rng.standard_normal((len(t_s), 3))
            force = np.where(share < 1.0, path, force)
            if share[-1, 0] >= 1.0:
                self._rested_since = self._turn_at + self.settings.turn_s
                self._turn_at = None
        return force + self._disturbances(t_s)

    def _disturbances(self, t_s: FloatArray) -> FloatArray:
        """Nudges, slips and creep, on an axis across gravity; a turn undoes slips and creep."""
        added = np.zeros((len(t_s), 3))
        axis = (int(np.argmax(np.abs(truth_force_g(self.position, 1.0)))) + 1) % 3
        for fault in self._faults:
            late = t_s - fault.at_s
            if fault.kind == "nudge":
                inside = (late >= 0.0) & (late < 0.3)
                added[:, axis] += inside * fault.value * 1e-3 * np.sin(late * 60.0)
            if fault.at_s < self._rested_since or self._turn_at is not None:
                continue
            if fault.kind == "slip":
                added[:, axis] += (late >= 0.0) * fault.value * 1e-6
            if fault.kind == "creep":
                grown = 1.0 - np.exp(-np.maximum(late, 0.0) / fault.length_s)
                added[:, axis] += fault.value * 1e-6 * grown
        return added

    def _temperatures(self) -> FloatArray:
        """True temperature of each sample of this second; chamber and unit go on by it."""
        settings = self.settings
        swing = settings.cycle_k * math.sin(2 * math.pi * self.seconds / settings.cycle_s)
        runaway = self.active("runaway")
        self._move_chamber(self.target_degc + (runaway.value if runaway else 0.0))
        before = self._temp_degc
        unit_share = -math.expm1(-1.0 / settings.unit_tau_s)
        self._temp_degc += unit_share * (self._chamber_degc + swing - before)
        share = np.arange(self._rate) / self._rate
        return before + share * (self._temp_degc - before)

    def _move_chamber(self, target_degc: float) -> None:
        """One second of the chamber: first order, or second order with its overshoot."""
        tau = self.settings.chamber_tau_s
        if not self.settings.overshoot:
            share = -math.expm1(-1.0 / tau)
            self._chamber_degc += share * (target_degc - self._chamber_degc)
            return
        log = math.log(self.settings.overshoot)
        damping = -log / math.hypot(math.pi, log)
        for _ in range(_CHAMBER_STEPS):
            pull = (target_degc - self._chamber_degc) / tau**2
            pull -= 2.0 * damping / tau * self._chamber_rate
            self._chamber_rate += pull / _CHAMBER_STEPS
            self._chamber_degc += self._chamber_rate / _CHAMBER_STEPS

    def _codes(self, force: FloatArray, temps: FloatArray, t_s: FloatArray) -> IntArray:
        adc = self._unit.adc
        if self.settings.flicker_micro_g:
            # Constant over the second: the slow noises are slower than that.
            keep = np.exp(-1.0 / np.array(_FLICKER_TAU_S))
            fresh = self.settings.flicker_micro_g * 1e-6 * self._rng.standard_normal((3, 3))
            self._flicker_g = self._flicker_g * keep + fresh * np.sqrt(1.0 - keep**2)
            force = force + self._flicker_g.sum(axis=1)
        voltage = self._truth.voltage_v(force, temps)
        voltage = voltage + self._truth.reading_sd_v * self._rng.standard_normal(voltage.shape)
        codes = codes_of_voltage(adc, voltage)
        for fault in self._faults:
            inside = (t_s >= fault.at_s) & (t_s < fault.at_s + fault.length_s)
            if fault.kind == "clipped":
                codes[inside, 0] = adc.code_max
            if fault.kind == "stuck":
                codes[inside, 1] = 4321
        return codes

    # ---- frames ----

    def _frames(self, codes: IntArray, temp_codes: IntArray, t_s: FloatArray) -> Frames:
        start, end = float(t_s[0]), float(t_s[0]) + 1.0
        sent = sent_serial(self._serial_is, self._unit.serial) or 0
        for fault in self._faults:
            if fault.kind == "serial" and start >= fault.at_s:
                sent ^= 1
            if fault.kind == "gone" and start <= fault.at_s + fault.length_s < end:
                self._maker.restart(0, 0)
        now = {f.kind: f for f in self._faults if f.at_s <= start < f.at_s + f.length_s}
        status = int(now["status"].value) if "status" in now else 0
        frames = self._maker.frames(
            codes, temp_codes, self.seconds, sent, status, temperature="notemp" not in now
        )
        if "twonodes" in now:
            other = self._second.frames(codes[::-1], temp_codes, self.seconds, sent)
            both = concatenate([frames, other])
            frames = both.take(np.argsort(both.t_ns, kind="stable"))
        return with_frame_faults(frames, self._faults, EPOCH_NS, self._rng)
