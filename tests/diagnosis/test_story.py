"""The story of an effect: its campaign shows it, diagnose names it, add makes the error fall; and where it cannot be shown."""


import pytest

from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z, add_measured

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers")]


def session_of(campaign: str, *effects: str, seed: int = 5) -> Session:
    """Short runs, and fewer of them than the campaign's own."""
    scenarios, seconds = {"paper": (9, 20.0), "full": (3, 10.0), "swing": (2, 20.0)}[campaign]
    return simulate(None, campaign, effects, seed, scenarios=scenarios, seconds=seconds)[0]


STORIES = [
    pytest.param("full", "g_sensitivity", "z", marks=pytest.mark.wide),
    pytest.param("full", "misalignment", "x", marks=pytest.mark.wide),
    pytest.param("paper", "warmup:A_dps=0.1,tau_s=15", "z", marks=pytest.mark.wide),
    pytest.param("swing", "lag", "z", marks=pytest.mark.wide),
]


@pytest.mark.parametrize(("campaign", "effect", "axis"), STORIES)
def test_it_is_named_and_added_and_the_error_falls(campaign: str, effect: str, axis: str) -> None:
    session, model = session_of(campaign, effect), Model.builtin("default").about(axis)
    effect_id = effect.partition(":")[0]
    found = diagnose(session, model)
    assert found.best is not None
    assert found.verdict == "add"
    assert found.best.effect.id == effect_id
    before, after, _ = add(session, model, effect_id)
    assert after.pooled.excess_dps < 0.4 * before.pooled.excess_dps
    assert after.verdict == "adequate"


@pytest.fixture(scope="module")
def null() -> Diagnosis:
    """The paper's campaign with nothing planted."""
    return diagnose(session_of("paper"), ON_Z)


def test_nothing_is_named_where_nothing_is(null: Diagnosis) -> None:
    assert null.verdict == "adequate"
    assert null.unknown is None


@pytest.mark.parametrize(
    ("effect_id", "record"),
    [
        ("lag", "swing"), ("clock_error", "swing"), ("centripetal", "three different speeds"),
        ("scale_nonlinearity", "two or more rates"), ("scale_asymmetry", "speeds"), ("earth_rate", "latitude_deg"),
    ],
)  # fmt: skip
def test_one_speed_cannot_show_it_and_what_can_is_said(null: Diagnosis, effect_id: str, record: str) -> None:
    (on_z,) = [c for c in null.candidates if (c.effect.id, c.axis) == (effect_id, "z")]
    assert on_z.decision == "not_measurable"
    assert record in on_z.next_measurement


@pytest.fixture(scope="module")
def rippled() -> Session:
    return session_of("paper", "table_ripple")


@pytest.fixture
def without_ripple(rippled: Session, library: dict[str, object]) -> None:
    """The library without the files of the two effects that are a wave once per turn."""
    del library["table_ripple"]
    del library["order_tone"]


@pytest.mark.usefixtures("without_ripple")
def test_without_its_file_the_same_data_are_unknown(rippled: Session) -> None:
    found = diagnose(rippled, ON_Z)
    assert found.verdict == "unknown"
    assert found.unknown is not None
    assert (found.unknown["axis"], found.unknown["against"]) == ("z", "table_angle")
    assert found.unknown["amplitude_dps"] == pytest.approx(78.0 * 0.0016, rel=0.1)


@pytest.mark.wide
def test_two_effects_are_found_one_by_one() -> None:
    """`explain` does the same of other effects (test_explain.py), and so does the blind benchmark of its pairs."""
    session = session_of("full", "g_sensitivity", "scale_temperature:k_per_c=3e-4")
    model: Model | None = None
    named = []
    for _ in range(3):
        found = diagnose(session, model)
        if found.best is None:
            break
        named.append(found.best.effect.id)
        model = add_measured(session, model, named[-1]).model
    assert sorted(named) == ["g_sensitivity", "scale_temperature"]
    assert found.verdict == "adequate"


@pytest.mark.wide
def test_a_wrong_effect_does_not_make_the_error_fall() -> None:
    before, after, _ = add_measured(session_of("full", "g_sensitivity"), ON_Z, "scale_temperature")
    assert after.pooled.excess_dps > 0.95 * before.pooled.excess_dps
