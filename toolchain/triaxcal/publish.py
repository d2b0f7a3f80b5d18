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


def renew(files: Mapping[str, bytes], target: Path) -> None:
    """Give files of the folder `target` new content, each in one step.

    Raises
    ------
    RefusedError
        When the disk refuses; a file is then either as it was or new.
    """
    for name, content in files.items():
        try:
            handle, staging = tempfile.mkstemp(prefix=f".{name}.", dir=target)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(content)
                Path(staging).chmod(0o666 & ~_umask())
                Path(staging).replace(target / name)
            finally:
                Path(staging).unlink(missing_ok=True)
        except OSError as error:
            raise _refusal(target / name, error) from error


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
