"""What the benchmarks that grade names print with ``--json``: ``edge``, ``blind``, and any of a tool in gyrocal's place."""

from __future__ import annotations

from typing import Literal, NotRequired

from typing_extensions import TypedDict

from gyrocal.json_small import Number

Interval = list[float]
"""Both ends of an exact 95 % interval of a share."""


class Share(TypedDict):
    """A share with its exact 95 % interval; null of nothing."""

    count: int
    of: int
    share: Number
    within: Interval | None


class Names(TypedDict):
    """Sure names, those that are wrong, with a 95 % bound, and what was reached of the planted effects."""

    cases: int
    sure: int
    wrong: int
    wrong_share: Number
    wrong_upper: Number
    reached: Share
    in_group: Share


class RaisedNames(Names):
    """The names of the tests alone beyond a limit of their held-out gain, ``at``."""

    limit: Literal["heldout_gain", "gain_errors"]
    at: Number


Bin = TypedDict(
    "Bin",
    {
        "from": float, "to": float, "mean_probability": Number, "count": int, "of": int, "share": Number,
        "within": Interval | None,
    },
)  # fmt: skip
"""Candidates whose probability is between two values, and how many of them are true."""


class Capped(Share):
    """The highest probability that was given."""

    probability: float


class Reliability(TypedDict):
    """Whether probabilities hold."""

    bins: list[Bin]
    capped: Capped


class Behind(TypedDict):
    """The oracle's log posterior less that of the answer, over the axes: quantiles, and how many are beyond ln 100."""

    axes: int
    quarter: float
    median: float
    nine_tenths: float
    beyond_100: Share


class TestsAlone(TypedDict):
    """The tests without the evidence of sets: as they are, and with a limit raised until they are as seldom wrong."""

    as_they_are: Names
    raised: RaisedNames


class Seconds(TypedDict):
    """Processor time of a case."""

    median: float
    mean: float
    largest: float


class WrongNames(TypedDict):
    """A case with a wrong name: effect and axis of what was said and planted."""

    case: str
    said: list[list[str]]
    planted: list[list[str]]


class FailedCase(TypedDict):
    """A case without an answer."""

    case: str
    error: str


class Mcnemar(TypedDict):
    """An exact one-sided test of pairs."""

    before: int
    after: int
    only_before: int
    only_after: int
    p: float


class ComparedEdge(TypedDict):
    """Beside an earlier file."""

    cases: int
    wrong: Mcnemar
    reached: Mcnemar


class NullsNamed(TypedDict):
    """Cases without an effect that were given a name, plain and disturbed."""

    plain: Share
    disturbed: Share


class Edge(TypedDict):
    """``benchmark edge``."""

    cases: int
    failed: list[FailedCase]
    all: Names
    by_kind: dict[str, Names]
    by_nearest_sigma: dict[str, Names]
    by_disturbance_sigma: dict[str, Names]
    nulls_named: NullsNamed
    reliability: Reliability | None
    behind_oracle: Behind | None
    tests_alone: TestsAlone | None
    seconds: Seconds | None
    wrong_names: list[WrongNames]
    compared: NotRequired[ComparedEdge]


class Figures(TypedDict):
    """A method's figures on the blind cases; null where no case bears on one."""

    false_alarm_rate: Number
    top1_rate: Number
    set_contains_rate: Number
    mean_set_size: Number
    confounded_declared_rate: Number
    unknown_flagged_rate: Number
    misnamed_rate: Number
    error_reduction_ratio: Number
    completed_rate: Number
    set_found_rate: Number
    set_error_ratio: Number


class Bound(TypedDict):
    """The 95 % interval of a rate, of so many cases."""

    n: int
    within: Interval


class BlindFailure(TypedDict):
    """A case that was answered wrongly, and how."""

    case: str
    fault: str
    what: str


class Blind(Figures):
    """``benchmark blind``; ``cases`` counts those of each kind that are not too faint to see."""

    bounds: dict[str, Bound]
    stepwise_f_test: Figures
    oracle: Figures
    cases: dict[str, int]
    too_faint: list[str]
    failures: list[BlindFailure]


class Sizes(TypedDict):
    """How many sizes a tool stated, and by how much of them they are off, median."""

    stated: int
    median_off: Number


class Corrected(TypedDict):
    """In how many cases a tool corrected readings, and what it left of the planted error, median."""

    cases: int
    median_of_before: Number


class Graded(TypedDict):
    """A tool in gyrocal's place: which one, how many cases it had, what it stated, and its processor time, s, median."""

    tool: str
    cases: int
    failed: list[FailedCase]
    sizes: Sizes
    corrected: Corrected
    seconds: Number


class GradedEdge(Graded):
    """``benchmark edge --tool``."""

    benchmark: Literal["edge"]
    names: Names
    by_kind: dict[str, Names]


class GradedBlind(Graded):
    """``benchmark blind --tool``."""

    benchmark: Literal["blind"]
    false_alarm_rate: Number
    top1_rate: Number
    misnamed_rate: Number
    completed_rate: Number
    set_found_rate: Number


class GradedPaperLine(TypedDict):
    """A tool's errors after so many seconds, and over the best possible ones; null without an answer."""

    seconds: float
    scale_mae: Number
    bias_mae_dps: Number
    scale_over_limit: Number
    bias_over_limit: Number


class GradedPaper(Graded):
    """``benchmark paper --tool``."""

    benchmark: Literal["paper"]
    table2: list[GradedPaperLine]


class FactAnswer(TypedDict):
    """What is said of a recording, what is true, and where the truth comes from."""

    recording: str
    what: str
    ours: str
    truth: str
    source: str
    ok: bool


class GradedStrangers(Graded):
    """``benchmark strangers --tool``."""

    benchmark: Literal["strangers"]
    facts: list[FactAnswer]
    true: int
    of: int
    absent: list[str]
