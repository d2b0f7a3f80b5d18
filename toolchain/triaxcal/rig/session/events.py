"""What goes into a session and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from triaxcal.rig.session.reasons import Reason
from triaxcal.rig.session.stillness import Reference


@dataclass(frozen=True)
class Agree:
    """The operator agrees to take the offered position out of order."""


@dataclass(frozen=True)
class Redo:
    """The operator wants a position of this temperature again."""

    position: str


Command = Agree | Redo
Kind = Literal[
    "reference", "equilibrium", "accepted", "refused", "found", "offer", "superseded", "left",
    "trouble", "done",
]  # fmt: skip
Stage = Literal["reference", "temperature", "turn", "still", "settle", "average", "guard", "done"]


@dataclass(frozen=True)
class AcceptedDwell:
    """One accepted average.

    Attributes
    ----------
    step : int
        Place of the temperature in the plan, from 0.
    temp_code : float
        Mean code of the thermometer.
    mean_code, u_code, batch_sd_code : tuples of three floats
        As `stillness.Average`; x, y, z.
    start_ns, end_ns : int
        Arrival of the first sample of the first and the last block averaged.
    lost, bad_crc : int
        Samples lost and frames with a wrong CRC among the averaged.
    """

    step: int
    position: str
    temp_code: float
    temp_degc: float
    mean_code: tuple[float, float, float]
    u_code: tuple[float, float, float]
    batch_sd_code: tuple[float, float, float]
    batches: int
    readings: int
    start_ns: int
    end_ns: int
    lost: int
    bad_crc: int


@dataclass(frozen=True)
class Event:
    """Something that the session decided.

    Attributes
    ----------
    kind : Kind
        Those in `DURABLE` must survive a crash.
    t_ns : int
        When, by the frames' own times.
    text : str
        One line for the operator.
    step : int
        Of the plan, from 0.
    reasons : tuple of Reason
        Why something was refused or complained of; the journal has their text only.
    """

    kind: Kind
    t_ns: int
    text: str
    step: int
    dwell: AcceptedDwell | None = None
    reference: Reference | None = None
    temp_degc: float | None = None
    reasons: tuple[Reason, ...] = ()


DURABLE: tuple[Kind, ...] = ("reference", "equilibrium", "accepted")
"""Kinds of event that a resumed session starts from."""


@dataclass(frozen=True)
class View:
    """What the operator should see; all of it for reading only.

    Attributes
    ----------
    phase : Stage
    order : str
        What to do, in two or three words for big letters.
    headline : str
        The one imperative line.
    wanted, seen, offered : str or None
        Positions.
    target_degc : float or None
        Temperature of the present step; None when done.
    progress : tuple of int
        Seconds done and to do of the present phase.
    checklist : tuple of (position, state)
        Of this step: "done", "now", "redo" or "open".
    mean_g, sd_micro_g, slope_micro_g_per_min, u_micro_g : tuples of three floats, or None
        Of the present rest, by the nominal scale.
    left_s : float or None
        Estimated seconds to the end of the session.
    """

    phase: Stage
    order: str
    headline: str
    wanted: str | None
    seen: str | None
    offered: str | None
    step: int
    steps: int
    target_degc: float | None
    progress: tuple[int, int]
    checklist: tuple[tuple[str, str], ...]
    mean_g: tuple[float, float, float] | None
    sd_micro_g: tuple[float, float, float] | None
    slope_micro_g_per_min: tuple[float, float, float] | None
    u_micro_g: tuple[float, float, float] | None
    temp_degc: float | None
    temp_slope_k_per_min: float | None
    left_s: float | None
    lost: int
    bad_crc: int
    accepted: int
    to_accept: int
    last_event: str
