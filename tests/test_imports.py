"""Doors between the rooms go one way; what only some rooms may touch, others do not."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "toolchain" / "triaxcal"

MAY_IMPORT = {
    "base": set(),
    "model": {"base"},
    "unit": {"base", "model"},
    "readings": {"base", "model", "unit"},
    "poses": {"base", "model", "unit", "readings"},
    "fitting": {"base", "model", "unit", "readings", "poses"},
    "diagnosis": {"base", "model", "unit", "readings", "poses", "fitting"},
    "dynamic": {"base", "model", "unit", "readings", "poses"},
    "evidence": {"base", "model", "unit", "readings", "poses", "dynamic"},
    "fixedpoint": {"base", "model", "unit"},
    "codegen": {"base", "model", "unit", "readings", "fixedpoint"},
    "uncertainty": {"base", "model", "unit", "readings", "poses", "fitting", "fixedpoint"},
    "noise": {"base", "model", "unit", "readings"},
    "simulation": {"base", "model", "unit", "readings", "dynamic"},
    "design": {"base", "model", "unit", "dynamic", "simulation"},
    "rig": {"base", "model", "unit", "readings", "simulation"},
    "guide": {"base", "model", "unit", "readings", "dynamic", "rig"},
    "device": {"base", "codegen"},
    "keytable": {"base", "unit", "dynamic", "simulation", "design", "rig"},
    "delivery": {
        "base", "model", "unit", "readings", "poses", "fitting", "diagnosis", "dynamic",
        "evidence", "fixedpoint", "codegen", "uncertainty",
    },
    "performance": {
        "base", "model", "unit", "readings", "fitting", "uncertainty", "noise", "delivery",
    },
    "exports": {"base", "model", "unit", "fitting", "codegen", "delivery"},
    "targets": {
        "base", "model", "unit", "readings", "fitting", "fixedpoint", "codegen", "delivery",
    },
    "verify": {
        "base", "model", "unit", "readings", "fitting", "fixedpoint", "codegen", "delivery",
        "targets",
    },
    "batch": {
        "base", "model", "unit", "readings", "fitting", "fixedpoint", "codegen", "delivery",
        "device", "dynamic", "simulation",
    },
    "report": {
        "base", "model", "unit", "readings", "poses", "fitting", "diagnosis", "dynamic",
        "evidence", "fixedpoint", "codegen", "uncertainty", "delivery", "batch", "device",
        "performance", "design",
    },
}  # fmt: skip
"""What each room may import: what lies below it. None but the API imports report, which reads all,
nor the API, nor cli, which calls all."""
MAY_IMPORT["api"] = set(MAY_IMPORT)

ONLY_IN = {
    "scipy": {
        "fitting",
        "dynamic",
        "evidence",
        "readings",
        "noise",
        "performance",
    },  # readings: MAT-files
    "allantools": {"noise"},
    "can": {"rig", "device"},
    "pyxcp": {"device"},
    "construct": {"device"},  # what pyxcp's answers are parsed with
    "cantools": {"rig"},
    "pyvisa": {"rig"},
    "pymodbus": {"rig"},
    "serial": {"rig"},
    "asammdf": {"rig", "readings"},
    "pyarrow": {"rig", "readings"},
    "z3": {"verify"},
    "bincopy": {"codegen"},
    "elftools": {"codegen"},
    "lxml": {"report"},
    "signxml": {"report"},
    "cryptography": {"report"},
    "jinja2": {"codegen", "report"},
    "markupsafe": {"report"},  # the type of text that jinja2 need not escape
    "segno": {"report"},
    "click": {"cli"},
    "matplotlib": {"report", "api"},  # api: the type of `plot` alone
    "rich": {"rig", "cli"},
    "dask": {"batch"},
    "distributed": {"batch"},
    "h5py": {"readings"},
    "openpyxl": {"readings"},
    "pyulog": {"readings"},
    "pymavlink": {"readings"},
    "rosbags": {"readings"},
}


def room_of(module: str) -> str:
    """Room of a dotted module name below triaxcal."""
    first = module.split(".", maxsplit=1)[0]
    return "cli" if first == "__main__" else first


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
            target = room_of(rest) if rest != "__version__" else "base"
            if room not in ("cli", "__init__", target) and target not in MAY_IMPORT[room]:
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
    assert room_of(module_name(path)) in {*MAY_IMPORT, "__init__", "cli"}, (
        "a new room: say what it may import"
    )
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
    below = [before for room, before in MAY_IMPORT.items() if room != "api"]
    assert all(not before & {"report", "api", "cli"} for before in below)


def import_graph() -> dict[str, set[str]]:
    """Modules that each module imports, inside functions too."""
    names = {module_name(path) for path in sources()}
    graph = {}
    for path in sources():
        found = set()
        for _, name in imports(tree_of(path)):
            rest = name.removeprefix("triaxcal.")
            if rest != name:
                found.add(rest if rest in names else rest.rpartition(".")[0])
        graph[module_name(path)] = found & names
    return graph


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """What is left when everything that no circle passes through has been taken away, sorted."""
    left = {name: set(after) for name, after in graph.items()}
    while True:
        ends = {n for n, after in left.items() if not after & left.keys()}
        starts = left.keys() - set().union(*left.values()) if left else set()
        if not ends | starts:
            return [sorted(left)] if left else []
        left = {n: after for n, after in left.items() if n not in ends | starts}


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert circles(import_graph()) == []


def test_no_folders_import_each_other_in_a_circle() -> None:
    def folder(module: str) -> str:
        return (
            module if (PACKAGE / module.replace(".", "/")).is_dir() else module.rpartition(".")[0]
        )

    graph: dict[str, set[str]] = {}
    for module, after in import_graph().items():
        graph.setdefault(folder(module), set()).update(map(folder, after))
    assert circles({name: after - {name} for name, after in graph.items()}) == []


def test_a_circle_is_seen() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}, "e": set()}
    assert circles(graph) == [["b", "c"]]


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
        ("model.thermal", "from triaxcal.fitting.tilter.curves import x", "model imports fitting"),
        ("fixedpoint.plan", "import triaxcal.codegen.render", "fixedpoint imports codegen"),
        ("codegen.render", "from triaxcal.report.files import all_files", "codegen imports report"),
        ("fitting.curves", "from triaxcal import delivery", "fitting imports delivery"),
        (
            "readings.text",
            "def f():\n    from triaxcal.fitting import curves",
            "readings imports fitting",
        ),
        ("fitting.curves", "from triaxcal.cli.main import main", "fitting imports cli"),
        ("fixedpoint.plan", "from scipy.linalg import solve", "scipy belongs to"),
        ("fitting.curves", "import jinja2", "jinja2 belongs to"),
        ("fitting.curves", "import can", "can belongs to"),
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
    assert len(wrong_uses("fitting.curves", ast.parse(source))) == 1
    assert wrong_uses("cli.main", ast.parse(source)) == []
