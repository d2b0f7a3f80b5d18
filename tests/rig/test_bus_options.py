"""Values of --bus: interface, channel, options, python-can's configuration files."""

from __future__ import annotations

import importlib
import inspect
import re
import socket
import threading

import can
import pytest
from can.interfaces import BACKENDS
from can.typechecking import BitTimingDict, BitTimingFdDict
from rig_cases import REPO

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.rig.bus.openbus import bus_name, open_bus
from triaxcal.rig.sources.source import kind_of

PAGE = (REPO / "docs/reference/can.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^\| `([a-z_]+:[^`]+)` \| [^|]*\|", PAGE, re.MULTILINE)
THROUGH = {"fd", "bitrate", "data_bitrate", *BitTimingDict.__annotations__,
           *BitTimingFdDict.__annotations__}  # fmt: skip
"""Options that classes take among their other keyword arguments, by python-can's documentation."""


class Recorder:
    """Stands for a driver: keeps what python-can makes of the options."""

    made: tuple[tuple, dict] = ((), {})

    def __init__(self, *channel, **options):
        Recorder.made = (channel, options)


@pytest.fixture
def recorder(monkeypatch):
    monkeypatch.setitem(BACKENDS, "pcan", (__name__, "Recorder"))
    return Recorder


@pytest.mark.parametrize(
    ("name", "interface", "channel", "options"),
    [
        ("pcan:PCAN_USBBUS1", "pcan", "PCAN_USBBUS1", {}),
        ("pcan:,bitrate=5", "pcan", "", {"bitrate": "5"}),
        ("pcan:bitrate=5", "pcan", "", {"bitrate": "5"}),
        ("vector:0,1,app_name=A", "vector", "0,1", {"app_name": "A"}),
        ("socketcand:can0,host=h,port=1", "socketcand", "can0", {"host": "h", "port": "1"}),
        ("serial:/dev/ttyS0,baudrate=9600", "serial", "/dev/ttyS0", {"baudrate": "9600"}),
    ],
)
def test_what_a_name_says(name, interface, channel, options):
    said = bus_name(name)
    assert (said.interface, said.channel, said.options) == (interface, channel, options)
    assert kind_of(name).name == "python-can"


def test_an_option_twice_is_refused():
    with pytest.raises(UsageError, match="with an option twice"):
        bus_name("pcan:X,bitrate=1,bitrate=2")


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_examples_of_the_page_name_options_that_the_classes_have(example):
    if example.startswith("config:"):
        return
    said = bus_name(example)
    module, name = BACKENDS[said.interface]
    try:
        known = inspect.signature(getattr(importlib.import_module(module), name)).parameters
    except (ImportError, AttributeError) as error:
        pytest.skip(f"{said.interface}: {error}")
    assert set(said.options) <= set(known) | THROUGH
    assert "kwargs" in known


def test_there_are_examples():
    assert len(EXAMPLES) == 13


def test_the_timing_of_can_fd(recorder):
    (example,) = [e for e in EXAMPLES if e.startswith("pcan") and "f_clock" in e]
    open_bus(example, fd=False)
    channel, options = recorder.made
    timing = options["timing"]
    assert channel == ("PCAN_USBBUS1",)
    assert options["fd"] is True
    assert (timing.nom_bitrate, timing.data_bitrate, timing.f_clock) == (500_000, 2_000_000, 8e7)


def test_a_plan_of_can_fd_asks_for_it(recorder):
    open_bus("pcan:PCAN_USBBUS1,bitrate=500000", fd=True)
    assert recorder.made == (("PCAN_USBBUS1",), {"fd": True, "bitrate": 500_000})
    open_bus("pcan:PCAN_USBBUS1,fd=false", fd=True)
    assert recorder.made[1] == {"fd": False}


def test_a_section_of_the_configuration_file(recorder, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "can.conf").write_text(
        "[default]\nbitrate = 125000\n[lab]\ninterface = pcan\nchannel = PCAN_USBBUS7\n"
    )
    open_bus("config:lab", fd=False)
    assert recorder.made == (("PCAN_USBBUS7",), {"bitrate": 125_000})
    open_bus("config:lab,bitrate=250000", fd=True)
    assert recorder.made == (("PCAN_USBBUS7",), {"fd": True, "bitrate": 250_000})
    with pytest.raises(
        RefusedError, match=r"state interface and channel in \[none\] of python-can"
    ):
        open_bus("config:none", fd=False)


def test_options_reach_a_real_interface():
    with open_bus("virtual:options,receive_own_messages=true", fd=False) as bus:
        bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        assert bus.recv(5).arbitration_id == 0x123
    with open_bus("virtual:options", fd=False) as bus:
        bus.send(can.Message(arbitration_id=0x123))
        assert bus.recv(0) is None


def test_a_can_device_of_another_computer():
    """A daemon that speaks socketcand's protocol, on loopback."""

    def serve(door):
        end, _ = door.accept()
        with end:
            end.sendall(b"< hi >")
            for _ in ("open", "rawmode"):
                end.recv(100)
                end.sendall(b"< ok >")
            end.sendall(b"< frame 101 1700000000.250000 0102AB >")
            end.recv(100)

    with socket.create_server(("127.0.0.1", 0)) as door:
        thread = threading.Thread(target=serve, args=(door,), daemon=True)
        thread.start()
        port = door.getsockname()[1]
        with open_bus(f"socketcand:can0,host=127.0.0.1,port={port}", fd=False) as bus:
            frame = bus.recv(20)
            assert (frame.arbitration_id, bytes(frame.data)) == (0x101, b"\x01\x02\xab")
            assert frame.timestamp == 1_700_000_000.25
        thread.join(20)
