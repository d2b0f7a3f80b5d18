"""JSON of the results: what is read back is what was written, one key a line."""

from __future__ import annotations

import json
import math

import pytest

from triaxcal.base.jsontext import json_bytes


def test_what_is_written_is_read_back() -> None:
    document = {
        "format": 1, "text": 'µ "quoted"\n', "numbers": [0.1, -1e-300, 2**53],
        "tables": [{"a": [1, None]}, {"b": {"c": True}}], "empty": [], "nothing": {},
    }  # fmt: skip
    text = json_bytes(document).decode()
    assert json.loads(text) == document
    assert text.splitlines()[1:3] == [' "format": 1,', ' "text": "µ \\"quoted\\"\\n",']
    assert len(text.splitlines()) == 2 + 6 + 3
    assert text.endswith("}\n")


def test_an_empty_document_is_json() -> None:
    assert json.loads(json_bytes({})) == {}


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_json_has_no_word_for_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="JSON"):
        json_bytes({"a": [{"b": value}]})
