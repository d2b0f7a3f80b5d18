"""The angles on other cores: the same bits, one cost for every input, and less than in double."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from targets.test_targets import CASES, need, run_on_host
from triaxcal.targets.bench_angles import angles_cost, angles_markdown
from triaxcal.targets.cores.registry import CORES
from triaxcal.targets.counting import build_plugin
from triaxcal.targets.matrix import compare
from triaxcal.targets.shapes import ANGLES
from triaxcal.targets.vectors import expected_lines, triads
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE
from triaxcal.unit.arithmetic import LIMBS, PORTABLE

WITH = {pair: next(c for c in CASES if c.name == name) for pair, name in ANGLES.items()}


def test_triads_have_every_size_and_sign_on_each_axis() -> None:
    found = triads()
    for j in range(3):
        sizes = {abs(v).bit_length() for v in found[:, j].tolist()}
        assert sizes >= set(range(32))
        assert (found[:, j] < 0).any()


@pytest.mark.long
@pytest.mark.parametrize("arithmetic", [PORTABLE, LIMBS])
@pytest.mark.parametrize("pair", WITH)
def test_host_prints_the_digest_of_python(pair: str, arithmetic: str, tmp_path: Path) -> None:
    case = WITH[pair]
    assert "angles" in expected_lines(case)
    assert compare(run_on_host(case, tmp_path, arithmetic), expected_lines(case)) == ""


@pytest.mark.long
def test_a_fault_in_the_angles_is_seen_by_their_digest_alone(tmp_path: Path) -> None:
    case = WITH[ZENITH_TOOL_FACE]
    text = case.files["triax_angles.c"]
    broken = text.replace("83443u", "83442u")
    assert broken != text
    case = replace(case, files={**case.files, "triax_angles.c": broken})
    printed = dict(line.split() for line in run_on_host(case, tmp_path).splitlines())
    expected = {name: f"{value:08x}" for name, value in expected_lines(case).items()}
    assert [name for name in expected if printed[name] != expected[name]] == ["angles"]


@pytest.mark.long
@pytest.mark.parametrize("name", [core.name for core in CORES if core.counted])
def test_the_cost_is_one_number(name: str, tmp_path: Path) -> None:
    """gcc makes no branch on the acceleration; double takes ten times as long and more."""
    core = next(c for c in CORES if c.name == name)
    need(*core.tools("gcc"))
    plugin = build_plugin(tmp_path)
    ours = angles_cost(WITH[PITCH_ROLL], core, tmp_path / "ours", plugin)
    double = angles_cost(None, core, tmp_path / "double", plugin)
    assert (ours.failure, double.failure) == ("", "")
    assert ours.count is not None
    assert double.count is not None
    assert ours.count.least == ours.count.most
    assert double.count.mean > 10 * ours.count.most
    assert f"| {PITCH_ROLL} | {name} | {ours.count.most} |" in angles_markdown([ours, double])
