"""docs/how-to/bench.md lists every setting with its default, every command and every fault."""

from __future__ import annotations

import re
from dataclasses import fields

import pytest
from click import Group
from rig_cases import REPO

from triaxcal.cli.rig import rig
from triaxcal.rig.dbc import REQUIRED
from triaxcal.rig.plan import Stillness, Thermal
from triaxcal.rig.simorders import KINDS

PAGE = (REPO / "docs/how-to/bench.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("settings", [Stillness(), Thermal()])
def test_every_setting_is_listed_with_its_default(settings):
    for field in fields(settings):
        line = re.search(rf"\| `{field.name}` \| ([0-9.]+) \|", PAGE)
        assert line is not None, field.name
        assert float(line[1]) == getattr(settings, field.name), field.name


def test_every_command_is_named():
    assert isinstance(rig, Group)
    assert [name for name in rig.commands if f"rig {name}" not in PAGE] == []


def test_every_fault_is_named():
    assert [kind for kind in KINDS if f"`{kind}`" not in PAGE] == []


def test_every_message_is_named():
    page = (REPO / "docs/reference/can.md").read_text(encoding="utf-8")
    assert [name for name in REQUIRED if name not in page and not name.startswith("COMP")] == []
