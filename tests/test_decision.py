"""Decision rules: each against its own words, on a unit whose error and uncertainty are known."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from test_certificate import DETAILS
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.firmware import make_firmware
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import judge, verdict_on
from triaxcal.delivery.unit import Delivery
from triaxcal.delivery.verdict import Verdict
from triaxcal.report.dcc.certificate import certificate_xml
from triaxcal.report.passport.content import passport
from triaxcal.report.passport.document import passport_json
from triaxcal.report.passport.page import passport_html
from triaxcal.unit.description import unit_of_text
from triaxcal.unit.limits import Limits

UNIT = (Path(__file__).parent.parent / "units/AT-SIM/unit.toml").read_text(encoding="utf-8")
GUARDED, BINARY, SIMPLE = "guard-band", "binary-guard-band", "simple-acceptance"


def fitted(delivery: Delivery, limits: Limits) -> Fitted:
    unit = replace(delivery.unit, limits=limits)
    parts = unit, delivery.measurements, delivery.inputs_sha256, delivery.calibration
    return Fitted(*parts)


@pytest.fixture(scope="module")
def known(delivered: dict[str, Delivery]) -> dict[str, float]:
    """Largest error and expanded uncertainty of |a|, in g, at T0 and over the range."""
    found = passport(delivered["AT-SIM"], {}).acceptance
    u = delivered["AT-SIM"].firmware.uncertainty.length_g
    return {"t0": found[0].largest_g, "range": found[1].largest_g, "u_t0": u[0], "u_range": u[1]}


RULES = [(GUARDED, None), (GUARDED, 6e-6), (BINARY, None), (BINARY, 6e-6), (SIMPLE, None)]


def verdict(delivery: Delivery, limits: Limits) -> Verdict:
    """Verdict on the firmware that was delivered, by other limits."""
    errors_g = np.abs([r.error_g for r in delivery.chosen.residuals])
    return verdict_on(fitted(delivery, limits), errors_g, delivery.firmware.uncertainty)


@pytest.mark.parametrize(("rule", "stated"), RULES)
@pytest.mark.parametrize("limit", [8e-6, 1.2e-5, 2.5e-5, 3e-5, 1e-3])
def test_a_rule_does_what_its_words_say(
    delivered: dict[str, Delivery],
    known: dict[str, float],
    rule: str,
    stated: float | None,
    limit: float,
) -> None:
    w_t0, w_range = (known["u_t0"], known["u_range"]) if stated is None else (stated, stated)
    if rule == SIMPLE:
        w_t0 = w_range = 0.0
    # No case is nearer to its limit than the arithmetic of the device, 1e-7 g.
    ends = known["t0"] + w_t0, known["range"] + w_range
    assert all(abs(end - limit) > 1e-7 for end in ends)
    accepted = max(ends) <= limit
    words = {True: "passed", False: "refused" if rule == BINARY else "not shown"}[accepted]
    found = verdict(delivered["AT-SIM"], Limits(limit, limit, rule, stated))
    assert found.result == words
    default = rule == GUARDED and stated is None
    assert words == "refused" or ("ILAC-G8:09/2019" in found.words) is not default


def test_what_a_binary_rule_refuses_has_no_firmware(delivered: dict[str, Delivery]) -> None:
    own = fitted(delivered["AT-SIM"], Limits(1.2e-5, 1e-3, BINARY))
    assert judge(own).result == "refused"
    with pytest.raises(RefusedError) as refusal:
        make_firmware(own)
    assert refusal.value.exit_code == 1
    assert "[limits] decision_rule: with uncertainty at T0: 0.01" in str(refusal.value)
    assert "by the binary statement with guard band w = U (95 %)" in str(refusal.value)


def test_a_guard_band_is_stricter(delivered: dict[str, Delivery], known: dict[str, float]) -> None:
    """Of the same unit and limit, only simple acceptance passes."""
    limit = (known["range"] + known["u_range"] + max(known["t0"], known["range"])) / 2.0
    results = [
        verdict(delivered["AT-SIM"], Limits(limit, limit, rule)).result
        for rule in (SIMPLE, GUARDED, BINARY)
    ]
    assert results == ["passed", "not shown", "refused"]


@pytest.mark.parametrize(
    ("limits", "words", "badge"),
    [
        (
            Limits(),
            "non-binary statement with guard band w = U (95 %) (ILAC-G8:09/2019, 4.2.3)",
            "within the limits, uncertainty included",
        ),
        (
            Limits(3e-4, 1e-3, GUARDED, 1e-4),
            "non-binary statement with guard band w = 0.1 mg (ILAC-G8:09/2019, 4.2.3)",
            "within the limits, guard band included",
        ),
        (
            Limits(3e-4, 1e-3, SIMPLE),
            "binary statement, simple acceptance, w = 0 (ILAC-G8:09/2019, 4.2.1)",
            "within the limits, uncertainty not counted",
        ),
    ],
)
def test_page_and_json_and_certificate_name_the_rule(
    delivered: dict[str, Delivery], limits: Limits, words: str, badge: str
) -> None:
    d = delivered["AT-SIM"]
    firmware = make_firmware(fitted(d, limits))
    made = passport(replace(d, unit=replace(d.unit, limits=limits), firmware=firmware), {})
    page, document = passport_html(made).decode(), json.loads(passport_json(made))
    assert document["decision_rule"] == {"name": limits.decision_rule, "words": words}
    assert words in page
    assert badge in page
    certificate = certificate_xml(made, DETAILS).decode()
    assert certificate.count(f"<dcc:convention>{words}</dcc:convention>") == 2
    assert certificate.count("<dcc:norm>ILAC-G8:09/2019</dcc:norm>") == 2
    assert certificate.count("<dcc:conformity>pass</dcc:conformity>") == 2
    for row, limit in zip(
        document["acceptance"], (limits.at_t0_g, limits.over_range_g), strict=True
    ):
        w = {SIMPLE: 0.0, GUARDED: limits.guard_band_g or row["expanded_uncertainty_g"]}
        assert row["guard_band_g"] == w[limits.decision_rule]
        assert row["acceptance_limit_g"] == limit - w[limits.decision_rule]
        said = f"guard band w {row['guard_band_g']:.3g} g, acceptance limit "
        assert f"{said}{row['acceptance_limit_g']:.3g} g" in certificate


def test_what_lies_in_the_guard_band_passes_on_condition(delivered: dict[str, Delivery]) -> None:
    d, limits = delivered["AT-SIM"], Limits(1.2e-5, 1e-3)
    firmware = make_firmware(fitted(d, limits))
    made = passport(replace(d, unit=replace(d.unit, limits=limits), firmware=firmware), {})
    certificate = certificate_xml(made, DETAILS).decode()
    found = re.findall("<dcc:conformity>(.*?)</dcc:conformity>", certificate)
    assert (made.verdict.result, found) == ("not shown", ["conditionalPass", "pass"])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            'decision_rule = "accept"',
            'found \'accept\'; expected one of "guard-band", "binary-guar',
        ),
        (
            'decision_rule = "simple-accept"',
            "found 'simple-accept' (did you mean \"simple-acceptance\"?)",
        ),
        ("guard_band_g = 3e-4", "guard_band_g: found 0.0003; expected less than 0.0003 g, the"),
        ("guard_band_g = -1e-4", "guard_band_g: found -0.0001; expected a number from 1e-09 to 1"),
        (
            'decision_rule = "simple-acceptance"\nguard_band_g = 1e-4',
            "guard_band_g: found 0.0001; expected none, as decision_rule is simple-",
        ),
    ],
)
def test_a_rule_is_checked(keys: str, message: str) -> None:
    with pytest.raises(RefusedError) as refusal:
        unit_of_text("AT-SIM", f"{UNIT}\n[limits]\n{keys}\n", "unit.toml")
    assert message in str(refusal.value)


def test_the_default_is_what_version_0_1_0_did() -> None:
    limits: Any = unit_of_text("AT-SIM", UNIT, "unit.toml").limits
    assert (limits.decision_rule, limits.guard_band_g) == (GUARDED, None)
    assert limits.guard_g(1.25e-5) == 1.25e-5
