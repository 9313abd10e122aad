"""The states of the noise: what the columns of the model take from the sums of products."""

import numpy as np

from gyrocal.error_model.model import Model
from gyrocal.evidence.answer import weigh
from gyrocal.evidence.hypotheses import options
from gyrocal.evidence.matrix import Matrix, runs_of
from gyrocal.evidence.states import States, beside_model, integrated
from gyrocal.inference.fit import fit
from make_runs import make_run, make_session

T_S = np.arange(600) / 50.0


def test_a_state_is_what_is_left_with_each_column_of_the_model_taken_out_in_turn() -> None:
    """First the offsets of power cycles, one cycle after the other, then what is shared, one column after the other."""
    rng, runs = np.random.default_rng(1), []
    for i in range(6):
        rate = 78.0 * (-1) ** i
        gyro = rng.normal([0, 0, 0.01 * (i // 2) + 1.01 * rate], 0.04, (T_S.size, 3))
        runs.append(make_run(T_S, gyro, table_rate_dps=rate, scenario=f"s{i // 2}"))
    axis = fit(make_session(*runs), Model.builtin("default"), axes=["z"]).axes["z"]
    matrix = Matrix.of(axis, options(runs_of(axis), 2, ["scale", "bias"]))
    assert len(matrix.options) > 3
    assert matrix.of_cycles.size > 0
    assert matrix.shared.size > 1
    states = States.of(matrix)
    for state in (0, len(states.noises) // 2, len(states.noises) - 1):
        carried = states.carried[state]
        grams = matrix.grams(states.noises[state])[0]
        cycles = np.array([grams[matrix.design.scenarios == k].sum(axis=0) for k in range(3)])
        if carried:
            cycles = np.concatenate([one.normal_equations(states.noises[state])[0] for one in matrix.going_on])
        sd = np.array(states.spreads[state])
        left = integrated(cycles, matrix.of_cycles, sd)[0].sum(axis=0)
        size = np.sqrt(np.maximum(np.diagonal(left), 1e-300))
        for j in matrix.shared:
            left = left - np.outer(left[j], left[j]) / left[j, j]
        left[matrix.shared], left[:, matrix.shared] = 0.0, 0.0
        scale = np.outer(size, size)
        np.testing.assert_allclose(states.products[state] / scale, left / scale, atol=1e-9)
        again = beside_model(matrix, states.noises[state], states.spreads[state], carried=carried)
        np.testing.assert_array_equal(again, states.products[state])


def test_what_only_the_noise_of_a_measured_column_tells_from_it_is_not_weighed() -> None:
    """The temperature rises in each power cycle as the time does, and the model depends on it. Beside it, the noise of the
    thermometer was all that showed a drift, and what was left after it was taken out was negative: the evidence was enormous.
    """
    rng, runs, t_s = np.random.default_rng(0), [], np.arange(1200) / 50.0
    for cycle in range(8):
        room_c = rng.uniform(25, 45)
        for rate, on_s in ((100.0, 0.0), (-100.0, 35.0)):
            true_c = room_c + 0.005 * (on_s + t_s)
            temp_c = true_c + rng.normal(0.0, 0.05, t_s.size)
            gyro = rng.normal(0.0, 0.015, (t_s.size, 3))
            gyro[:, 2] += 1.01 * rate + 0.05 * (true_c - 25.0) + 0.003 * np.cos(np.deg2rad(rate * t_s))
            runs.append(make_run(t_s, gyro, table_rate_dps=rate, scenario=f"s{cycle}", power_on_s=on_s, temp_c=temp_c))
    session = make_session(*runs)
    axis = fit(session, Model.builtin("default").add("bias_temperature", "z"), axes=["z"]).axes["z"]
    found = weigh(axis, [t.effect_id for t in axis.terms])
    assert found is not None
    scales = found.weighing.scales
    for weighed in found.weighing.sets:
        assert scales.chi2(weighed) > 0.8 * scales.states.degrees
    assert found.log_odds.get("drift", 0.0) < 3.0
