"""The sentences of verdicts: what an adequate model leaves, and what a misfit stands on beside an excess of zero."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.digits import rounded
from gyrocal.policy import POLICY
from gyrocal.units import unit_of


def first_sentence(text: str) -> str:
    """The first sentence of a text, with its one full stop."""
    return f"{text.split('. ')[0].rstrip('.')}."


def adequate(compared: Mapping[str, Any]) -> str:
    """The sentence of a comparison whose verdict is ``adequate``, given as ``gyrocal compare --json``."""
    if not compared.get("as_is"):
        return left_over(compared, "The model is adequate")
    tried = "No parameter has moved, and no test finds what the model lacks"
    return left_over(compared, "The model still holds, and no parameter has moved", tried)


def left_over(compared: Mapping[str, Any], fits: str, tried: str = "") -> str:
    """The sentence of an adequate model: that noise alone is left over, or the excess that no test names.

    ``compared`` is the output of ``gyrocal compare --json``. ``fits`` opens the sentence of noise, and ``tried`` the other one,
    which must not say that the model is adequate; without it, that no test finds what the model lacks.
    """
    excess = beyond_noise(compared)
    if not excess and compared.get("held_out") == "none":
        return "No test finds what the model lacks. No part of the recording can be held out, so that no excess is known."
    if not excess:
        blocked = sorted({w["axis"] for w in compared["warnings"] if w["blocking"] and w["axis"]})
        judged = [axis for axis in compared["per_axis"] if axis not in blocked]
        if not blocked or not judged:
            return f"{fits}: what is left over is noise."
        apart = f"The warning against {' and '.join(blocked)} stands"
        return f"{fits} on {' and '.join(judged)}: what is left over there is noise. {apart}."
    return f"{tried or 'No test finds what the model lacks'}, but more than noise is left over: an excess of {excess}."


def nothing_found(candidates: Iterable[Candidate], compared: Mapping[str, Any]) -> str:
    """The sentence of a diagnosis that is adequate: how many effects were tried, and how many the recording cannot show.

    Noise alone is left over only as far as the recording shows; an effect that it cannot show may act all the same. What the
    recording suggests but cannot prove is told as that.
    """
    judged: dict[str, bool] = {}
    suggested: list[str] = []
    for c in candidates:
        suggested += [f"{c.effect.id} on {c.axis}"] * (c.decision == "suggest")
        judged[c.effect.id] = judged.get(c.effect.id, False) or c.decision != "not_measurable"
    tried, unseen = sum(judged.values()), len(judged) - sum(judged.values())
    cannot = f"; {unseen} this recording cannot show" if unseen else ""
    of = f"of {tried} effect{'s' * (tried != 1)}"
    found = f"Nothing certain {of}; suggested: {', '.join(suggested)}{cannot}" if suggested else f"Nothing found {of}{cannot}"
    excess = beyond_noise(compared)
    return f"{found}. More than noise is left over: an excess of {excess}." if excess else f"{found}."


def beyond_noise(compared: Mapping[str, Any]) -> str:
    """The excesses beyond ``Policy.adequate_errors`` of their standard errors, in words; empty if there are none.

    They are those of the judged axes; that of all together counts where none of these stands out by itself.
    """
    unit = "deg" if compared["residual"] == "angle" else "dps"
    whole = [w["axis"] for w in compared["warnings"] if w["blocking"] or w["code"] == "axis_absent"]
    judged = {axis: level for axis, level in compared["per_axis"].items() if None not in whole and axis not in whole}
    told = [f"{size} on {axis}" for axis, level in judged.items() if (size := _certain(level, unit))]
    if not told and not whole and (size := _certain(compared, unit)):
        told = [f"{size} on all axes together"]
    return " and ".join(told)


def _certain(level: Mapping[str, Any], unit: str) -> str:
    """An excess with its standard error, as text; empty if it is within ``Policy.adequate_errors`` of them, or not known."""
    excess, se = level[f"excess_{unit}"], level[f"excess_se_{unit}"]
    if excess is None or se is None or excess <= POLICY.adequate_errors * se:
        return ""
    if unit == "deg":
        return f"{rounded(excess, se, 4)} ± {rounded(se, se, 4)} deg"
    of = unit_of([excess])
    return " ± ".join(of.pair(excess, se)) + f" {of.name}"


def high_floor(compared: Mapping[str, Any]) -> str:
    """The sentence about axes whose noise floor is above the rms by more than chance allows; empty if there are none.

    ``compared`` is the output of ``gyrocal compare --json``.
    """
    unit = "deg" if compared["residual"] == "angle" else "dps"
    axes = [axis for axis, level in compared["per_axis"].items() if is_high(level, unit)]
    if not axes:
        return ""
    return (
        f"On {' and '.join(axes)} the noise floor is above the rms: the fitted noise expects more than these data show, and an "
        "effect may be hidden in it. More power cycles, or longer runs, determine the noise better."
    )


def is_high(level: Mapping[str, Any], unit: str = "dps") -> bool:
    """True if a noise floor is above the rms by more than chance allows.

    At an excess of zero, three of its standard errors are the root of three of the mean square's (``levels.excess_of``).
    """
    rms, floor, se = (level[f"{name}_{unit}"] for name in ("rms", "floor", "excess_se"))
    return rms is not None and floor is not None and se is not None and floor**2 - rms**2 > (POLICY.adequate_errors * se) ** 2


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
        f"The verdict rests on the tests of the residual in all data. The strongest is on {first['axis']}, against "
        f"{first['against'].replace('_', ' ')} ({first['strength']:.1f} σ). An excess of zero within its error does not "
        "contradict it: the excess counts only what held-out data show beyond the floor, and the floor contains the error of "
        "their prediction."
    )
