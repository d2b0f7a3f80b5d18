"""Putting finished files in place: all of them, or none."""

from __future__ import annotations

import errno
import glob
import shutil
import tempfile
from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from triaxcal.base.durable import exchange, replace_file, sync_folder, umask, write_durably
from triaxcal.base.errors import RefusedError, refused_by_system

_OLD = ".old"


def publish(files: Mapping[str, bytes], target: Path, sometimes: Collection[str] = ()) -> None:
    """Make the folder `target` hold exactly these files.

    They are written to a folder beside it, which takes its place when it is complete and on the
    disk. `sometimes` names files that an earlier delivery may have had besides; * stands for any
    text.

    Raises
    ------
    RefusedError
        When the disk refuses, or `target` holds anything but an earlier delivery; `target` is then
        as it was.
    """
    _take_back(target)
    _refuse_foreign(target, {*files, *sometimes})
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise _refusal(target.parent, error) from error
    try:
        for name, content in files.items():
            write_durably(staging / name, content)
        staging.chmod(0o777 & ~umask())
        sync_folder(staging)
        _replace(staging, target)
        sync_folder(target.parent)
    except OSError as error:
        raise _refusal(target, error) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def publish_beside(
    files: Mapping[str, bytes], target: Path, kept: Path | None, sometimes: Collection[str] = ()
) -> None:
    """As `publish`; what `target` held before is kept in the folder `kept`, where one is named.

    Raises
    ------
    RefusedError
        As `publish`; neither folder has changed then.
    """
    _take_back(target)
    if kept is None or not target.is_dir() or kept.exists():
        publish(files, target, sometimes)
        return
    _refuse_foreign(target, {*files, *sometimes})
    try:
        shutil.copytree(target, kept)
    except OSError as error:
        shutil.rmtree(kept, ignore_errors=True)
        raise _refusal(kept, error) from error
    try:
        publish(files, target, sometimes)
    except BaseException:
        shutil.rmtree(kept, ignore_errors=True)
        raise


def renew(files: Mapping[str, bytes], target: Path) -> None:
    """Give files of the folder `target` new content, each in one step.

    Raises
    ------
    RefusedError
        When the disk refuses, or a name is that of a device; a file is then either as it was or
        new.
    """
    for name, content in files.items():
        path = target / name
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise RefusedError(
                str(path),
                "is no regular file",
                expected="a file, or nothing there",
                remedy="name another file",
            )
        try:
            replace_file(path, content)
        except OSError as error:
            raise _refusal(target / name, error) from error


def _refuse_foreign(target: Path, files: Collection[str]) -> None:
    """Nobody's own files are replaced: only what an earlier run wrote."""
    if target.is_symlink() or (target.exists() and not target.is_dir()):
        raise RefusedError(
            str(target),
            "is not a folder of results",
            expected="nothing there, or what an earlier run wrote",
            remedy="move it away, or name another folder",
        )
    if not target.is_dir():
        return
    try:
        foreign = sorted(
            path.name
            for path in target.iterdir()
            if not any(fnmatchcase(path.name, file) for file in files)
        )
    except OSError as error:
        raise _refusal(target, error) from error
    if foreign:
        raise RefusedError(
            str(target),
            f"holds {foreign[0]!r}, which no delivery has"
            + (f", and {len(foreign) - 1} more" if len(foreign) > 1 else ""),
            expected="only what an earlier run wrote: the folder is replaced as a whole",
            remedy="move it away, or name another folder",
        )


def _replace(staging: Path, target: Path) -> None:
    """Put a finished folder in the place of an earlier one, which is then removed.

    Where names can change places this is one step. Elsewhere it is two, and a crash between them
    leaves the earlier folder under another name, from which `_take_back` fetches it.
    """
    if not target.exists():
        staging.rename(target)
        return
    if exchange(staging, target):
        return
    old = staging.with_name(f"{staging.name}{_OLD}")
    try:
        target.rename(old)
        staging.rename(target)
    except BaseException:
        if old.exists() and not target.exists():
            old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _take_back(target: Path) -> None:
    """Give a folder its name again that a crash between two renames took."""
    if target.exists() or not target.parent.is_dir():
        return
    left = sorted(target.parent.glob(f".{glob.escape(target.name)}.*{_OLD}"))
    if left:
        left[-1].rename(target)


def _refusal(where: Path, error: OSError) -> RefusedError:
    remedy = "check its permissions, or name another folder"
    if error.errno == errno.ENOENT:
        remedy = "make its folder, or name another folder"
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        remedy = "free some space, or name another folder"
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        remedy = "a file is in the way: move it, or name another folder"
    return refused_by_system(where, "written", error, remedy=remedy)
