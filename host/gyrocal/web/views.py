"""The values that the worker sends to the page. They contain no objects of the engine."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class RunView:
    """One run: rows ``first:first + rows`` of the session's traces."""

    file: str
    scenario: str
    face: str
    axis: str
    rate_dps: float | None
    day: int | None
    first: int
    rows: int
    seconds: float


@dataclass(frozen=True)
class SessionView:
    """A session that was read and checked. ``traces`` holds ``t_s.npy`` and the pyramid ``measured`` (less the true rate)."""

    path: Path
    sensor: str
    axis: str
    sample_rate_hz: float
    runs: list[RunView]
    traces: Path

    @property
    def rows(self) -> int:
        return sum(run.rows for run in self.runs)


@dataclass(frozen=True)
class Curve:
    """A measured curve and its reference: the level between lines, or the curve of the noise model."""

    x: list[float]
    y: list[float]
    expected: list[float]


@dataclass(frozen=True)
class ModelView:
    """A model compared with the session. ``traces`` holds the pyramids ``modelled``, ``residual`` and ``points.npz``."""

    toml: str
    compared: dict[str, Any]
    """The exact output of `gyrocal compare --json`."""
    headline: str
    rows: list[list[str]]
    """Axis, rms, floor, excess, its error, excess within power cycles, as the command line prints them; last all axes."""
    effects: list[tuple[str, str, bool]]
    """(id, title, may be removed)."""
    traces: Path
    against: list[str]
    spectra: dict[str, Curve] = field(repr=False)
    allan: dict[str, Curve] = field(repr=False)


@dataclass(frozen=True)
class Signature:
    """A small plot: the residual without the effect (dots) and the fitted effect (line)."""

    title: str
    x_label: str
    dots: list[tuple[float, float]]
    line: list[tuple[float, float]]


@dataclass(frozen=True)
class Card:
    """One effect on one axis, judged; ``judged`` is its entry of `gyrocal diagnose --json`."""

    judged: dict[str, Any]
    title: str
    cause: str
    equation: str
    looks_like: list[str]
    """Titles of the effects that this session cannot tell from it."""
    size: str
    signature: Signature | None = None


@dataclass(frozen=True)
class DiagnosisView:
    verdict: str
    sentence: str
    cards: list[Card]
    unknown: dict[str, Any] | None


@dataclass(frozen=True)
class CalibrationView:
    """Estimates of the latest model, and differences of the first seconds from the whole recording by method and seconds."""

    estimates: list[dict[str, Any]]
    errors: dict[str, dict[float, tuple[float, float]]]
    """{method: {seconds: (scale, bias_dps)}}: mean absolute difference over the power cycles."""
    note: str = ""


@dataclass(frozen=True)
class Bar:
    """One step of the waterfall: the excess in mdps over the floor of the richest model so far."""

    label: str
    before: float
    after: float


@dataclass(frozen=True)
class TrainedView:
    """A network trained for a model, in its run folder. ``parity`` is the output of `gyrocal verify --json`."""

    folder: Path
    errors: list[dict[str, Any]]
    """Mean absolute errors on scenarios drawn from the model, by method and seconds: `errors` of `gyrocal train --json`."""
    parity: dict[str, Any]


@dataclass(frozen=True)
class ExportView:
    """The project written for the device. ``parity`` is the output of `gyrocal verify --json`."""

    folder: Path
    effects: list[str]
    parity: dict[str, Any]
