"""Layouts for build systems: the delivered C in folders, and files made of templates."""

from __future__ import annotations

import re
from pathlib import PurePosixPath

from triaxcal import __version__
from triaxcal.base.shipped import shipped
from triaxcal.codegen.templates import environment
from triaxcal.exports.target import Exported, Source
from triaxcal.unit.arithmetic import ARITHMETICS

_TO_INCLUDE = ("_calib.h", "_imu.h", "_angles.h")
"""What a program includes: the constants, of an IMU the call for both triads, and angles."""


def layout(source: Source, name: str, sources: str = "src", headers: str = "include") -> Exported:
    """The C of a delivery in the layout of a build system.

    Parameters
    ----------
    name : str
        Of the folder in templates/integration; what ends in .j2 there is made, at its own path.
    sources, headers : str
        Folders for *.c with the image, and for *.h.
    """
    delivered = _one_routine(source.c_files())
    prefix = next(n for n in delivered if n.endswith("_comp.h")).removesuffix("_comp.h")
    files = {
        str(PurePosixPath(headers if file.endswith(".h") else sources) / file): content
        for file, content in delivered.items()
    }
    context = {
        "prefix": prefix,
        "PREFIX": prefix.upper(),
        "version": __version__.split(".dev", maxsplit=1)[0],
        "serial": source.serial,
        "sensor": source.sensor,
        "headers": [name for name in delivered if name.endswith(_TO_INCLUDE)],
        "sources": sorted(p for p in files if p.endswith(".c")),
        "link_names": _link_names(delivered),
    }
    top = shipped("templates") / "integration" / name
    for template in sorted(top.rglob("*.j2")):
        path = template.relative_to(top).as_posix()
        made = environment().get_template(f"integration/{name}/{path}").render(**context)
        target = path.removesuffix(".j2").replace("PREFIX", prefix)
        files[target] = made.encode()
    added = sorted(path for path in files if PurePosixPath(path).name not in delivered)
    return Exported(files, f"{len(delivered)} delivered files and {', '.join(added)}")


def _one_routine(files: dict[str, bytes]) -> dict[str, bytes]:
    """Without the portable routine of a triad where one in another arithmetic stands for it."""
    forms = tuple(f"_comp_{form}.c" for form in ARITHMETICS)
    replaced = {f"{name.rsplit('_', 1)[0]}.c" for name in files if name.endswith(forms)}
    return {name: content for name, content in files.items() if name not in replaced}


def _link_names(delivered: dict[str, bytes]) -> dict[str, str]:
    """Names in the C that are macros, with the link names that they stand for."""
    text = "\n".join(c.decode() for n, c in sorted(delivered.items()) if n.endswith(".h"))
    return dict(re.findall(r"^#define (\w+) (\w+_[0-9a-f]{8}_\w+)$", text, re.MULTILINE))
