"""`triaxcal rig fil`: build the node, start it, ask it."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import FLAGS, find_compiler
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.shim import write_shim
from triaxcal.delivery.unit import deliver
from triaxcal.rig.dbc import read_dbc
from triaxcal.rig.engine import Setup
from triaxcal.rig.fil import (
    CODE_BITS,
    NODE_SOURCES,
    Agreement,
    exchange,
    layout_of,
    packing_source,
    vectors,
)
from triaxcal.rig.socketcan import can_socket, open_refusal


def firmware_in_the_loop(setup: Setup, samples: int, bus: str | None, seed: int) -> Agreement:
    """Calibrate the unit, build its node, and compare its answers.

    Raises
    ------
    RefusedError
        When the unit is refused, its codes do not fit the frames, a tool is missing, or an
        answer differs.
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
    temps, raw = vectors(samples, (plan.temp_min_code, plan.temp_max_code), seed, bits)
    with tempfile.TemporaryDirectory() as folder:
        node = build_node(Path(folder), delivery.files, setup)
        with node_on(node, bus, fd=layout == "fd") as link:
            return exchange(
                link, read_dbc(setup.rig.bus_file), temps, raw, python_routine(plan), layout
            )


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
    command = [find_compiler(), *FLAGS, *(f"-I{path}" for path in include), "-o", str(program)]
    done = subprocess.run(
        [*command, *map(str, sources)], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "error" in line]
        raise RefusedError("gcc", (lines or ["failed without a message"])[0])
    return program


@contextlib.contextmanager
def node_on(program: Path, bus: str | None, fd: bool = False) -> Iterator[socket.socket]:
    """Start the node; gives our end of its bus."""
    if bus is not None:
        try:
            link = can_socket(bus, fd)
        except OSError as error:
            raise open_refusal(bus, error) from error
        process = subprocess.Popen([str(program), "can", bus])
    else:
        link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        number = theirs.fileno()
        process = subprocess.Popen([str(program), "socket", str(number)], pass_fds=[number])
        theirs.close()
    try:
        yield link
    finally:
        link.close()
        if bus is not None:
            process.terminate()
        process.wait(10)
