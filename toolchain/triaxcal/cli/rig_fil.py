"""`triaxcal rig fil`: build a node, start and ask it; or check one that is on a bus."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.compilers import find_compiler
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.shim import write_shim
from triaxcal.delivery.firmware import Firmware
from triaxcal.delivery.unit import deliver
from triaxcal.fixedpoint.angles import TURN, angles
from triaxcal.rig.description.dbc import read_dbc
from triaxcal.rig.node.fil import (
    CODE_BITS,
    NODE_SOURCES,
    Agreement,
    Int32Array,
    Results,
    Routine,
    exchange,
    layout_of,
    packing_source,
    vectors,
)
from triaxcal.rig.node.listen import listen
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.sources.port import Port, SocketPort


def firmware_in_the_loop(
    setup: Setup, samples: int, bus: str | None, seed: int, own_sensor: bool = False
) -> Agreement:
    """Calibrate the unit, and compare the answers of its node.

    Without `bus` the node is built and started here. With `own_sensor` it is not asked: it sends
    its raw codes and its results.

    Raises
    ------
    RefusedError
        When the unit is refused, its codes do not fit the frames, a tool is missing, no node
        answers, or an answer differs.
    """
    layout, bits = layout_of(setup.rig), setup.unit.adc.bits
    if bits > CODE_BITS[layout]:
        raise RefusedError(
            f"{setup.unit.name}, [adc] bits",
            f"found {bits}",
            expected=f"at most {CODE_BITS[layout]}, the codes of RIG_XY and RIG_Z",
            remedy='a plan with rig = "tilter-fd" has 32 bits',
        )
    delivery = deliver(setup.folder)
    plan = delivery.plan
    routine, angles_plan = routine_of(delivery.firmware), delivery.firmware.angles
    dbc = read_dbc(setup.rig.bus_file, angles=angles_plan is not None)
    with contextlib.ExitStack() as stack:
        if bus is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            node = build_node(Path(folder), delivery.files, setup)
            port: Port = SocketPort(stack.enter_context(node_on(node)))
        else:
            from triaxcal.rig.sources.busport import port_of  # noqa: PLC0415  imports python-can

            port = stack.enter_context(port_of(bus, fd=layout == "fd"))
        if own_sensor:
            return listen(port, dbc, samples, routine, setup.unit.serial)
        temps, raw = vectors(samples, (plan.temp_min_code, plan.temp_max_code), seed, bits)
        return exchange(port, dbc, temps, raw, routine, layout)


def routine_of(firmware: Firmware) -> Routine:
    """What Python expects of a node with this firmware, angles and their status included."""
    routine, plan = python_routine(firmware.plan), firmware.angles
    if plan is None:
        return routine

    def run(temp: Int32Array, raw: Int32Array) -> Results:
        accel, status = routine(temp, raw)
        angle, flags = angles(plan, accel.astype(np.int64))
        values = np.concatenate([accel.astype(np.int64), angle % TURN], axis=1)
        return values, np.bitwise_or(status, flags.astype(np.uint32))

    return run


def build_node(folder: Path, files: dict[str, bytes], setup: Setup) -> Path:
    """Compile the node with a unit's generated files; returns the program.

    Raises
    ------
    RefusedError
        When there is no compiler or it refuses.
    """
    for name, content in files.items():
        (folder / name).write_bytes(content)
    for name, text in packing_source(read_dbc(setup.rig.bus_file)).items():
        (folder / name).write_text(text, encoding="utf-8")
    ours = shipped("rig") / "firmware"
    program = folder / "rig_node"
    sources = [
        *(ours / name for name in NODE_SOURCES),
        folder / "tilter.c",
        *(folder / name for name in files if name.endswith(".c")),
    ]
    include = [folder, *write_shim(folder / "names", setup.unit.prefix), ours]
    compiler = find_compiler()
    has_angles = any(name.endswith("_angles.c") for name in files)
    defined = ["-DRIG_NODE_ANGLES"] if has_angles else []
    command = [
        *compiler.command,
        *FLAGS,
        *defined,
        *(f"-I{path}" for path in include),
        "-o",
        str(program),
    ]
    done = subprocess.run(
        [*command, *map(str, sources)], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "error" in line]
        raise RefusedError(compiler.name, (lines or ["failed without a message"])[0])
    return program


@contextlib.contextmanager
def node_on(program: Path, *sensor: str) -> Iterator[socket.socket]:
    """Start the node; gives our end of its bus. `sensor` is the file of its own, and its rate."""
    if not hasattr(socket, "SOCK_SEQPACKET") or not hasattr(socket, "AF_UNIX"):
        raise RefusedError(
            "rig fil",
            "this system has no sockets of packets between programs",
            remedy="name a bus with --bus, and connect a node to it",
        )
    link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    number = theirs.fileno()
    command = [str(program), "socket", str(number), *sensor]
    process = subprocess.Popen(command, pass_fds=[number])
    theirs.close()
    try:
        yield link
    finally:
        link.close()
        process.wait(10)
