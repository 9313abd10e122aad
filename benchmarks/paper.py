"""Tables 1 to 3 and Figs. 4 and 5 of the paper on the simulated campaign `table2`, with other methods and the limit.

A campaign is three days of 13, 7 and 28 scenarios. A method learns from other scenarios than those that it is judged by:
`prior` and `shrunk` learn from the remaining days (leave one day out), or from all but the last two scenarios of the last day,
as in the paper. The networks and the model are those that ship, made from other scenarios: the model by `gyrocal add`
from one simulated campaign (docs/calibration.md); the C core answers by its calibration.h. The network and the limit use the
campaign's own priors of scale and bias; a table of its own gives both of them flat priors. The last two tables plant effects
that no method was told of. They show the errors before and after the effect is added, and how often the misfit reveals it.

    gyrocal benchmark paper
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from gyrocal.calibration import limit
from gyrocal.calibration.network import FaceNetwork, Network, Prior
from gyrocal.recording.session import Array
from gyrocal.simulation.simulate import TABLE_RATE_DPS

from .paper_campaign import DAYS, FIRST_SEED, MOST, SECONDS, Campaign, shipped
from .paper_figures import METHODS, draw, report_of, show, table2_of
from .paper_hidden import judge_hidden, judge_misfit

__all__ = ["run", "show"]

SEEDS = 42
SAMPLE_SEEDS = 2
FLAT_METHODS = ("baseline", "gyrocal", "limit")
MISFIT_TESTS, SAMPLE_TESTS = 1500, 600
SAMPLE_CAMPAIGN = 24


def folds() -> Iterator[tuple[str, Array, Array]]:
    """Yields the split's name, the indices of the scenarios to learn from, and those of the scenarios to be judged by."""
    everything = np.arange(len(DAYS))
    for day in (1, 2, 3):
        held = np.equal(DAYS, day)
        yield "day", everything[~held], everything[held]
    yield "paper", everything[:-2], everything[-2:]


def answered(campaign: Campaign) -> tuple[Array, Array]:
    """Answers [methods, seconds, scenarios, 2] of the methods that learned elsewhere, and their standard errors.

    The last index is scale and bias in dps. An answer or an error that a method does not give is NaN.
    """
    found = np.full((len(METHODS), len(SECONDS), len(DAYS), 2), np.nan)
    errors = found.copy()
    up, down = campaign.up, campaign.down
    ours, papers = FaceNetwork.shipped(), Network.shipped()
    prior = Prior(limit.table2().scale, limit.table2().bias_dps)
    model = shipped().answers(up[:, :MOST], down[:, :MOST], SECONDS, limit.PROTOCOL)
    for k, seconds in enumerate(SECONDS):
        windows = round(seconds / 2)
        cut = [y[:, : windows * papers.window].reshape(-1, papers.window) for y in (up, down)]
        y = papers.estimate(cut[0], cut[1], TABLE_RATE_DPS, -TABLE_RATE_DPS)
        found[METHODS.index("paper"), k] = y.reshape(len(DAYS), windows, 2).mean(1)
        n = ours.samples(k)
        y = ours.estimate(up[:, :n], down[:, :n], k, TABLE_RATE_DPS, -TABLE_RATE_DPS, prior)
        p = limit.limit(up, down, seconds)
        for method, values, se in (
            ("baseline", campaign.baseline[round(seconds) - 1], np.nan),
            ("gyrocal", y[:, :2], y[:, 2:]),
            ("model", model[k][:, [0, 2]], model[k][:, [1, 3]]),
            ("limit", np.column_stack([p.scale, p.bias_dps]), np.column_stack([p.scale_se, p.bias_se_dps])),
        ):
            found[METHODS.index(method), k], errors[METHODS.index(method), k] = values, se
    return found, errors


def without_priors(campaign: Campaign) -> Array:
    """Answers [FLAT_METHODS, seconds, scenarios, 2] of methods that know the effects but have flat priors of scale and bias."""
    found = np.empty((len(FLAT_METHODS), len(SECONDS), len(DAYS), 2))
    net = FaceNetwork.shipped()
    for k, seconds in enumerate(SECONDS):
        n = net.samples(k)
        best = limit.limit(campaign.up, campaign.down, seconds, known=False)
        found[:, k] = (
            campaign.baseline[round(seconds) - 1],
            net.estimate(campaign.up[:, :n], campaign.down[:, :n], k, TABLE_RATE_DPS, -TABLE_RATE_DPS)[:, :2],
            np.column_stack([best.scale, best.bias_dps]),
        )
    return found


def judge(campaign: Campaign, elsewhere: Array, known: Array, tested: Array) -> Array:
    """Answers [methods, seconds, tested, 2]: ``elsewhere``, completed by the methods that learn from the ``known`` labels."""
    labels = campaign.baseline[-1][known]
    found = elsewhere[:, :, tested].copy()
    for k, seconds in enumerate(SECONDS):
        base = campaign.baseline[round(seconds) - 1]
        mean, of_base = labels.mean(0), base[known].mean(0)
        slope = np.mean((labels - mean) * (base[known] - of_base), axis=0) / base[known].var(0)
        found[METHODS.index("prior"), k] = mean
        found[METHODS.index("shrunk"), k] = mean + slope * (base[tested] - of_base)
    return found


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Run all seeds and return what ``gyrocal benchmark paper --json`` prints. Unless it is a sample, draw docs/images."""
    seeds = SAMPLE_SEEDS if sample else SEEDS
    kept: dict[str, list[tuple[Array, Array, Array, Array]]] = {"day": [], "paper": []}
    seconds_of_baseline, labels, truths, flat = [], [], [], []
    for seed in range(seeds):
        campaign = Campaign.draw(FIRST_SEED + seed)
        labels.append(campaign.baseline[-1])
        truths.append(campaign.truth)
        seconds_of_baseline.append(np.abs(campaign.baseline - campaign.truth))
        elsewhere, errors = answered(campaign)
        flat.append(np.abs(without_priors(campaign) - campaign.truth))
        for split, known, tested in folds():
            found = judge(campaign, elsewhere, known, tested)
            kept[split].append((found, errors[:, :, tested], campaign.truth[tested], campaign.baseline[-1][tested]))
        progress(seed + 1, seeds + 2)
    by_second = np.concatenate(seconds_of_baseline, axis=1).mean(1)
    joined = {split: tuple(np.concatenate([p[i] for p in parts], axis=-2) for i in range(4)) for split, parts in kept.items()}
    report = report_of(joined, by_second, np.concatenate(labels), np.concatenate(truths))
    report["table2_flat"] = table2_of(np.concatenate(flat, axis=2), FLAT_METHODS)
    tests = SAMPLE_TESTS if sample else MISFIT_TESTS
    report["hidden_effect"] = judge_hidden(SAMPLE_CAMPAIGN if sample else len(DAYS), tests)
    progress(seeds + 1, seeds + 2)
    report["misfit"] = judge_misfit(tests)
    if not sample:
        draw(report, by_second, np.concatenate(labels), np.concatenate(truths))
    return report
