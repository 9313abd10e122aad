"""The cases: what is planted, how large, and beside which disturbance; each fixed by its part, kind and number.

- ``edge``: one effect whose nearest rival is 0.5 to 12 standard errors away, log-uniform.
- ``misspecified``: an effect (every second one at the edge as above, the others of typical size) and a small disturbance
  outside the library, mostly on the same axis.
- ``null``: nothing; every second one with such a disturbance.
- ``sets``: two to five effects. ``unknown``: a larger disturbance alone. ``confounded``: an effect that a rival of physical
  size explains but for a quarter (cosine above 0.97 beside scale and bias) and 2.5 standard errors.

An effect that is confounded in this sense is drawn again for all other kinds.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from . import disturbances, planting
from .apart import Judge, Seen
from .frozen import tree
from .library import LIMITS, measurable
from .planting import DIGITAL, PROPORTIONAL, Planted
from .protocols import draw as draw_recording
from .protocols import log_uniform
from .recording import AXES, Array, Random, Recording, analogue, refer

COUNTS = {
    "work": {"edge": 180, "misspecified": 300, "null": 120, "sets": 60, "unknown": 60, "confounded": 60},
    "calibration": {"edge": 90, "misspecified": 150, "null": 60, "sets": 30, "unknown": 30, "confounded": 30},
    "frozen": {"edge": 450, "misspecified": 750, "null": 300, "sets": 200, "unknown": 200, "confounded": 200},
}
MAIN = ("edge", "misspecified", "null")
ORDER = ("misspecified", "edge", "misspecified", "null", "misspecified", "edge", "misspecified", "null", "misspecified", "edge")
SEEDS = {"work": 310_001, "calibration": 520_003}

NEAREST = (0.5, 12.0)
LEAST_SEEN = 2.0
ALIKE = 0.97
SEEN, MOST_SEEN, APART = 8.0, 3000.0, 4.0
"""Least and most standard errors of an effect of ordinary size by itself, and least beside its nearest rival."""
HARDLY_APART = 2.5
"""Most standard errors between a confounded effect and its equal."""
ORDERS_DPS = (0.003, 0.008, 0.02)
ORDINARY_DENSITY_DPS = 3.8e-3
BLOCK_SIGMA = (2.0, 40.0)
LARGEST_SIGMA, LARGEST_DPS = 150.0, 0.2
OWN_SHARE, OWN_SHARE_OF_ALL = 0.6, 0.3
"""What a disturbance keeps of its size beside scale, bias and any one effect, and beside all effects together."""
SAME_AXIS = 0.75
MOST_DRAWS = 300
IDS = tuple(planting.SIZES)
EDGE_IDS = tuple(id_ for id_ in IDS if id_ != "quantization")
"""Coarse codes are certain or absent: they have no edge."""


@dataclass
class Disturbance:
    """A signal outside the library on one axis. ``sigma`` is its size in the metric of the noise beside scale and bias."""

    kind: str
    axis: int
    signal: list[Array]
    rms_dps: float
    sigma: float
    own_share: float
    own_share_of_all: float


@dataclass
class Case:
    """A drawn case: the recording, its readings, and what it holds."""

    name: str
    kind: str
    made: Recording
    planted: list[Planted]
    seen: list[Seen]
    disturbance: Disturbance | None
    readings: list[Array]
    ideal: list[Array] = field(repr=False)  # without any effect
    random: Random = field(repr=False)
    wanted_sigma: float | None = None


@dataclass(frozen=True)
class Draw:
    """One case to be drawn; ``case`` does it, the same each time."""

    part: str
    kind: str
    number: int

    @property
    def name(self) -> str:
        return f"{self.part}_{self.kind}_{self.number:04d}"

    def case(self) -> Case:
        """The first draw that obeys the rules of its kind."""
        fixed = self._random(2**31)
        at_edge = self.kind == "edge" or (self.kind == "misspecified" and self.number % 2 == 0)
        wanted = log_uniform(fixed, *NEAREST) if at_edge else None
        for attempt in range(MOST_DRAWS):
            if wanted is not None and attempt and attempt % 40 == 0:
                wanted = log_uniform(fixed, *NEAREST)
            found = _attempt(self, self._random(attempt), wanted, attempt)
            if found is not None:
                return found
        raise ValueError(f"{self.name}: no draw of {MOST_DRAWS} obeys the rules of its kind")

    def _random(self, attempt: int) -> Random:
        return np.random.default_rng([*seed_of(self.part), list(COUNTS["work"]).index(self.kind), self.number, attempt])


def seed_of(part: str) -> list[int]:
    """The seed of a part; that of the frozen part is the code that it judges (``frozen.py``)."""
    if part in SEEDS:
        return [SEEDS[part]]
    return np.frombuffer(hashlib.sha256(f"{tree()}/cases".encode()).digest(), dtype="<u4").tolist()


def draws(part: str, kinds: tuple[str, ...] = ()) -> list[Draw]:
    """The cases of a part: edge, misspecified and null in turn as 30 : 50 : 20, then in the frozen part the other kinds."""
    counts_of, seen = COUNTS[part], dict.fromkeys(COUNTS[part], 0)
    listed = []
    for k in range(sum(counts_of[kind] for kind in MAIN)):
        kind = ORDER[k % len(ORDER)]
        listed.append(Draw(part, kind, seen[kind]))
        seen[kind] += 1
    others = [kind for kind in counts_of if kind not in MAIN]
    if part == "frozen" or set(kinds) & set(others):
        listed += [Draw(part, kind, k) for k in range(counts_of["sets"]) for kind in others]
    return [draw for draw in listed if not kinds or draw.kind in kinds]


def _attempt(draw: Draw, random: Random, wanted: float | None, attempt: int) -> Case | None:
    made = draw_recording(random)
    refer(made, random)
    ids = _ids(draw, made, random, attempt)
    if ids is None:
        return None
    planted = [planting.draw(id_, made, random) for id_ in ids]
    for one in planted:
        if one.id == "saturation":
            made.sensor = replace(made.sensor, full_scale_dps=2000.0)
    judge = Judge(made, analogue(made, random))
    seen: list[Seen] = []
    if planted:
        sized = _sized(draw.kind, judge, planted, wanted)
        if sized is None:
            return None
        planted, seen = sized
    disturbance = None
    if draw.kind in ("misspecified", "unknown") or (draw.kind == "null" and draw.number % 2):
        disturbance = _disturbed(judge, planted, random, draw)
        if disturbance is None:
            return None
    readings = judge.readings(planted, disturbance)
    for one in planted:
        if one.id == "saturation":
            made.sensor = replace(made.sensor, full_scale_dps=planting.stated_full_scale(one, made))
    return Case(draw.name, draw.kind, made, planted, seen, disturbance, readings, judge.ideal, random, wanted)


def _ids(draw: Draw, made: Recording, random: Random, attempt: int) -> list[str] | None:
    """The effects to plant; None where this recording cannot show them. After many draws, the next effect of the list."""
    if draw.kind in ("null", "unknown"):
        return []
    fits = measurable(made)
    if draw.kind == "sets":
        each = sorted(fits - set(DIGITAL))
        return random.choice(each, min(2 + draw.number % 4, len(each)), replace=False).tolist() if len(each) > 1 else None
    if draw.kind == "confounded":
        each = sorted(fits - set(DIGITAL) - {"bias_jumps"})
        return [str(random.choice(each))] if each else None
    edge = draw.kind == "edge" or draw.number % 2 == 0
    number = draw.number if draw.kind == "edge" else draw.number // 2
    ids = EDGE_IDS if edge else IDS
    id_ = ids[(number + attempt // 60) % len(ids)]
    return [id_] if id_ in fits else None


def _sized(kind: str, judge: Judge, planted: list[Planted], wanted: float | None) -> tuple[list[Planted], list[Seen]] | None:
    """The effects with the sizes that their kind asks for, and how they stand out."""
    if wanted is not None:
        one = at_distance(judge, planted[0], wanted)
        if one is None or one[1].alone < LEAST_SEEN or one[1].cosine > ALIKE or not physical(one[0]):
            return None
        return [one[0]], [one[1]]
    seen = [judge.seen(one, [other for other in planted if other is not one]) for one in planted]
    if any(not SEEN <= s.alone <= MOST_SEEN for s in seen):
        return None
    if kind == "confounded":
        return _confounded(planted[0], seen[0])
    if any(s.cosine > ALIKE or s.nearest < APART for s in seen):
        return None
    return planted, seen


def _confounded(one: Planted, seen: Seen) -> tuple[list[Planted], list[Seen]] | None:
    """The effect in a size at which it is certain and its equal rival is hardly further away than noise."""
    if seen.cosine <= ALIKE:
        return None
    if seen.nearest > HARDLY_APART and one.id in PROPORTIONAL:
        factor = HARDLY_APART / seen.nearest
        one, seen = one.times(factor), seen.times(factor)
    return ([one], [seen]) if seen.alone >= SEEN and seen.nearest <= 1.001 * HARDLY_APART and physical(one) else None


def physical(one: Planted) -> bool:
    """Is the size within three times the typical range, and not below a twentieth of its low end?"""
    low, high = planting.LIMITS.get(one.id, planting.TYPICAL[one.id][0])
    return bool(low / 20 <= one.size <= 3 * high)


def at_distance(judge: Judge, one: Planted, wanted: float) -> tuple[Planted, Seen] | None:
    """The effect in the size at which its nearest rival is ``wanted`` standard errors away."""
    power = 0.5 if one.id in ("byte_fault", "sampling_fault") else 1.0
    seen = judge.seen(one, [])
    for _ in range(12):
        if seen.nearest <= 1e-9 * max(seen.alone, 1e-12):
            return None
        factor = wanted / seen.nearest
        if abs(np.log(factor)) < 0.02:
            return one, seen
        one = one.times(float(np.clip(factor ** (1 / power), 1e-4, 1e4)))
        if one.id in PROPORTIONAL:
            return one, seen.times(factor)
        low, high = planting.LIMITS[one.id]
        if not low / 5 <= one.size <= 5 * high:
            return None
        seen = judge.seen(one, [])
        power = 0.5 * power + 0.5 * max(power, 0.5) if one.id != "dead_band" else 2.0
    return None


def _disturbed(judge: Judge, planted: list[Planted], random: Random, draw: Draw) -> Disturbance | None:
    """A disturbance of a kind drawn at random that this recording can show and no effect explains."""
    made = judge.made
    axis = int(random.choice([made.axis, random.integers(3)]))
    if planted and random.random() < SAME_AXIS:
        axis = AXES.index(planted[0].axes[0])
    for kind in random.permutation(list(disturbances.KINDS))[:8].tolist():
        raw = disturbances.without_scale_and_bias(made, axis, disturbances.KINDS[kind](made, axis, random))
        rms = float(np.sqrt(np.mean(np.concatenate(raw) ** 2)))
        if not np.isfinite(rms) or rms < 1e-9:
            continue
        raw = [signal / rms for signal in raw]
        sigma, single, joint = judge.own_share(axis, raw)
        if sigma < 1e-6 or single < OWN_SHARE or joint < OWN_SHARE_OF_ALL:
            continue
        size_dps = _size_dps(draw, made, sigma, random)
        if size_dps > LARGEST_DPS:
            continue
        scaled = [size_dps * signal for signal in raw]
        return Disturbance(str(kind), axis, scaled, size_dps, size_dps * sigma, single, joint)
    return None


def _size_dps(draw: Draw, made: Recording, sigma: float, random: Random) -> float:
    """Root mean square of a disturbance whose ``sigma`` is for 1 deg/s of it."""
    if draw.kind == "unknown":
        return log_uniform(random, 12.0, 80.0) / sigma
    if random.random() < 0.5:
        of_sensor = float(np.clip(made.sensor.density_dps / ORDINARY_DENSITY_DPS, 0.5, 3.0))
        return min(float(random.choice(ORDERS_DPS)) * of_sensor, LARGEST_SIGMA / sigma)
    return log_uniform(random, *BLOCK_SIGMA) / sigma


def axes_of(case: Case) -> list[str]:
    """The axes on which something was planted or disturbed, else the table's."""
    found = {seen.axis for seen in case.seen}
    if case.disturbance is not None:
        found.add(AXES[case.disturbance.axis])
    return sorted(found) or [AXES[case.made.axis]]


def right_names(one: Planted, seen: Seen) -> list[list[str]]:
    """The effect on every axis that shows it, and the simpler effect that equals it to less than two standard errors."""
    equal = [name for name, limits in LIMITS.items() if one.id in limits and seen.cosine_beside(name) > ALIKE]
    equal = [name for name in equal if seen.rivals[name] < LEAST_SEEN]
    return [[id_, axis] for id_ in (one.id, *equal) for axis in one.axes]


def truth(case: Case) -> dict[str, Any]:
    """What the case holds, as the benchmark stores it."""
    d, made = case.disturbance, case.made
    return {
        "name": case.name,
        "kind": case.kind,
        "protocol": made.protocol,
        "reference": made.reference,
        "samples": made.samples,
        "rate_hz": made.sensor.rate_hz,
        "runs": len(made.runs),
        "white_sd_dps": made.sensor.white_sd_dps,
        "angle_step_deg": made.angle_step_deg if made.reference == "angle" else None,
        "has": {"temp": made.has_temp, "acc": made.has_acc, "angle": made.has_angle},
        "effects": [
            planting.truth_of(one, made) | seen.to_json() | {"right": right_names(one, seen)}
            for one, seen in zip(case.planted, case.seen, strict=True)
        ],
        "right": [name for one, seen in zip(case.planted, case.seen, strict=True) for name in right_names(one, seen)],
        "wanted_sigma": case.wanted_sigma,
        "disturbance": None if d is None else {
            "kind": d.kind, "axis": AXES[d.axis], "rms_dps": d.rms_dps, "sigma": d.sigma, "own_share": d.own_share,
            "own_share_of_all": d.own_share_of_all,
        },
    }  # fmt: skip


