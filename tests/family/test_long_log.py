"""The memory that a long log needs."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "bench" / "long_log.py"


@pytest.mark.slow
def test_a_log_of_two_million_rows_is_not_held_in_memory(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("long_log", BENCH)
    assert spec is not None
    assert spec.loader is not None
    bench = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bench)
    # Python with numpy takes about 100 MB, a block of 65536 rows a few. Rows held as text, or in
    # Python's floats, would take 500 MB and more.
    _, peak_mb = bench.measured(bench.write_unit(tmp_path / "LONG", 2_000_000))
    assert peak_mb < 300
