"""The thresholds that decide a verdict, in one frozen dataclass: :data:`POLICY`. There is one file for each kind of verdict.

Each threshold states its meaning, the effect of a larger and a smaller value, and its origin: a command whose figures chose it,
a test that protects it, or a law. A threshold without such an origin is marked as chosen by judgement. ``gyrocal benchmark
blind`` measured those of a diagnosis together on 180 sessions (docs/blind.md). Unless stated otherwise, a threshold was not
varied by itself. A test compares the thresholds that the device has too. This folder imports nothing of the package.
"""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.calibration import Calibration
from gyrocal.policy.diagnosis import Diagnosis
from gyrocal.policy.evidence import Evidence
from gyrocal.policy.fleet import Fleet
from gyrocal.policy.gravity import Gravity
from gyrocal.policy.inference import Inference
from gyrocal.policy.outliers import Outliers
from gyrocal.policy.planning import Planning
from gyrocal.policy.plausibility import Plausibility
from gyrocal.policy.threshold import JUDGEMENT

__all__ = ["JUDGEMENT", "POLICY", "Policy"]


@dataclass(frozen=True)
class Policy(Plausibility, Inference, Outliers, Diagnosis, Evidence, Calibration, Gravity, Fleet, Planning):
    """Every threshold of all kinds of verdict."""


POLICY = Policy()
