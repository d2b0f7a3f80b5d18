"""A guided recording: frames go into the log and to the guide."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from itertools import pairwise
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuSamples, joined
from triaxcal.dynamic.several import read_recordings
from triaxcal.guide.firstnoise import is_stated, with_rest
from triaxcal.guide.firstunit import LOG_FILE, Place, write_first_unit
from triaxcal.guide.goals import goals_of
from triaxcal.guide.guide import FIRST_HOLD_S, Guide, Setting, Submit
from triaxcal.guide.stream import ImuStream
from triaxcal.guide.watch import Watch
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.rigkeys import RIG_FILE
from triaxcal.rig.records.rawlog import RawLog

_PART_NS = 500_000_000
"""Of frames that are looked at together."""


def at_once(work: Callable[[], DynamicResult]) -> Future[DynamicResult]:
    """Run a calibration here and now: where frames wait for it."""
    ended: Future[DynamicResult] = Future()
    try:
        ended.set_result(work())
    except RefusedError as refusal:
        ended.set_exception(refusal)
    return ended


def recorded_rig(folder: Path) -> RigDescription:
    """Rig description that unit.toml of an IMU names.

    Raises
    ------
    RefusedError
        When a file cannot be read, or it names none.
    """
    unit = read_dynamic(folder)
    if unit.file.rig is None:
        raise RefusedError(
            f"{unit.path}, [dynamic]",
            "names no rig description",
            expected=f'rig = "{RIG_FILE}" and recording = "{LOG_FILE}"',
        )
    return read_description(folder / unit.file.rig)


class GuidedRecording:
    """Records the frames of an IMU, and guides the operator.

    Parameters
    ----------
    folder : Path
        Of the unit.
    place : Place or None
        For the unit.toml that is written; None where there is one. rig.toml is there.
    channel : str
        Of frames that state none, for the log.
    submit : callable
        Runs calibrations.

    Attributes
    ----------
    unit : DynamicDescription
    guide : Guide or None
        None until rate and white noise are known.
    seconds : float
        Length of the recording.

    Raises
    ------
    RefusedError
        When a file cannot be read, the unit's recording is no log of a rig, or the log is there.
    """

    def __init__(self, folder: Path, place: Place | None, channel: str, submit: Submit) -> None:
        self._folder, self._submit = folder, submit
        if place is not None:
            write_first_unit(folder, read_description(folder / RIG_FILE), place)
        self.unit = read_dynamic(folder)
        self.rig = recorded_rig(folder)
        self.stream = ImuStream(self.rig)
        self._path = self.unit.recording
        if self._path.exists():
            raise RefusedError(
                str(self._path),
                "is there already",
                expected="a new recording",
                remedy="move it away, or record into the folder of another unit",
            )
        self.log = RawLog(self._path, channel)
        self.guide: Guide | None = None
        self.seconds = 0.0
        self._waiting: list[ImuSamples] = []
        self._watch: Watch | None = None

    def feed(self, frames: Frames) -> Iterator[None]:
        """Record frames, and look at them; something may be shown after each part.

        Raises
        ------
        RefusedError
            When the disk refuses, or a file of the unit is wrong.
        """
        if not len(frames):
            return
        latest_ns = np.maximum.accumulate(frames.t_ns)
        ends = np.arange(int(latest_ns[0]) + _PART_NS, int(latest_ns[-1]), _PART_NS)
        for first, last in pairwise([0, *np.searchsorted(latest_ns, ends).tolist(), len(frames)]):
            part = frames.take(slice(first, last))
            self.log.append(part)
            samples = self.stream.feed(part)
            if samples is not None:
                self._look(samples)
                yield

    def close(self) -> None:
        """Close the log; one without a sample is removed, as it would be in the way of another."""
        self.log.close()
        if not self.stream.count:
            self._path.unlink(missing_ok=True)

    def finish(self) -> None:
        """The recording has ended: wait for a calibration that is under way.

        Raises
        ------
        RefusedError
            When there was no sample.
        """
        if self.guide is not None:
            self.guide.finish()
        if not self.stream.count:
            raise RefusedError(
                str(self._path),
                f"no sample of {self.rig.name}",
                expected="frames of the rig that the description is about",
                remedy="`triaxcal rig check` says what is on a bus",
            )

    def _look(self, samples: ImuSamples) -> None:
        self.seconds = float(samples.time_s[-1])
        if self.guide is not None:
            if self.guide.done is None:
                self.guide.feed(samples)
            return
        self._waiting.append(samples)
        noise = self._noise(samples)
        if noise is None:
            return
        self.guide = self._new_guide(noise)
        for waiting in self._waiting:
            self.guide.feed(waiting)
        self._waiting = []

    def _noise(self, samples: ImuSamples) -> DataSheet | None:
        """White noise as stated, else that of the first rest; None while that is too short."""
        stated, rate_hz = self.unit.noise, self.stream.rate_hz
        if is_stated(stated):
            return stated
        assert rate_hz is not None
        if self._watch is None:
            self._watch = Watch(rate_hz)
        self._watch.feed(samples)
        if self._watch.resting_s < FIRST_HOLD_S:
            return None
        count = round((FIRST_HOLD_S - 1.0) * rate_hz)
        return with_rest(stated, joined(self._waiting)[-count:], rate_hz)

    def _new_guide(self, noise: DataSheet) -> Guide:
        unit, rate_hz = self.unit, self.stream.rate_hz
        assert rate_hz is not None
        layout = Layout((*BASE, *unit.state_blocks()))
        goals = goals_of(unit.limits, layout)
        setting = Setting(layout, noise, unit.gravity_m_per_s2, rate_hz, goals)
        return Guide(setting, self._calibrate, self._begin)

    def _begin(self, work: Callable[[], DynamicResult]) -> Future[DynamicResult]:
        """Begin a calibration of what the log holds; only this thread writes into it."""
        self.log.flush()
        return self._submit(work)

    def _calibrate(self) -> DynamicResult:
        """Calibrate the log as it is: what `triaxcal dynamic` would do now."""
        unit = read_dynamic(self._folder)
        return calibrate_dynamic(
            read_recordings(unit),
            unit.noise,
            unit.state_blocks(),
            reference_degc=unit.reference_degc,
        )
