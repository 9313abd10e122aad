"""A session that cannot tell two effects apart, diagnosed once on the axis that matters."""

from dataclasses import replace

import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.error_model.model import Model
from gyrocal.planning.plan import Plan, plan
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

EFFECT = "bias_temperature:k1_dps_per_c=0.01"


def model_of_z() -> Model:
    model = Model.open("default")
    return replace(model, terms=tuple(t for t in model.terms if t.axis == "z"), noise={"z": model.noise["z"]})


@pytest.fixture(scope="session")
def ambiguous() -> Session:
    """Four power cycles of one day, 40 s up and down, with a temperature coefficient."""
    return simulate(None, "paper", [EFFECT], seed=4, scenarios=4, seconds=40.0)[0]


@pytest.fixture(scope="session")
def diagnosis(ambiguous: Session) -> Diagnosis:
    return diagnose(ambiguous, model_of_z())


@pytest.fixture
def diagnosed_once(diagnosis: Diagnosis, monkeypatch: pytest.MonkeyPatch) -> Diagnosis:
    """Plans of this session take its one diagnosis."""
    monkeypatch.setattr("gyrocal.planning.plan.diagnose", lambda *_, **__: diagnosis)
    return diagnosis


@pytest.fixture(scope="session")
def of_four_minutes(ambiguous: Session, diagnosis: Diagnosis) -> Plan:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gyrocal.planning.plan.diagnose", lambda *_, **__: diagnosis)
        return plan(ambiguous, minutes=4.0)
