"""What the small verbs print with ``--json``: those of one table, one file or one board (:mod:`gyrocal.json_schemas`)."""

from __future__ import annotations

from typing import Any, Literal

from typing_extensions import TypedDict

Axis = Literal["x", "y", "z"]
Number = float | None


class AllanFigures(TypedDict):
    """What a datasheet states, read off the Allan deviation."""

    noise_density_dps_per_rthz: Number
    angle_random_walk_deg_per_rth: Number
    bias_instability_dps: float
    at_s: float
    bottom: bool


class Allan(TypedDict):
    """``allan``."""

    axis: Axis
    tau_s: list[float]
    deviation_dps: list[float]
    figures: AllanFigures | None


class EffectParameter(TypedDict):
    """A parameter of an effect."""

    name: str
    unit: str
    typical: list[float]
    source: str


class EffectAnswer(TypedDict):
    """An effect of the library."""

    effect: str
    title: str
    cause: str
    equation: str
    parameters: list[EffectParameter]
    looks_like: str
    next_measurement: str
    on_device: bool
    package: str


class Effects(TypedDict):
    """``effects``."""

    effects: list[EffectAnswer]


class HeldRun(TypedDict):
    """A run of a session."""

    file: str
    scenario: str
    face: Literal["up", "down"]
    axis: Axis
    table_rate_dps: Number
    turn_deg: Number
    samples: int
    seconds: float


class HeldSession(TypedDict):
    """``info`` of a session."""

    kind: Literal["session"]
    sensor: str | None
    axis: Axis
    sample_rate_hz: float
    columns: list[str]
    runs: list[HeldRun]


class HeldSessions(TypedDict):
    """``info`` of a folder of sessions."""

    kind: Literal["sessions"]
    sessions: list[str]


class HeldModel(TypedDict):
    """``info`` of a model."""

    kind: Literal["model"]
    name: str
    model: list[str]
    parameters: list[dict[str, Any]]
    accelerometer: dict[str, Any] | None


class HeldPlan(TypedDict):
    """``info`` of a plan."""

    kind: Literal["plan"]
    runs: list[dict[str, Any]]


class HeldJson(TypedDict):
    """``info`` of a truth, or of what a verb printed."""

    kind: Literal["json"]
    keys: list[str]


class HeldLog(TypedDict):
    """``info`` of a log."""

    kind: Literal["log"]
    rows: int
    columns: list[str]
    guessed: list[str]
    unknown: str | None


Info = HeldSession | HeldSessions | HeldModel | HeldPlan | HeldJson | HeldLog
"""``info``."""


class Simulated(TypedDict):
    """A run that was simulated."""

    file: str
    samples: int


class Simulate(TypedDict):
    """``simulate``."""

    session: str
    truth: str
    effects: list[str]
    runs: list[Simulated]


class Device(TypedDict):
    """``device``."""

    port: str


class Plot(TypedDict):
    """``plot``."""

    file: str


class Firmware(TypedDict):
    """``firmware``."""

    folder: str
    kind: Literal["project", "library"]


class CheckAnswer(TypedDict):
    """One check of a board; ``ok`` is null where it could not be made."""

    name: str
    ok: bool | None
    found: str
    advice: str
    imu: int


class Doctor(TypedDict):
    """``doctor``."""

    port: str
    ok: bool
    checks: list[CheckAnswer]


class Version(TypedDict):
    """``version``, with the version of every answer."""

    gyrocal: str
    python: str
    system: str
    answers: dict[str, str]


class Train(TypedDict):
    """``train``: the run's folder, and its metrics."""

    run: str
