"""Drivers of chambers and positioners against instruments that are not theirs to write."""

from __future__ import annotations

import socket
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

import pytest
from click.testing import CliRunner
from instrument_cases import SIMULATED, free_port, modbus_server, plan_with

from triaxcal.base.errors import RefusedError
from triaxcal.cli.init import init
from triaxcal.keytable.catalogue import FILES
from triaxcal.keytable.reference import reference_markdown
from triaxcal.rig.check.check import Finding
from triaxcal.rig.check.instrumentcheck import instrument_findings
from triaxcal.rig.hands.instrument import DRIVERS, Driver, Order, numbers_in

OWN = "import sys, pathlib; p = pathlib.Path(sys.argv[1]); "


def chamber_of(plan):
    by = plan.equipment.chamber_by
    return by.driver.open(by.settings, plan.equipment.chamber.timeout_s)


@pytest.mark.parametrize(
    ("answer", "numbers"),
    [
        ("23.50\n", (23.5,)), ("T1=-40.2 C, RH 5", (-40.2, 5.0)), ("+1.25E+01", (12.5,)),
        (".5;1.", (0.5, 1.0)), ("CH2 7", (7.0,)),
    ],
)  # fmt: skip
def test_the_numbers_of_an_answer(answer, numbers):
    assert numbers_in(answer, "T?") == numbers


def test_an_answer_without_a_number_is_refused():
    with pytest.raises(RefusedError, match=r"TEMP\?: answered 'ERROR'; expected a number"):
        numbers_in("ERROR\n", "TEMP?")


def test_any_command_line_sets_and_reads(tmp_path):
    state = tmp_path / "degc"
    words = [sys.executable, "-c", OWN + "p.write_text(sys.argv[2])", str(state), "{degc:.2f}"]
    reads = [sys.executable, "-c", OWN + "print('now', p.read_text(), 'degC')", str(state)]
    plan = plan_with(
        tmp_path, f'[chamber]\ndriver = "command"\ncommand = {words}\ncommand_read = {reads}\n'
    )
    chamber = chamber_of(plan)
    chamber.write(plan.equipment.chamber.order(-12.5))
    assert state.read_text() == "-12.50"
    assert plan.equipment.chamber_by.readable
    assert chamber.read() == (-12.5,)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("raise SystemExit('door open')", "ended with exit code 1: door open"),
        ("import time; time.sleep(60)", r"did not end within 0.5 s"),
    ],
)
def test_a_command_line_that_fails_is_one_line(tmp_path, program, said):
    plan = plan_with(
        tmp_path,
        f'[chamber]\ndriver = "command"\ntimeout_s = 0.5\n'
        f"command = {[sys.executable, '-c', program]}\n",
    )
    with pytest.raises(RefusedError, match=said):
        chamber_of(plan).write(plan.equipment.chamber.order(20.0))


def test_a_program_that_is_not_there(tmp_path):
    plan = plan_with(tmp_path, '[chamber]\ndriver = "command"\ncommand = ["no-such-program"]\n')
    with pytest.raises(RefusedError, match="no-such-program: cannot be started: no such file"):
        chamber_of(plan).write(plan.equipment.chamber.order(20.0))


SCPI = """
[chamber]
driver = "scpi"
scpi_library = {library!r}
scpi_resource = {resource!r}
scpi_set = "TEMP {{degc:.2f}}"
scpi_read = "TEMP?"
timeout_s = 0.5
"""


@pytest.mark.parametrize("resource", ["GPIB::8::INSTR", "TCPIP::chamber::5025::SOCKET"])
def test_scpi_over_visa(tmp_path, resource):
    pytest.importorskip("pyvisa_sim")
    plan = plan_with(tmp_path, SCPI.format(library=SIMULATED, resource=resource))
    chamber = chamber_of(plan)
    chamber.write(plan.equipment.chamber.order(-40.0))
    assert chamber.read()[0] == -40.0
    chamber.close()


def test_scpi_that_speaks_kelvin_and_acknowledges(tmp_path):
    pytest.importorskip("pyvisa_sim")
    tables = SCPI.format(library=SIMULATED, resource="GPIB::8::INSTR")
    tables = tables.replace("TEMP {degc:.2f}", "KEL {kelvin:.2f}").replace("TEMP?", "KEL?")
    plan = plan_with(tmp_path, tables + 'scpi_answers = true\nunit = "K"\n')
    chamber = chamber_of(plan)
    chamber.write(plan.equipment.chamber.order(-40.0))
    assert chamber.read() == (233.15,)
    assert plan.equipment.chamber.unit.degc(233.15) == pytest.approx(-40.0)
    chamber.close()


def test_scpi_that_does_not_answer_is_one_line(tmp_path):
    """A socket that takes everything and says nothing, by pyvisa-py."""
    pytest.importorskip("pyvisa_py")
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        port = deaf.getsockname()[1]
        tables = SCPI.format(library="@py", resource=f"TCPIP::127.0.0.1::{port}::SOCKET")
        chamber = chamber_of(plan_with(tmp_path, tables))
        with pytest.raises(RefusedError, match=r"SOCKET, TEMP\?: no answer within 0.5 s"):
            chamber.read()
        chamber.close()


def test_scpi_of_nobody_is_one_line(tmp_path):
    pytest.importorskip("pyvisa_py")
    tables = SCPI.format(library="@py", resource=f"TCPIP::127.0.0.1::{free_port()}::SOCKET")
    with pytest.raises(
        RefusedError, match=r"::SOCKET(, TEMP\?: no answer|: cannot be opened)"
    ) as refusal:
        chamber_of(plan_with(tmp_path, tables)).read()
    assert "\n" not in str(refusal.value)


MODBUS = """
[chamber]
driver = "modbus"
modbus_address = "127.0.0.1:{port}"
modbus_set = [4]
modbus_read = [{read}]
modbus_type = "{kind}"
modbus_per_unit = {steps}
timeout_s = 2
"""


@pytest.mark.parametrize(
    ("kind", "steps", "degc", "registers"),
    [
        # Two's complement of -405 is 65131; IEEE 754 of -40.5f is 0xC2220000.
        ("int16", 10, -40.5, [65131, 0]), ("float32", 1, -40.5, [0xC222, 0]),
        ("int32", 100, 85.25, [0, 8525]),
    ],
)  # fmt: skip
def test_modbus(tmp_path, kind, steps, degc, registers):
    pytest.importorskip("pymodbus")
    given = [0] * 10
    with modbus_server([*given[:6], *registers, 0, 0]) as port:
        tables = MODBUS.format(port=port, kind=kind, steps=steps, read=6)
        plan = plan_with(tmp_path, tables)
        chamber = chamber_of(plan)
        assert chamber.read() == (degc,)
        chamber.write(plan.equipment.chamber.order(degc))
        chamber.close()
        again = chamber_of(plan_with(tmp_path, tables.replace("[6]", "[4]")))
        assert again.read() == (degc,)
        again.close()


def test_modbus_of_no_such_register_and_of_nobody(tmp_path):
    pytest.importorskip("pymodbus")
    with modbus_server([0] * 10) as port:
        tables = MODBUS.format(port=port, kind="int16", steps=1, read=900)
        chamber = chamber_of(plan_with(tmp_path, tables))
        with pytest.raises(RefusedError, match="register 900: refused by the instrument"):
            chamber.read()
        chamber.close()
    with pytest.raises(RefusedError, match="cannot be opened: no Modbus there"):
        chamber_of(plan_with(tmp_path, tables))


CHAMBER_DBC = """VERSION ""
BU_: Bench Chamber
BO_ 1792 Order: 8 Bench
 SG_ SetPoint : 7|16@0- (0.1,0) [-100|300] "degC" Chamber
 SG_ On : 16|1@1+ (1,0) [0|1] "" Chamber
BO_ 2566848741 State: 8 Chamber
 SG_ Actual : 0|32@1- (1,0) [0|0] "degC" Bench
SIG_VALTYPE_ 2566848741 Actual : 1;
"""
CAN = """
[chamber]
driver = "can"
can_bus = "virtual:chamber"
can_dbc = "chamber.dbc"
can_set = ["Order.SetPoint"]
can_read = ["State.Actual"]
timeout_s = 20
"""


def test_can_signals(tmp_path):
    """The other end packs by hand: big-endian 16 bits of 0.1 K; float32 under a 29-bit ID."""
    import can

    (tmp_path / "chamber.dbc").write_text(CHAMBER_DBC)
    plan = plan_with(tmp_path, CAN)
    chamber = chamber_of(plan)
    with can.Bus(interface="virtual", channel="chamber") as there:
        chamber.write(plan.equipment.chamber.order(-40.5))
        order = there.recv(5)
        assert (order.arbitration_id, bytes(order.data[:3])) == (0x700, b"\xfe\x6b\x00")
        with pytest.raises(RefusedError, match=r"virtual:chamber, State: no message within 0.1 s"):
            chamber_of(plan_with(tmp_path, CAN.replace("20", "0.1"))).read()
        answer = can.Message(
            arbitration_id=0x18FF00E5, is_extended_id=True, data=b"\x00\x00\x22\xc2" + bytes(4)
        )
        stop = threading.Event()

        def says():
            while not stop.wait(0.02):
                there.send(answer)

        thread = threading.Thread(target=says)
        thread.start()
        try:
            assert chamber.read() == (-40.5,)
        finally:
            stop.set()
            thread.join()
    chamber.close()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"Order.SetPoint"', '"Order.SetPiont"'), r'has no Order.SetPiont \(did you mean "SetPoi'),
        (('"Order.SetPoint"', '"Oder.SetPoint"'), r'has no Oder.SetPoint \(did you mean "Order"'),
        (('"chamber.dbc"', '"none.dbc"'), r"none.dbc: cannot be read: "),
    ],
)
def test_can_signals_that_are_not_there(tmp_path, change, said):
    (tmp_path / "chamber.dbc").write_text(CHAMBER_DBC)
    plan = plan_with(tmp_path, CAN.replace(*change))
    with pytest.raises(RefusedError, match=said):
        chamber_of(plan)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ('[chamber]\ndriver = "skpi"', r'\[chamber\] driver: found \'skpi\' \(did you mean "scpi"'),
        ('[chamber]\ndriver = "scpi"', r"\[chamber\] scpi_resource: missing; expected it, for dri"),
        (
            '[chamber]\ndriver = "command"\ncommand = ["c"]\nscpi_read = "T?"',
            r'\[chamber\] scpi_read: is of driver "scpi"; expected keys of driver "command"',
        ),
        (
            '[chamber]\ndriver = "command"\ncommand = ["c", "{celsius}"]',
            r"\[chamber\] command: found '\{celsius\}'; expected between braces one of degc, kelv",
        ),
        (
            ('[positioner]\ndriver = "command"\ncommand = ["c", "{angle2}"]\n'
            "angles = {TP1 = [0], TP2 = [90]}"),
            r"\[positioner\] command: found '\{angle2\}'; expected .* position, number, angle1",
        ),
        (
            '[chamber]\ndriver = "command"\ncommand = ["c"]\nrange_degc = [0, 24]',
            r"temperatures_degc: found 25 degC; expected temperatures of the chamber's range, 0",
        ),
        ("[chamber]\nrange_degc = [30, 40]", r"safe_degc: found 23 degC; expected a temperature"),
        ("[positioner]\nangles = {TP7 = [0]}", r"angles: found a table; expected a table of pos"),
        ("[positioner]\nangles = {TP1 = [0], TP2 = [0, 1]}", r"angles: found a table; expected"),
        (
            ('[positioner]\nangles = {TP1 = [0], TP2 = [0], TP4 = [0], TP5 = [0], TP6 = [0]}\n'
            'home = "CP1"'),
            r"\[positioner\] angles: missing; expected angles of TP3, CP1",
        ),
        ("[unattended]\nattempts = 0", r"\[unattended\] attempts: found 0; expected a whole num"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused(tmp_path, tables, said):
    with pytest.raises(RefusedError, match=said):
        plan_with(tmp_path, tables + "\n")


def test_an_address_may_be_corrected_within_a_session(tmp_path):
    """What decides about dwells is in the hash that `resume` compares; an address is not."""
    tables = '[chamber]\ndriver = "command"\ncommand = ["{}"]\n'
    first = plan_with(tmp_path, tables.format("a"))
    assert first.sha256 == plan_with(tmp_path, tables.format("b")).sha256
    assert first.sha256 != plan_with(tmp_path, tables.format("a"), temps="[20, 26]").sha256


def test_a_positioner_is_told_angles_or_a_number(tmp_path):
    others = ", ".join(f"TP{k} = [0, {30 * k}]" for k in range(2, 7))
    angles = f"[positioner]\nangles = {{TP1 = [0, 90], CP2 = [25, -90], {others}}}\n"
    positioner = plan_with(tmp_path, angles).equipment.positioner
    assert positioner.order("CP2").numbers == (25.0, -90.0)
    assert positioner.order("CP2").words == {
        "position": "CP2", "number": 8, "angle1": 25.0, "angle2": -90.0,
    }  # fmt: skip
    assert positioner.is_at("TP1", (359.8, -270.3))
    assert not positioner.is_at("TP1", (0.6, 90.0))
    assert not positioner.is_at("TP1", (0.0,))
    plain = plan_with(tmp_path, "").equipment.positioner
    assert plain.order("TP4").numbers == (4.0,)
    assert plain.is_at("TP4", (4.0,))
    assert not plain.is_at("TP4", (364.0,))


@pytest.mark.parametrize(
    ("asks", "good", "said"),
    [
        ("TEMP?", True, "chamber answers 21.50 degC"),
        ("KEL?", False, "chamber answers 294.65 degC, outside range_degc -40 to 85: another unit?"),
        ("STATE?", False, "chamber: STATE?: answered 'RUNNING'; expected a number"),
    ],
)
def test_the_check_asks_the_instruments(tmp_path, asks, good, said):
    pytest.importorskip("pyvisa_sim")
    copy = tmp_path / "instruments.yaml"  # another file is another simulation, as it is at first
    copy.write_text(Path(SIMULATED.removesuffix("@sim")).read_text())
    tables = SCPI.format(library=f"{copy}@sim", resource="GPIB::8::INSTR").replace("TEMP?", asks)
    assert instrument_findings(plan_with(tmp_path, tables).equipment) == [Finding(good, said)]


def test_the_check_of_what_cannot_be_asked_and_of_a_table(tmp_path):
    prints = [sys.executable, "-c", "print(30.0)"]
    tables = f"""
[chamber]
driver = "command"
command = ["none"]
[positioner]
driver = "command"
command = ["none"]
command_read = {prints}
angles = {{{", ".join(f"TP{k} = [{k}, 0]" for k in range(1, 7))}}}
"""
    assert instrument_findings(plan_with(tmp_path, tables).equipment) == [
        Finding(True, "chamber cannot be asked: command_read is not given"),
        Finding(False, "positioner answers 30, not 2"),
    ]
    assert instrument_findings(plan_with(tmp_path, "").equipment) == []


@dataclass(frozen=True)
class _Nothing:
    """No keys."""


def test_a_driver_added_at_run_time_is_read_and_explained(tmp_path):
    told = []

    class Toy:
        def write(self, order):
            told.append(order.numbers)

    toy = Driver("toy", "toy", "A test's.", _Nothing, lambda _settings, _timeout: Toy())
    with DRIVERS.added(toy):
        plan = plan_with(tmp_path, '[chamber]\ndriver = "toy"\n')
        chamber_of(plan).write(Order({}, (1.0,)))
        assert "toy: A test's." in reference_markdown(FILES["rig"]())
        made = CliRunner().invoke(init, [str(tmp_path / "new"), "--kind", "rig"])
        assert made.exit_code == 0
        assert "toy: A test's." in (tmp_path / "new" / "plan.toml").read_text()
    assert told == [(1.0,)]
