"""The states of the noise: what the columns of the model take from the sums of products."""

import numpy as np

from gyrocal.error_model.model import Model
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
        grams, _ = matrix.grams(states.noises[state])
        cycles = np.array([grams[matrix.design.scenarios == k].sum(axis=0) for k in range(3)])
        sd = np.array(states.spreads[state])
        left = integrated(cycles, matrix.of_cycles, sd)[0].sum(axis=0)
        size = np.sqrt(np.maximum(np.diagonal(left), 1e-300))
        for j in matrix.shared:
            left = left - np.outer(left[j], left[j]) / left[j, j]
        left[matrix.shared], left[:, matrix.shared] = 0.0, 0.0
        scale = np.outer(size, size)
        np.testing.assert_allclose(states.products[state] / scale, left / scale, atol=1e-9)
        np.testing.assert_array_equal(beside_model(matrix, states.noises[state], states.spreads[state]), states.products[state])
