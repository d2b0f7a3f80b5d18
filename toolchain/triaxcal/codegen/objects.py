"""Object files that units have in common: the routine of one shape is the same text in each.

What a compiler makes is decided by what it reads. So an object is made again only where the source
or a header that it includes is another text; flags and compiler are those of the process.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from triaxcal.codegen.compiler import compile_object

_INCLUDED = re.compile(rb'^[ \t]*#[ \t]*include[ \t]+"([^"\n]+)"', re.MULTILINE)
_OTHER_INCLUDE = re.compile(rb"^[ \t]*#[ \t]*include[ \t]+[^\"<\s]", re.MULTILINE)


class SharedObjects:
    """Objects by the text of their source and its headers; one for a whole series."""

    def __init__(self) -> None:
        self._made: dict[str, bytes] = {}

    def instead_of(self, source: Path) -> Path:
        """Object to be linked instead of a source; the source where that cannot be told."""
        key = _text_sha256(source)
        if key is None:
            return source
        if key not in self._made:
            content = _compiled(source)
            if content is None:
                return source  # the whole compilation says why
            self._made[key] = content
        target = source.with_suffix(".o")
        target.write_bytes(self._made[key])
        return target


def _text_sha256(source: Path) -> str | None:
    """Hash of a source and of its headers beside it; None where one of them is elsewhere."""
    found: dict[Path, bytes] = {}
    waiting = [source]
    while waiting:
        path = waiting.pop()
        if path in found:
            continue
        if not path.is_file():
            return None
        found[path] = path.read_bytes()
        if _OTHER_INCLUDE.search(found[path]):
            return None
        waiting += [path.parent / name.decode() for name in _INCLUDED.findall(found[path])]
    digest = hashlib.sha256()
    for path in sorted(found):
        digest.update(f"{path.name}\0{len(found[path])}\0".encode() + found[path])
    return digest.hexdigest()


def _compiled(source: Path) -> bytes | None:
    target = source.with_name(f"{source.stem}_shared.o")
    process = compile_object(source, target, [source.parent]).process
    process.communicate()
    return target.read_bytes() if not process.returncode and target.is_file() else None
