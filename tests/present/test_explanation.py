"""What the page of an explanation draws for a step."""

import numpy as np
import pytest

from gyrocal.diagnosis.comparison import measure
from gyrocal.diagnosis.explain import Step
from gyrocal.error_model.model import Model
from gyrocal.present.explanation import evidence, removed, shown
from make_runs import make_run, make_session


def test_a_step_is_drawn_against_what_it_removed_also_if_its_delay_moves_the_blocks() -> None:
    """A delay of a swing in proportion to the change of the rate, which leaves the first samples without a reference."""
    rng = np.random.default_rng(3)
    t_s = np.arange(0, 20, 0.02)
    runs = []
    for k in range(2):
        rate_dps, late_dps = (60 * np.sin(2 * np.pi * 0.6 * (t_s - delay_s) + k) for delay_s in (0.0, 0.03))
        gyro = rng.normal(0, 0.02, (t_s.size, 3)) + np.outer(late_dps, [0, 0, 1])
        runs.append(make_run(t_s, gyro, rate_ref_dps=rate_dps, scenario=f"s{k}"))
    session = make_session(*runs)
    model = Model.builtin("default")
    step = Step(("lag",), ("z",), (), measure(session, model), measure(session, model.add("lag", "z")))
    finding = removed(step)
    assert finding is not None
    assert (finding.axis, finding.against) == ("z", "rate")
    assert "in proportion to the change of the rate" in shown(finding)
    assert finding.amplitude_dps == pytest.approx(60 * 2 * np.pi * 0.6 * 0.03, rel=0.2)
    figure = evidence(step)
    assert figure is not None
    assert figure.axes[0].get_xlabel() == "change of the rate, deg/s²"
