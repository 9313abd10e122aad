"""Cases drawn at random: protocols that users have, sensors from a population, effects of physical size.

A drawn case is fixed by its kind, its number and the set's seed. Every rule below was written before any tool was run:

- An effect counts where it stands out by `SEEN` standard errors for one who knows its shape and the noise, and by `APART`
  beside each rival of the documented table (`generator.told_apart`): else the draw is repeated.
- A confounded case stands out by `SEEN`, and by less than `ALIKE` beside at least one rival of physical size: those are its
  rivals.
- An unknown shape keeps at least `OWN_SHAPE` of its size beside every effect of the table. Nobody knows it, so it counts by
  its power: that of the Fourier coefficients that hold it stands `SEEN_UNKNOWN` standard errors over the noise's.
- In a set, each effect stands out by `SEEN` beside all others together, and by `APART` beside each rival as well.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edge import frozen

from .generator.case import AXES, Case, Effect
from .generator.chip import DIGITAL
from .generator.protocol import MOVING
from .generator.session import make
from .generator.told_apart import power, told_apart

SEEN, APART, ALIKE = 8.0, 5.0, 2.0
SEEN_UNKNOWN, OWN_SHAPE = 10.0, 0.7
MOST_DRAWS = 400
SEEDS = {"work": 20_000, "frozen": 70_000}
UNSEEN = "unseen"
"""The set whose seed is the git tree of the code that its cases judge, as that of the frozen part of the edge benchmark."""
SETS = (*SEEDS, UNSEEN)
COUNTS = {"effect": 200, "set": 60, "confounded": 60, "unknown": 60, "null": 200}

SECONDS = {"paper": 14.0, "full": 8.0, "swing": 10.0, "long": 180.0, "staircase": 50.0, "hand": 25.0, "chamber": 100.0}
RUNS = {"paper": 18, "full": 42, "swing": 18, "long": 1, "staircase": 3, "hand": 6, "chamber": 3}
MOST_SAMPLES = 70_000
LOGGERS = ((50.0, 104.0), (100.0, 208.0), (145.0, 416.0), (200.0, 416.0), (400.0, 833.0), (1000.0, 1666.0))
"""Rate of the logger and output data rate of the chip, Hz."""

ALL = tuple(SECONDS)
MOVED = ("swing", *MOVING)
SEVERAL_RATES = ("full", *MOVED)
Random = np.random.Generator
Parameters = dict[str, float]


@dataclass(frozen=True)
class Kind:
    """How an effect is drawn: where it can be seen, on which axes, with which parameters, and what the session needs."""

    protocols: Sequence[str]
    axes: str  # "table", "off" (in the table's plane), "any" or "all"
    parameters: Callable[[Random, Case], Parameters]
    settings: dict[str, Any] | None = None


def size(random: Random, typical: float) -> float:
    """Log-uniform from a third of the typical size to five times it."""
    return float(typical * np.exp(random.uniform(np.log(1 / 3), np.log(5.0))))


def _signed(random: Random, typical: float) -> float:
    return size(random, typical) * float(random.choice([-1.0, 1.0]))


def _between(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _bias_temperature(random: Random, _: Case) -> Parameters:
    k1 = _signed(random, 0.01)
    return {"k1_dps_per_c": k1, **({"k2_dps_per_c2": k1 * random.uniform(-0.05, 0.05)} if random.random() < 0.4 else {})}


def _ripple(random: Random, _: Case) -> Parameters:
    orders = random.choice(np.arange(1, 5), random.integers(1, 3), replace=False)
    found: Parameters = {}
    for order in orders:
        found |= {f"amplitude_{order}": size(random, 1e-3), f"phase_{order}_deg": random.uniform(0.0, 360.0)}
    return found


def _tone(random: Random, case: Case) -> Parameters:
    return {"f_hz": _between(random, 2.0, 0.4 * min(case.poll_hz, 2 * case.cutoff_hz)), "A_dps": size(random, 0.02)}


def _gravity(random: Random, case: Case) -> Parameters:
    return {f"g{case.table_axis}_dps_per_g": _signed(random, 0.03)}


def _byte_fault(random: Random, case: Case) -> Parameters:
    """A lost carry leaves single steps in a rate that moves; a torn reading takes a byte of the sample before."""
    if case.protocol in MOVED and random.random() < 0.5:
        return {"bit": float(random.choice([6, 8]))}
    return {"bit": float(random.choice([4, 8] if case.protocol in MOVED else [4])), "fraction": _between(random, 0.01, 0.3)}


def _clipped(random: Random, case: Case) -> Parameters:
    return {"full_scale_dps": case.full_scale_dps}


def _one(name: str, typical: float, signed: bool = True) -> Callable[[Random, Case], Parameters]:
    return lambda random, case: {name: (_signed if signed else size)(random, typical)}


MEASURED = {"accelerometer": True}
RAMP = {"climate": "ramp"}
WARM = {"climate": "chamber"}
SHAKEN = {"accelerometer": True, "vibration_g": 1.0}
# where an accelerometer sees the arm's acceleration, g_sensitivity is as true a name
STILL = {"accelerometer": False}

EFFECTS: dict[str, Kind] = {
    "bias_temperature": Kind(("paper", "full", "chamber", "long"), "any", _bias_temperature, WARM),
    "scale_temperature": Kind(("full", "chamber", "staircase"), "table", _one("k_per_c", 1e-4), WARM),
    "thermal_lag": Kind(("paper", "chamber", "long"), "any", _one("k_dps_s_per_c", 0.1), WARM),
    "warmup": Kind(
        ("paper", "full", "long", "staircase", "hand"),
        "any",
        lambda r, c: {"A_dps": _signed(r, 0.02), "tau_s": _between(r, 4.0, 40.0)},
    ),
    "drift": Kind(("paper", "full", "staircase", "hand"), "any", _one("k_dps_per_s", 5e-4)),
    "table_ripple": Kind(ALL, "table", _ripple),
    "vibration_tone": Kind(ALL, "any", _tone),
    "spin_up": Kind(
        ("paper", "full"), "table", lambda r, c: {"A": size(r, 3e-3), "tau_s": _between(r, 0.3, 2.5)}
    ),
    "g_sensitivity": Kind(("full", "staircase", "hand", "swing"), "any", _gravity, MEASURED),
    "misalignment": Kind(SEVERAL_RATES, "off", _one("m", 5e-3)),
    "scale_nonlinearity": Kind(("full", "staircase", "hand"), "table", _one("k3", 5e-8)),
    "scale_asymmetry": Kind(SEVERAL_RATES, "table", _one("k", 5e-4)),
    "centripetal": Kind(("full", "staircase", "hand"), "table", _one("k", 4e-6), STILL),
    "lag": Kind(("swing", "hand", "staircase"), "table", _one("tau_s", 3e-3, signed=False)),
    "clock_error": Kind(("swing", "hand", "staircase"), "table", _one("e", 5e-4)),
    "bias_jumps": Kind(
        ("paper", "full", "hand", "swing"), "any", lambda r, c: {"n": float(r.integers(2, 7)), "size_dps": size(r, 0.06)}
    ),
    "quantization": Kind(ALL, "all", lambda r, c: {"lsb_dps": 35e-6 * c.full_scale_dps * float(r.choice([2, 4, 8]))}),
    "saturation": Kind(("full", "swing", "staircase", "hand"), "table", _clipped),
    "sampling_fault": Kind(ALL, "all", lambda r, c: {"fraction": _between(r, 0.01, 0.1)}),
    "thermal_hysteresis": Kind(
        ("chamber",), "any", lambda r, c: {"amplitude_dps": size(r, 0.03), "width_c": r.uniform(3.0, 9.0)}, RAMP
    ),
    "dead_band": Kind(("swing", "hand"), "table", lambda r, c: {"width_dps": _between(r, 0.15, 1.5)}),
    "order_tone": Kind(
        SEVERAL_RATES,
        "any",
        lambda r, c: {
            "order": float(r.choice([0.5, 1, 2, 3, 4.25, 5, 7])), "A_dps": size(r, 0.02), "phase_deg": r.uniform(0, 360)
        },
    ),
    "g2_sensitivity": Kind(("paper", "staircase", "hand", "swing"), "any", _one("k_dps_per_g2", 0.02), SHAKEN),
    "byte_fault": Kind(("paper", "swing", "staircase", "hand"), "any", _byte_fault),
}

FAST = ("vibration_tone", "order_tone", "quantization", "sampling_fault", "byte_fault", "mount_resonance")
"""Short runs show them as well: their sessions may have the fastest loggers."""

UNKNOWN: dict[str, Kind] = {
    "stick_slip": Kind(
        ("paper", "staircase", "long"),
        "table",
        lambda r, c: {"amplitude": size(r, 2e-3), "period_s": r.uniform(0.5, 1.5), "spread": 0.3},
    ),
    "mount_resonance": Kind(
        ("paper", "full", "long", "swing"),
        "any",
        lambda r, c: {"f_hz": r.uniform(0.1, 0.3) * c.poll_hz, "bandwidth_hz": r.uniform(1.0, 3.0), "sd_dps": size(r, 0.03)},
    ),
    "fan_sweep": Kind(
        ("paper", "long", "staircase"),
        "any",
        lambda r, c: {"f_start_hz": 0.1 * c.poll_hz, "f_end_hz": r.uniform(0.15, 0.3) * c.poll_hz, "A_dps": size(r, 0.04)},
    ),
    "two_point_control": Kind(
        ("paper", "long", "hand"), "any", lambda r, c: {"A_dps": size(r, 0.05), "period_s": r.uniform(1.0, 3.0)}
    ),
    # a staircase has so few reversals that it leaves a handful of steps, which bias_jumps are
    "friction": Kind(("swing", "hand"), "table", _one("A_dps", 0.05)),
    "periodic_nonlinearity": Kind(
        ("staircase", "hand"),
        "table",
        lambda r, c: {"A_dps": size(r, 0.05), "period_dps": r.uniform(20.0, 50.0), "phase": r.uniform(0.0, 6.28)},
    ),
    "hum_bursts": Kind(
        ("paper", "full", "long"),
        "any",
        lambda r, c: {"f_hz": r.uniform(0.1, 0.3) * c.poll_hz, "burst_s": r.uniform(0.5, 2.0), "A_dps": size(r, 0.05)},
    ),
}

ONE_RATE = {"rates_dps": (78.0,), "rate_spread": 0.0}
CONFOUNDED: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("misalignment", "paper", MEASURED),
    ("g_sensitivity", "paper", {}),
    ("scale_asymmetry", "full", ONE_RATE),
    ("centripetal", "full", ONE_RATE | STILL),
    ("order_tone", "paper", {"table_angle": False}),
    ("misalignment", "paper", {}),
    ("scale_temperature", "long", WARM),
    ("bias_temperature", "long", WARM),
    ("warmup", "long", WARM),
    ("order_tone", "long", {"table_angle": False}),
)
"""An effect, and a protocol that cannot tell it from another."""


@dataclass(frozen=True)
class Draw:
    """One case to be drawn; `case` does it, the same each time."""

    set: str
    kind: str
    number: int

    @property
    def name(self) -> str:
        return f"{self.set}_{self.kind}_{self.number:03d}"

    @property
    def seed(self) -> int:
        first = int(frozen.tree()[:12], 16) if self.set == UNSEEN else SEEDS[self.set]
        return first + 1000 * list(COUNTS).index(self.kind) + self.number

    def case(self) -> Case:
        """The first draw that the rules let through; the seed of the session tells which one it was."""
        for attempt in range(MOST_DRAWS):
            drawn = self._attempt(np.random.default_rng([self.seed, attempt]), 100 * self.seed + attempt)
            kept = _kept(drawn)
            if kept is not None:
                return kept
        raise ValueError(f"{self.name}: no draw of {MOST_DRAWS} stands out as its kind requires")

    def _attempt(self, random: Random, seed: int) -> Case:
        if self.kind == "null":
            return _session(self.name, self.kind, ALL[self.number % len(ALL)], random, seed)
        if self.kind == "confounded":
            id_, protocol, settings = CONFOUNDED[self.number % len(CONFOUNDED)]
            case = replace(_session(self.name, self.kind, protocol, random, seed), **settings)
            return _with(case, (id_,), EFFECTS, random)
        if self.kind == "set":
            return self._set(random, seed)
        kinds = EFFECTS if self.kind == "effect" else UNKNOWN
        id_ = list(kinds)[self.number % len(kinds)]
        protocol = str(random.choice(kinds[id_].protocols))
        case = _session(self.name, self.kind, protocol, random, seed, id_ in FAST)
        return _with(case, (id_,), kinds, random)

    def _set(self, random: Random, seed: int) -> Case:
        protocol = str(random.choice(["paper", "full", "staircase", "hand", "chamber"]))
        case = _session(self.name, self.kind, protocol, random, seed)
        # readings that are put together wrongly or lost hide what lies under them; the arm's acceleration is not planted
        fit = [id_ for id_, k in EFFECTS.items() if protocol in k.protocols and id_ not in (*DIGITAL, "centripetal")]
        ids = random.choice(fit, min(2 + self.number % 4, len(fit)), replace=False)
        return _with(case, tuple(map(str, ids)), EFFECTS, random)


def _session(name: str, kind: str, protocol: str, random: Random, seed: int, fast: bool = False) -> Case:
    """A logger, a sensor from the population and a room."""
    poll_hz, odr_hz = LOGGERS[random.integers(len(LOGGERS))]
    if kind != "null" and not fast:  # slow effects need their time: a logger too fast for it is left at home
        fits = [each for each in LOGGERS if SECONDS[protocol] * RUNS[protocol] * each[0] <= MOST_SAMPLES]
        poll_hz, odr_hz = fits[random.integers(len(fits))]
    cutoff_hz = odr_hz * float(random.choice([1 / 3, 1 / 5, 1 / 10]))
    seconds = max(2.0, min(SECONDS[protocol], MOST_SAMPLES / RUNS[protocol] / poll_hz))
    drifts = random.random() < 0.7
    return Case(
        name=name,
        kind=kind,
        protocol=protocol,
        seed=seed,
        seconds=seconds,
        table_axis=str(random.choice(list(AXES))),
        ou_sd_dps=_between(random, 5e-4, 4e-3) if drifts else 0.0,
        ou_tau_s=_between(random, 10.0, 60.0),
        turn_on_sd_dps=_between(random, 2e-3, 2e-2) if random.random() < 0.8 else 0.0,
        climate="ramp" if protocol == "chamber" else str(random.choice(["room", "chamber"])),
        full_scale_dps=float(random.choice([250.0, 500.0])),
        rates_dps=(30.0, 78.0, 150.0) if protocol != "swing" else (10.0,),
        accelerometer=bool(random.random() < 0.7),
        table_angle=bool(protocol in MOVING or random.random() < 0.3),
        poll_hz=poll_hz,
        odr_hz=odr_hz,
        cutoff_hz=cutoff_hz,
        noise_density_dps=_between(random, 2e-3, 1.5e-2),
        reference_sd_dps=0.01 if protocol == "hand" else 0.0,
        largest_scale=0.03,
        largest_bias_dps=10.0,
        file_format="parquet",
    )


def _with(case: Case, ids: tuple[str, ...], kinds: dict[str, Kind], random: Random) -> Case:
    if "saturation" in ids:  # the fastest parts of the motion lie beyond the range
        case = replace(case, full_scale_dps=9.0 if case.protocol == "swing" else 125.0)
    for id_ in ids:
        settings = kinds[id_].settings or {}
        if case.climate == "ramp":
            settings = {key: value for key, value in settings.items() if key != "climate"}
        case = replace(case, **settings)
    in_plane = [axis for axis in AXES if axis != case.table_axis]
    effects = []
    for id_ in ids:
        axes = {
            "table": case.table_axis, "off": str(random.choice(in_plane)), "any": str(random.choice(list(AXES))), "all": AXES
        }[kinds[id_].axes]  # fmt: skip
        effects.append(Effect(id_, {k: float(v) for k, v in kinds[id_].parameters(random, case).items()}, axes))
    return replace(case, effects=tuple(effects), expected=() if case.kind == "unknown" else ids)


def _kept(case: Case) -> Case | None:
    """The case with its rivals, if it is what its kind says."""
    if case.kind == "null":
        return case
    with tempfile.TemporaryDirectory() as scratch:
        truth = make(case, scratch)
    rivals: list[str] = []
    for effect in case.effects:
        seen, beside = told_apart(truth, effect.id, physical=case.kind == "confounded")
        nearest = min(beside.values(), default=seen)
        if seen < SEEN or (case.kind == "unknown" and power(truth, effect.id) < SEEN_UNKNOWN):
            return None
        if case.kind == "unknown" and nearest < OWN_SHAPE * seen:
            return None
        if case.kind in ("effect", "set") and nearest < APART:
            return None
        rivals += [name for name, left in beside.items() if left < ALIKE]
    if case.kind == "confounded" and not rivals:
        return None
    return replace(case, rivals=tuple(dict.fromkeys(rivals)))


def draws(name: str) -> list[Draw]:
    """The cases of the set "work", "frozen" or "unseen", kinds in turn within each number so that a part is a cross-section."""
    each = [Draw(name, kind, number) for kind, count in COUNTS.items() for number in range(count)]
    return sorted(each, key=lambda draw: draw.number)
