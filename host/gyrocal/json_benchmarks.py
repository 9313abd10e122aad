"""What ``benchmark NAME --json`` prints: one type for each benchmark, and one for a tool that is graded in gyrocal's place."""

from __future__ import annotations

from typing import NotRequired

from typing_extensions import TypedDict

from gyrocal.json_grades import (
    Blind,
    Edge,
    FactAnswer,
    GradedBlind,
    GradedEdge,
    GradedPaper,
    GradedStrangers,
    Interval,
)
from gyrocal.json_small import Number


class MeanErrors(TypedDict):
    """Mean absolute errors of a method after so many seconds, and over the best possible ones."""

    seconds: float
    method: str
    scale_mae: float
    bias_mae_dps: float
    scale_over_limit: float
    bias_over_limit: float


class PaperLine(MeanErrors):
    """Mean absolute errors of a method after so many seconds, with half a 95 % interval, and over the best possible ones."""

    scale_half_interval: float
    bias_half_interval_dps: float


class Terms(TypedDict):
    """A figure of the scale, of the bias, and their mean."""

    scale: Number
    bias: Number
    mean: Number


class Improvement(Terms):
    """In per cent of the baseline's error, with its 95 % interval."""

    mean_interval: list[float]


class Converged(TypedDict):
    """The first second at which the baseline is as good; null if it is not within the run."""

    scale: int | None
    bias: int | None


class Table1(TypedDict):
    """Labels and truths of the paper's campaign."""

    label_mean: Terms
    label_sd: Terms
    truth_mean: Terms
    truth_sd: Terms
    label_mae: Terms


class BySecond(TypedDict):
    """The baseline's error after so many seconds."""

    seconds: int
    scale: float
    bias_dps: float


class HiddenLine(MeanErrors):
    """A method where the table also ripples twice a turn."""

    flagged: Number


class Hidden(TypedDict):
    """Before and after the hidden effect is added."""

    hidden: str
    scenarios: int
    answers: list[HiddenLine]


class MisfitLine(TypedDict):
    """How often the misfit reveals a signal."""

    hidden: str
    seconds: float
    beyond_five_se: float
    flagged: float
    flagged_of_those: Number
    flagged_at_sigma: NotRequired[dict[str, float]]


class Paper(TypedDict):
    """``benchmark paper``."""

    scenarios: int
    seeds: int
    table1: Table1
    table2: list[PaperLine]
    table2_against_labels: list[PaperLine]
    table2_paper_split: list[PaperLine]
    table2_flat: list[PaperLine]
    covered_68: dict[str, list[Terms]]
    improvement_percent: dict[str, Improvement]
    convergence_s: dict[str, Converged]
    time_saving_percent: dict[str, Terms]
    baseline_mae: list[BySecond]
    hidden_effect: Hidden
    misfit: list[MisfitLine]


class RobustnessLine(TypedDict):
    """The network on one table."""

    table: str
    seconds: float
    scale_mae: Number
    bias_mae_dps: Number
    covered_68: Number
    covered_95: Number
    scale_z_sd: Number
    bias_z_sd: Number
    no_answer: float


class Robustness(TypedDict):
    """``benchmark robustness``."""

    scenarios: int
    rows: list[RobustnessLine]


class Cost(TypedDict):
    """What one answer costs on the device."""

    instructions: int
    ram_bytes: int
    flash_bytes: int


class Peer(Cost):
    """The same network by another generator of C code."""

    name: str
    max_abs_diff: float


class Ratios(TypedDict):
    """The best peer's cost over ours; null without a peer."""

    instructions: Number
    ram: Number
    flash: Number


class Inference(TypedDict):
    """``benchmark inference``."""

    ours: Cost
    gyrocal: Cost
    gyrocal_fixed: Cost
    peers: list[Peer]
    best_peer_ratio: Ratios
    absent: list[str]
    cpu: str


class PopulationLine(TypedDict):
    """Answers on sensors of one kind; null where too few are trusted."""

    effects: str
    seconds: float
    method: str
    answered: float
    trusted: float
    scale_sd: Number
    scale_95: Number
    scale_sd_all: Number
    bias_sd: Number
    bias_95: Number
    bias_sd_all: Number
    trusted_and_far: int
    n: int
    bound_95: float


class Population(TypedDict):
    """``benchmark population``."""

    sensors: int
    rows: list[PopulationLine]


CoverageLine = TypedDict(
    "CoverageLine",
    {
        "effect": str, "size": str, "parameter": str, "fits": int, "without": int, "outside": list[str],
        "z_mean": Number, "z_sd": Number, "68": float, "68_band": list[float], "95": float, "95_band": list[float],
    },
)  # fmt: skip
"""A parameter's coverage at both levels, with the band that chance allows; ``outside``: the levels beyond it."""


class Coverage(TypedDict):
    """``benchmark coverage``; ``left_out``: effects without a standard error, with the reason."""

    family_wise: float
    left_out: dict[str, str]
    rows: list[CoverageLine]


class Real(TypedDict):
    """``benchmark real``."""

    facts: list[FactAnswer]
    true: int
    of: int
    absent: list[str]


class Strangers(Real):
    """``benchmark strangers``; ``kinds_without``: kinds of which no recording was found."""

    kinds_without: list[str]


class Memory(TypedDict):
    """What so many boards take."""

    boards: int
    client_mb: float
    summary_kb: float
    worker_mb: NotRequired[float]
    scheduler_mb: NotRequired[float]
    client_ms_a_board: float


class FleetCost(TypedDict):
    """``benchmark fleet``."""

    boards: int
    with_search_for_drift_boards_per_s: float
    plain_boards_per_s: float
    task_boards_per_s: float
    cost_ratio: float
    memory: list[Memory]
    failed: int
    named: list[str]
    speedup_of_2_workers: float
    load: float
    task_s: float
    max_abs_diff: float


class SoakSamples(TypedDict):
    """Samples of a seed that are not accounted for."""

    seed: int
    samples: int
    faults: list[str]


class SoakWrong(TypedDict):
    """A trusted answer that is wrong, as the device sent it."""

    seed: int
    answer: str
    faults: list[str]


class Soak(TypedDict):
    """``benchmark soak``."""

    seeds: int
    device_s: float
    device_hours: float
    sent: int
    kept: int
    left_out: int
    lost: int
    power_cycles: int
    pairs: int
    clock_wraps: int
    sequence_wraps: int
    trusted: int
    unheard: list[SoakSamples]
    unaccounted: list[SoakSamples]
    wrong: list[SoakWrong]
    wrong_bound: float
    first_seed: int
    early_peak_mb: float
    peak_mb: float


class FieldSpread(TypedDict):
    """Errors over their standard errors."""

    n: int
    mean: float
    rms: float
    largest: float


class FieldLine(TypedDict):
    """Sessions of one kind; ``bounds``: of false names and of alarms."""

    kind: str
    words: str
    sessions: int
    false_names: int
    named: int
    alarms: int
    contradictions: int
    bounds: list[Interval]
    floor_over_rms: list[float] | None
    excess_over_floor: Number
    z: FieldSpread | None
    scale_z: FieldSpread | None


class Field(TypedDict):
    """``benchmark field``."""

    rows: list[FieldLine]


class ReferenceSpread(TypedDict):
    """Errors of a parameter, and these over their standard errors where it has one; ``ok``: as chance allows."""

    n: int
    error_rms: float
    error_largest: float
    z_mean: NotRequired[float]
    z_rms: NotRequired[float]
    z_largest: NotRequired[float]
    ok: NotRequired[bool]


class ReferenceLine(TypedDict):
    """Sessions with one kind of reference; ``by_effect``: how many were named, of how many."""

    kind: str
    words: str
    sessions: int
    adequate: int
    adequate_bounds: Interval
    named: int | None
    named_bounds: Interval | None
    false_names: int
    by_effect: dict[str, list[int]]
    within: int | None
    within_bounds: Interval | None
    parameters: dict[str, ReferenceSpread]


class References(TypedDict):
    """``benchmark references``."""

    rows: list[ReferenceLine]


Benchmark = (
    Paper | Robustness | Inference | Population | Coverage | Real | FleetCost | Soak | Field | References | Edge | Strangers
    | Blind | GradedEdge | GradedBlind | GradedPaper | GradedStrangers
)  # fmt: skip
"""``benchmark``: the figures of the benchmark that was asked for."""
