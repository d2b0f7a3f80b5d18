"""A damaged journal of many units: nothing that is good is lost, and the session goes on."""

from __future__ import annotations

import pytest
from click.testing import CliRunner
from many_cases import Run, bench_of, refuse_false_records, setup_of

from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.rig.many.mend import events_of, mend_many
from triaxcal.rig.many.recording import ManyRecording
from triaxcal.rig.records.journal import read_journal
from triaxcal.rig.records.recording import JOURNAL_FILE


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory):
    """A session of two units that was cut after some dwells, one of them set aside."""
    folder = tmp_path_factory.mktemp("unfinished")
    setup = setup_of(folder, 3, tables="[unattended]\nsilence_max_s = 5\n")
    bench = bench_of(setup, "AT-3/linkdown@90:1:9999")
    run = Run(setup, bench, folder / "001").go(until=lambda run: len(run.accepted("AT-2")) == 3)
    return setup, folder / "001", run


def spoiled_copy(folder, target, bit):
    """A session's folder in which one bit of the journal is flipped."""
    target.mkdir()
    for file in folder.iterdir():
        (target / file.name).write_bytes(file.read_bytes())
    text = bytearray((folder / JOURNAL_FILE).read_bytes())
    text[bit // 8] ^= 1 << bit % 8
    (target / JOURNAL_FILE).write_bytes(text)
    return target


def dwells_of(setup, records):
    by_unit = events_of(setup, records)
    return {name: [e.dwell for e in events if e.dwell] for name, events in by_unit.items()}


@pytest.mark.long
def test_a_damaged_journal_of_many_units_is_mended(unfinished, tmp_path):
    """A bit is flipped in every record of the journal, one after the other."""
    setup, folder, _ = unfinished
    text = (folder / JOURNAL_FILE).read_bytes()
    wanted = dwells_of(setup, read_journal(folder / JOURNAL_FILE).records)
    assert [len(wanted[name]) for name in ("AT-1", "AT-2")] == [3, 3]
    starts = [0, *(i + 1 for i, byte in enumerate(text[:-1]) if byte == ord("\n"))]
    for n, start in enumerate(starts[:-1]):
        target = spoiled_copy(folder, tmp_path / f"{n}", 8 * (start + 20) + n % 8)
        with pytest.raises(RefusedError, match="damaged behind its"):
            ManyRecording(setup, target)
        done = mend_many(setup, target)
        assert done.complete
        records = read_journal(target / JOURNAL_FILE).records
        found = dwells_of(setup, records)
        lost_aside = b'"kind":"aside"' in text[start : text.index(b"\n", start)]
        for name in ("AT-1", "AT-2", "AT-3"):
            assert found[name] == wanted[name], (n, name)
        asides = [r["unit"] for r in records if r["kind"] == "aside"]
        assert asides == ([] if lost_aside else ["AT-3"])


@pytest.mark.long
def test_a_mended_session_of_many_units_goes_on(unfinished):
    """The command line asks for it first; the records are true, and made again from the logs."""
    setup, folder, _ = unfinished
    text = (folder / JOURNAL_FILE).read_bytes()
    at = text.index(b'"kind":"accepted"')
    setup.sessions.mkdir()
    target = spoiled_copy(folder, setup.sessions / "001", 8 * at + 3)
    options = ["rig", "resume", "--plan", setup.source, "--bus", "virtual", "--plain"]
    refused = CliRunner().invoke(main, options)
    assert "agree to it with --mend" in str(refused.exception)
    assert "5 accepted dwells are whole" in str(refused.exception)
    done = CliRunner().invoke(main, [*options, "--mend"])
    assert done.exit_code == 1, done.output
    assert "mended: 6 accepted dwells; the log gave again what was lost" in done.output
    assert "AT-3" in str(done.exception)
    for place in setup.places[:2]:
        assert refuse_false_records(place, place.setup.folder) == 6
    assert any(f.name.startswith(f"{JOURNAL_FILE}.damaged-") for f in target.iterdir())
