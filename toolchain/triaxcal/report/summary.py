"""The terminal's summary of one delivery: short, aligned, in mg, micro-g, LSB and degC."""

from __future__ import annotations

from collections.abc import Iterable

from triaxcal.base.screentext import table
from triaxcal.delivery.order import Functions
from triaxcal.delivery.unit import Delivery
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.recorded import RecordingFit
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.report.passport.content import Passport
from triaxcal.report.stated.words import caution_words
from triaxcal.report.words.angles import angles_words
from triaxcal.report.words.measured import measured_words
from triaxcal.report.words.numbers import thousands
from triaxcal.report.words.shares import share_rows
from triaxcal.report.words.temperatures import by_temperature, degrees
from triaxcal.unit.arithmetic import HIGH_WORDS
from triaxcal.unit.choices import ESTIMATOR_WORDS

_LABEL = 16
CONDITION_SHOWN = 1e6
"""A condition number from here on says that a constant is not seen at all."""
HORNER_STEP_ON_M3 = 4
"""Instructions of one step in the portable C: load, SMULL, addition and the copy of the low word.
tests/targets counts them."""


def summary(made: Passport, files: Iterable[str], where: str) -> str:
    """Text of the summary; `files` lie in the folder `where`."""
    delivery = made.delivery
    blocks = [
        _head(made),
        _constants(delivery.calibration),
        *_shares(delivery.calibration),
        _candidates(delivery.calibration),
        _residuals(delivery),
        _uncertainty(made),
        _verdict(made),
        _entry("files", f"{where}/", ", ".join(sorted(files))),
    ]
    return "\n\n".join(blocks)


def _entry(label: str, *lines: str) -> str:
    indent = "\n" + " " * _LABEL
    return f"{label:<{_LABEL}}" + indent.join(lines)


def _head(made: Passport) -> str:
    delivery = made.delivery
    calibration, plan = delivery.calibration, delivery.plan
    low, high = calibration.range_degc
    measured = measured_words(delivery).removesuffix("; no check dwells")
    outside = len(delivery.measurements.dwells) - len(delivery.methods[0].residuals)
    if outside:
        measured += f"; {outside} of the dwells lie outside the range and are not in the residuals"
    codes = thousands(delivery.bound.codes, " ")
    method = f"{delivery.chosen.method.label}: {_method_words(delivery)}"
    return "\n".join(
        [
            _entry("unit", f"{delivery.unit.name}  (serial {delivery.unit.serial})"),
            _entry("measured", measured),
            *_findings(calibration),
            *([_entry("found", made.cause)] if made.cause else []),
            *(_entry("stated", caution_words(caution)) for caution in made.cautions),
            _entry("thermal model", calibration.selection_reason),
            _entry("method", method),
            *_order(delivery.firmware.functions),
            _entry(
                "range",
                f"{low:g} to {high:g} degC, {codes} temperature codes; "
                f"LSB 2^-{plan.shape.output_q} g",
            ),
        ]
    )


def _findings(calibration: Calibration) -> list[str]:
    """How well a recording's poses determine the constants, and what was found in them."""
    recording = calibration.recording
    found = [_entry("found", finding) for finding in calibration.findings]
    if recording is None:
        return found
    worth = f"condition number {recording.condition:.3g} (1 is the best)"
    worth += f"; the poses determine {recording.weakest} least" if recording.weakest else ""
    if not recording.condition < CONDITION_SHOWN:
        worth = f"the poses alone do not determine {recording.weakest}: [priors] bounds the rest"
    return [_held_out(recording), _entry("observability", worth), *found]


def _held_out(recording: RecordingFit) -> str:
    """The held-out error of a recording: |a| at poses outside the fit."""
    if recording.left_out_length_g is None:
        words = "none: no pose is determined by the others; the constants are not tested"
        return _entry("held out", words)
    rms, poses = recording.left_out_length_g * 1e3, len(recording.poses.poses)
    of = f", {recording.held_out_poses} of {poses}" if 0 < recording.held_out_poses < poses else ""
    return _entry("held out", f"|a| - g: {rms:.4f} mg rms at held-out poses{of}")


def _method_words(delivery: Delivery) -> str:
    shape = delivery.plan.shape
    segments = "one segment" if shape.segments == 1 else f"{shape.segments} segments"
    what = {"direct": "N(T) and offset", "inverse": "K(T) and U0(T), inverted on the device,"}
    return (
        f"{what[shape.form]} of order {shape.order} on {segments}; within "
        f"{delivery.model_error_g * 1e6:.3g} micro-g of K(T)^-1 (U - U0(T)) for every raw code"
    )


def _order(functions: Functions) -> list[str]:
    """Why the functions have their order, and what it saves."""
    if functions.share_max is None:
        return []
    order = functions.plan.shape.order
    share = (
        f"{order}: method and arithmetic are {functions.share:.3f} of the least standard "
        f"uncertainty, and add {functions.growth * 100:.2g} % to it"
    )
    if functions.share > functions.share_max:
        share += f"; more than {functions.share_max:g}: raise compensation.output_q"
    lines = [share]
    if saved := functions.coefficients_saved:
        steps = 12 * (functions.order_before - order)
        lines.append(
            f"within 1 micro-g it would be {functions.order_before}: saved are {saved} coefficients"
            f", {4 * saved} bytes of flash and {HORNER_STEP_ON_M3 * steps} instructions of "
            "set_temperature (Cortex-M3)"
        )
    return [_entry("order", *lines)]


def _constants(calibration: Calibration) -> str:
    t0 = calibration.thermal.t0_degc
    K, U0 = unpack_constants(calibration.thermal.constants_at(t0))
    unit = calibration.reading_unit
    scale, name = (1e3, "mV") if unit == "V" else (1.0, unit)
    rows = [
        [
            f"  {axis}",
            *(f"{K[i, j]:+.8f}" for j in range(3)),
            f"{U0[i] * scale:+.5f}",
        ]
        for i, axis in enumerate(AXES)
    ]
    of_gain = [f"K.{axis} {calibration.gain_unit}" for axis in AXES]
    head = [f"constants at {t0:g} degC", *of_gain, f"U0 {name}"]
    return "\n".join([*table(head, rows), *calibration.terms.lines()])


def _shares(calibration: Calibration) -> list[str]:
    """How much the poses, and how much the prior, determine each constant of a recording."""
    rows = share_rows(calibration)
    if not rows:
        return []
    cells = [[f"  {r.name}", r.value, r.sd, r.prior_sd, r.data, r.prior] for r in rows]
    head = ["determined by", "value", "sd", "prior's sd", "poses", "prior"]
    return ["\n".join(table(head, cells))]


def _candidates(calibration: Calibration) -> str:
    poses = calibration.recording is not None  # of which there is one estimator
    rows = [
        [
            f"{'*' if c.chosen else ' '} {c.short_label}",
            *([] if poses else [ESTIMATOR_WORDS[c.estimator]]),
            str(c.parameters),
            _micro_g(c.fit_residual_g),
            "-" if c.held_out_g is None else _micro_g(c.held_out_g),
            *([] if not poses else [_condition(c.condition)]),
        ]
        for c in calibration.candidates
    ]
    head = ["candidates, rms micro-g", *([] if poses else ["bias by"])]
    head += ["terms", "fitted", "held out", *(["condition"] if poses else [])]
    return "\n".join(table(head, rows))


def _condition(value: float | None) -> str:
    return "-" if value is None or not value < CONDITION_SHOWN else f"{value:.3g}"


def _micro_g(value_g: float) -> str:
    return f"{value_g * 1e6:.2f}" if value_g < 1e-4 else f"{value_g * 1e6:.0f}"


def _residuals(delivery: Delivery) -> str:
    """Largest | |a| - g | per temperature and method: figures 5 and 6 of P1 as a table."""
    methods = [m for m in delivery.methods if m.residuals]
    rows = []
    for kind, prefix in (("test", "TP"), ("check", "CP"), ("poses", "P")):
        for temp, indices in by_temperature(methods[0], prefix):
            largest = [max(abs(m.residuals[i].error_g) for i in indices) for m in methods]
            rows.append([f"  {degrees(temp)} degC, {kind}", *(f"{v * 1e3:.4f}" for v in largest)])
    names = [m.method.short_label for m in methods]
    head = ["max | |a| - g |, mg", *names]
    lines = table(head, rows)
    lines += [f"  {m.method.label}: {m.refusal}" for m in delivery.methods if m.refusal]
    return "\n".join(lines)


def _uncertainty(made: Passport) -> str:
    """Expanded uncertainty of the acceleration, its sources, and limits that it exceeds."""
    if not made.verdict.checked:
        unknown = (
            "unknown: there are as many constants as poses, so no residuals; record more poses"
        )
        return _entry("uncertainty", unknown)
    components, length = made.component_budget, made.length_budget
    reached = (
        f"95 %, worst orientation at 1 g: {_small_g(components.expanded)} a component, "
        f"{_small_g(length.expanded)} of |a|. {components.verdict}"
    )
    missed = [
        f"Of |a| {a.where} the main source is {a.cause}." for a in made.acceptance if not a.shown
    ]
    lines = [reached, *missed, *made.uncertainty.warnings]
    text = " ".join(lines).replace("°C", "degC").replace("µ", "micro-")
    return _entry("uncertainty", text)


def _high_words(delivery: Delivery) -> list[str]:
    """Whether what [firmware] arithmetic = "high-words" asks for was taken."""
    if delivery.plan.arithmetic != HIGH_WORDS:
        return []
    if delivery.plan.shape.high_words:
        return [
            _entry("", "products are summed by their high words, whose floors are in the error")
        ]
    return [_entry("", "64-bit sums: high words do not keep the share, or this form has none")]


def _angles(delivery: Delivery) -> list[str]:
    """Of triax_angles, where the device has it."""
    words = angles_words(delivery.firmware.angles, delivery.angles_check)
    if words is None:
        return []
    return [
        _entry(
            "angles",
            f"{words.names} within {words.proven} arcsec of the exact ones: proven; "
            f"{thousands(words.vectors, ' ')} vectors bit for bit",
        )
    ]


def _small_g(value_g: float) -> str:
    return f"{value_g * 1e3:.3g} mg" if value_g >= 1e-3 else f"{value_g * 1e6:.3g} micro-g"


def _verdict(made: Passport) -> str:
    delivery, verdict = made.delivery, made.verdict
    bound, check = delivery.bound, delivery.check
    q, vectors = delivery.plan.shape.output_q, thousands(check.total, " ")
    lines = [
        _entry(
            "arithmetic",
            f"proven error <= {bound.lsb:.3f} LSB ({bound.lsb * 1e6 / 2**q:.3f} micro-g); "
            f"largest seen {check.largest_error_lsb:.3f}",
        ),
        _entry(
            "",
            f"with the method's error <= {delivery.firmware.error_g * 2**q:.3f} LSB "
            f"({delivery.firmware.error_g * 1e6:.3f} micro-g) of K(T)^-1 (U - U0(T))",
        ),
        _entry("cross-check", f"{vectors} vectors bit for bit: Python = reference = generated C"),
        *_high_words(delivery),
        *_angles(delivery),
        "",
        _entry("verdict", verdict.words),
        *(f"  {line}" for line in table(verdict.heads, verdict.rows)),
        *([_entry("", verdict.note)] if verdict.note else []),
    ]
    return "\n".join(lines)
