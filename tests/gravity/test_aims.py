"""What a recording by hand still lacks: the errors so far, and the turn that lowers them most."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from by_hand import matrix_of, truth_of, turned_by
from gyrocal.error_model.model import Model
from gyrocal.gravity.aims import Turn, columns, next_turn, progress
from gyrocal.gravity.calibrate import calibrate
from gyrocal.gravity.fit import GravityFit, fit, full
from gyrocal.gravity.observations import Observer
from gyrocal.gravity.scene import Scene
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Session
from gyrocal.simulation.simulate import simulate

ABOUT = {axis: [(axis, 90.0), (axis, 90.0), (axis, -180.0)] for axis in AXES}
"""Turns after which the sensor is as before."""


def fitted(session: Session) -> GravityFit:
    return fit(Scene.of(session), full(Model.open(None)))


def variances(found: GravityFit) -> float:
    """Sum of the variances of scales and misalignments, relative to their aims."""
    cross = POLICY.misalignment_aim**-2 * sum(found.se("misalignment", a, f"m_{b}") ** 2 for a in AXES for b in AXES if a != b)
    return cross + POLICY.scale_aim**-2 * sum(found.se("scale", a, "scale") ** 2 for a in AXES)


@pytest.mark.parametrize("angle_deg", [180.0])
def test_an_ideal_turn_has_the_information_of_a_recorded_one(angle_deg: float) -> None:
    """Against the rows of the fit, which are integrated over the recorded rates."""
    others = [*ABOUT["y"], ("y", 90.0), *ABOUT["x"]]
    found = fitted(turned_by([("z", angle_deg), ("z", -angle_deg), *others]))
    mine = [k for k, p in enumerate(found.parameters) if p.term.effect_id in ("scale", "misalignment")]
    perfect = [replace(t, values=dict.fromkeys(t.values, 0.0)) for t in found.model.terms]
    seen = Observer(found.scene).observe(replace(found.model, terms=tuple(perfect)), found.parameters)
    rows = seen.columns[:2, mine]
    ideal = columns(found.parameters, Turn("z", "x", angle_deg))[:, mine]
    assert np.abs(rows).max() > 1
    assert ideal.T @ ideal == pytest.approx(rows.T @ rows, abs=0.1)


@pytest.mark.parametrize(("turns", "missing"), [("zy", "x"), ("yx", "z")])
def test_a_turn_about_an_axis_that_is_missing_comes_next(turns: str, missing: str) -> None:
    made = turned_by([turn for axis in turns for turn in ABOUT[axis]])
    now = progress(made)
    assert now.turn.axis in missing
    assert now.turn.upright != now.turn.axis
    assert {aim.axis for aim in now.aims if not aim.met} >= set(missing)
    assert f"turn it about {now.turn.axis}" in str(now.turn)


@pytest.mark.wide
def test_the_next_turn_lowers_the_errors_more_than_any_other() -> None:
    """Each turn is recorded, from its pose, and the errors of the fit to all movements are compared."""
    start = [*ABOUT["z"], *ABOUT["y"]]
    turn = next_turn(fitted(turned_by(start)))
    pose: dict[str, list[tuple[str, float]]] = {"x": [], "y": [("z", 90.0)], "z": [("y", 90.0)]}  # brings this axis up
    left = {}
    for axis, upright in permutations(AXES, 2):
        scene = Scene.of(turned_by([*start, *pose[upright], (axis, turn.angle_deg)]))
        assert abs(scene.up[-2][AXES.index(upright)]) > 0.99
        left[axis, upright] = variances(fit(scene, full(Model.open(None))))
    assert left[turn.axis, turn.upright] < 1.2 * min(left.values())
    assert left[turn.axis, turn.upright] < 0.7 * max(left.values())


def test_too_few_rests_have_no_errors_yet() -> None:
    now = progress(turned_by([("z", 90.0)]))
    assert (now.rests, now.at_rest, now.met) == (2, True, False)
    assert all(aim.scale_se is None and not aim.met for aim in now.aims)


def test_the_errors_are_kept_until_there_is_another_rest() -> None:
    session = turned_by(ABOUT["z"])
    before = progress(session)
    run = session.runs[0]
    moving = session.with_runs([run.first(float(run.t_s[-1]) - 1.5) or run])
    assert before.at_rest
    assert not progress(moving).at_rest
    assert progress(session, before).aims is before.aims
    assert progress(moving, before).rests == before.rests - 1


def test_a_recording_that_ends_at_its_aims_is_as_good_as_it_says() -> None:
    session, truth = simulate(campaign="hands", seed=1)
    run = session.runs[0]
    for seconds in np.arange(50.0, run.duration_s, 5.0):
        cut = session.with_runs([run.first(float(seconds)) or run])
        if progress(cut).met:
            break
    assert seconds < 80
    matrix, se = matrix_of(calibrate(cut))
    error = matrix - truth_of(truth)
    assert np.abs(np.diag(error)).max() < 0.003
    assert np.abs(error - np.diag(np.diag(error))).max() < 0.004
    assert np.abs(error / se).max() < 4.5
