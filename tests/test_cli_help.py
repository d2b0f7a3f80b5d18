"""Help, names of units, width of the output, completion: what every command has in common."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.base.screentext import WIDTH, table, wrapped
from triaxcal.cli import entry, rig_options
from triaxcal.cli.main import SECTIONS, main

ROOT = Path(__file__).resolve().parents[1]


def commands(
    command: click.Command = main, name: str = "triaxcal"
) -> Iterator[tuple[str, click.Command]]:
    """Every command and subcommand, with its whole name."""
    yield name, command
    if isinstance(command, click.Group):
        context = click.Context(command)
        for part in command.list_commands(context):
            found = command.get_command(context, part)
            assert found is not None
            yield from commands(found, f"{name} {part}")


COMMANDS = dict(commands())


def shown(name: str, columns: int = WIDTH) -> str:
    done = CliRunner().invoke(
        main, [*name.split()[1:], "--help"], prog_name="triaxcal", terminal_width=columns,
        max_content_width=columns,
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    return done.output


# ---- help ----


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_has_an_example_that_is_accepted(name: str) -> None:
    lines = shown(name).partition("Example:\n")[2].splitlines()
    assert lines
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "triaxcal"
        assert line.strip().startswith(name)
        command: click.Command = main
        context = click.Context(main, **main.context_settings)
        while isinstance(command, click.Group) and arguments != ["--help"]:
            _, found, arguments = command.resolve_command(context, arguments)
            assert found is not None
            command = found
            if isinstance(command, click.Group):
                context = click.Context(command, context, **command.context_settings)
        if arguments != ["--help"]:
            # Refuses what the command does not take. With its parent: click keeps the help option
            # that it made first, and the parent decides whether that has -h.
            command.make_context(line, arguments, parent=context)


@pytest.mark.parametrize("columns", [80, 120])
@pytest.mark.parametrize("name", COMMANDS)
def test_no_line_of_the_help_is_cut_off_or_too_long(name: str, columns: int) -> None:
    text = shown(name, columns)
    assert "..." not in text.replace("[ARGS]...", "").replace("UNITS...", "")
    assert max(map(len, text.splitlines())) <= columns


def test_every_command_has_a_section_in_the_help() -> None:
    names = [name for section in SECTIONS.values() for name in section]
    assert len(set(names)) == len(names)
    assert set(main.commands) <= set(names)
    for name in names:
        assert f"\n  {name} " in shown("triaxcal")


def test_the_help_of_rig_needs_no_optional_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rig_options, "_NEEDED", ("no_such_package",))
    assert "--bus" in shown("triaxcal rig run")
    with pytest.raises(RefusedError) as refusal:
        CliRunner().invoke(
            main, ["rig", "status", "--unit", "AT-SIM-BENCH"], catch_exceptions=False
        )
    assert str(refusal.value) == (
        "triaxcal rig: missing packages: no_such_package; install them: " + install_command("rig")
    )


def test_the_command_that_installs_runs_in_the_folder_where_one_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = tmp_path / "my lab" / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    monkeypatch.setattr(sys, "executable", str(python))
    monkeypatch.setenv("PATH", "/usr/bin")
    monkeypatch.chdir(tmp_path / "my lab")
    assert install_command("ulog") == ".venv/bin/python -m pip install 'triaxcal[ulog]'"
    monkeypatch.chdir(python.parent)
    assert install_command("ulog") == "./python -m pip install 'triaxcal[ulog]'"
    monkeypatch.chdir("/")
    monkeypatch.setattr(sys, "executable", "/opt/my lab/python")
    monkeypatch.chdir(tmp_path)
    assert install_command("ulog") == "'/opt/my lab/python' -m pip install 'triaxcal[ulog]'"
    monkeypatch.setattr(sys, "executable", str(python))
    monkeypatch.setenv("PATH", str(python.parent))
    assert install_command("ulog") == "python -m pip install 'triaxcal[ulog]'"


# ---- the name of a unit ----


def test_a_name_is_a_folder_in_units(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    unit = rig_options.UnitFolder()
    assert unit.convert("AT-SIM", None, None) == Path("units/AT-SIM")
    assert unit.convert("units/AT-SIM", None, None) == Path("units/AT-SIM")
    monkeypatch.chdir(ROOT / "units")
    assert unit.convert("AT-SIM", None, None) == Path("AT-SIM")
    assert unit.convert(".", None, None) == Path()


@pytest.mark.parametrize("command", ["calib", "dynamic", "poses", "drift", "history", "verify"])
def test_a_file_is_refused_and_its_folder_named(
    monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises(RefusedError) as refusal:
        CliRunner().invoke(main, [command, "units/AT-SIM/unit.toml"], catch_exceptions=False)
    assert str(refusal.value) == (
        "units/AT-SIM/unit.toml: a file; expected the unit's folder; give units/AT-SIM"
    )


def test_an_unknown_name_is_refused_with_the_names_there_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises(RefusedError, match=r"^units/NOPE: no such unit; units in units: AT-CH"):
        CliRunner().invoke(main, ["history", "NOPE"], catch_exceptions=False)


def test_the_shell_completes_names_of_units() -> None:
    asked = {
        "_TRIAXCAL_COMPLETE": "bash_complete",
        "COMP_WORDS": "x calib AT-SIM",
        "COMP_CWORD": "2",
    }
    program = "import sys; sys.argv[0] = 'triaxcal'; from triaxcal.cli.entry import entry; entry()"
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT, capture_output=True, text=True, check=False, env=os.environ | asked,
    )  # fmt: skip
    assert done.stdout.split() == ["plain,AT-SIM", "plain,AT-SIM-BENCH"], done.stderr


# ---- words on the screen ----


def test_words_go_on_below_where_they_started() -> None:
    assert wrapped("method      one two three\n\n* a  1  2", 20) == (
        "method      one two three\n\n* a  1  2"  # the words start in the right half
    )
    assert wrapped("method    one two three", 20) == "method    one two\n          three"
    assert wrapped("  one two three", 11) == "  one two\n  three"
    assert wrapped("x" * 30, 20) == "x" * 30


@given(st.text(alphabet=" ab\n", max_size=200), st.integers(8, 40))
def test_wrapping_keeps_every_word(text: str, width: int) -> None:
    assert wrapped(text, width).split() == text.split()


def test_heads_of_a_wide_table_are_broken() -> None:
    names = ["first", *["additive-first-order"] * 5]
    lines = table(names, [["a", *["1.0"] * 5]])
    assert max(map(len, lines)) <= WIDTH
    assert [line.split() for line in lines[:-1]] == [
        ["additive-"] * 5, ["first-"] * 5, ["first", *["order"] * 5]
    ]  # fmt: skip
    assert table(["a", "b c"], [["1", "2"]]) == ["a  b c", "1    2"]


# ---- start ----


def test_a_system_without_sighup(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delattr(signal, "SIGHUP")
    monkeypatch.setattr(sys, "argv", ["triaxcal", "--version"])
    before = signal.getsignal(signal.SIGTERM)
    try:
        entry.entry()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert capsys.readouterr().out.startswith("triaxcal, version ")


def loaded(program: str) -> set[str]:
    """Modules that a program has loaded at its end."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}\nprint('\\n', *sys.modules)"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return set(done.stdout.splitlines()[-1].split())


def test_importing_the_package_loads_nothing_heavy() -> None:
    """So it takes no longer than importing numpy, whatever the machine does besides."""
    assert not loaded("import triaxcal") & {"numpy", "scipy", "jinja2", "click", "matplotlib"}


def test_a_tilters_calibration_does_not_load_what_it_does_not_need(tmp_path: Path) -> None:
    """Each takes as long to load as a good part of the whole calibration."""
    program = (
        "from triaxcal.cli.main import main\n"
        f"main(['calib', 'AT-SIM', '--build', {str(tmp_path)!r}], standalone_mode=False)"
    )
    slow = {"scipy.special", "scipy.optimize", "scipy.linalg", "numpy.ma", "rich", "matplotlib"}
    assert not loaded(program) & slow
