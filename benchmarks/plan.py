"""Does a plan answer its question as often as it promises? python benchmarks/plan.py [sessions for each truth]

A session with a known effect is simulated and planned for. Then the planned runs are added many times, on other days with other
noise and rooms, each effect in question true in turn at the size that the session gives it, and the whole is diagnosed. The
answer is right if the verdict is only the true effect, or if the standard error is a tenth of the value.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gyrocal.api import Model, Session, diagnose, simulate
from gyrocal.planning.plan import Plan, plan
from gyrocal.recording.plan_file import PlannedRuns

SESSIONS = 10


@dataclass(frozen=True)
class Case:
    """A campaign with an effect, and a question about it; ``between`` is empty where its size is measured."""

    effect: str
    between: tuple[str, ...]
    minutes: float
    scenarios: int
    seconds: float
    seed: int
    campaign: str = "paper"
    chamber_c: tuple[float, float] | None = None


TEMPERATURE = "bias_temperature:k1_dps_per_c=0.01"
LAG = ("bias_temperature", "thermal_lag")
CASES = (
    Case(TEMPERATURE, LAG, 4.0, 4, 40.0, 4),
    Case(TEMPERATURE, LAG, 10.0, 4, 40.0, 4),
    Case(TEMPERATURE, LAG, 10.0, 4, 40.0, 4, chamber_c=(5.0, 45.0)),
    Case("drift:k_dps_per_s=0.0002", ("bias_temperature", "drift"), 4.0, 4, 30.0, 5),
    Case("drift:k_dps_per_s=0.0002", ("bias_temperature", "drift"), 10.0, 4, 30.0, 5),
    Case("warmup:A_dps=0.04,tau_s=80", ("warmup", "drift"), 8.0, 6, 30.0, 6),
    Case("scale_nonlinearity:k3=3e-8", ("scale_nonlinearity", "scale_asymmetry"), 5.0, 1, 20.0, 7, "full"),
    Case(TEMPERATURE, (), 3.0, 4, 40.0, 8),
)


def of_axis(axis: str) -> Model:
    """The default model of one axis alone: the others cost time and say nothing here."""
    model = Model.open("default")
    return replace(model, terms=tuple(t for t in model.terms if t.axis == axis), noise={axis: model.noise[axis]})


def simulated(case: Case, effect: str, runs: PlannedRuns | None = None) -> Session:
    """The case's session with an effect, and with the planned runs added where there are any."""
    first, _ = simulate(None, case.campaign, [effect], seed=case.seed, scenarios=case.scenarios, seconds=case.seconds)
    return first if runs is None else simulate(None, effects=[effect], seed=case.seed, plan=runs, add_to=first)[0]


def answered(session: Session, effect: str, named: bool) -> bool:
    """True if the diagnosis names the effect alone, or knows its main parameter to a tenth."""
    found = diagnose(session, of_axis("z"))
    if named:
        best = found.best
        return found.verdict == "add" and best is not None and best.effect.id == effect
    c = next(c for c in found.candidates if c.effect.id == effect)
    name = c.effect.coding.used(c.values)[0]
    return bool(c.values) and c.se.get(name, float("inf")) <= 0.1 * abs(c.values[name])


def planted(planned: Plan, case: Case) -> list[str]:
    """The effects in question at the sizes that the planner used, as options of ``simulate``."""
    from gyrocal.diagnosis.answer.diagnose import diagnose as full

    first = simulated(case, case.effect)
    members = planned.question.members(full(first, of_axis("z")))
    out = []
    for member in members:
        values = ",".join(f"{k}={v:.6g}" for k, v in member.values.items() if not k.endswith("_sd"))
        out.append(f"{member.effect.id}:{values}")
    return out


def rate(case: Case, truths: Sequence[str], planned: Plan, sessions: int) -> float:
    """The fraction of simulated sessions in which the question is answered."""
    days = [PlannedRuns(planned.runs, 10 + k) for k in range(sessions)]
    right = [
        answered(simulated(case, truth, runs), truth.split(":")[0], bool(case.between)) for truth in truths for runs in days
    ]
    return sum(right) / len(right)


def main() -> int:
    sessions = int(sys.argv[1]) if len(sys.argv) > 1 else SESSIONS
    print("question                              minutes  runs   predicted  achieved  sessions", flush=True)
    for case in CASES:
        first = simulated(case, case.effect)
        asked = {"between": case.between} if case.between else {"measure": case.effect.split(":")[0]}
        planned = plan(first, of_axis("z"), minutes=case.minutes, chamber_c=case.chamber_c, **asked)  # type: ignore[arg-type]
        truths = planted(planned, case)
        achieved = rate(case, truths, planned, sessions)
        words = " or ".join(case.between) if case.between else f"size of {asked['measure']}"
        words += "" if case.chamber_c is None else ", chamber"
        print(
            f"{words[:38]:38s} {planned.minutes:6.1f} {len(planned.runs):5d} {planned.power:11.2f} {achieved:9.2f} "
            f"{sessions * len(truths):9d}   {planned.runs[0].seconds:g} s, same again {planned.power_same_again:.2f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
