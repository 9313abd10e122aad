"""What a verdict of misfit stands on where the excess beside it is zero within its error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gyrocal.policy import POLICY


def stands_on(compared: Mapping[str, Any]) -> str:
    """Which finding the verdict stands on, and why the excess does not show it; empty where both agree.

    ``compared`` is the output of ``gyrocal compare --json``.
    """
    unit = "deg" if compared["residual"] == "angle" else "dps"
    excess, se = compared[f"excess_{unit}"], compared[f"excess_se_{unit}"]
    if compared["verdict"] != "misfit" or excess is None or se is None or excess >= POLICY.excess_errors * se:
        return ""
    first = compared["where"][0]
    return (
        f"The verdict stands on the tests of what the model leaves of all data: first on {first['axis']}, against "
        f"{first['against'].replace('_', ' ')} ({first['strength']:.1f} σ). That the excess is zero within its error does not "
        "contradict them: it counts only what data left out of the fit show beyond the floor, and the floor contains how "
        "uncertainly the rest predicts them."
    )
