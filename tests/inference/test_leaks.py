"""What is left out is not seen: neither by the spread over runs, nor by the fit to the rest of a run."""

import numpy as np

from gyrocal.error_model.model import Model
from gyrocal.inference import heldout
from gyrocal.inference.fit import fit
from make_runs import make_run, make_session

T_S, TABLE_DPS, WHITE_DPS = np.arange(1000) / 50.0, 78.0, 0.04


def test_the_size_of_a_wave_in_runs_that_are_left_out_is_not_that_of_the_others() -> None:
    """The runs of the first day have a wave of 0.5 deg/s once per turn, the others none."""
    rng, runs = np.random.default_rng(1), []
    for i in range(9):
        gyro = rng.normal(0, WHITE_DPS, (T_S.size, 3))
        gyro[:, 2] += TABLE_DPS + 0.5 * (i < 3) * np.cos(np.radians(TABLE_DPS * T_S) + i)
        runs.append(make_run(T_S, gyro, table_rate_dps=TABLE_DPS, scenario=f"s{i}", day=1 + i // 3))
    found = fit(make_session(*runs), Model.builtin("default").add("table_ripple", "z"), axes=["z"])
    spreads = {s.fold.label: float(s.spreads.run.max()) for s in heldout.steps(found.axes["z"], heldout.folds(found))}
    assert sorted(spreads) == ["1", "2", "3"]
    assert spreads["1"] < 0.1 * min(spreads["2"], spreads["3"])


def test_a_part_of_a_run_is_predicted_without_what_stands_beside_it() -> None:
    """In a run of 20 s nothing within a second of the part is used, as drift correlates it with the part."""
    rng = np.random.default_rng(2)
    runs = [
        make_run(T_S, rng.normal([0, 0, rate], WHITE_DPS, (T_S.size, 3)), table_rate_dps=rate, scenario="s0", day=1)
        for rate in (TABLE_DPS, -TABLE_DPS)
    ]
    found = fit(make_session(*runs), Model.builtin("default"), axes=["z"])
    steps = list(heldout.steps(found.axes["z"], heldout.folds(found)))
    assert len(steps) > 2
    for step in steps:
        assert step.fold.time is not None
        start_s, stop_s = (part * 20.0 for part in step.fold.time)
        used_s = np.concatenate([b.t_s for b in step.trained.design.blocks])
        assert used_s.size > 100
        assert not np.any((used_s > start_s - 0.9) & (used_s < stop_s + 0.9))


def test_a_part_of_the_blocks_has_the_equations_of_a_fit_to_it_alone() -> None:
    """Its block means are taken from those of the whole; the second run has no temperature, and the third one is left out."""
    rng, runs = np.random.default_rng(3), []
    for i, sign in enumerate((1, -1, 1, -1)):
        temp_c = np.nan if i == 1 else 25 + 0.2 * i + 0.1 * T_S
        gyro = rng.normal([0, 0, sign * TABLE_DPS], WHITE_DPS, (T_S.size, 3))
        runs.append(make_run(T_S, gyro, table_rate_dps=sign * TABLE_DPS, scenario="s0", temp_c=temp_c))
    model = Model.builtin("default").add("bias_temperature", "z").add("table_ripple", "z")
    axis = fit(make_session(*runs), model, axes=["z"]).axes["z"]
    kept = [rng.random(b.t_s.size) < (0.0 if i == 2 else 0.6) for i, b in enumerate(axis.design.blocks)]
    part = axis.design.selected(kept)
    alone = axis.design.over([b.select(mask) for b, mask in zip(axis.design.blocks, kept, strict=True) if mask.any()])
    assert part.layout == alone.layout
    for one, other in zip(part.grams(axis.noise), alone.grams(axis.noise), strict=True):
        assert one.shape[0] == 3
        np.testing.assert_allclose(one, other, rtol=1e-12)
