"""`rig export`: what every format holds is read back by somebody else's reader."""

from __future__ import annotations

import csv
import sys
from decimal import Decimal

import can
import numpy as np
import pytest
from rig_cases import rig_of, short_setup
from test_candump import mixed, same

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import EFF_FLAG, ERR_FLAG, ID_MASK, RTR_FLAG, Frames, widened
from triaxcal.rig.bus.messages import frames_of
from triaxcal.rig.description.dbc import default_dbc
from triaxcal.rig.logs.candump import format_frames
from triaxcal.rig.logs.export import WRITERS, export_log

WITHOUT = "not installed: .venv/bin/pip install -c constraints.txt -e '.[export]'"
"""Not among the developers' tools: python-can imports asammdf, and that pandas, at every start."""


def installed(name):
    return pytest.importorskip(name, reason=f"could not import {name}: {WITHOUT}")


def _installed_for(suffix):
    package = {".mf4": "asammdf", ".parquet": "pyarrow"}.get(suffix)
    if package:
        installed(package)


def exported(folder, frames, suffix):
    log, target = folder / "frames.log", folder / f"frames{suffix}"
    log.write_bytes(format_frames(frames, "can0"))
    counts = []
    assert export_log(log, target, counts.append) == (len(frames), [])
    assert counts[-1] == len(frames)
    assert {p.name for p in folder.iterdir()} == {"frames.log", f"frames{suffix}"}
    return target


def by_python_can(path):
    """Frames as python-can's reader of the suffix gives them."""
    options = {"relative_timestamp": False} if path.suffix == ".asc" else {}
    with can.LogReader(str(path), **options) as reader:
        return frames_of(list(reader))


def without_error_class(frames):
    """Error frames without class and payload."""
    error = frames.is_error
    data = np.where(error[:, None], 0, widened(frames.data, 64)).astype(np.uint8)
    can_id = np.where(error, ERR_FLAG, frames.can_id).astype(np.uint32)
    length = np.where(error, 0, frames.length).astype(np.uint8)
    return Frames(frames.t_ns, can_id, length, frames.fd, data)


@pytest.mark.parametrize("suffix", [".blf", ".mf4"])
def test_every_frame_comes_back(tmp_path, suffix):
    _installed_for(suffix)
    frames = mixed(21)
    same(by_python_can(exported(tmp_path, frames, suffix)), frames)


def test_asc_loses_only_what_an_error_frame_says(tmp_path):
    frames = mixed(22)
    # python-can reads an empty CAN FD frame as a remote request.
    frames = frames.take(~frames.fd | (frames.length > 0))
    found = by_python_can(exported(tmp_path, frames, ".asc"))
    same(without_error_class(found), without_error_class(frames))


def test_csv_is_the_frames_row_by_row(tmp_path):
    frames = mixed(27)
    with exported(tmp_path, frames, ".csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [round(Decimal(r["time_s"]) * 10**9) for r in rows] == frames.t_ns.tolist()
    assert [bytes.fromhex(r["payload"]) for r in rows] == payloads(frames)
    flags = (("extended", EFF_FLAG), ("remote", RTR_FLAG), ("error", ERR_FLAG))
    ids = [int(r["id"], 16) | sum(f for name, f in flags if r[name] == "1") for r in rows]
    assert ids == frames.can_id.tolist()
    assert [r["fd"] == "1" for r in rows] == frames.fd.tolist()
    assert [int(r["length"]) for r in rows] == frames.length.tolist()


def payloads(frames):
    rows = zip(frames.data, frames.length.tolist(), strict=True)
    return [data[:length].tobytes() for data, length in rows]


def test_mf4_is_bus_logging_that_a_dbc_gives_meaning(tmp_path):
    asammdf = installed("asammdf")
    setup = short_setup(tmp_path)
    frames = rig_of(setup).advance()
    (tmp_path / "x").mkdir()
    path = exported(tmp_path / "x", frames, ".mf4")
    with asammdf.MDF(path) as file:
        decoded = file.extract_bus_logging({"CAN": [(str(default_dbc()), 0)]})
        found = [decoded.get(f"Accel{axis}").samples for axis in "XYZ"]
    codes = setup.decoder().feed(frames).codes
    np.testing.assert_array_equal(np.stack(found, axis=1), codes)


def test_parquet_is_the_frames_column_by_column(tmp_path):
    parquet = installed("pyarrow.parquet")
    frames = mixed(23)
    table = parquet.read_table(exported(tmp_path, frames, ".parquet"))
    columns = {name: table[name].to_pylist() for name in table.column_names if name != "time"}
    assert table["time"].cast("int64").to_pylist() == frames.t_ns.tolist()
    assert columns["id"] == (frames.can_id & np.uint32(ID_MASK)).tolist()
    for name, flag in (("extended", EFF_FLAG), ("remote", RTR_FLAG), ("error", ERR_FLAG)):
        assert columns[name] == ((frames.can_id & np.uint32(flag)) != 0).tolist()
    assert columns["fd"] == frames.fd.tolist()
    assert columns["payload"] == payloads(frames)


@pytest.mark.parametrize("suffix", [".mf4", ".parquet"])
def test_chunks_make_one_file(tmp_path, suffix, monkeypatch):
    _installed_for(suffix)
    whole = exported(_made(tmp_path / "a"), mixed(24), suffix)
    monkeypatch.setattr("triaxcal.rig.logs.candump._CHUNK_BYTES", 4096)
    parts = exported(_made(tmp_path / "b"), mixed(24), suffix)
    if suffix == ".mf4":
        same(by_python_can(parts), by_python_can(whole))
    else:
        parquet = installed("pyarrow.parquet")
        assert parquet.read_table(parts).equals(parquet.read_table(whole))


def _made(folder):
    folder.mkdir()
    return folder


@pytest.mark.parametrize(("suffix", "package"), [(".mf4", "asammdf"), (".parquet", "pyarrow")])
def test_a_missing_package_is_named(tmp_path, suffix, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(
        RefusedError, match=rf"missing package: {package}; install it: .*pip install"
    ):
        exported(tmp_path, mixed(25, 3), suffix)
    assert [p.name for p in tmp_path.iterdir()] == ["frames.log"]


@pytest.mark.parametrize("suffix", sorted(WRITERS))
@pytest.mark.parametrize("content", [b"", b"neither\nnor\n", None])
def test_what_is_no_log_gives_no_file(tmp_path, suffix, content):
    _installed_for(suffix)
    log, target = tmp_path / "x.log", tmp_path / f"x{suffix}"
    if content is not None:
        log.write_bytes(content)
    said = "no frames in it" if content is not None else "cannot be read: no such file"
    with pytest.raises(RefusedError, match=rf"x\.log: {said}"):
        export_log(log, target, lambda _: None)
    assert [p.name for p in tmp_path.iterdir()] == (["x.log"] if content is not None else [])


@pytest.mark.parametrize("suffix", sorted(WRITERS))
def test_a_target_that_cannot_be_written(tmp_path, suffix):
    _installed_for(suffix)
    log = tmp_path / "x.log"
    log.write_bytes(format_frames(mixed(26, 9), "can0"))
    target = tmp_path / "nowhere" / f"x{suffix}"
    with pytest.raises(RefusedError, match="cannot be written: no such file or directory"):
        export_log(log, target, lambda _: None)
