"""The error bound as theorems that Coq checks, one for each axis and segment.

`gappa -Bcoq` writes a proof about reals that takes the script's hints for granted, as hypotheses.
Each of them is proven here by algebra, and the theorem is stated in the integers of
docs/explanation/fixed-point.md. Whoever runs `coqc` on the file trusts nothing of triaxcal but the
statement at its end, which holds the words of the delivered image.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction

from triaxcal.base.progress import Progress
from triaxcal.base.tools import TOOLS
from triaxcal.verify import gappa
from triaxcal.verify.campaign import guarded
from triaxcal.verify.image_reader import Image, read_image
from triaxcal.verify.outcome import NOT_DONE, PASSED, Outcome, judged
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import Workspace

COQ = TOOLS["coqc"]
KEY, TITLE = "coq", "Coq: error bound"

_HINT = re.compile(r"Hypothesis (a\d+) : ([^\n]*)\.\nLemma (b\d+) : \2\.\n apply \1\.\nQed\.\n")
_PROVEN_HINT = r"Lemma \3 : \2.\nProof. identity. Qed.\n"
_VARIABLE = re.compile(r"^Variable _(\w+) : R\.$", re.MULTILINE)
_END = "End Generated_by_Gappa.\n"
_LIBRARY = "Require Import Gappa.Gappa_library.\n"
_AXIOM = re.compile(r"^([\w.]+)(?= :|$)", re.MULTILINE)
CLASSICAL_REALS = frozenset(
    {
        "Classical_Prop.classic",
        "ClassicalDedekindReals.sig_forall_dec",
        "ClassicalDedekindReals.sig_not_dec",
        "FunctionalExtensionality.functional_extensionality_dep",
    }
)
"""What Coq's own library of real numbers takes for granted."""
_AS_IN_THE_SCRIPT = ("axis", "segment", "rate", "sensitivity", "preload", "high_words")
_FUNCTIONS = ("nx", "ny", "nz", "b")


@dataclass(frozen=True)
class Certificate:
    """A theorem and its proof.

    Attributes
    ----------
    file : str
        Name of the Coq file.
    axis, segment : int
        What it is about.
    text : str
        Of the file.
    low_lsb, high_lsb : Fraction
        The theorem: the device's result less the exact one lies between them.
    """

    file: str
    axis: int
    segment: int
    text: str
    low_lsb: Fraction
    high_lsb: Fraction

    @property
    def bound_lsb(self) -> float:
        """Larger magnitude of the two, rounded up."""
        largest = max(-self.low_lsb, self.high_lsb)
        value = float(largest)
        return value if Fraction(value) >= largest else math.nextafter(value, math.inf)


def _not_certified(image: Image) -> str:
    """Why there is no theorem about this kind of routine; empty when there is one."""
    if image.inverse_form:
        return (
            "not done for the inverse form: Gappa's intervals lose how the errors of adjugate and "
            "determinant cancel; the exact bound over every code stands alone"
        )
    if image.quadratic:
        return (
            "not done with quadratic terms: their share is bounded by a second Gappa script, which "
            "is not joined to the first in Coq; the exact bound over every code stands alone"
        )
    return ""


def certify(
    work: Workspace, part: str, progress: Progress | None = None
) -> tuple[Outcome, dict[str, bytes]]:
    """Write the theorems of a routine and have Coq check them, two at a time.

    Parameters
    ----------
    part : str
        Stands before the names of the files, where it is not empty.

    Returns
    -------
    Outcome
        Not done where a tool is missing or there is no theorem about this kind of routine; failed
        where Coq refuses one.
    dict
        The accepted files; empty unless the outcome is passed.
    """
    accepted: dict[str, bytes] = {}

    def check() -> Outcome:
        image = read_image(work.image)
        reason = _not_certified(image)
        if reason:
            return Outcome(KEY, TITLE, NOT_DONE, reason)
        gappa.GAPPA.find()
        program = COQ.find()
        jobs = [(axis, s) for axis in range(3) for s in range(len(image.segments))]
        written = [_certificate(work, image, part, axis, s) for axis, s in jobs]
        with ThreadPoolExecutor(2) as pool:
            found = []
            for names in pool.map(lambda c: _axioms(work, program, c), written):
                found.append(names)
                if progress is not None:
                    progress(f"theorems {part}".strip(), len(found) / len(written))
        accepted.update({c.file: c.text.encode() for c in written})
        return _judged(work, written, sorted(frozenset().union(*found)))

    outcome = guarded(KEY, TITLE, check)
    return outcome, accepted if outcome.result == PASSED else {}


def _axioms(work: Workspace, program: str, certificate: Certificate) -> frozenset[str]:
    """Axioms that a theorem rests upon, as Coq prints them when it has accepted the file."""
    answer = run([program, "-q", certificate.file], work.folder)
    _, printed, axioms = answer.text.partition("Axioms:")
    if answer.code or not printed:
        said = " ".join(answer.text.split())[:200]
        raise BrokenToolError(f"coqc refuses {certificate.file}: {said}")
    names = frozenset(_AXIOM.findall(axioms))
    if not names <= CLASSICAL_REALS:
        taken = ", ".join(sorted(names - CLASSICAL_REALS))
        raise BrokenToolError(f"{certificate.file} takes for granted {taken}: nothing is proven")
    return names


def _judged(work: Workspace, accepted: Sequence[Certificate], axioms: Sequence[str]) -> Outcome:
    per_axis = [max(c.bound_lsb for c in accepted if c.axis == axis) for axis in range(3)]
    exact = work.bound.lsb
    good = gappa.not_below(per_axis, work.bound.per_axis_lsb)
    finding = f"{max(per_axis):.3f} LSB, {len(accepted)} theorems accepted; exact {exact:.3f} LSB"
    if not good:
        finding = f"{max(per_axis):.3f} LSB lies below the exact {exact:.3f}: one is wrong"
    figures = {
        "version": COQ.version(),
        "per_axis_lsb": per_axis,
        "axioms": list(axioms),
        "sha256": {c.file: hashlib.sha256(c.text.encode()).hexdigest() for c in accepted},
    }
    return judged(KEY, TITLE, good=good, finding=finding, figures=figures)


def _certificate(work: Workspace, image: Image, part: str, axis: int, s: int) -> Certificate:
    known = gappa.script_context(work, image, axis, s)
    name = "_".join(filter(None, ("error", part, "xyz"[axis], str(s))))
    script = work.render(f"{name}.g", "verify/gappa.g.j2", known)
    text = gappa.run_gappa(work, script, "-Bcoq")
    proof, end, results = text.partition(_END)
    interval = gappa.INTERVAL.search(results)
    if interval is None:
        raise BrokenToolError(f"gappa wrote no proof: {' '.join(text.split())[-200:]}")
    low, high = gappa.ends_of(interval)
    file = f"{name}.v"
    context = {
        "file": file,
        "gappa": without_hypotheses(proof + end),
        "gappa_order": _VARIABLE.findall(proof),
        "low": _real(low),
        "high": _real(high),
        **_statement(work, image, axis, s),
        **{key: known[key] for key in _AS_IN_THE_SCRIPT},
    }
    path = work.render(file, "verify/certificate.v.j2", context)
    return Certificate(file, axis, s, path.read_text(encoding="utf-8"), low, high)


def without_hypotheses(proof: str) -> str:
    """Gappa's text with a proof of every hint in the place of the hypothesis."""
    text = _HINT.sub(_PROVEN_HINT, proof.replace(_LIBRARY, "", 1))
    if "Hypothesis" in text or _LIBRARY not in proof:
        raise BrokenToolError("gappa: its text for Coq has another form; version 1.4 is known")
    return text.strip()


def _statement(work: Workspace, image: Image, axis: int, s: int) -> dict[str, object]:
    """What the theorem says, from the words of the image; see the template."""
    segment = image.segments[s]
    spare = image.output_shift - 32
    rate, by_force = work.plan.rate, work.plan.real_sensitivity
    ends = (segment.first_code, segment.last_code)
    box = max(abs(image.raw_min), abs(image.raw_max)) << image.raw_shift
    low, high = ((code - segment.origin_code) * segment.gain for code in ends)
    ranges = [("x", low, high), *((name, -box, box) for name in "uvw")]
    if image.rate:
        least, largest, gain = image.rate[:3]
        ranges.append(("q", -max(-least, largest) * gain, max(-least, largest) * gain))
    ranges += [(f"f{k}", -(2**31), 2**31) for k in range(len(image.sensitivity))]
    functions = [
        {
            "name": name,
            "integer": _horner_integer(segment.coefficients[4 * axis + j]),
            "real": _horner_real([float(c) for c in work.plan.real[s, 4 * axis + j]]),
        }
        for j, name in enumerate(_FUNCTIONS)
    ]
    return {
        "functions": functions,
        "ranges": ranges,
        "output_shift": image.output_shift,
        "scale": f" * (1 * / {2**spare})" if spare > 0 else f" * (1 * {2**-spare})",
        "rate_fitted": _real(Fraction(float(rate.real[axis]))) if rate else "",
        "sensitivity_fitted": [
            _real(Fraction(float(exact))) for exact in ([] if by_force is None else by_force[axis])
        ],
    }


def _horner_integer(coefficients: Sequence[int]) -> str:
    text = f"({coefficients[-1]})"
    for c in coefficients[-2::-1]:
        text = f"step ({c}) x ({text})"
    return text


def _horner_real(coefficients: Sequence[float]) -> str:
    """As the script has it: the coefficient of order k carries the k bits of Horner's halving."""
    exact = [Fraction(c) * 2**k for k, c in enumerate(coefficients)]
    text = _real(exact[-1])
    for c in exact[-2::-1]:
        text = f"{_real(c)} + x * ({text})"
    return text


def _real(value: Fraction) -> str:
    """A dyadic number in Coq, of the form that unfolding Gappa's gives."""
    top = f"{value.numerator}" if value.numerator >= 0 else f"({value.numerator})"
    return top if value.denominator == 1 else f"{top} * / {value.denominator}"
