"""Do intervals cover the truth as often as they say? Every effect at three sizes, given in the model and fitted.

Each session is short, has one effect planted besides scale, bias, turn-on bias, drift and white noise, and is fitted with the
model that has this effect. Sizes are a third of the typical size, the typical size (the geometric mean of the effect's typical
range) and three times that. Truth is what the session contains: of a wave whose phase differs from run to run, the root mean
square of its amplitudes over the runs. Intervals of spreads over power cycles and of nonlinear parameters (time constants,
frequencies, widths) are symmetric in the logarithm: from ``value * exp(-k se / value)`` to ``value * exp(k se / value)``.

    gyrocal benchmark coverage
    python benchmarks/coverage.py [--fits 300] [--effects warmup,drift] [--workers 2] [--out build/coverage.jsonl] [--page FILE]

Each fit is appended to ``--out``. Fits that the file already holds are not repeated if they were made with the same sources.
``--page docs/coverage.md`` writes the tables of all cells into the page, from its heading "Effects" on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.effects.base import Effect, effect, effects
from gyrocal.effects.wave import Wave
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Session
from gyrocal.simulation.simulate import simulate

ROOT = Path(__file__).parents[1]
OUT = ROOT / "build" / "coverage.jsonl"
FITS, SAMPLE_FITS = 300, 4
FIRST_SEED = 100_000
"""Smaller seeds were looked at while the method was written."""
SIZES = {"third": 1 / 3, "typical": 1.0, "triple": 3.0}
LEVELS = {"68": (1.0, 0.6827), "95": (1.96, 0.95)}
FAMILY_WISE = 0.99
"""Chance that no cell at all is outside the band if every interval is right."""
EFFECTS = "## Effects"
"""The heading of the page from which on it has the tables."""
SCALE, BIAS_DPS, TURN_ON_SD_DPS = 0.004, -0.05, 0.005


@dataclass(frozen=True)
class Protocol:
    """How a session is recorded: the simulator's campaign, its size and the axis on which the effect is looked for."""

    campaign: str
    scenarios: int
    seconds: float
    axis: str = "z"

    def simulate(self, planted: Sequence[tuple[str, Mapping[str, float]]], seed: int) -> tuple[Session, dict[str, Any]]:
        every = [("scale", {"scale": SCALE}), ("bias", {"bias_dps": BIAS_DPS}), *planted]
        return simulate(
            None, self.campaign, every, seed, scenarios=self.scenarios, seconds=self.seconds, turn_on_sd_dps=TURN_ON_SD_DPS
        )


PAPER, FULL = Protocol("paper", 12, 12.0), Protocol("full", 1, 12.0)
BENCH, SWING = Protocol("bench", 1, 12.0), Protocol("swing", 2, 15.0)
PROTOCOLS = (PAPER, FULL, BENCH, SWING)
"""An effect without an entry in :data:`OWN` is recorded by the first of these that can show it."""
OWN = {
    "bias_temperature": BENCH, "scale_temperature": BENCH, "thermal_lag": BENCH,
    "warmup": Protocol("paper", 8, 30.0), "drift": Protocol("paper", 8, 30.0), "bias_jumps": Protocol("paper", 8, 20.0),
    "vibration_tone": Protocol("paper", 8, 4.0), "g_sensitivity": FULL, "misalignment": Protocol("full", 1, 12.0, "x"),
    "scale_nonlinearity": FULL, "scale_asymmetry": FULL, "centripetal": FULL, "order_tone": FULL,
    "g2_sensitivity": Protocol("shaker", 1, 12.0), "thermal_hysteresis": Protocol("chamber", 6, 400.0),
}  # fmt: skip
LEFT_OUT = {
    "earth_rate": "it is computed from the latitude and never fitted",
    "quantization": "the step is read off the readings exactly and has no standard error",
    "saturation": "the limit is read off the readings exactly and has no standard error",
    "byte_fault": "the step is a power of two of counts, read off the codes, and has no standard error",
}
SIZED_BY = {
    "g_sensitivity": "gz_dps_per_g",  # only az differs between face up and face down
    "dead_band": "width_dps",
}
BESIDE = {"dead_band": {"depth": 1.0}}
"""Linear parameters beside the size that are planted and not zero: a driver sets small rates to zero."""
JITTER = {"dead_band": 0.2}
"""Largest change of the size from session to session, in its logarithm, where the error is a distance between samples."""
STRUCTURE = {"g2_sensitivity": {"k_dps_per_g2": 0.0}}
"""What is given of an effect with several structures: below three errors, noise chooses between the sum and one direction."""
INHERENT = {("scale", "scale"): SCALE, ("bias", "bias_dps"): BIAS_DPS, ("turn_on_bias", "sd_dps"): TURN_ON_SD_DPS}
"""What every session has, by id and parameter: counted over all sizes of an effect together."""


def covered_effects() -> list[str]:
    """Ids of the effects with cells: scale and bias are in every session and counted there."""
    return [i for i, kind in effects().items() if i not in LEFT_OUT and kind.role is None]


def protocol_of(kind: Effect) -> Protocol:
    """The protocol of an effect."""
    if kind.id in OWN:
        return OWN[kind.id]
    for protocol in PROTOCOLS:
        if kind.missing(protocol.simulate([], 0)[0].runs, AXES.index(protocol.axis)) is None:
            return protocol
    raise ValueError(f"no protocol shows {kind.id}")


def sized(kind: Effect) -> str:
    """The parameter that carries the size: the first linear one with a default, or else the first parameter."""
    candidates = [n for n in kind.linear if kind.parameter(n).default] or list(kind.linear) or [kind.parameters[0].name]
    return SIZED_BY.get(kind.id, candidates[0])


def values_of(kind: Effect, size: str) -> dict[str, float]:
    """What is planted: the size, and nonlinear parameters in the middle of their typical ranges."""
    middle = {p.name: float(np.sqrt(p.typical[0] * p.typical[1])) for p in kind.parameters if p.typical[0] > 0}
    name = sized(kind)
    others = dict.fromkeys((n for n in kind.linear if n != name), 0.0) | BESIDE.get(kind.id, {})
    return {**others, **{n: middle[n] for n in kind.nonlinear}, name: middle[name] * SIZES[size]}


def truth_of(kind: Effect, axis: str, record: Mapping[str, Any], name: str) -> float | None:
    """A parameter as the session realises it; None if it is not planted, or differs from run to run without a meaning."""
    planted = [e for run in record["runs"] for e in run["effects"] if e["id"] == kind.id and e["axis"] in (axis, "all")]
    given = [e[name] for e in planted if name in e]
    if not given or not np.any(given):
        return None
    if name in kind.linear and kind.scope == "run" and not kind.common_mean:
        return float(np.sqrt(np.mean(np.square(given))))
    return float(given[0]) if np.ptp(given) == 0 else None


def one_fit(effect_id: str, size: str, seed: int) -> dict[str, list[float | None]]:
    """Value, standard error and truth of each parameter, from one session that no other cell has."""
    kind = effect(effect_id)
    protocol = protocol_of(kind)
    own_seed = zlib.crc32(f"{effect_id} {size} {seed}".encode())
    jitter = JITTER.get(effect_id, 0.0)
    factor = float(np.exp(np.random.default_rng(own_seed).uniform(-jitter, jitter)))
    planted = values_of(kind, size)
    session, record = protocol.simulate([(effect_id, {**planted, sized(kind): factor * planted[sized(kind)]})], own_seed)
    model = Model.builtin("default").with_term(Term(effect_id, protocol.axis, STRUCTURE.get(effect_id, {})))
    fitted = fit(session, model, axes=[protocol.axis]).model
    found: dict[str, list[float | None]] = {}
    term = fitted.term(effect_id, protocol.axis)
    assert term is not None
    for parameter in kind.parameters:
        truth = truth_of(kind, protocol.axis, record, parameter.name)
        if truth is None or not _estimated(kind, parameter.name):
            continue
        value, se = term.values.get(parameter.name), term.se.get(parameter.name)
        if value is not None and isinstance(kind, Wave) and parameter.name in kind.phases:
            value = truth + (value - truth + 180) % 360 - 180
        found[parameter.name] = [_finite(value), _finite(se), truth]
    for (line_id, name), truth in INHERENT.items():
        line = fitted.line(line_id, protocol.axis)
        if line is not None and name in line.values:
            found[f"{line_id}.{name}"] = [_finite(line.values[name]), _finite(line.se.get(name)), truth]
    return found


def _estimated(kind: Effect, name: str) -> bool:
    """True if a fit estimates the parameter. A fault of the reading is a detection, and its values have an error if any."""
    known = (*kind.linear, *kind.nonlinear, *(kind.phases if isinstance(kind, Wave) else ()))
    return name in known if known else True


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def _row(job: tuple[str, str, int]) -> dict[str, Any]:
    effect_id, size, seed = job
    return {"effect": effect_id, "size": size, "seed": seed, "found": one_fit(effect_id, size, seed)}


def sources() -> str:
    """A digest of the package's and this file's sources, by which old results are told from current ones."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted((ROOT / "host" / "gyrocal").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def measured(
    fits: int, wanted: Iterable[str], progress: Callable[[int, int], None], out: Path | None = None, workers: int = 1
) -> list[dict[str, Any]]:
    """The rows of all fits, old ones from ``out`` first; new ones are appended to it."""
    jobs = [(e, size, seed) for seed in range(FIRST_SEED, FIRST_SEED + fits) for e in wanted for size in SIZES]
    stamp, rows = sources(), []
    if out is not None and out.is_file():
        asked = set(jobs)
        read = (json.loads(line) for line in out.read_text(encoding="utf-8").splitlines())
        rows = [r for r in read if r["sources"] == stamp and (r["effect"], r["size"], r["seed"]) in asked]
    done = {(r["effect"], r["size"], r["seed"]) for r in rows}
    left = [job for job in jobs if job not in done]
    for row in _each(left, workers):
        rows.append({"sources": stamp, **row})
        if out is not None:
            out.parent.mkdir(parents=True, exist_ok=True)
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        progress(len(rows), len(jobs))
    return rows


def _each(jobs: Sequence[tuple[str, str, int]], workers: int) -> Iterator[dict[str, Any]]:
    if workers == 1:
        yield from map(_row, jobs)
    else:
        with ProcessPoolExecutor(workers) as pool:
            yield from pool.map(_row, jobs, chunksize=8)


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """A line for each effect, size and parameter: coverage at both levels with its band, mean and spread of z."""
    from scipy.stats import binom

    grouped: dict[tuple[str, str, str], list[float]] = {}
    for row in rows:
        for name, numbers in row["found"].items():
            size = "all" if tuple(name.split(".")) in INHERENT else row["size"]
            grouped.setdefault((row["effect"], size, name), []).append(_z(*numbers, in_logarithm(row["effect"], name)))
    chance = (1 - FAMILY_WISE) / max(1, len(grouped) * len(LEVELS))
    lines = []
    for (effect_id, size, name), estimates in grouped.items():
        z = np.array(estimates)
        line: dict[str, Any] = {"effect": effect_id, "size": size, "parameter": name, "fits": z.size}
        there = z[np.isfinite(z)]
        line |= {"without": int(z.size - there.size), "outside": []}
        line |= {"z_mean": float(there.mean()) if there.size else None, "z_sd": float(there.std()) if there.size else None}
        for level, (width, share) in LEVELS.items():
            inside = int(np.count_nonzero(np.abs(z) <= width))
            low, high = binom.interval(1 - chance, z.size, share)
            line |= {level: inside / z.size, f"{level}_band": [low / z.size, high / z.size]}
            line["outside"] += [] if low <= inside <= high else [level]
        lines.append(line)
    order = [*SIZES, "all"]
    lines.sort(key=lambda line: (line["size"] == "all", line["effect"], line["parameter"], order.index(line["size"])))
    return {"family_wise": FAMILY_WISE, "left_out": LEFT_OUT, "rows": lines}


def in_logarithm(effect_id: str, name: str) -> bool:
    """True if an interval is ``value * exp(+-k se / value)``: of a spread over power cycles, and of a nonlinear parameter."""
    return name == "turn_on_bias.sd_dps" or (effect_id in effects() and name in effect(effect_id).nonlinear)


def _z(value: float | None, se: float | None, truth: float, logarithm: bool = False) -> float:
    """Error over standard error; NaN, which no interval covers, if the fit has no value or no error."""
    if value is None or not se:
        return float("nan")
    return float(np.log(value / truth)) * value / se if logarithm and value > 0 else (value - truth) / se


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """What ``gyrocal benchmark coverage --json`` prints. The whole run is kept in ``build/coverage.jsonl``."""
    fits, out = (SAMPLE_FITS, None) if sample else (FITS, OUT)
    return summary(measured(fits, covered_effects(), progress, out))


def show(found: dict[str, Any]) -> None:
    """The table."""
    rows = []
    for line in found["rows"]:
        shares = [f"{line[level]:.0%} ({low:.0%}-{high:.0%})" for level in LEVELS for low, high in [line[f"{level}_band"]]]
        moments = ["-" if line[m] is None else f"{line[m]:.2f}" for m in ("z_mean", "z_sd")]
        counts = [str(line["fits"]), str(line["without"])]
        outside = " ".join(line["outside"])
        rows.append([line["effect"], line["parameter"], line["size"], *counts, *shares, *moments, outside])
    columns = ["effect:", "parameter:", "size:", "fits", "no error", "68 % (band)", "95 % (band)", "mean z", "sd z", "outside:"]
    table(f"intervals that cover the truth; the bands hold for all cells together at {found['family_wise']:.0%}", columns, rows)
    for effect_id, why in found["left_out"].items():
        stdout.print(f"{effect_id} is left out: {why}", markup=False)


def with_tables(page: str, found: Mapping[str, Any]) -> str:
    """The page with the tables of all cells from its heading "Effects" on."""
    head = ["| effect | parameter | size | fits | 68 % | 95 % | mean z | sd z |", "|" + " --- |" * 8]
    lines: dict[bool, list[str]] = {False: [], True: []}
    for line in found["rows"]:
        shares = [f"{line[level]:.0%}".replace("%", " %") + " (outside)" * (level in line["outside"]) for level in LEVELS]
        moments = ["-" if line[m] is None else f"{line[m]:.2f}" for m in ("z_mean", "z_sd")]
        cells = [line["effect"], line["parameter"], line["size"], str(line["fits"]), *shares, *moments]
        lines[line["size"] == "all"].append("| " + " | ".join(cells) + " |")
    beside = "## Scale, bias and turn-on bias beside them, all sizes together"
    text = page[: page.index(EFFECTS)]
    return text + "\n".join([EFFECTS, "", *head, *lines[False], "", beside, "", *head, *lines[True]]) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """The benchmark with its options; 1 if a cell is outside its band."""
    parser = argparse.ArgumentParser(description="Do intervals cover the truth as often as they say?")
    parser.add_argument("--fits", type=int, default=FITS, help="fits of each cell")
    parser.add_argument("--effects", default=",".join(covered_effects()), help="ids, separated by commas")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=OUT, help="results, one JSON object a line")
    parser.add_argument("--page", type=Path, help="a page into which the tables are written")
    asked = parser.parse_args(arguments)

    def progress(done: int, total: int) -> None:
        print(f"\r{done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

    found = summary(measured(asked.fits, asked.effects.split(","), progress, asked.out, asked.workers))
    show(found)
    if asked.page is not None:
        asked.page.write_text(with_tables(asked.page.read_text(encoding="utf-8"), found), encoding="utf-8")
    return int(any(line["outside"] for line in found["rows"]))


if __name__ == "__main__":
    sys.exit(main())
