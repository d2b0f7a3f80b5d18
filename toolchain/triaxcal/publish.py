"""Putting finished files in place: all of them, or none."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from triaxcal.errors import RefusedError


def publish(files: Mapping[str, bytes], target: Path) -> None:
    """Make the folder `target` hold exactly these files.

    They are written to a folder beside it, which takes its place when it is complete.

    Raises
    ------
    RefusedError
        When the disk refuses; `target` is then as it was.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise _refusal(target.parent, error) from error
    try:
        for name, content in files.items():
            (staging / name).write_bytes(content)
        staging.chmod(0o777 & ~_umask())
        _replace(staging, target)
    except OSError as error:
        raise _refusal(target, error) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _replace(staging: Path, target: Path) -> None:
    if not target.exists():
        staging.rename(target)
        return
    old = staging.with_name(f"{staging.name}.old")
    target.rename(old)
    try:
        staging.rename(target)
    except BaseException:
        old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    current = os.umask(0o022)
    os.umask(current)
    return current


def _refusal(where: Path, error: OSError) -> RefusedError:
    reason = (error.strerror or str(error)).lower()
    return RefusedError(
        str(where), f"cannot be written: {reason}", remedy="free some space or name another folder"
    )
