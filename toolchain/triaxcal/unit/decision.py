"""Decision rules: how the uncertainty is counted when a result is held against a limit.

Their names and clauses are those of ILAC-G8:09/2019, "Guidelines on decision rules and statements
of conformity". A result is accepted up to the acceptance limit AL = TL - w, with the limit TL and
the guard band w.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

GUIDE = "ILAC-G8:09/2019"


@dataclass(frozen=True)
class DecisionRule:
    """One rule.

    Attributes
    ----------
    name : str
        As [limits] decision_rule has it.
    title, clause : str
        As the guide has them.
    guarded : bool
        Whether there is a guard band.
    binary : bool
        Whether what lies in the guard band is refused; else it is not shown to pass, which the
        guide calls a conditional pass.
    """

    name: str
    title: str
    clause: str
    guarded: bool
    binary: bool


_RULES = (
    DecisionRule("guard-band", "non-binary statement with guard band", "4.2.3", True, False),
    DecisionRule("binary-guard-band", "binary statement with guard band", "4.2.2", True, True),
    DecisionRule("simple-acceptance", "binary statement, simple acceptance", "4.2.1", False, True),
)
RULES: Mapping[str, DecisionRule] = MappingProxyType({rule.name: rule for rule in _RULES})
"""By name; the first is the default."""
DEFAULT_RULE = _RULES[0].name
