"""What each verb prints with ``--json``, as types from which its JSON schema is made.

``gyrocal schema VERB`` prints the schema. Where an answer is a dataclass of a lower layer, its type is derived from that. A
schema demands what is always there and lets new keys come: a version ``MAJOR.MINOR`` grows in MINOR where keys were added, and
in MAJOR where one was removed or changed.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Literal, NotRequired, get_type_hints

from pydantic import TypeAdapter
from typing_extensions import TypedDict

from gyrocal.calibration.calibrate import Estimate
from gyrocal.device.run_writer import Recorded
from gyrocal.device.wifi import Network
from gyrocal.errors import InputError, did_you_mean, there_are
from gyrocal.fleet.history import Aging
from gyrocal.fleet.missing import Missing
from gyrocal.fleet.outliers import Outlier
from gyrocal.fleet.trend import Trend
from gyrocal.gravity.aims import Aim
from gyrocal.gravity.budget import BudgetRow as GravityBudget
from gyrocal.json_benchmarks import Benchmark
from gyrocal.json_events import DeviceAnswer, Event
from gyrocal.json_small import (
    Allan,
    Axis,
    Device,
    Doctor,
    Effects,
    Firmware,
    Info,
    Number,
    Plot,
    Simulate,
    Train,
    Version,
)
from gyrocal.recording.first_rows import Taken
from gyrocal.recording.plan_file import PlannedRun
from gyrocal.warning import Warning


def derived(kind: type, *without: str, **more: Any) -> Any:
    """The type of a dataclass written field by field, without some of its fields and with more of them."""
    hints = get_type_hints(kind)
    named = {f.name: hints[f.name] for f in fields(kind) if f.name not in without}
    return TypedDict(f"{kind.__name__}Answer", {**named, **more})  # type: ignore[operator]


if TYPE_CHECKING:
    EstimateAnswer = dict[str, Any]
    AimAnswer = dict[str, Any]
else:
    EstimateAnswer = derived(Estimate, "budget", "taken", trusted=bool)
    AimAnswer = derived(Aim, met=bool)


class Warned(TypedDict):
    """Every answer on a session."""

    warnings: list[Warning]


class Level(TypedDict):
    """Errors that are left over, of rates (deg/s) or of angles (deg)."""

    rms_dps: NotRequired[Number]
    floor_dps: NotRequired[Number]
    excess_dps: NotRequired[Number]
    excess_se_dps: NotRequired[Number]
    excess_within_dps: NotRequired[Number]
    excess_within_se_dps: NotRequired[Number]
    rms_deg: NotRequired[Number]
    floor_deg: NotRequired[Number]
    excess_deg: NotRequired[Number]
    excess_se_deg: NotRequired[Number]


class Shape(TypedDict):
    """One place where a model fails."""

    axis: Axis
    against: str
    strength: float
    note: str
    times_rate: bool


class ParameterLine(TypedDict):
    """One parameter of a model; ``axis`` is null for a property of the reference."""

    effect: str
    axis: Axis | None
    name: str
    value: float
    se: Number


class Moved(TypedDict):
    """A parameter of a file beside the session's own."""

    effect: str
    axis: Axis
    name: str
    file: Number
    session: Number
    se: Number
    z: Number


class Compare(Level, Warned):
    """``compare``."""

    model: list[str]
    residual: Literal["rate", "angle"]
    per_axis: dict[Axis, Level]
    verdict: Literal["adequate", "misfit", "implausible"]
    where: list[Shape]
    held_out: str | None
    note: str
    parameters: list[ParameterLine]
    rests: NotRequired[int]
    movements: NotRequired[int]
    accelerometer: NotRequired[AccelerometerAnswer | None]
    as_is: NotRequired[bool]
    moved: NotRequired[list[Moved]]


class Sized(TypedDict):
    """A parameter of a candidate."""

    value: float
    se: Number
    unit: str


class Checks(TypedDict):
    """The checks of a probability."""

    share: Number
    same_in_parts_p: Number
    difference: Number
    parts: list[str]
    passed: bool


class CandidateAnswer(TypedDict):
    """An effect as it was judged on one axis."""

    effect: str
    axis: Axis
    parameters: dict[str, Sized]
    explained: Number
    excess_drop_dps: NotRequired[Number]
    excess_drop_se_dps: NotRequired[Number]
    excess_drop_deg: NotRequired[Number]
    heldout_gain: Number
    heldout_gain_se: Number
    q_value: Number
    group: list[str]
    together: list[str]
    decision: Literal["add", "suggest", "reject", "not_measurable"]
    next_measurement: str
    probability: Number
    checks: Checks | None


class Alternative(TypedDict):
    """A set of effects that explains an axis."""

    axis: Axis
    effects: list[str]
    unnamed: list[str]
    probability: float


class Unknown(TypedDict):
    """A misfit that no effect explains."""

    axis: Axis
    against: str
    shape: str
    amplitude_dps: NotRequired[Number]
    amplitude_deg: NotRequired[Number]


Verdict = Literal["add", "ambiguous", "adequate", "unknown", "implausible"]


class Diagnose(Warned):
    """``diagnose``."""

    verdict: Verdict
    residual: Literal["rate", "angle"]
    candidates: list[CandidateAnswer]
    unknown: Unknown | None
    alternatives: NotRequired[list[Alternative]]


class Add(Warned):
    """``add``."""

    before: Compare
    after: Compare


class Step(TypedDict):
    """One step of ``explain``."""

    effects: list[str]
    axes: list[Axis]
    removed: NotRequired[list[str]]
    excess: NotRequired[str]
    excess_before_dps: NotRequired[Number]
    excess_after_dps: NotRequired[Number]
    excess_before_deg: NotRequired[Number]
    excess_after_deg: NotRequired[Number]
    matters: bool


class Left(TypedDict):
    """What stays open."""

    group: list[str]
    axis: Axis
    next_measurement: str


class Explain(Warned):
    """``explain``."""

    steps: list[Step]
    residual: Literal["rate", "angle"]
    left: list[Left]
    verdict: Verdict
    model: list[str]
    parameters: list[ParameterLine]
    unknown: Unknown | None


class Keep(Warned):
    """``keep``."""

    formula: str
    axis: Axis
    against: str
    heldout_gain: Number
    heldout_gain_se: Number
    before: Compare
    after: Compare


class BudgetLine(TypedDict):
    """A source of the error of one estimate."""

    scenario: str
    method: str
    seconds: float
    axis: Axis
    source: str
    scale: Number
    bias_dps: Number
    in_se: bool
    advice: str


class Cross(TypedDict):
    """What an axis reads of the rate about another one."""

    scenario: str
    axis: Axis
    about: Axis
    value: Number
    se: Number


class AccelerometerAnswer(TypedDict):
    """The accelerometer: a reading is ``matrix`` times the true acceleration plus the bias, g."""

    scale: dict[Axis, float]
    scale_se: dict[Axis, float]
    bias_g: dict[Axis, float]
    bias_se_g: dict[Axis, float]
    matrix: list[list[float]]
    matrix_se: list[list[float]]
    misfit: float


class Calibrate(Warned):
    """``calibrate``; the second half for a session by gravity."""

    estimates: list[EstimateAnswer]
    budget: list[BudgetLine | GravityBudget]
    misalignment: NotRequired[list[Cross]]
    accelerometer: NotRequired[AccelerometerAnswer]
    rests: NotRequired[int]
    movements: NotRequired[int]


class HistorySession(TypedDict):
    """A session of a history."""

    session: str
    made_on: str


class HistoryBoard(TypedDict):
    """One sensor over months."""

    board: str
    sessions: list[HistorySession]
    parameters: list[Aging]


class Histories(TypedDict):
    """``calibrate --history``."""

    boards: list[HistoryBoard]


class Question(TypedDict):
    """What a plan answers."""

    kind: Literal["tell_apart", "measure", "accuracy"]
    effects: list[str]
    axis: Axis


class Plan(TypedDict):
    """``plan``."""

    question: Question
    runs: list[PlannedRun]
    minutes: float
    power: Number
    power_same_again: Number
    why: str
    advice: str


class Stays(TypedDict):
    """What a file or a corrected recording does not hold."""

    effect: str
    why: str


class Apply(Warned):
    """``apply``."""

    rows: int
    applied: list[str]
    left: list[Stays]
    outside: dict[str, int]
    accelerometer: NotRequired[bool]
    guessed: NotRequired[list[str]]


class Imported(Warned):
    """``import``."""

    rows: int
    runs: int
    sample_rate_hz: float
    repaired: dict[str, int]
    guessed: list[str]
    first_rows: list[Taken]


class Record(Warned):
    """``record``."""

    session: str
    runs: list[Recorded]
    lost_sentences: int
    bad_sentences: int
    results: list[DeviceAnswer]
    errors: list[str]
    rests: NotRequired[int]
    aims: NotRequired[list[AimAnswer]]


class Pooled(TypedDict):
    """A parameter of a population."""

    mean: float
    se: Number
    sd: float
    sd_se: Number
    rig_sd: NotRequired[Number]
    rig_sd_se: NotRequired[Number]


class Failed(TypedDict):
    """A session that could not be fitted."""

    session: str
    reason: str


class Fleet(TypedDict):
    """``fleet fit``."""

    boards: int
    sessions: int
    failed: list[Failed]
    population: dict[str, Pooled]
    outliers: list[Outlier]
    missing: list[Missing]
    trends: list[Trend]
    attribution: str
    warnings: dict[str, int]
    sessions_per_s: float


class Export(TypedDict):
    """``export``."""

    files: list[str]
    left: list[Stays]


class Verify(TypedDict):
    """``verify``."""

    windows: int
    max_abs_diff: float
    max_diff_of_range: float
    tolerance: float
    integers_max_of_se: float | None
    integers_rms_of_se: float | None
    ok: bool


class Before(TypedDict):
    """One half of the demonstration."""

    compare: Compare
    estimates: list[EstimateAnswer]


class Demo(TypedDict):
    """``demo``."""

    truth: dict[str, Any]
    before: Before
    diagnosis: Diagnose
    after: Before
    parity: Verify | dict[str, Any] | None


ANSWERS: dict[str, tuple[Any, str]] = {
    "add": (Add, "1.1"), "allan": (Allan, "1.1"), "apply": (Apply, "1.0"), "benchmark": (Benchmark, "1.1"),
    "calibrate": (Calibrate | Histories, "1.0"), "compare": (Compare, "1.1"), "demo": (Demo, "1.3"), "device": (Device, "1.0"),
    "diagnose": (Diagnose, "1.2"), "doctor": (Doctor, "1.0"), "effects": (Effects, "1.0"), "explain": (Explain, "1.0"),
    "export": (Export, "1.1"),
    "firmware": (Firmware, "1.0"), "fleet": (Fleet, "1.0"), "import": (Imported, "1.1"), "info": (Info, "1.2"),
    "keep": (Keep, "1.1"), "monitor": (Event, "1.2"), "plan": (Plan, "1.0"), "plot": (Plot, "1.0"), "record": (Record, "1.1"),
    "simulate": (Simulate, "1.0"), "train": (Train, "1.1"), "verify": (Verify, "1.1"), "version": (Version, "1.0"),
    "wifi": (derived(Network, url=str, token=str), "1.0"),
}  # fmt: skip
"""The type and the version of the answer of each verb."""
VERSIONS = {verb: version for verb, (_, version) in ANSWERS.items()}


def schema(verb: str) -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of what a verb prints with ``--json``. Raises InputError for a verb without one."""
    if verb not in ANSWERS:
        raise InputError(f"no answer of {verb!r}{did_you_mean(verb, ANSWERS)}; {there_are(ANSWERS, '`gyrocal --help`')}")
    kind, version = ANSWERS[verb]
    made = _of_answers(TypeAdapter(kind).json_schema(mode="serialization"))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"urn:gyrocal:{verb}:{version}",
        "version": version, **made,
    }  # fmt: skip


def _of_answers(part: Any) -> Any:
    """A schema in which fields of dataclasses that have a default are demanded too, because an answer has them always."""
    if isinstance(part, list):
        return [_of_answers(each) for each in part]
    if not isinstance(part, dict):
        return part
    found = {key: _of_answers(value) for key, value in part.items() if key != "default"}
    defaults = [n for n, p in part.get("properties", {}).items() if isinstance(p, dict) and "default" in p]
    return found | ({"required": [*part.get("required", []), *defaults]} if defaults else {})
