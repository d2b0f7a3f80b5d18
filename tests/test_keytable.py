"""Each key is declared once: the reader, the reference, the schemas and `init` agree on it."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FileKeys
from triaxcal.cli.main import main
from triaxcal.design.problem import read_problem
from triaxcal.dynamic.description import read_dynamic
from triaxcal.keytable.catalogue import FILES
from triaxcal.keytable.reference import reference_markdown
from triaxcal.keytable.schema import json_schema
from triaxcal.keytable.starter import starter_text, write_starter
from triaxcal.rig.plan.plan import read_plan
from triaxcal.simulation.truth import read_truth
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.uncertainty.rig_sources import (
    DRIFT_DEGC,
    GRAVITY_M_PER_S2,
    LEVEL_ARCSEC,
    THERMOMETER_DEGC,
)
from triaxcal.unit.description import read_unit
from triaxcal.unit.uncertainty import StatedUncertainty

REPO = Path(__file__).parent.parent
SHIPPED = {
    "units/AT-SIM/unit.toml": "tilter",
    "units/AT-SIM-BENCH/unit.toml": "tilter",
    "units/AT-CHERNIAK/unit.toml": "tilter",
    "tests/formats/unit-v1/unit.toml": "tilter",
    "units/IMU-SIM/unit.toml": "imu",
    "units/AT-SIM/truth.toml": "truth",
    "units/AT-SIM-BENCH/truth.toml": "truth",
    "units/IMU-SIM/imu_truth.toml": "imu-truth",
    "units/AT-CHERNIAK/tables.toml": "tables",
    "rig/plans/five-temperatures.toml": "rig",
    "rig/design.toml": "design",
    "rig/descriptions/tilter/rig.toml": "rig-description",
    "rig/descriptions/tilter-fd/rig.toml": "rig-description",
    "rig/descriptions/automotive-imu/rig.toml": "rig-description",
    "rig/descriptions/j1939-inclinometer/rig.toml": "rig-description",
    "rig/descriptions/canopen-float/rig.toml": "rig-description",
}


def for_schema(value: Any) -> Any:
    """What an editor hands to its validator: dates as text."""
    if isinstance(value, dict):
        return {k: for_schema(v) for k, v in value.items()}
    if isinstance(value, list):
        return [for_schema(v) for v in value]
    return value if isinstance(value, str | int | float) else str(value)


def validator(kind: str) -> Draft202012Validator:
    schema = json.loads(json.dumps(json_schema(FILES[kind]())))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema, format_checker=Draft202012Validator.FORMAT_CHECKER)


def faults(kind: str, text: str) -> list[str]:
    return [e.message for e in validator(kind).iter_errors(for_schema(tomllib.loads(text)))]


def uncommented(file: FileKeys) -> str:
    """A starter whose every key stands."""
    names = "|".join(key.name for table in file.tables for key in table.keys)
    return re.sub(rf"(?m)^# (?=\[?\[[\w.]+\]\]?$|({names}) = )", "", starter_text(file))


@pytest.mark.parametrize("kind", FILES)
def test_the_reference_names_every_key_with_its_documentation(kind: str) -> None:
    file = FILES[kind]()
    page = reference_markdown(file)
    for table in file.tables:
        assert f"`{table.header}`" in page or not table.name
        for key in table.keys:
            (row,) = [
                row
                for row in page.split(f"`{table.header}`")[-1 if table.name else 0].splitlines()
                if row.startswith(f"| `{key.name}` |")
            ][:1]
            assert key.doc.replace("|", "\\|") in row
            assert row.replace("\\|", "").count("|") == 6
            assert key.doc.endswith(".")


@pytest.mark.parametrize("kind", FILES)
def test_every_example_is_of_its_kind(kind: str) -> None:
    """With every key of the starter in force, each table's values are read and fit the schema."""
    file = FILES[kind]()
    text = uncommented(file)
    document = tomllib.loads(text, parse_float=Decimal)
    for table in file.tables:
        found = document[table.name] if table.name else document
        found = found[table.each] if table.each else found[0] if table.many else found
        for key in table.keys:
            key.kind.parse(found[key.name])
    assert faults(kind, text) == []


@pytest.mark.parametrize("kind", ["tilter", "recording"])
def test_a_commented_value_is_the_default_or_called_an_example(kind: str, tmp_path: Path) -> None:
    """Each key put in force alone leaves the unit as it was, or its comment warns."""
    path, _ = write_starter(tmp_path / "U-7", kind)
    text, default = path.read_text(encoding="utf-8"), read_unit(path.parent)
    examples = []
    for table in FILES[kind]().tables:
        if any(key.required for key in table.keys) and table.optional:
            continue  # its keys mean something together only
        start = text.index(f"[{table.name}]\n") if table.name else 0
        for key in table.keys:
            place = text.index(f"{key.name} = ", start)
            if text[place - 2 : place] != "# ":
                continue
            comment = text[:place].rpartition("\n\n")[2].replace("\n# ", " ")
            if "The value is an example." in comment:
                examples.append(key.name)
                continue
            alone = text[: place - 2] + text[place:]
            path.write_text(alone.replace(f"# [{table.name}]\n", f"[{table.name}]\n"), "utf-8")
            assert read_unit(path.parent) == default, key.name
    assert {"polarity", "range_degc", "level_arcsec"} <= set(examples)


def test_an_uncertainty_in_force_is_the_one_that_is_assumed(tmp_path: Path) -> None:
    """A stated uncertainty of 0 by mistake would make the interval far too small."""
    stated = StatedUncertainty(10.0, 5.0, LEVEL_ARCSEC, GRAVITY_M_PER_S2, THERMOMETER_DEGC)
    path, _ = write_starter(tmp_path / "U-7", "tilter")
    text = path.read_text(encoding="utf-8")
    table = text[text.index("# [uncertainty]") :].partition("\n\n# The ")[0]
    keys = re.findall(r"(?m)^# (\w+ = .*)$", table)[:6]
    path.write_text("\n".join([text, "[uncertainty]", *keys]) + "\n", encoding="utf-8")
    found = read_unit(path.parent).stated
    assert found == replace(stated, thermometer_drift_degc=DRIFT_DEGC)


READERS: dict[str, Callable[[Path], object]] = {
    "tilter": read_unit,
    "recording": read_unit,
    "imu": read_dynamic,
    "rig-description": lambda folder: FILES["rig-description"]().read(folder / "rig.toml"),
    "rig": lambda folder: read_plan(folder / "plan.toml", read_unit(REPO / "units/AT-SIM")),
    "design": lambda folder: read_problem(folder / "problem.toml"),
    "truth": read_truth,
    "imu-truth": lambda folder: FILES["imu-truth"]().read(folder / "imu_truth.toml"),
    "tables": lambda folder: FILES["tables"]().read(folder / "tables.toml"),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_first_file_is_read_as_it_is_written(kind: str, tmp_path: Path) -> None:
    path, schema = write_starter(tmp_path / "U-7", kind)
    text = path.read_text(encoding="utf-8")
    assert text.startswith(f"#:schema ./{schema.name}\n")
    assert json.loads(schema.read_text(encoding="utf-8")) == validator(kind).schema
    assert faults(kind, text) == []
    assert max(map(len, text.splitlines())) <= 100
    READERS[kind](tmp_path / "U-7")


def test_a_first_file_of_a_tilter_goes_the_whole_way(tmp_path: Path) -> None:
    """With readings of the simulated unit, whose ADC and thermometer the examples describe."""
    folder = tmp_path / "SN-7"
    done = CliRunner().invoke(main, ["init", str(folder)])
    assert done.exit_code == 0
    assert done.output == (
        f"{folder / 'unit.toml'} written; replace its examples. unit.schema.json is for your "
        "editor.\n"
        "Next: write a row for each dwell to measurements.csv beside it, below the line\n"
        "  position,temp_degc,ux_v,uy_v,uz_v\n"
        "as docs/how-to/add-a-unit.md says. Then:\n"
        f"  triaxcal calib {folder}\n"
    )
    (folder / "truth.toml").write_bytes((REPO / "units/AT-SIM/truth.toml").read_bytes())
    write_simulated_unit(folder)
    done = CliRunner().invoke(main, ["calib", str(folder), "--build", str(tmp_path / "build")])
    assert done.exit_code == 0, done.output
    result = json.loads((tmp_path / "build/SN-7/calibration.json").read_text(encoding="utf-8"))
    assert (result["unit"], result["serial"]) == ("SN-7", "SN-7")


@pytest.mark.parametrize("kind", ["tilter", "recording"])
def test_the_codes_of_a_first_file_hold_when_they_are_in_force(kind: str, tmp_path: Path) -> None:
    path, _ = write_starter(tmp_path / "U-7", kind)
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^# (?=\[adc\]|code_m)", "", text)
    path.write_text(text, encoding="utf-8")
    adc = read_unit(path.parent).adc
    assert (adc.bits, adc.code_min, adc.code_max) == (24, -32000, 32000)


@pytest.mark.parametrize("there", ["unit.toml", "unit.schema.json"])
def test_no_file_is_overwritten(tmp_path: Path, there: str) -> None:
    (tmp_path / "U").mkdir()
    (tmp_path / "U" / there).write_text("mine", encoding="utf-8")
    with pytest.raises(RefusedError) as refusal:
        write_starter(tmp_path / "U", "imu")
    assert str(refusal.value) == (
        f"{tmp_path / 'U' / there}: exists already; edit it, remove it, or name another folder"
    )
    assert [(p.name, p.read_text()) for p in (tmp_path / "U").iterdir()] == [(there, "mine")]


def test_an_unfit_name_of_a_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="expected 1 to 64 of A-Z"):
        write_starter(tmp_path / "my unit", "tilter")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_files_fit_their_schemas(name: str) -> None:
    assert faults(SHIPPED[name], (REPO / name).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("bits = 24", "bits = 33", "33 is greater than the maximum of 32"),
        ("bits = 24", 'bits = "24"', "'24' is not of type 'integer'"),
        ("bits = 24", "bitz = 24", "'bits' is a required property"),
        ("[site]", "[sight]", "'site' is a required property"),
        ("t0_degc = 20", 't0_degc = 20\nmodel = "cubic"', "'cubic' is not one of"),
        ("t0_degc = 20", "t0_degc = 20\n[measured]\ndate = 'soon'", "'soon' is not a 'date'"),
    ],
)
def test_a_schema_marks_mistakes(old: str, new: str, fault: str) -> None:
    text = (REPO / "units/AT-SIM/unit.toml").read_text(encoding="utf-8")
    assert old in text
    assert any(f.startswith(fault) for f in faults("tilter", text.replace(old, new)))


def test_the_schema_is_printed() -> None:
    done = CliRunner().invoke(main, ["schema", "recording"])
    assert done.exit_code == 0
    assert json.loads(done.output) == validator("recording").schema


def test_the_examples_of_other_tests_are_plausible(tmp_path: Path) -> None:
    """Not the ends of the range, which nobody would have measured."""
    text = write_starter(tmp_path / "U-7", "tilter")[0].read_text(encoding="utf-8")
    for term in ("own_square", "odd_square", "cube"):
        assert not re.search(rf"# {term}(_sd)? = .*(e\+|\[0, )", text)
        assert re.search(rf"# {term}_sd = ", text)
