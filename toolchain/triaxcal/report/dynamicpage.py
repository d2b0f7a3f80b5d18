"""dynamic.html: how the constants of an IMU were found, and what was shown of its C."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from triaxcal import __version__
from triaxcal.delivery.imu import ImuDelivery
from triaxcal.delivery.imuangles import not_in_them
from triaxcal.delivery.imuverdict import ON_RECORDING
from triaxcal.delivery.verdict import NOT_CHECKED, NOT_SHOWN, PASSED, REFUSED
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.observability import Weak
from triaxcal.evidence.chance import innovation_words
from triaxcal.report.imuc import NO_C, imu_verification
from triaxcal.report.imunoise import noise_words
from triaxcal.report.imurecording import STAYS_OFF_SD, effect_words, recorded_words
from triaxcal.report.overtemperature import over_context
from triaxcal.report.passport.angles import angles_context, arcsec_of_routine
from triaxcal.report.stated.statements import statements_of
from triaxcal.report.stated.words import label, value_words
from triaxcal.report.texts.html import page
from triaxcal.report.texts.speaker import speaker
from triaxcal.report.words.firmware import file_rows, theorem_rows, tool_rows
from triaxcal.report.words.numbers import signed, superscript, thousands
from triaxcal.unit.measured import MEASURED
from triaxcal.unit.passport import ENGLISH

PANEL_WIDTH, PANEL_HEIGHT = 228.0, 112.0
BAND = 10.0
"""Panels show so many final standard deviations on each side."""
FAR = 1000.0
"""Half panels: so far out a line has the right slope where it comes in."""
FEW = 12
"""Points of a short recording: each is marked."""
COVERAGE = 1.96
"""k of 95 % of a normal distribution."""
PLOT_LEFT, PLOT_WIDTH = 30.0, 670.0


def digits(value: float, sd: float) -> str:
    """Value to the second digit of its standard deviation."""
    places = min(max(0, 1 - math.floor(math.log10(sd))) if sd > 0 else 3, 9)
    return f"{round(value, places) + 0.0:.{places}f}"  # no minus before a nought


def weak_words(weak: Weak) -> str:
    """One combination that a motion determines poorly, in words."""
    common = " and ".join(weak.names)
    text = (
        f"a common change of {common} has a standard deviation of "
        f"{digits(weak.sd_each, weak.sd_each)} {weak.unit} each; every other combination has "
        f"{digits(weak.sd_next, weak.sd_next)} {weak.unit} or less"
    )
    return f"{text}: {weak.why}." if weak.why else f"{text}."


def dynamic_page(made: ImuDelivery, tools: Mapping[str, Mapping[str, Any]]) -> bytes:
    """HTML without network, clock or script.

    `tools` is the section of that name in verification.json: outcomes of each triad, and of both.
    """
    done = made.done
    result, seen = done.result, done.seen
    layout, time = result.layout, result.passes[-1].history.time_s
    labels = {state.name: state.label for state in layout.states}
    context = {
        "unit": done.unit,
        "badge": _badge(made),
        "facts": _facts(made),
        "warnings": _warnings(made),
        "checks": [(c.name, _named(c.words, labels), c.held) for c in made.verdict.checks],
        "recorded": [_sentence(words) for words in recorded_words(done)],
        "notes": made.verdict.notes,
        "stages": [
            {
                "axis": "xyz"[s.axis],
                "start": f"{s.start_s:.0f}",
                "end": f"{s.end_s:.0f}",
                "turns": f"{s.turned_rad / 2 / math.pi:.1f}",
            }
            for s in result.survey.stages
        ],
        "blocks": [
            {
                "title": block.title[0].upper() + block.title[1:],
                "panels": [_panel(result, i) for i in _range(layout.place(block.name))],
            }
            for block in layout.blocks
        ],
        "over": over_context(done.over),
        "innovations": _innovations(result),
        "minutes": f"{(time[-1] - time[0]) / 60:.0f}",
        "off": [
            (e.title, f"{e.chi_square:.1f}", e.states, e.name, e.shown, effect_words(e), e.hint)
            for e in done.off
        ],
        "unseen": [[labels[name] for name in names] for names in seen.unseen],
        "weak": [weak_words(_for_people(w, labels)) for w in seen.weak],
        "together": [(labels[a], labels[b], signed(f"{c:+.4f}")) for a, b, c in seen.together],
        "coverage": COVERAGE,
        "width": PANEL_WIDTH,
        "height": PANEL_HEIGHT,
        "angles": _angles(made),
        "no_c": f"No C: {NO_C.removeprefix('none: ')}",
        "verification": imu_verification(made),
        "tools": [
            row
            for group, entries in tools.items()
            for row in tool_rows(entries, f"{group.replace('_', ' ')}: ")
        ],
        "files": [
            *([] if made.c is None else file_rows(made.c.build.files)),
            *(row for entries in tools.values() for row in theorem_rows(entries)),
        ],
    }
    return page("dynamic.html.j2", t=speaker(ENGLISH), **context)


def _sentence(words: str) -> str:
    """With a capital and a full stop; the name of an axis stays small."""
    first = words[0] if words[1:2] == " " else words[0].upper()
    return signed(f"{first}{words[1:]}.")


def _named(words: str, labels: Mapping[str, str]) -> str:
    """The same with the labels of states in place of their names."""
    names = "|".join(map(re.escape, sorted(labels, key=len, reverse=True)))
    return re.sub(rf"\b(?:{names})\b", lambda found: labels[found[0]], words)


def _for_people(weak: Weak, labels: Mapping[str, str]) -> Weak:
    """The same with the labels of its states, and their signs."""
    signs = ("minus " if name.startswith("-") else "" for name in weak.names)
    names = (sign + labels[name.lstrip("-")] for sign, name in zip(signs, weak.names, strict=True))
    return replace(weak, names=tuple(names))


_BADGES = {
    PASSED: "PASSED",
    ON_RECORDING: "PASSED ON THE RECORDING",
    NOT_SHOWN: "NOT SHOWN",
    NOT_CHECKED: "NOT CHECKED",
    REFUSED: "REFUSED",
}


def _badge(made: ImuDelivery) -> tuple[bool, str, str]:
    """Whether the IMU has passed, and the words for it."""
    verdict = made.verdict
    return verdict.passed, _BADGES[verdict.result], innovation_words(made.done.result)


def _facts(made: ImuDelivery) -> list[tuple[str, str]]:
    unit, result = made.done.unit, made.done.result
    sections = len(result.survey.sections)
    recording = f"{unit.recording_words}: {thousands(result.survey.sections[-1].last + 1)} samples"
    freedom = thousands(result.passes[-1].freedom)
    states, passes = len(result.layout) + 3, len(result.passes)
    facts = [
        ("Serial number", unit.serial),
        ("Recording", recording + (f" in {sections} sections" if sections > 1 else "")),
        ("Place", signed(f"latitude {unit.latitude_deg:g}°, {unit.gravity_m_per_s2:.6g} m/s²")),
        ("Filter", f"{states} states, {passes} passes, {freedom} measurements"),
        ("Extensions", ", ".join(unit.blocks) or "none"),
        ("Noise", noise_words(result)),
    ]
    if made.c is not None:
        low, high = made.c.device.range_degc
        own = ""
        if made.c.device.two_thermometers:
            own = "; gyros {:g} to {:g} °C".format(*made.c.device.gyro_range)
        q = superscript(-made.c.device.accel_q), superscript(-made.c.device.gyro_rate_q)
        facts += [
            ("Working range", signed(f"{low:g} to {high:g} °C{own}")),
            ("Firmware", f"LSB 2{q[0]} g, 2{q[1]} °/s"),
        ]
    stated, t = statements_of(MEASURED, unit.measured), speaker(ENGLISH)
    return [
        *facts,
        *((label(s.name, t), value_words(s, t)) for s in stated if s.value is not None),
        ("Made by", f"triaxcal {__version__}"),
        ("Inputs", f"sha256 {made.inputs_sha256[:16]}…"),
    ]


def _warnings(made: ImuDelivery) -> list[str]:
    """What must be seen before the constants are used."""
    verdict = made.verdict
    words = [] if verdict.passed else [verdict.words]
    found = [f"{text[0].upper()}{text[1:]}." for text in (*words, *verdict.not_tested)]
    for effect in made.done.off:
        if effect.shown and effect.moves_sd >= STAYS_OFF_SD:
            found.append(
                f"The recording shows an effect that is switched off, {effect.title}: it would "
                f"move no constant by more than {effect.moves_sd:.2g} standard deviations. Switch "
                f'on "{effect.name}" in [dynamic] blocks.'
            )
    return found


def _angles(made: ImuDelivery) -> dict[str, Any] | None:
    """Context of the section on the angles; None where the device makes none."""
    found = made.angles
    check = None if made.c is None else made.c.build.angles_check
    if found is None or check is None:
        return None
    first, second = arcsec_of_routine(check)
    note = (
        "Worst orientation. In it: the standard deviations of the accelerometers' constants with "
        "their correlations, the rounding of the codes, and the C. Not in it: "
        f"{'; '.join(not_in_them(made.done))}. The routine itself is within {first} and {second} "
        "arcsec: proven."
    )
    return angles_context(found, speaker(ENGLISH), note)


def _range(place: slice) -> range:
    return range(place.start, place.stop)


def _panel(result: DynamicResult, i: int) -> dict[str, Any]:
    """Estimate and its expanded uncertainty over time, about the final estimate."""
    state, history = result.layout.states[i], result.passes[-1].history
    time = np.array(history.time_s)
    p = np.array([row[i] for row in history.p])
    sd = np.array([row[i] for row in history.sd])
    final, unit_sd = result.p[i] / state.per_unit, result.sd[i] / state.per_unit
    expanded, span = COVERAGE * unit_sd, BAND * result.sd[i]
    x = PANEL_WIDTH * (time - time[0]) / max(time[-1] - time[0], 1e-9)

    def y(values: Any) -> Any:
        return PANEL_HEIGHT / 2 * (1 - np.clip((values - result.p[i]) / span, -FAR, FAR))

    upper = [f"{a:.1f},{b:.1f}" for a, b in zip(x, y(p + COVERAGE * sd), strict=True)]
    lower = [f"{a:.1f},{b:.1f}" for a, b in zip(x, y(p - COVERAGE * sd), strict=True)]
    return {
        "name": state.label,
        "unit": state.unit.replace("^2", "²"),
        "value": signed(f"{digits(final, expanded)} ± {digits(expanded, expanded)}"),
        "scale": digits(BAND * unit_sd, BAND * unit_sd),
        "band": " ".join(upper + lower[::-1]),
        "line": " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y(p), strict=True)),
        "points": [(f"{a:.1f}", f"{b:.1f}") for a, b in zip(x, y(p), strict=True)]
        if len(x) <= FEW
        else [],
    }


def _innovations(result: DynamicResult) -> dict[str, Any]:
    """Chi-square per degree of freedom between checkpoints, with the band that noise fills."""
    history = result.passes[-1].history
    chi, freedom = np.array(history.chi_square), np.array(history.freedom, dtype=float)
    time = np.array(history.time_s)
    step = np.diff(freedom)
    keep = step > 0
    ratio = np.diff(chi)[keep] / step[keep]
    height, top = PANEL_HEIGHT, max(2.0, float(ratio.max(initial=0)) * 1.05)
    x = PLOT_LEFT + PLOT_WIDTH * (time[1:][keep] - time[0]) / max(time[-1] - time[0], 1e-9)
    band = 3 * np.sqrt(2 / step[keep])
    return {
        "height": height,
        "points": [
            {"x": f"{a:.1f}", "y": f"{height * (1 - r / top):.1f}", "out": bool(abs(r - 1) > b)}
            for a, r, b in zip(x, ratio, band, strict=True)
        ],
        "one": round(height * (1 - 1 / top), 1),
        "top": f"{top:.1f}",
    }
