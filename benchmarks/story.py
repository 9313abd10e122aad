"""The story of each effect on a campaign: planted, compared, diagnosed, added. python benchmarks/story.py CAMPAIGN [effect ...]

One line an effect at the size that `gyrocal simulate` plants: the verdict, what is named first and with whom it is grouped, and
the held-out excess error before and after the planted effect is added. Without effects named: nothing planted, then each.
"""

from __future__ import annotations

import argparse

from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.base import effects
from gyrocal.simulation.simulate import simulate

INNATE = ("scale", "bias")


def story(campaign: str, effect: str | None, seed: int, scenarios: int | None) -> list[str]:
    """The cells of one row of the table."""
    session, _ = simulate(None, campaign, [effect] if effect else [], seed, scenarios=scenarios)
    found = diagnose(session)
    best = found.best
    named = "-" if best is None else f"{best.effect.id} on {best.axis}"
    if best is not None and len(best.group) > 1:
        named = f"one of {', '.join(best.group)}"
    excess = "-"
    mine = [c for c in found.candidates if effect and c.effect.id == effect.partition(":")[0]]
    if mine and all(c.decision == "not_measurable" for c in mine):
        named = f"{named}; not measurable"
    elif mine:
        before, after, _ = add(session, None, mine[0].effect.id)
        if before.pooled.excess_dps is not None and after.pooled.excess_dps is not None:
            excess = f"{before.pooled.excess_dps * 1e3:.1f} -> {after.pooled.excess_dps * 1e3:.1f}"
    return [effect or "nothing", found.verdict, named, excess]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("campaign")
    parser.add_argument("effect", nargs="*")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenarios", type=int)
    given = parser.parse_args()
    wanted = given.effect or [None, *(e for e in effects() if e not in INNATE)]
    print("| planted | verdict | named | excess before -> after, mdps |\n| --- | --- | --- | --- |")
    for effect in wanted:
        print(f"| {' | '.join(story(given.campaign, effect, given.seed, given.scenarios))} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
