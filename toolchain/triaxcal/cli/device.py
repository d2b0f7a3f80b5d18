"""`triaxcal device`: the calibration in the unit at the other end of a CAN cable."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.cli.devicehands import ask_for_position, ask_for_power_cycle
from triaxcal.cli.options import DELIVERED, HELP, HexNumber, UnitFolder, example, say

if TYPE_CHECKING:
    from triaxcal.delivery.unit import Delivery
    from triaxcal.device.link import Link
    from triaxcal.device.unit import Node

_NEEDED = ("can", "pyxcp")
Opener = Callable[[], "contextlib.AbstractContextManager[Link]"]


@click.group(
    context_settings=HELP,
    epilog=example("triaxcal device identify --bus can0", "triaxcal device flash --help"),
)
def device() -> None:
    """Identify, read, flash and verify a unit over XCP on CAN.

    The unit runs the XCP slave of firmware_ref/xcp.
    """


_BUS = click.option(
    "--bus", required=True, help="A CAN device, or interface:channel of python-can."
)


def _ids(command: Callable[..., None]) -> Callable[..., None]:
    """CAN ids of a node."""
    request = click.option(
        "--request-id", type=HexNumber(), default="0x650", show_default=True,
        help="CAN id of what the node takes; bit 31 for 29-bit ids.",
    )  # fmt: skip
    response = click.option(
        "--response-id", type=HexNumber(), default="0x651", show_default=True,
        help="CAN id of what it sends; the same.",
    )  # fmt: skip
    return request(response(command))


def _node_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options that say which node; `command` gets `opener`, which connects to it."""

    @wraps(command)
    def with_opener(bus: str, request_id: int, response_id: int, **others: Any) -> None:
        from triaxcal.device.ids import node_ids  # noqa: PLC0415

        ids = node_ids(request_id, response_id)
        command(opener=lambda: _connected(bus, *ids), **others)

    return _BUS(_ids(with_opener))


@contextlib.contextmanager
def _connected(bus: str, request_id: int, response_id: int) -> Iterator[Link]:
    refuse_missing_packages("triaxcal device", _NEEDED, "device")
    from triaxcal.device.link import Link  # noqa: PLC0415
    from triaxcal.rig.bus.openbus import open_bus  # noqa: PLC0415

    opened = open_bus(bus if ":" in bus else f"socketcan:{bus}", fd=False)
    with contextlib.closing(Link(opened, bus, request_id, response_id)) as link:
        yield link


@device.command(epilog=example("triaxcal device identify --bus can0"))
@_node_options
def identify(opener: Opener) -> None:
    """Show who a node is, and whose calibration it has in flash."""
    from triaxcal.device.unit import identify as ask  # noqa: PLC0415

    with opener() as link:
        say(_about(link.name, ask(link)))


def _about(name: str, node: Node) -> str:
    from triaxcal.report.image import image_text  # noqa: PLC0415

    info = node.info
    rows = [
        ("hardware", node.hardware or "no serial number of its own"),
        ("firmware", node.firmware or "no version"),
        ("EPK", node.epk or "none"),
        ("takes", f"shape {info.shape:08x}, {info.file_size} bytes"),
        ("uses", "the calibration in RAM" if info.page_used else "the calibration in flash"),
    ]
    if node.part is None:
        rows[-1] = ("flash", f"{info.without}: uses that in its program")
    lines = [name, *(f"  {key:<15} {value}" for key, value in rows)]
    if node.part is None:
        return "\n".join(lines)
    where = f"slot {info.slot}, store {info.sequence}"
    return "\n".join([*lines, image_text(f"flash, {where}", node.content, (node.part,))])


@device.command(epilog=example("triaxcal device read found.bin --bus can0"))
@click.argument("file", type=click.Path(path_type=Path))
@_node_options
def read(opener: Opener, file: Path) -> None:
    """Read the calibration in a node's flash into FILE.

    `triaxcal image FILE` shows it, and writes it in other formats.
    """
    from triaxcal.base.publish import renew  # noqa: PLC0415
    from triaxcal.device.unit import identify as ask  # noqa: PLC0415

    with opener() as link:
        node = ask(link)
        name = link.name
    if node.part is None:
        raise RefusedError(name, f"{node.info.without} in flash", remedy="nothing was written")
    renew({file.name: node.content}, file.parent)
    say(f"{file} written: {node.serial}, {len(node.content)} bytes, every CRC is correct")


@device.command(
    epilog=example(
        "triaxcal device flash build/AT-7/triax_calib.bin --bus can0",
        "triaxcal device flash build/AT-7/triax_calib.bin --bus can0 --power-cycle",
    )
)
@click.argument("file", type=click.Path(path_type=Path))
@_node_options
@click.option("--power-cycle", is_flag=True, help="Ask for one, and read the calibration again.")
@click.option(
    "--replaces", default="", metavar="SERIAL", help="The node's serial number until now."
)
def flash(opener: Opener, file: Path, power_cycle: bool, replaces: str) -> None:
    """Store a calibration in a node's flash.

    FILE is a triax_calib.bin. It is read back and compared. If anything fails, the calibration in
    use before is still in use.
    """
    from triaxcal.device.unit import flash as store  # noqa: PLC0415

    try:
        content = file.read_bytes()
    except OSError as error:
        raise refused_by_system(file, "read", error) from error
    with opener() as link:
        asked = ask_for_power_cycle if power_cycle else None
        info = store(link, content, str(file), replaces, asked, _note)
        name = link.name
    again = ", after the power cycle too" if power_cycle else ""
    say(f"{name}: {file} is in use from slot {info.slot}, read back and equal{again}")


def _note(words: str) -> None:
    click.echo(words, err=True)


@device.command(
    epilog=example(
        "triaxcal device verify AT-7 --bus can0",
        "triaxcal device verify AT-7 --bus can0 --samples 1000",
        "triaxcal device verify AT-7 --bus can0 --positions 6",
    )
)
@click.argument("unit", type=UnitFolder())
@DELIVERED
@_node_options
@click.option(
    "--samples",
    type=click.IntRange(min=10),
    default=100,
    show_default=True,
    help="How many, in each position.",
)
@click.option(
    "--positions",
    type=click.IntRange(1, 6),
    help="Walk through so many check positions, and write the result beside the delivery.",
)
@click.option(
    "--gravity", "gravity_m_per_s2", type=click.FloatRange(9.7, 9.9),
    help="Local gravity here, m/s^2; default: that of the unit.",
)  # fmt: skip
def verify(  # noqa: PLR0917
    opener: Opener,
    unit: Path,
    build: Path,
    samples: int,
    positions: int | None,
    gravity_m_per_s2: float | None,
) -> None:
    """Compare a node's samples with the integer model.

    Result and status of each must be equal bit for bit. The node must have this UNIT's
    calibration in use. At rest |a| - g is judged too. With --positions, passport and certificate
    state the result.
    """
    from triaxcal.api.unit import read_unit  # noqa: PLC0415
    from triaxcal.delivery.unit import deliver  # noqa: PLC0415

    read_unit(unit)  # refuses an IMU
    delivery = deliver(unit)
    if positions is None:
        _verify_samples(opener, delivery, samples, gravity_m_per_s2)
        return
    if delivery.plan.rate is not None:
        raise RefusedError(
            f"{unit}, --positions",
            "a term in dT/dt",
            expected="a calibration without it: positions are judged at a steady temperature",
            remedy="verify without --positions: every sample is compared, with its rate",
        )
    from triaxcal.api.device import require_delivered, verify_at_positions  # noqa: PLC0415
    from triaxcal.report.words.device import device_words  # noqa: PLC0415

    target = build / delivery.unit.name
    require_delivered(delivery, target)
    with opener() as link:
        record = verify_at_positions(
            link, delivery, target, positions, samples, ask_for_position, gravity_m_per_s2
        )
        name = link.name
    rows = [
        f"  {p.position:<15} {1e3 * p.error_g:+.3f} mg, standard error "
        f"{1e3 * p.standard_error_g:.3f} mg; {p.temp_degc:.1f} degC"
        for p in record.positions
    ]
    say("\n".join([f"{name}: {device_words(record)}", *rows, f"{target}: passport renewed"]))


def _verify_samples(
    opener: Opener, delivery: Delivery, samples: int, gravity_m_per_s2: float | None
) -> None:
    from triaxcal.api.device import allowed_length  # noqa: PLC0415
    from triaxcal.codegen.crosscheck import python_routine  # noqa: PLC0415
    from triaxcal.codegen.names import names_of  # noqa: PLC0415
    from triaxcal.device.compare import compare, take_samples  # noqa: PLC0415
    from triaxcal.device.rest import judge_length  # noqa: PLC0415
    from triaxcal.device.unit import require_in_use  # noqa: PLC0415
    from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2  # noqa: PLC0415

    plan, unit = delivery.plan, delivery.unit
    gravity_g = unit.gravity_g
    if gravity_m_per_s2 is not None:
        gravity_g = gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2
    with opener() as link:
        image = delivery.files[names_of(plan).file("triax_calib.bin")]
        node = require_in_use(link, image, unit.name)
        taken = take_samples(link, samples)
        name = link.name
    routine = python_routine(plan, taken.rate)
    found = compare(taken, routine, plan.shape.output_q, gravity_g)
    found.refuse_difference(name)
    allowed = allowed_length(delivery, float(taken.temp.mean()))
    why_not = judge_length(name, taken, found, plan.shape.output_q, allowed)
    length = f"not judged: {why_not}"
    if not why_not:
        length = (
            f"{1e3 * found.length_error_g:+.3f} mg of the mean, standard error "
            f"{1e3 * found.length_sd_g:.3f} mg; at rest, limit {1e3 * allowed.limit_g:g} mg"
        )
    say(
        f"{name}: {'every bit ' if why_not else ''}verified on device {node.serial}\n"
        f"  samples         {found.samples}, largest difference 0 LSB; "
        f"{found.flagged} with a status other than 0\n"
        f"  |a| - g         {length}"
    )


@device.command(
    epilog=example(
        "triaxcal device a2l AT-7 at-7.a2l",
        "triaxcal device a2l AT-7 at-7.a2l --request-id 0x555 --response-id 0x666",
    )
)
@click.argument("unit", type=UnitFolder(files=True))
@click.argument("file", type=click.Path(path_type=Path))
@DELIVERED
@_ids
@click.option("--bitrate", type=int, help="Bit rate of the bus, bit/s.")
def a2l(  # noqa: PLR0917
    unit: Path, file: Path, build: Path, request_id: int, response_id: int, bitrate: int | None
) -> None:
    """Write the A2L of a node with this calibration.

    UNIT is a unit, whose calibration is in build/UNIT, or a delivered folder. Constants can be read
    and changed, raw and compensated signals measured, with any tool for XCP on CAN.
    """
    import triaxcal  # noqa: PLC0415
    from triaxcal.api.delivery import delivered_file  # noqa: PLC0415
    from triaxcal.device.ids import node_ids  # noqa: PLC0415

    ids = node_ids(request_id, response_id)
    made = triaxcal.firmware(triaxcal.load(delivered_file(unit, build)))
    say(f"{made.write_node_a2l(file, ids, bitrate=bitrate)} written")
