"""Which cause would explain what failed: each is tried, none is guessed.

A trial repeats the failed tests as if its cause were there and allowed for. It explains the failure
where every chi-square then keeps its limit. Of the causes that describe the whole recording the
most likely one is named, and with it all that are nearly as likely. A trial that leaves a part of
the recording out, or changes the noise, has another chi-square, which cannot be compared: such a
cause needs a sign of its own in the recording, and is then named as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.progress import Progress
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.missing import Effect, without_others
from triaxcal.evidence.afresh import solved_beside_the_axis
from triaxcal.evidence.case import Case
from triaxcal.evidence.chance import EXPLAINED, chi_square, largest, lengths, stacked
from triaxcal.evidence.check import Cause, Evidence
from triaxcal.evidence.heldout import HeldOut, held_out_every
from triaxcal.evidence.suspect import Suspect, innovations_again
from triaxcal.evidence.trials import TRIALS
from triaxcal.model.types import FloatArray

EQUAL = 13.8
"""Chi-squares that differ by less than this are within a factor of 1000 in likelihood."""
MOST_LEFT = 1.0
"""Of the limits of the chi-squares, where a cause explains the failure."""


@dataclass(frozen=True)
class _Tried:
    cause: Cause
    total: float
    direct: bool = False
    innovations: float = 0.0
    rival: bool = False


def causes_of(
    found: Evidence, case: Case, off: Sequence[Effect], held: HeldOut | None, report: Progress
) -> Evidence:
    """The same evidence with the causes that explain its failed tests."""
    if not any(c.name in EXPLAINED for c in found.failed):
        return found
    tried = list(_effects(case, off, held, report))
    names = [f'block "{e.name}"' for e in off]
    for trial in TRIALS:
        report(f"trying {trial.name}", 0.0)
        suspect = trial.of(case, held)
        if suspect is not None:
            names.append(trial.name)
            tried.append(_of_suspect(suspect))
    explains = [t for t in tried if t.cause.left <= MOST_LEFT]
    together = [e for e in off if e.shown]
    if not explains and len(together) > 1:
        names.append(" with ".join(f'"{e.name}"' for e in together))
        explains = [t for t in [_together(case, together, held)] if t.cause.left <= MOST_LEFT]
    if not explains:
        report("trying a unit beside the table's axis", 0.0)
        suspect = solved_beside_the_axis(case)
        explains = [] if suspect is None else [_of_suspect(suspect)]
    effects = [t.innovations for t in explains if not t.direct]
    direct = [
        t
        for t in explains
        if t.direct and not (t.rival and t.innovations + EQUAL > min(effects, default=np.inf))
    ]
    likely = sorted((t for t in explains if not t.direct), key=lambda t: t.total)
    likely = [t for t in likely if t.total - likely[0].total < EQUAL]
    named = tuple(t.cause for t in (*direct, *likely))
    return replace(found, causes=named, tried=tuple(names))


def _together(case: Case, shown: Sequence[Effect], held: HeldOut | None) -> _Tried:
    """All effects that are off and shown, where none of them explains it alone."""
    blocks = (block for effect in shown for block in EXTENSIONS[effect.name].blocks)
    layout = Layout((*case.result.layout.blocks, *blocks))
    out = None if held is None else held_out_every(case, held.every, layout=layout)
    titles = " and ".join(effect.title for effect in shown)
    names = ", ".join(f'"{effect.name}"' for effect in shown)
    words = f"{titles} together, which are switched off"
    remedy = f"switch on {names} in [dynamic] blocks"
    return _of_suspect(Suspect(words, remedy, innovations_again(case, layout=layout), out))


def _of_suspect(suspect: Suspect) -> _Tried:
    last = suspect.innovations
    left = [last[0] / largest(last[1])]
    total = last[0]
    if suspect.held is not None:
        shares, more = _held_shares(*stacked(suspect.held))
        left += shares
        total += more
    cause = Cause(suspect.words, suspect.remedy, max(left))
    return _Tried(cause, total, suspect.direct, last[0], suspect.rival)


def _held_shares(y: FloatArray, covariance: FloatArray) -> tuple[list[float], float]:
    rest = lengths(y)
    values = [chi_square(y, covariance, which) for which in (rest, ~rest)]
    shares = [v / largest(int(which.sum())) for v, which in zip(values, (rest, ~rest), strict=True)]
    return shares, sum(values)


def _effects(
    case: Case, off: Sequence[Effect], held: HeldOut | None, report: Progress
) -> Iterator[_Tried]:
    """Each effect that is off, alone: one pass with the states of all, the others then zero."""
    if not off:
        return
    result = case.result
    entries = [EXTENSIONS[e.name] for e in off]
    layout = Layout((*result.layout.blocks, *(b for entry in entries for b in entry.blocks)))
    last, base = result.passes[-1], np.arange(len(result.layout))
    out = None
    if held is not None:
        report("trying effects", 0.0)
        out = held_out_every(case, held.every, layout=layout)
    for effect, entry in zip(off, entries, strict=True):
        own = [np.arange(len(layout))[layout.place(b.name)] for b in entry.blocks]
        kept = np.unique(np.concatenate([base, *own]))
        value = last.chi_square - effect.alone
        left, total = [value / largest(last.freedom)], value
        if out is not None:
            step, covariance = without_others(out.step, out.covariance, kept)
            stretches = tuple(
                replace(s, y=s.y + s.J @ out.step - s.J[:, kept] @ step, J=s.J[:, kept])
                for s in out.stretches
            )
            alone = replace(out, step=step, covariance=covariance, stretches=stretches)
            shares, more = _held_shares(*stacked(alone))
            left += shares
            total += more
        words = f"{effect.title}, which is switched off"
        remedy = f'switch on "{effect.name}" in [dynamic] blocks'
        if effect.hint:
            remedy += f", unless: {effect.hint}"
        yield _Tried(Cause(words, remedy, max(left)), total, innovations=value)
