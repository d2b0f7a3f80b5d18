"""Identify, read and flash a node."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.image_parts import ImagePart, image_parts
from triaxcal.device.layout import FILE, FLASH_PAGE, RAM_PAGE
from triaxcal.device.link import Info, Link


@dataclass(frozen=True)
class Node:
    """What a node is.

    Attributes
    ----------
    hardware : str
        Serial number that its firmware knows; "" where it knows none.
    firmware : str
        Version of its firmware.
    epk : str
        EPK of the calibration in use, as its A2L states it.
    info : Info
        What it says of itself.
    part : ImagePart or None
        The calibration in its flash; None where it has none.
    content : bytes
        That calibration's file; empty where it has none.
    """

    hardware: str
    firmware: str
    epk: str
    info: Info
    part: ImagePart | None
    content: bytes

    @property
    def serial(self) -> str:
        """Serial number of the hardware, or of the calibration in flash; "" where none is known."""
        identity = self.part.identity if self.part else None
        return self.hardware or (identity.serial if identity else "")


def identify(link: Link) -> Node:
    """Ask a node who it is, and read its calibration from flash.

    Raises
    ------
    RefusedError
        When it does not answer, or what it has in flash is no calibration.
    """
    info = link.info()
    texts = link.texts()
    if info.without:
        return Node(*texts, info, None, b"")
    link.choose(FLASH_PAGE)
    content = link.read(FILE, 0, info.file_size)
    return Node(*texts, info, single_part(content, link.name), content)


def single_part(content: bytes, where: str) -> ImagePart:
    """The accelerometer's constants in a file.

    Raises
    ------
    RefusedError
        When it is no image, or that of an IMU.
    """
    parts = image_parts(content, where)
    if len(parts) != 1 or parts[0].triad != "accelerometer":
        raise RefusedError(
            where,
            "constants of " + " and ".join(part.triad for part in parts),
            expected="those of one accelerometer",
            remedy="give a triax_calib.bin",
        )
    return parts[0]


def flash(  # noqa: PLR0917
    link: Link,
    content: bytes,
    where: str,
    replaces: str = "",
    power_cycle: Callable[[], None] | None = None,
    note: Callable[[str], None] | None = None,
) -> Info:
    """Download a calibration, have it stored, and read it back from flash.

    Parameters
    ----------
    link : Link
        The node.
    content : bytes
        A triax_calib.bin.
    where : str
        Its name, for messages.
    replaces : str
        Serial number that the node has until now, where it may differ from the file's.
    power_cycle : callable or None
        Switches the node off and on; then the calibration is read once more.
    note : callable or None
        Gets what is to be known during a long wait.

    Returns
    -------
    Info
        What the node says of itself afterwards.

    Raises
    ------
    RefusedError
        When file and node do not belong together, or the node does not do it. In use is then the
        calibration before, or already the new one; the message says which, where it is known.
    """
    node = identify(link)
    _belongs(node, content, where, link.name, replaces)
    link.choose(RAM_PAGE)
    link.write(content)
    info = link.store(note)
    _read_back(link, content, "after the store")
    if power_cycle is not None:
        power_cycle()
        info = link.connect()
        _read_back(link, content, "after the power cycle")
    return info


def _belongs(node: Node, content: bytes, where: str, name: str, replaces: str) -> None:
    part, info = single_part(content, where), node.info
    if int(part.shape, 16) != info.shape or len(content) != info.file_size:
        raise RefusedError(
            where,
            f"shape {part.shape}, {len(content)} bytes",
            expected=f"shape {info.shape:08x}, {info.file_size} bytes, which {name} has",
            remedy="build the node with this unit's triax_comp.c, or take the file of its unit",
        )
    serial = part.identity.serial if part.identity else ""
    if node.serial not in ("", serial, replaces):
        raise RefusedError(
            where,
            f"constants of {serial or 'no serial number'}",
            expected=f"{node.serial}, which {name} has",
            remedy=f"if it was exchanged, say --replaces {node.serial}",
        )


def _read_back(link: Link, content: bytes, when: str) -> None:
    link.choose(FLASH_PAGE)
    if link.read(FILE, 0, len(content)) != content:
        raise RefusedError(link.name, f"{when} its flash holds another calibration")


def require_in_use(link: Link, content: bytes, where: str) -> Node:
    """The node, which must have this calibration in flash and in use.

    Raises
    ------
    RefusedError
        When it has another one, uses the one in RAM, or has another serial number.
    """
    node = identify(link)
    part = single_part(content, where)
    serial = part.identity.serial if part.identity else ""
    if node.hardware not in ("", serial):
        raise RefusedError(
            link.name,
            f"the device has the serial number {node.hardware}",
            expected=f"{serial or 'none'}, that of {where}",
            remedy="connect the device of this unit",
        )
    if node.content != content or node.info.page_used != FLASH_PAGE:
        found = f"a calibration of {node.serial}" if node.part else node.info.without
        found += " in flash"
        if node.info.page_used != FLASH_PAGE:
            found = "the node uses the calibration in RAM"
        raise RefusedError(
            link.name,
            found,
            expected=f"that of {where} as it is now",
            remedy="flash it with `triaxcal device flash`, or switch the node off and on",
        )
    return node
