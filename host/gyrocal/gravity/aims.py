"""How far a recording by hand is from its aims, and the movement that would bring it closest.

The standard errors come from the Fisher information of the rests and movements so far. A next movement adds the information of
an ideal turn about one of the sensor's axes, with the noise of the movements so far.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.gravity.fit import CROSS, GravityFit, fit, full
from gyrocal.gravity.observations import Parameter
from gyrocal.gravity.rests import TRIM_S, look
from gyrocal.gravity.rotation import cross_matrix, exponential, tangents
from gyrocal.gravity.scene import Scene
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Session

TURNS_DEG = (90.0, 180.0)
STEP_DEG = 2.5


@dataclass(frozen=True)
class Aim:
    """Standard errors of an axis's scale (fraction) and of its larger misalignment, None while unknown, and their aims."""

    axis: str
    scale_se: float | None = None
    misalignment_se: float | None = None
    scale_aim: float = POLICY.scale_aim
    misalignment_aim: float = POLICY.misalignment_aim

    @property
    def met(self) -> bool:
        """True if both standard errors are at most their aims."""
        if self.scale_se is None or self.misalignment_se is None:
            return False
        return self.scale_se <= self.scale_aim and self.misalignment_se <= self.misalignment_aim

    def to_json(self) -> dict[str, Any]:
        return {**asdict(self), "met": self.met}


@dataclass(frozen=True)
class Turn:
    """A movement about one axis of the sensor by an angle, either way, that begins with another axis up or down."""

    axis: str
    upright: str
    angle_deg: float

    def __str__(self) -> str:
        hold = f"hold {self.axis} level, {self.upright} up or down"
        return f"{hold}; turn it about {self.axis} by about {self.angle_deg:.0f} deg, either way; keep it still for two seconds"


@dataclass(frozen=True)
class Progress:
    """A recording by hand so far: its rests, whether the sensor is at rest now, the aims, and the next movement."""

    rests: int
    at_rest: bool
    aims: tuple[Aim, ...]
    turn: Turn

    @property
    def met(self) -> bool:
        """True if the recording has enough rests and meets the aims of every axis."""
        return self.rests >= POLICY.aim_rests and all(aim.met for aim in self.aims)

    def to_json(self) -> dict[str, Any]:
        """The progress as plain data; ``turn`` is a sentence."""
        aims = [aim.to_json() for aim in self.aims]
        return {"rests": self.rests, "at_rest": self.at_rest, "aims": aims, "turn": str(self.turn), "met": self.met}


def progress(session: Session, before: Progress | None = None) -> Progress:
    """The progress of a session whose last run is being recorded.

    ``before`` is the progress a moment ago; the fit is repeated only if a rest has been added since.
    """
    found = look(session)
    count, last = len(found.rests), len(session.runs) - 1
    run = session.runs[last]
    still_s = run.sample_s[-1] - run.sample_s[found.rests[-1].stop - 1] if count and found.rests[-1].run == last else np.inf
    at_rest = bool(still_s < 2 * TRIM_S)
    if before is not None and before.rests == count:
        return replace(before, at_rest=at_rest)
    try:
        fitted = fit(Scene.of(session), full(Model.open(None)))
    except InputError:  # rests are too few, or the readings are not accelerations
        axis = count % len(AXES)
        return Progress(count, at_rest, tuple(Aim(a) for a in AXES), Turn(AXES[axis], AXES[axis - 1], TURNS_DEG[0]))
    return Progress(count, at_rest, tuple(_aim(fitted, axis) for axis in AXES), next_turn(fitted))


def next_turn(fitted: GravityFit) -> Turn:
    """The turn after which the variances of scale and misalignment, relative to their aims, have the least sum."""
    weight = np.array([0.0 if aim is None else aim**-2 for aim in map(_aim_of, fitted.parameters)])
    rows = fitted.observations.movement_rows
    noise = np.eye(2) * float(np.median(np.diag(fitted.noise)[:rows]))
    turns = [Turn(a, b, angle_deg) for a in AXES for b in AXES if a != b for angle_deg in TURNS_DEG]

    def gain(turn: Turn) -> float:
        x = columns(fitted.parameters, turn)
        shared = fitted.covariance @ x.T
        return float(weight @ np.sum(shared * np.linalg.solve(x @ shared + noise, shared.T).T, axis=1))

    return max(turns, key=gain)


def columns(wanted: list[Parameter], turn: Turn) -> Array:
    """Both rows of an ideal turn by parameter, shape [2, p], as in :class:`Observations`; only scale and misalignment count."""
    axis, up = AXES.index(turn.axis), np.eye(3)[AXES.index(turn.upright)]
    angles = np.deg2rad(np.arange(0.0, turn.angle_deg + STEP_DEG / 2, STEP_DEG))
    rotation = exponential(np.outer(angles, np.eye(3)[axis]))
    integral = np.deg2rad(STEP_DEG) * (rotation[:-1] + rotation[1:]).sum(axis=0) / 2
    across = tangents(up) @ cross_matrix(up)
    out = np.zeros((2, len(wanted)))
    for k, p in enumerate(wanted):
        turned = p.axis == axis if p.term.effect.role is Role.SCALE else p.name == f"m_{turn.axis}"
        if turned and _aim_of(p) is not None:
            out[:, k] = across @ integral[:, p.axis]
    return out


def _aim_of(parameter: Parameter) -> float | None:
    if parameter.term.effect.role is Role.SCALE:
        return POLICY.scale_aim
    return POLICY.misalignment_aim if parameter.term.effect_id == CROSS else None


def _aim(fitted: GravityFit, axis: str) -> Aim:
    excess = max(1.0, fitted.misfit)
    se = {p.key: fitted.se(*p.key) * excess for p in fitted.parameters if p.term.axis == axis and _aim_of(p) is not None}
    scale = [value for key, value in se.items() if key[0] != CROSS]
    cross = [value for key, value in se.items() if key[0] == CROSS]
    return Aim(axis, scale[0], max(cross))
