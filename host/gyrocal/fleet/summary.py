"""The summary of one session: estimates with covariance, and its likelihood for every candidate, as small matrices."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.errors import GyrocalError
from gyrocal.files import replacing
from gyrocal.recording.session import Array

FORMAT = "gyrocal-fleet-summary/3"


@dataclass(frozen=True)
class AxisSummary:
    """One axis of one session, at the session's own white level.

    ``cycles`` [drifts, power cycles, q, q] are whitened normal equations of ``[readings | the model's columns | candidates]``,
    from which the changes of bias and scale between power cycles are not yet removed, and ``drift_loglik`` [drifts]
    log-likelihoods, both at drifts near the fleet's (:attr:`gyrocal.fleet.drift.FleetDrift.near`). ``columns`` are the names
    (``effect.axis.parameter``) of the p columns of the model, ``candidates`` those of the others. ``random`` are the indices
    among the p columns whose coefficients differ from power cycle to power cycle, ``random_sd`` their spreads as fitted.
    ``values`` and ``se`` are all fitted parameters by name; ``cov`` [p, p] is the covariance of the coefficients.
    """

    columns: tuple[str, ...]
    candidates: tuple[str, ...]
    random: tuple[int, ...]
    random_sd: tuple[float, ...]
    values: dict[str, float]
    se: dict[str, float]
    noise: dict[str, float]
    cov: Array = field(repr=False)
    cycles: Array = field(repr=False)
    drift_loglik: tuple[float, ...] = ()

    def at_drift(self, weights: Array) -> Array:
        """The normal equations [power cycles, q, q], interpolated between the drifts with ``weights`` [drifts]."""
        return np.asarray(np.tensordot(weights, self.cycles, 1))


@dataclass(frozen=True)
class Summary:
    """One session. ``warnings`` are the codes of its warnings, with the axis where there is one.

    ``ranges`` and ``corrected`` are those of :class:`~gyrocal.error_model.fitted_on.FittedOn`.
    """

    session: str
    board: str
    rig: str | None
    line: str | None
    made_on: str | None
    warnings: tuple[str, ...]
    axes: dict[str, AxisSummary]
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    corrected: str = ""

    @property
    def fitted_on(self) -> FittedOn:
        """What the session's parameters were fitted on."""
        return FittedOn(self.ranges, self.corrected)

    def at(self, session: str) -> Summary:
        """The same summary of a session that was moved to another path."""
        return replace(self, session=session, board=session if self.board == self.session else self.board)

    def save(self, path: Path) -> None:
        """Write the summary whole or not at all."""
        told = {"format": FORMAT, **_shallow(self, "axes"), "axes": {}}
        arrays: dict[str, Array] = {}
        for axis, one in self.axes.items():
            upper = np.triu_indices(one.cycles.shape[-1])
            arrays |= {f"cov_{axis}": one.cov, f"cycles_{axis}": one.cycles[:, :, *upper]}
            told["axes"][axis] = _shallow(one, "cov", "cycles")
        with replacing(path, durable=False) as partial, partial.open("wb") as handle:
            np.savez(handle, told=np.array(json.dumps(told)), **arrays)  # type: ignore[arg-type]

    @staticmethod
    def load(path: Path, equations: bool = True) -> Summary:
        """Read a summary, or what is kept of it in memory: all but the ``equations``.

        Raises GyrocalError if the file is not one of this version.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                told: dict[str, Any] = json.loads(str(stored["told"]))
                if told.pop("format") != FORMAT:
                    raise ValueError("another version")
                axes = {
                    axis: AxisSummary(
                        tuple(one["columns"]), tuple(one["candidates"]), tuple(one["random"]), tuple(one["random_sd"]),
                        one["values"], one["se"], one["noise"],
                        stored[f"cov_{axis}"] if equations else np.zeros((0, 0)),
                        _whole(stored[f"cycles_{axis}"]) if equations else np.zeros((0, 0, 0, 0)), tuple(one["drift_loglik"]),
                    )
                    for axis, one in told.pop("axes").items()
                }  # fmt: skip
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise GyrocalError(f"{path}: no summary of this version ({error}); delete it, and it is computed again") from None
        told["ranges"] = {name: (low, high) for name, (low, high) in told["ranges"].items()}
        return Summary(**{**told, "warnings": tuple(told["warnings"])}, axes=axes)


def _shallow(of: AxisSummary | Summary, *without: str) -> dict[str, Any]:
    """The fields of a summary by name; ``dataclasses.asdict`` copies each array."""
    return {f.name: getattr(of, f.name) for f in fields(of) if f.name not in without}


def _whole(upper: Array) -> Array:
    """Symmetric matrices [..., q, q] from their upper triangles [..., q (q + 1) / 2]."""
    q = int(np.sqrt(2 * upper.shape[-1]))
    rows, columns = np.triu_indices(q)
    out = np.empty((*upper.shape[:-1], q, q))
    out[..., rows, columns] = upper
    out[..., columns, rows] = upper
    return out
