"""Objects that the units of a series share: only where the compiler would read the same text."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from triaxcal.codegen import objects as module
from triaxcal.codegen.compiler import compile_library
from triaxcal.codegen.objects import SharedObjects

SOURCE = '#include "unit.h"\n\nint answer(void)\n{\n    return ANSWER;\n}\n'


def folder_with(top: Path, name: str, answer: int, source: str = SOURCE) -> Path:
    folder = top / name
    folder.mkdir()
    (folder / "unit.h").write_text(
        f'#include "more.h"\nint answer(void);\n#define ANSWER (MORE + {answer})\n'
    )
    (folder / "more.h").write_text("#define MORE 1\n")
    (folder / "unit.c").write_text(source)
    return folder / "unit.c"


def answer_of(path: Path) -> int:
    library = compile_library([path], path.with_name("linked.so"), [path.parent]).load()
    assert isinstance(library, ctypes.CDLL)
    return int(library.answer())


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The sources that were compiled to an object."""
    done: list[Path] = []
    usual = module._compiled

    def counted(source: Path) -> bytes | None:
        done.append(source)
        return usual(source)

    monkeypatch.setattr(module, "_compiled", counted)
    return done


def test_the_same_text_is_compiled_once(tmp_path: Path, compiled: list[Path]) -> None:
    objects = SharedObjects()
    found = [objects.instead_of(folder_with(tmp_path, name, 41)) for name in ("a", "b")]
    assert [path.suffix for path in found] == [".o", ".o"]
    assert [path.parent.name for path in found] == ["a", "b"]
    assert [answer_of(path) for path in found] == [42, 42]
    assert len(compiled) == 1


def test_another_header_is_another_object(tmp_path: Path, compiled: list[Path]) -> None:
    """The header of a header decides too."""
    objects = SharedObjects()
    first, second, third = (folder_with(tmp_path, name, 1) for name in ("a", "b", "c"))
    (second.parent / "unit.h").write_text("int answer(void);\n#define ANSWER 7\n")
    (third.parent / "more.h").write_text("#define MORE 9\n")
    assert [answer_of(objects.instead_of(path)) for path in (first, second, third)] == [2, 7, 10]
    assert len(compiled) == 3


@pytest.mark.parametrize(
    "source",
    [
        '#include "elsewhere.h"\n' + SOURCE,
        '#define UNIT "unit.h"\n#include UNIT\nint answer(void)\n{\n    return ANSWER;\n}\n',
    ],
)
def test_headers_that_cannot_be_told_are_left_to_the_compiler(tmp_path: Path, source: str) -> None:
    path = folder_with(tmp_path, "a", 1, source)
    assert SharedObjects().instead_of(path) == path


def test_a_warning_is_not_hidden(tmp_path: Path) -> None:
    """The source is left to the compilation of the whole, which refuses it in words."""
    path = folder_with(tmp_path, "a", 1, SOURCE.replace("ANSWER;", "ANSWER + 0.5;"))
    assert SharedObjects().instead_of(path) == path
