"""Labelled faces are the tilter's test positions for the fit; a reader knows them as faces."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import position_of
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import FACES

if TYPE_CHECKING:
    from triaxcal.diagnosis.answer import Diagnosis, Suspect

_FACE_OF = {position_of(face): f"face {face}" for face in FACES}
_POSITION = re.compile(rf"\b({'|'.join(_FACE_OF)})\b( \([+-][xyz] up, )?")
"""A position, perhaps with the face beside it: "TP2 (-y up, row 7)"."""


def by_face(text: str) -> str:
    """Text with faces in place of test positions: "face +z" for "TP1"."""
    return _POSITION.sub(lambda found: _FACE_OF[found[1]] + (" (" if found[2] else ""), text)


@contextmanager
def named_by_face(unit: UnitDescription) -> Iterator[None]:
    """Refusals of a unit with labelled faces name these."""
    try:
        yield
    except RefusedError as refusal:
        if unit.recording is None or not unit.recording.faces:
            raise
        place, found = by_face(refusal.place), by_face(refusal.found)
        expected, remedy = by_face(refusal.expected), by_face(refusal.remedy)
        raise type(refusal)(place, found, expected=expected, remedy=remedy) from refusal


def diagnosis_by_face(found: Diagnosis) -> Diagnosis:
    """The same of a diagnosis."""
    request = found.request
    return replace(
        found,
        suspects=tuple(map(_suspect, found.suspects)),
        answer=tuple(map(_suspect, found.answer)),
        request=request and replace(request, position=by_face(request.position)),
    )


def _suspect(suspect: Suspect) -> Suspect:
    words = {key: by_face(getattr(suspect, key)) for key in ("place", "change", "apart", "name")}
    amplitudes = tuple(replace(a, name=by_face(a.name)) for a in suspect.amplitudes)
    return replace(suspect, amplitudes=amplitudes, **words)  # type: ignore[arg-type]
