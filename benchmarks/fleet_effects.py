"""What a fleet says of effects that its model lacks: alarms without one, standard errors, and the boards that a name takes.

    gyrocal benchmark fleet --limit 2000 --results null --workers 2
    python benchmarks/fleet_effects.py null

The folder holds the summaries of simulated boards without an effect. Effects are planted into the summaries: at given noise the
likelihood is quadratic in the size of an effect, so that a size changes the scores alone. More null fleets are drawn from the
likelihood of these boards, as normal scores with their information.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from gyrocal.errors import InputError
from gyrocal.fleet.drift import FleetDrift
from gyrocal.fleet.fit import drift_weights
from gyrocal.fleet.likelihood import CycleSpreads, evidence, names_of
from gyrocal.fleet.missing import Evidence, find
from gyrocal.fleet.summary import Summary
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array

PLANTED = ("scale_asymmetry.z.k", "g_sensitivity.x.gz_dps_per_g")
COMMON, ZERO_MEAN, SHARED = (100, 200, 300, 400, 600), (500, 1000, 1500), (200, 400)
SPREAD, SHARE, SHARED_SIZE = 0.6, 0.1, 3.0
"""Spread of a size of zero mean, and size where a share of the boards has an effect, in standard errors of one board."""
FLEET = 200
"""Boards of a fleet without an effect."""

Index = np.ndarray[Any, np.dtype[np.intp]]


@dataclass(frozen=True)
class Boards:
    """Null boards: their summaries on each axis, the candidates' names, and score and information of each axis."""

    summaries: list[Summary]
    names: dict[str, list[str]]
    said: list[Evidence]
    drift: dict[str, FleetDrift]

    @staticmethod
    def load(folder: Path) -> Boards:
        rows = [json.loads(path.read_text()) for path in sorted((folder / "done").glob("*.json"))]
        keys = [row["key"] for row in rows if row["task"] == "work" and row["key"]]
        if not keys:
            raise InputError(f"{folder}: no boards; write them by `gyrocal benchmark fleet --results {folder}`")
        summaries = [Summary.load(folder / "results" / f"{key}.npz") for key in keys]
        drift = {axis: FleetDrift(1.0, 1.0) for axis in AXES}  # sizes are relative to that of the pilot
        names = {axis: names_of([s.axes[axis] for s in summaries]) for axis in AXES}
        return Boards(summaries, names, _said(summaries, names, drift), drift)

    @property
    def n(self) -> int:
        return len(self.summaries)

    def some(self, which: Index) -> list[Evidence]:
        """The evidence of a selection of the boards, each as a board of its own on one rig."""
        number, rig = np.arange(which.size), np.zeros(which.size, dtype=np.intp)
        return [
            replace(e, score=e.score[which], information=e.information[which], board=number, rig=rig) for e in self.said
        ]

    @property
    def alone(self) -> float:
        """Standard errors at which one board would pass the limit of a fleet by itself."""
        return float(norm.isf(POLICY.fleet_names / sum(map(len, self.names.values())) / 2))


def _said(summaries: Sequence[Summary], names: dict[str, list[str]], drift: dict[str, FleetDrift]) -> list[Evidence]:
    """The evidence of boards with the drift and the spreads over power cycles that they share."""
    cycles, out = CycleSpreads(), []
    weights = drift_weights(summaries, drift)[1]
    for summary in summaries:
        for axis, one in summary.axes.items():
            cycles.add(one, weights[axis])
    spreads, number = cycles.fit(), np.arange(len(summaries))
    for axis, known in names.items():
        each = [evidence(s.axes[axis], weights[axis], spreads, known) for s in summaries]
        score, information = (np.stack(of) for of in zip(*each, strict=True))
        out.append(Evidence(axis, known, score, information, number, np.zeros(number.size, dtype=np.intp), 1))
    return out


def z_values(boards: Boards) -> dict[str, Array]:
    """The z values [n] of every candidate."""
    out = {}
    for e in boards.said:
        own = np.einsum("bii->bi", e.information)
        for j, name in enumerate(e.names):
            seen = own[:, j] > 0
            out[name] = e.score[seen, j] / np.sqrt(own[seen, j])
    return out


def parts(boards: Boards, size: int) -> Iterator[list[Evidence]]:
    """Fleets of boards of their own, each with the spreads over power cycles that it determines itself."""
    for first in range(0, boards.n - size + 1, size):
        yield _said(boards.summaries[first : first + size], boards.names, boards.drift)


def drawn(boards: Boards, size: int, rng: np.random.Generator) -> list[Evidence]:
    """A fleet without an effect, drawn from the likelihood of the boards."""
    out = []
    for e in boards.some(rng.choice(boards.n, size)):
        values, vectors = np.linalg.eigh(e.information)
        root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        out.append(replace(e, score=np.einsum("bij,bj->bi", root, rng.normal(size=e.score.shape))))
    return out


def planted(boards: Boards, which: Index, name: str, sizes: Array) -> list[Evidence]:
    """A fleet of the boards ``which`` with an effect whose ``sizes`` [n] are in standard errors of each board."""
    out = boards.some(which)
    for i, e in enumerate(out):
        if name in e.names:
            j = e.names.index(name)
            own = np.maximum(e.information[:, j, j], 1e-300)
            out[i] = replace(e, score=e.score + e.information[:, :, j] * (sizes / np.sqrt(own))[:, None])
    return out


def power(boards: Boards, name: str, kind: str, n: int, fleets: int, rng: np.random.Generator) -> dict[str, Any]:
    """In how many fleets of ``n`` boards a planted effect is named, by itself or in a group, and is shown by one board."""
    effect, axis = name.split(".")[:2]
    named = grouped = others = alone = 0
    for _ in range(fleets):
        sizes = {
            "common": lambda: np.full(n, boards.alone / 10),
            "zero mean": lambda: rng.normal(0.0, SPREAD, n),
            "share": lambda: np.where(rng.random(n) < SHARE, SHARED_SIZE, 0.0),
        }[kind]()
        found = find(planted(boards, rng.permutation(boards.n)[:n], name, sizes))
        mine = [m for m in found if m.axis == axis and effect in (m.effect, *m.group)]
        named += any(m.effect == effect for m in mine)
        grouped += bool(mine)
        others += len(found) > len(mine)
        alone += sum(m.named_alone_by for m in mine)
    return {
        "planted": name, "kind": kind, "boards": n, "fleets": fleets, "named": named, "in_group": grouped,
        "other_names": others, "boards_that_show_it": alone / fleets,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("--fleets", type=int, default=10, help="fleets for each planted effect")
    parser.add_argument("--drawn", type=int, default=100, help="null fleets that are drawn from the likelihood")
    given = parser.parse_args()
    boards, rng = Boards.load(given.results), np.random.default_rng(0)
    z = z_values(boards)
    sd = {name: float(np.sqrt(np.mean(values**2))) for name, values in z.items()}
    print(json.dumps({"boards": boards.n, "candidates": len(sd), "z_sd": dict(sorted(sd.items(), key=lambda i: i[1]))}))
    print(json.dumps({"median_z_sd": float(np.median(list(sd.values()))), "sampling_error": (2 * boards.n) ** -0.5}))
    own = [bool(find(fleet)) for fleet in parts(boards, FLEET)]
    print(json.dumps({"null_fleets": len(own), "boards": FLEET, "alarms": sum(own)}), flush=True)
    whole = find(boards.said)
    print(json.dumps({"null_fleets": 1, "boards": boards.n, "named": [f"{m.effect}.{m.axis}" for m in whole]}), flush=True)
    for name in PLANTED:
        for kind, sizes in (("common", COMMON), ("zero mean", ZERO_MEAN), ("share", SHARED)):
            for n in (s for s in sizes if s <= boards.n):
                print(json.dumps(power(boards, name, kind, n, given.fleets, rng)), flush=True)
    alarms = sum(bool(find(drawn(boards, FLEET, rng))) for _ in range(given.drawn))
    print(json.dumps({"drawn_null_fleets": given.drawn, "boards": FLEET, "alarms": alarms}))


if __name__ == "__main__":
    main()
