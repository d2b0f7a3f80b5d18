"""SIGKILL at any moment of a session: `python kill_campaign.py FOLDER FIRST COUNT`.

A line of JSON a seed: what was shown, what was kept, what was lost. The session runs in a child
that is forked from here, so that the packages are imported once; `rig run` itself is killed in
test_cli_rig.py. Run by test_kill.py.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import time
from pathlib import Path

import numpy as np
from rig_cases import BENCH, rig_of, short_setup

from triaxcal.cli.rig_live import guide
from triaxcal.rig.bus.frames import concatenate
from triaxcal.rig.live.runner import live
from triaxcal.rig.records.journal import read_journal
from triaxcal.rig.records.recording import JOURNAL_FILE, LOG_FILE, Recording, durable_events
from triaxcal.rig.records.replay import replay
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.sources.canbus import SimulatedSource
from triaxcal.rig.sources.socketcan import SocketSource, packed
from triaxcal.simulation.tilts import truth_force_g
from triaxcal.simulation.truth import read_truth

SESSION_S = 1.6
"""About what a whole session takes here; kills later than its end hit nothing."""


class Straight(SimulatedSource):
    """The simulated rig without the virtual bus, which takes most of the time."""

    def __init__(self, rig):
        self.name, self.rig = "virtual", rig

    def read(self):
        return self.rig.advance()

    def close(self):
        pass


def forked(work):
    """Start `work` in a child; its pid, and its standard output."""
    ours, theirs = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        os.close(theirs)
        return pid, os.fdopen(ours, "r")
    status = 1
    try:
        os.close(ours)
        os.dup2(theirs, 1)
        sys.stdout = os.fdopen(1, "w", buffering=1)
        work()
        status = 0
    finally:
        os._exit(status)


def killed(work, seconds, after_lines):
    """Lines that the child had shown when it was killed, so many seconds after so many lines."""
    pid, out = forked(work)
    shown = [line for line, _ in zip(out, range(after_lines), strict=False)]
    time.sleep(seconds)
    os.kill(pid, signal.SIGKILL)
    shown += out.readlines()
    os.waitpid(pid, 0)
    out.close()
    return shown


def accepted_lines(shown):
    return [line.split(" accepted: ")[1].strip() for line in shown if " accepted: " in line]


def kept_dwells(session):
    records = read_journal(session / JOURNAL_FILE).records
    return [event for event in durable_events(records) if event.dwell]


def refuse_wrong(setup, dwells):
    """No dwell is off the truth by more than 8.2 u, Student's t of 9 degrees, 200 * 36 axes."""
    truth, _ = read_truth(BENCH)
    for dwell in dwells:
        force = truth_force_g(dwell.position, setup.unit.gravity_g)
        exact = truth.voltage_v(force, dwell.temp_degc) / setup.unit.adc.volts_per_code
        off = np.abs(np.array(dwell.mean_code) - exact) / np.array(dwell.u_code)
        assert off.max() < 14.7, (dwell, off)


def session_killed(top, seed):
    """Kill a session once or more, go on with it, look at everything that is left."""
    rng = np.random.default_rng(seed)
    folder = top / f"s{seed}"
    unit = folder / "AT-SIM-BENCH"
    unit.mkdir(parents=True)
    for name in ("unit.toml", "truth.toml"):
        (unit / name).write_bytes((BENCH / name).read_bytes())
    setup = short_setup(folder, temps="[20]")
    setup = Setup(unit, setup.unit, setup.plan, setup.rig)
    session = folder / "001"

    def play(rig_seed):
        return lambda: guide(setup, Straight(rig_of(setup, seed=rig_seed)), session, plain=True)

    # Half of the kills at any moment, half within 5 ms of a line: near the files' own moments.
    near = bool(seed % 2)
    lines = int(rng.integers(1, 9)) if near else 0
    shown = killed(play(seed), rng.uniform(0.0, 0.005 if near else SESSION_S), lines)
    acknowledged = accepted_lines(shown)
    kept = kept_dwells(session) if (session / JOURNAL_FILE).exists() else []
    assert [event.text for event in kept][: len(acknowledged)] == acknowledged
    if (session / LOG_FILE).exists():
        played = replay(setup, session / LOG_FILE, session / JOURNAL_FILE)
        accepted = played.engine.session.accepted
        assert all(accepted[e.dwell.step, e.dwell.position] == e.dwell for e in kept)
    done = (unit / "measurements.csv").exists()
    resumed_s = 0.0
    if not done:
        pid, out = forked(play(1000 + seed))
        said = out.readlines()
        out.close()
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0, said
        words = [line for line in said if line.startswith("resumed in ")]
        resumed_s = float(words[0].split()[2]) if words else 0.0
    final = {(e.dwell.step, e.dwell.position): e.dwell for e in kept_dwells(session)}
    assert len(final) == 6
    assert all(final[e.dwell.step, e.dwell.position] == e.dwell for e in kept)
    refuse_wrong(setup, final.values())
    return {"shown": len(acknowledged), "kept": len(kept), "resumed_s": resumed_s}


def raw_frames_killed(top, seed):
    """Kill a recording of frames that come at their pace; those that came and are not in the log.

    "Lost" is the time between the kill and the oldest frame sent before it that the log lacks.
    """
    rng = np.random.default_rng(seed)
    folder = top / f"r{seed}"
    folder.mkdir(parents=True)
    setup = short_setup(folder)
    rig = rig_of(setup)
    frames = packed(concatenate([rig.advance() for _ in range(3)]))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

    def record():
        taken = Recording(setup, folder / "001", "test0")
        print("ready", flush=True)
        for _ in live(taken, SocketSource("test0", lambda: theirs), tuple):
            pass

    pid, out = forked(record)
    assert out.readline() == "ready\n"
    theirs.close()
    sent_at, pace_s = [], 1.0 / 211.0
    end = time.monotonic() + rng.uniform(0.3, 0.8)
    for frame in frames:
        ours.send(frame)
        sent_at.append(time.monotonic())
        time.sleep(max(0.0, sent_at[0] + len(sent_at) * pace_s - time.monotonic()))
        if time.monotonic() > end:
            break
    killed_at = time.monotonic()
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    out.close()
    ours.close()
    text = (folder / "001" / LOG_FILE).read_bytes()
    logged = text.count(b"\n")
    assert logged <= len(sent_at)
    lost = len(sent_at) - logged
    return {"frames": lost, "lost_ms": 1000 * (killed_at - sent_at[logged]) if lost else 0.0}


def main():
    top, first, count = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    for seed in range(first, first + count):
        found = session_killed(top, seed) | raw_frames_killed(top, seed)
        print(json.dumps({"seed": seed, **found}), flush=True)


if __name__ == "__main__":
    main()
