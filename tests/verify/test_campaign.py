"""What counts as passed, failed and not done; what reaches verification.json and the table."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from builds import UNITS
from triaxcal.base.errors import RefusedError
from triaxcal.base.jsontext import json_bytes
from triaxcal.base.tools import MissingToolError, Tool
from triaxcal.cli.main import main
from triaxcal.verify import campaign
from triaxcal.verify.campaign import CHECKS, exit_code, verify_files
from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED, Outcome
from triaxcal.verify.record import FILE, entries, is_delivered, record
from triaxcal.verify.shapes import Subject
from triaxcal.verify.table import table
from triaxcal.verify.tools import BrokenToolError, run

PASS = Outcome("a", "check a", PASSED, "0 alarms", {"alarms": 0})
FAIL = Outcome("b", "check b", FAILED, "12 alarms", {"alarms": 12}, tuple(map(str, range(12))))
LEFT = Outcome("c", "check c", NOT_DONE, "gappa not found; sudo apt-get install gappa")


def test_without_any_tool_everything_is_not_done(
    subjects: dict[str, Subject], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = subjects["direct-two-segments"]
    monkeypatch.setenv("PATH", str(tmp_path))
    outcomes = verify_files(tmp_path / "work", made.files, made.plan, made.bound)
    assert [o.key for o in outcomes] == [key for key, _, _ in CHECKS]
    assert {o.result for o in outcomes} == {NOT_DONE}
    for outcome in outcomes:
        assert "not found; sudo apt-get install " in outcome.finding
    assert exit_code(outcomes) == 0
    text = table({"": outcomes})
    assert f"0 passed, 0 failed, {len(CHECKS)} not done: " in text
    assert "frama-c-base" in text


@pytest.mark.parametrize(
    ("outcomes", "code"), [([PASS], 0), ([PASS, LEFT], 0), ([LEFT, FAIL, PASS], 1)]
)
def test_exit_code(outcomes: list[Outcome], code: int) -> None:
    assert exit_code(outcomes) == code


def test_a_tool_that_breaks_fails(
    subjects: dict[str, Subject], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: object) -> Outcome:
        raise BrokenToolError("gappa was killed by signal 9")

    monkeypatch.setattr(campaign, "CHECKS", (("gappa", "Gappa", broken),))
    made = subjects["inverse"]
    (outcome,) = verify_files(tmp_path, made.files, made.plan, made.bound)
    assert (outcome.result, outcome.finding) == (FAILED, "gappa was killed by signal 9")


def test_table_tells_complaints_of_failures_only() -> None:
    text = table({"": [PASS, FAIL, LEFT]})
    assert "1 passed, 1 failed, 1 not done: check c" in text
    assert "  9\n  and 2 more" in text


def test_no_result_but_three() -> None:
    with pytest.raises(ValueError, match="is no result"):
        Outcome("a", "a", "skipped", "")


def test_missing_tool_is_named_with_its_package() -> None:
    with pytest.raises(MissingToolError, match="no-such-tool not found; sudo apt-get install pkg"):
        Tool("no-such-tool", "pkg", "nothing").find()


def test_a_killed_tool_is_broken(tmp_path: Path) -> None:
    with pytest.raises(BrokenToolError, match="killed by signal 9"):
        run(["sh", "-c", "kill -9 $$"], tmp_path)


# ---- verification.json ----

BASE = {"format": 1, "unit": "U", "limit": 0.1, "text": "µg", "nested": {"b": [1, 2.5e-09]}}


def content(document: dict[str, object]) -> bytes:
    return json_bytes(document)


def test_record_keeps_every_other_byte(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(content(BASE))
    record(tmp_path, entries([PASS, LEFT]))
    written = (tmp_path / FILE).read_bytes()
    base = content(BASE).decode().rstrip("}\n")
    assert written.decode().startswith(base)
    assert json.loads(written)["tools"] == {
        "a": {"result": "passed", "finding": "0 alarms", "alarms": 0},
        "c": {"result": "not done", "finding": LEFT.finding},
    }
    record(tmp_path, entries([PASS, LEFT]))
    assert (tmp_path / FILE).read_bytes() == written
    assert [p.name for p in tmp_path.iterdir()] == [FILE]


def test_delivered_means_the_same_files_whatever_was_added(tmp_path: Path) -> None:
    files = {"triax_comp.c": b"int x;\n", FILE: content(BASE)}
    assert not is_delivered(tmp_path, files)
    for name, text in files.items():
        (tmp_path / name).write_bytes(text)
    assert is_delivered(tmp_path, files)
    record(tmp_path, entries([PASS]))
    assert is_delivered(tmp_path, files)
    assert not is_delivered(tmp_path, {**files, "triax_comp.c": b"int y;\n"})
    assert not is_delivered(tmp_path, {**files, FILE: content({**BASE, "limit": 0.2})})


@pytest.mark.parametrize("command", ["verify", "certify"])
def test_an_edited_file_is_refused_and_left(tmp_path: Path, command: str) -> None:
    arguments = [str(UNITS / "AT-CHERNIAK"), "--build", str(tmp_path)]
    assert CliRunner().invoke(main, ["calib", *arguments]).exit_code == 0
    file = tmp_path / "AT-CHERNIAK" / "triax_comp.c"
    text = file.read_text(encoding="utf-8")
    edited = text.replace("+ offset", "- offset", 1).encode()
    assert edited != text.encode()
    file.write_bytes(edited)
    done = CliRunner().invoke(main, [command, *arguments])
    assert isinstance(done.exception, RefusedError)
    assert str(done.exception).startswith(
        f"{file}: is not the file that was delivered, so nothing was verified; expected SHA-256 "
    )
    assert file.read_bytes() == edited


def test_a_damaged_record_is_refused(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("[]")
    with pytest.raises(RefusedError, match="is no JSON object; run triaxcal calib again"):
        record(tmp_path, entries([PASS]))
