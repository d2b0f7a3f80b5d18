"""docs/how-to/bench.md has a plan that is read, every command and every fault."""

from __future__ import annotations

from click import Group
from rig_cases import REPO

from triaxcal.cli.rig import rig
from triaxcal.rig.description.dbc import REQUIRED
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.simulated.simorders import KINDS
from triaxcal.unit.description import read_unit

PAGE = (REPO / "docs/how-to/bench.md").read_text(encoding="utf-8")


def test_the_plan_of_the_page_is_read(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PAGE.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    plan = read_plan(path, read_unit(REPO / "units/AT-SIM-BENCH"))
    assert [step.temp_degc for step in plan.steps] == [-40, -10, 20, 45, 70]


def test_the_plans_of_the_unattended_page_are_read(tmp_path):
    page = (REPO / "docs/how-to/unattended.md").read_text(encoding="utf-8")
    whole, *tables = [part.split("```")[0] for part in page.split("```toml\n")[1:]]
    first = whole[: whole.index("[chamber]")]
    path = tmp_path / "plan.toml"
    for text in (whole, *(first + table for table in tables)):
        path.write_text(text, encoding="utf-8")
        plan = read_plan(path, read_unit(REPO / "units/AT-SIM-BENCH"))
        assert plan.equipment.chamber_by.readable
    assert len(tables) == 2


def test_the_descriptions_of_the_page_on_lines_are_read(tmp_path):
    page = (REPO / "docs/how-to/lines.md").read_text(encoding="utf-8")
    texts = [part.split("```")[0] for part in page.split("```toml\n")[1:]]
    path = tmp_path / "rig.toml"
    for text in texts:
        path.write_text(text, encoding="utf-8")
        rig = read_description(path)
        assert rig.lines is not None
        assert rig.temperature is not None
    assert len(texts) == 2


def test_every_command_is_named():
    assert isinstance(rig, Group)
    assert [name for name in rig.commands if f"rig {name}" not in PAGE] == []


def test_every_fault_is_named():
    assert [kind for kind in KINDS if f"`{kind}`" not in PAGE] == []


def test_every_message_is_named():
    page = (REPO / "docs/reference/can.md").read_text(encoding="utf-8")
    assert [name for name in REQUIRED if name not in page and not name.startswith("COMP")] == []
