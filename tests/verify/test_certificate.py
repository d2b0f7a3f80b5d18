"""The theorem of the error bound: Coq accepts it, and refuses a false one."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from plans import INT32_MAX, INT32_MIN, integer_plan, integer_shape
from triaxcal.codegen.image import image_bytes
from triaxcal.fixedpoint.plan import with_high_words
from triaxcal.fixedpoint.proof import prove
from triaxcal.model.terms import EXAMPLE_RATE, Terms
from triaxcal.targets.shapes import made_case
from triaxcal.verify import certificate, gappa
from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED
from triaxcal.verify.record import record
from triaxcal.verify.shapes import ALL_SHAPES, Subject, subject
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import IMAGE, Workspace
from verify.conftest import UNITS, Planter, needs

PROVERS = needs("gappa", "coqc")
GAIN, CROSS, OFFSET = [-1_217_740_769, -277_829], [1_026_252, 311_567], [1_974_680, -1_930_389]


@pytest.fixture(autouse=True)
def _few_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    """A proof an eighth as long; the bound is a little wider."""
    monkeypatch.setattr(gappa, "SLICES", 2)


def small(folder: Path, *, high_words: bool = False) -> Workspace:
    """Three rows alike, functions of order 1, codes that fill 32 bits: seconds for Coq."""
    rows = [GAIN, CROSS, CROSS, OFFSET] * 3
    plan = integer_plan(
        integer_shape(order=1, raw=(INT32_MIN, INT32_MAX)),
        [rows],
        temp=(-800, 800),
        rounded_by=0.25,
    )
    if high_words:
        plan = with_high_words(plan) or plan
    return Workspace.create(folder, {IMAGE: image_bytes(plan)}, plan, prove(plan))


@PROVERS
@pytest.mark.long
@pytest.mark.parametrize("high_words", [False, True])
def test_coq_accepts_the_bound_and_nothing_below_the_largest_error(
    tmp_path: Path, high_words: bool
) -> None:
    work = small(tmp_path, high_words=high_words)
    assert work.plan.shape.high_words == high_words
    outcome, files = certificate.certify(work, "")
    assert outcome.result == PASSED, outcome
    assert sorted(files) == ["error_x_0.v", "error_y_0.v", "error_z_0.v"]
    assert sorted(outcome.figures["sha256"]) == sorted(files)
    assert set(outcome.figures["axioms"]) <= certificate.CLASSICAL_REALS
    for bound, exact in zip(outcome.figures["per_axis_lsb"], work.bound.per_axis_lsb, strict=True):
        assert exact <= bound < 1.3 * exact

    text = files["error_x_0.v"].decode()
    ends = re.search(r"\n  (\(-\d+\) \* / \d+) <=\n.*?<= (\d+ \* / \d+)\.\n", text, re.DOTALL)
    assert ends is not None
    lowered = f"{int(0.99 * work.bound.per_axis_lsb[0] * 10**6)} * / 1000000"
    narrow = text.replace(ends[1], f"-{lowered}").replace(ends[2], lowered)
    another_word = text.replace("step (-1217740769)", "step (-1217740768)")
    for changed in (narrow, another_word):
        assert changed != text
        (tmp_path / "changed.v").write_text(changed)
        assert run(["coqc", "-q", "changed.v"], tmp_path).code != 0


@PROVERS
@pytest.mark.long
def test_a_proof_with_a_gap_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Coq takes a file with an axiom of its own; we do not."""
    work = small(tmp_path)
    render = Workspace.render

    def with_gap(self: Workspace, name: str, template: str, context: dict[str, object]) -> Path:
        path = render(self, name, template, context)
        if path.suffix == ".v":
            before, _, after = path.read_text().partition("Lemma l1 : s1 -> False.\nProof.")
            after = after[after.index("Qed.") + 4 :]
            path.write_text(f"{before}Lemma l1 : s1 -> False.\nProof. Admitted.{after}")
        return path

    monkeypatch.setattr(Workspace, "render", with_gap)
    outcome, files = certificate.certify(work, "")
    assert outcome.result == FAILED
    assert "takes for granted l1" in outcome.finding
    assert not files


def test_a_text_of_another_gappa_is_no_proof() -> None:
    """A hypothesis that stays would make the theorem say less than its name."""
    known = (
        "Require Import Gappa.Gappa_library.\nSection Generated_by_Gappa.\n"
        "Hypothesis a1 : r1 = r2.\nLemma b1 : r1 = r2.\n apply a1.\nQed.\nEnd Generated_by_Gappa.\n"
    )
    mended = certificate.without_hypotheses(known)
    assert "Hypothesis" not in mended
    assert "Lemma b1 : r1 = r2.\nProof. identity. Qed." in mended
    for other in (known.replace(" apply a1", " exact a1"), known.replace("Gappa_library", "Lib")):
        with pytest.raises(BrokenToolError, match="another form"):
            certificate.without_hypotheses(other)


@pytest.mark.parametrize("missing", ["gappa", "coqc"])
def test_a_missing_prover_is_not_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    there = tmp_path / "bin"
    there.mkdir()
    (there / ("gappa" if missing == "coqc" else "coqc")).symlink_to("/bin/true")
    monkeypatch.setenv("PATH", str(there))
    outcome, files = certificate.certify(small(tmp_path), "")
    assert outcome.result == NOT_DONE
    assert f"{missing} not found; sudo apt-get install" in outcome.finding
    assert not files


@pytest.mark.parametrize("shape", ["inverse", "quadratic"])
def test_what_has_no_theorem_says_so(plant: Planter, shape: str) -> None:
    outcome, files = certificate.certify(plant(shape), "")
    assert outcome.result == NOT_DONE
    assert "the exact bound over every code stands alone" in outcome.finding
    assert not files


@PROVERS
@pytest.mark.slow
@pytest.mark.parametrize(
    "shape", ["direct-two-segments", "saturating", "high words", "rate alone", "gyro"]
)
def test_coq_accepts_every_shape(tmp_path: Path, shape: str) -> None:
    made = subject(shape, UNITS) if shape in ALL_SHAPES else rate_alone()
    work = Workspace.create(tmp_path, made.files, made.plan, made.bound)
    outcome, _ = certificate.certify(work, "accelerometer")
    assert outcome.result == PASSED, outcome


def rate_alone() -> Subject:
    """A term in dT/dt, without the quadratic ones."""
    case = made_case(UNITS / "AT-SIM", "rate", "", lambda u: u, Terms(rate=EXAMPLE_RATE))
    return Subject("rate", case.plan, prove(case.plan), {IMAGE: case.image})


def test_outcomes_of_other_checks_stay(tmp_path: Path) -> None:
    path = tmp_path / "verification.json"
    path.write_text(json.dumps({"bound": 1, "tools": {"gappa": {"result": "passed"}}}))
    added = {"coq": {"result": "passed", "finding": "6 theorems"}}
    assert record(tmp_path, added) == {"gappa": {"result": "passed"}, **added}
    again = {"gappa": {"result": "failed"}}
    assert record(tmp_path, again) == {**again, **added}
    assert json.loads(path.read_text()) == {"bound": 1, "tools": {**again, **added}}


def test_outcomes_of_both_triads_are_kept_apart(tmp_path: Path) -> None:
    path = tmp_path / "verification.json"
    path.write_text(json.dumps({"tools": {"gyro": {"gappa": {"result": "passed"}}}}))
    found = record(tmp_path, {"gyro": {"coq": {"result": "failed"}}, "accelerometer": {}})
    assert found == {
        "gyro": {"gappa": {"result": "passed"}, "coq": {"result": "failed"}},
        "accelerometer": {},
    }
