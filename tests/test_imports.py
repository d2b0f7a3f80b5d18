"""Doors between the rooms go one way; what only some rooms may touch, others do not."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "toolchain" / "triaxcal"

ROOM_OF_MODULE = {
    "records": "records",
    "records_csv": "records",
    "recordinglayout": "records",
    "certificate": "records",
    "measured": "records",
    "tomltable": "records",
    "unitfile": "records",
    "errors": "ground",
    "jsontext": "ground",
    "resources": "ground",
    "__init__": "ground",
    "__main__": "cli",
    "delivery": "delivery",
    "imudelivery": "delivery",
    "imuplan": "imuplan",
    "publish": "publish",
}
"""Modules beside the rooms. `ground` is below every room."""

MAY_IMPORT = {
    "ground": set(),
    "model": {"ground"},
    "records": {"ground", "model"},
    "simulation": {"ground", "model", "records", "dynamic"},
    "dynamic": {"ground", "model", "records"},
    "recording": {"ground", "model", "records"},
    "fit": {"ground", "model", "records", "recording"},
    "fixedpoint": {"ground", "model", "records"},
    "codegen": {"ground", "model", "records", "fixedpoint"},
    "publish": {"ground"},
    "delivery": {"ground", "model", "records", "fit", "dynamic", "fixedpoint", "codegen"},
    "design": {"ground", "model", "records"},
    "imuplan": {"ground", "model", "records", "dynamic", "simulation"},
    "targets": {"ground", "model", "records", "fit", "fixedpoint", "codegen", "delivery"},
    "uncertainty": {"ground", "model", "records", "fit", "fixedpoint"},
    "verify": {"ground", "model", "records", "fit", "fixedpoint", "codegen", "delivery", "targets"},
    "rig": {"ground", "model", "records", "simulation"},
    "batch": {"ground", "model", "records", "fit", "fixedpoint", "codegen", "delivery", "publish"},
    "report": {
        "ground",
        "model",
        "records",
        "fit",
        "fixedpoint",
        "codegen",
        "delivery",
        "uncertainty",
        "batch",
        "publish",
        "dynamic",
        "recording",
    },
}
"""rig -> records -> fit -> model -> fixedpoint -> codegen -> delivery -> cli, as data flow. A room
imports what lies before it; none imports report, which reads all, nor cli, which calls all."""

ONLY_IN = {
    "scipy": {"fit", "dynamic", "recording"},  # recording reads MAT-files by it
    "can": {"rig"},
    "cantools": {"rig"},
    "asammdf": {"rig"},
    "pyarrow": {"rig", "dynamic"},
    "jinja2": {"codegen", "report"},
    "click": {"cli"},
    "matplotlib": {"report"},
    "rich": {"rig", "cli"},
    "dask": {"batch"},
    "distributed": {"batch"},
    "h5py": {"dynamic"},
}


def room_of(module: str) -> str:
    """Room of a dotted module name below triaxcal."""
    first = module.split(".", maxsplit=1)[0]
    return ROOM_OF_MODULE.get(first, first)


def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


def imports(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and full dotted name of everything imported, inside functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: relative import"
            for alias in node.names:
                yield node.lineno, f"{node.module}.{alias.name}"


def wrong_imports(module: str, tree: ast.AST) -> list[str]:
    room = room_of(module)
    wrong = []
    for line, name in imports(tree):
        top, _, rest = name.partition(".")
        if top == "triaxcal":
            target = room_of(rest) if rest != "__version__" else "ground"
            if room not in ("cli", target) and target not in MAY_IMPORT[room]:
                wrong.append(f"{module}, line {line}: {room} imports {target} ({name})")
        elif top in ONLY_IN and room not in ONLY_IN[top]:
            wrong.append(f"{module}, line {line}: {top} belongs to {sorted(ONLY_IN[top])}")
    return wrong


def wrong_uses(module: str, tree: ast.AST) -> list[str]:
    """print, input, sys.exit, sys.argv, sys.stdout: of the command line alone."""
    if room_of(module) == "cli":
        return []
    wrong = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in ("print", "input", "exit", "quit"):
            wrong.append(f"{module}, line {node.lineno}: {node.id}")
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and (node.value.id, node.attr)
            in {("sys", a) for a in ("exit", "argv", "stdout", "stderr", "stdin")}
            | {("os", "_exit"), ("os", "abort")}
        ):
            wrong.append(f"{module}, line {node.lineno}: {node.value.id}.{node.attr}")
        if isinstance(node, ast.Name) and node.id == "SystemExit":
            wrong.append(f"{module}, line {node.lineno}: SystemExit")
    return wrong


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_doors_go_one_way(path: Path) -> None:
    assert room_of(module_name(path)) in {*MAY_IMPORT, "cli"}, "a new room: say what it may import"
    assert wrong_imports(module_name(path), tree_of(path)) == []


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_only_the_command_line_prints_and_exits(path: Path) -> None:
    assert wrong_uses(module_name(path), tree_of(path)) == []


def test_the_rule_itself_has_no_circle() -> None:
    done: set[str] = set()
    while len(done) < len(MAY_IMPORT):
        ready = {room for room, before in MAY_IMPORT.items() if before <= done} - done
        assert ready, f"a circle among {sorted(set(MAY_IMPORT) - done)}"
        done |= ready
    assert all("report" not in before and "cli" not in before for before in MAY_IMPORT.values())


def test_third_party_packages_are_declared() -> None:
    declared = {"numpy", *ONLY_IN}
    for path in sources():
        for _, name in imports(tree_of(path)):
            top = name.split(".")[0]
            assert top in sys.stdlib_module_names or top in declared | {"triaxcal"}, (
                f"{path}: {top}"
            )


# ---- the checker sees what it should ----


@pytest.mark.parametrize(
    ("module", "source", "found"),
    [
        ("model.thermal", "from triaxcal.fit.curves import x", "model imports fit"),
        ("fixedpoint.plan", "import triaxcal.codegen.render", "fixedpoint imports codegen"),
        ("codegen.render", "from triaxcal.report.files import all_files", "codegen imports report"),
        ("fit.curves", "from triaxcal import delivery", "fit imports delivery"),
        ("records", "def f():\n    from triaxcal.fit import curves", "records imports fit"),
        ("fit.curves", "from triaxcal.cli.main import main", "fit imports cli"),
        ("fixedpoint.plan", "from scipy.linalg import solve", "scipy belongs to"),
        ("fit.curves", "import jinja2", "jinja2 belongs to"),
        ("fit.curves", "import can", "can belongs to"),
        ("report.summary", "import click", "click belongs to"),
    ],
)
def test_a_wrong_door_is_seen(module: str, source: str, found: str) -> None:
    (wrong,) = wrong_imports(module, ast.parse(source))
    assert found in wrong


@pytest.mark.parametrize(
    "source", ["print(1)", "import sys\nsys.exit(1)", "x = sys.argv[1:]", "raise SystemExit(2)"]
)
def test_a_print_or_exit_is_seen(source: str) -> None:
    assert len(wrong_uses("fit.curves", ast.parse(source))) == 1
    assert wrong_uses("cli.main", ast.parse(source)) == []
