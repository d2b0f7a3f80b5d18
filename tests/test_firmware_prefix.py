"""`triaxcal firmware`: the C of a calibrated unit under another prefix."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return triaxcal.deliver(ROOT / "units" / "AT-SIM", tmp_path_factory.mktemp("build")).folder


def ran(*arguments: object) -> str:
    done = CliRunner().invoke(main, ["firmware", *map(str, arguments)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_another_prefix_is_the_same_c_with_other_names(folder: Path, tmp_path: Path) -> None:
    said = ran(folder, "--prefix", "left_accel", "--into", tmp_path / "out")
    assert "vectors: Python, reference C and generated C agree" in said
    made = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    c = {path.name: path.read_bytes() for path in folder.glob("triax_*.[ch]")}
    c["triax_calib.bin"] = (folder / "triax_calib.bin").read_bytes()
    assert set(made) == {name.replace("triax", "left_accel", 1) for name in c}
    assert made["left_accel_calib.bin"] == c["triax_calib.bin"]
    for name, content in made.items():
        if name.endswith(".bin"):
            continue
        text = content.decode()
        assert name in said
        # What stays are words for all triads: status bits, the templates' names.
        assert not re.search(r"\btriax_(?:apply|calib_t|set_temperature|state_t)\b", text)
        # Numbers are those of the delivery, in their order.
        theirs = c[name.replace("left_accel", "triax", 1)].decode()
        for figure in (r"-?\b\d{6,}\b", r"0x[0-9A-F]{8}u"):
            assert re.findall(figure, text) == re.findall(figure, theirs), name


def test_its_own_prefix_gives_the_delivered_bytes(folder: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    shutil.copytree(folder, build / "AT-SIM")
    ran(build / "AT-SIM", "--build", build)
    made = sorted((build / "AT-SIM-triax").iterdir())
    assert len(made) == 7
    for path in made:
        assert path.read_bytes() == (folder / path.name).read_bytes()


def test_a_failed_check_writes_nothing(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(*_: object) -> None:
        raise RefusedError("cross-check", "differs")

    monkeypatch.setattr("triaxcal.delivery.unit.cross_check", wrong)
    command = ["firmware", str(folder), "--prefix", "left", "--into", str(tmp_path / "out")]
    done = CliRunner().invoke(main, command)
    assert str(done.exception) == "cross-check: differs"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("prefix", ["9a", "Left", "strength", "triax_2", "a__b", "", "a" * 21])
def test_what_is_no_prefix_is_refused_as_in_unit_toml(prefix: str, folder: Path) -> None:
    with pytest.raises(RefusedError) as refusal:
        triaxcal.delivered_firmware(folder, prefix=prefix)
    told = str(refusal.value)
    assert told.startswith(f'prefix: found "{prefix}"') or told.startswith(
        f"prefix: found '{prefix}'"
    )
    assert "expected 1 to 20 small letters, digits and single underscores" in told


def test_a_folder_with_other_files_is_not_replaced(folder: Path) -> None:
    with pytest.raises(RefusedError, match=r"calibration\.json', which no delivery has"):
        triaxcal.delivered_firmware(folder, prefix="left").write(folder)
    assert (folder / "calibration.json").is_file()


def test_another_arithmetic_is_a_file_beside_the_same_c(folder: Path, tmp_path: Path) -> None:
    """An export has it in place of triax_comp.c: with both a linker would find names twice."""
    said = ran(folder, "--arithmetic", "thumb2", "--into", tmp_path / "out")
    assert "triax_comp_thumb2.c" in said
    for name in ("triax_comp.c", "triax_calib.c", "triax_calib.bin", "triax_selftest.c"):
        assert (tmp_path / "out" / name).read_bytes() == (folder / name).read_bytes(), name
    assert "#define TRIAX_ROW_WORDS 5" in (tmp_path / "out" / "triax_comp.h").read_text()
    made = triaxcal.export(folder, "cmake", tmp_path / "cmake", arithmetic="thumb2")
    assert "src/triax_comp_thumb2.c" in made.files
    assert "src/triax_comp.c" not in made.files
    lists = (tmp_path / "cmake" / "CMakeLists.txt").read_text()
    assert "src/triax_comp_thumb2.c" in lists


def test_what_is_no_arithmetic_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(RefusedError) as refusal:
        triaxcal.delivered_firmware(folder, arithmetic="neon")
    assert str(refusal.value) == (
        'arithmetic: found \'neon\'; expected one of "portable", "limbs", "thumb2", "thumb1", '
        '"high-words"'
    )
    with pytest.raises(RefusedError, match='arithmetic: found "thumb2"; expected none: PX4 gets'):
        triaxcal.export(folder, "px4", tmp_path / "px4", arithmetic="thumb2")
