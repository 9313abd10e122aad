"""Noise is a field of the model: files and commands list it by the ids that people know."""

from dataclasses import replace
from pathlib import Path

import pytest

from gyrocal.calibration.estimator import calibration_of
from gyrocal.diagnosis.answer.add import add
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.simulation.simulate import simulate

OLD = """\
format = "gyrocal-model/1"
name = "old"
white_sd_dps = { z = 0.045 }
effects = [
  { id = "scale", axis = "z", scale = 0.004, scale_sd = 0.0004, scale_se = 5e-05, scale_sd_se = 4e-05 },
  { id = "bias", axis = "z", bias_dps = -0.05, bias_dps_se = 0.005 },
  { id = "turn_on_bias", axis = "z", sd_dps = 0.04, sd_dps_se = 0.004 },
  { id = "colored_noise", axis = "z", sd_dps = 0.0015, tau_s = 12.0 },
  { id = "table_ripple", axis = "z", amplitude_1 = 0.0015, amplitude_1_se = 8e-05 },
]
"""


def opened(text: str, folder: Path) -> Model:
    (folder / "m.toml").write_text(text, encoding="utf-8")
    return Model.open(folder / "m.toml")


def test_an_old_file_s_lines_are_the_noise_of_the_model(tmp_path: Path) -> None:
    model = opened(OLD, tmp_path)
    assert model.noise_on("z") == AxisNoise(
        0.045, Drift(0.0015, 12.0), TurnOnBias(0.04, se={"sd_dps": 0.004}), TurnOnScale(0.0004, 4e-05)
    )
    assert [t.effect_id for t in model.terms] == ["scale", "bias", "table_ripple"]
    assert model.ids == ["scale", "bias", "turn_on_bias", "colored_noise", "table_ripple"]
    assert model.effect_ids == ["table_ripple"]
    assert model.axes == ["z"]
    assert [line for line in model.toml().splitlines() if "{ id" in line] == [f for f in OLD.splitlines() if "{ id" in f]
    assert opened(model.toml(), tmp_path).toml() == model.toml()


def test_priors_are_the_spreads_and_flat_without_them(tmp_path: Path) -> None:
    model = opened(OLD, tmp_path)
    known = calibration_of(model, "z")
    assert known.bias_dps == (-0.05, pytest.approx((0.04**2 + 0.004**2 + 0.005**2) ** 0.5, rel=1e-3))
    assert known.scale == (0.004, pytest.approx((0.0004**2 + 4e-05**2 + 5e-05**2) ** 0.5, rel=1e-2))
    noise = replace(model.noise_on("z"), turn_on_bias=None, turn_on_scale=None)
    flat = calibration_of(replace(model, noise={"z": noise}), "z")
    assert (flat.bias_dps, flat.scale) == ((0.0, float("inf")),) * 2


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{ id = "colored_noise", axis = "z", tau_s = 0.0 }', "tau_s is 0, must be positive"),
        ('{ id = "colored_noise", axis = "z", sd_dps = -1.0 }', "sd_dps is -1, must be positive"),
        ('{ id = "turn_on_bias", axis = "z", tau_s = 1.0 }', "no parameter 'tau_s'"),
        ('{ id = "scale", axis = "z", scale_sd = -1.0 }', "scale_sd is -1, must be positive"),
        ('{ id = "bias", axis = "z", bias_dps_se = -1.0 }', "bias_dps_se is -1, must be positive"),
        ('{ id = "warmup", axis = "z", tau_s = 0.0 }', "tau_s is 0, must be positive"),
        ('{ id = "earth_rate", axis = "z", latitude_deg = 91.0 }', "latitude_deg is 91, must be from -90 to 90"),
    ],
)
def test_a_value_out_of_its_parameter_s_bounds_is_refused(line: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        opened(f'format = "gyrocal-model/1"\neffects = [\n  {line},\n]\n', tmp_path)


@pytest.mark.usefixtures("measured_adds")
def test_a_noise_is_added_and_removed_by_its_id() -> None:
    grown = Model.builtin("paper").add("colored_noise", "z")
    assert grown.ids == ["scale", "bias", "colored_noise"]
    assert grown.noise_on("z").drift is not None
    assert grown.noise_on("x").drift is None
    assert grown.without("colored_noise").ids == ["scale", "bias"]
    session, _ = simulate(None, "paper", ["turn_on_bias:sd_dps=0.1"], 3, scenarios=3, seconds=20.0)
    before, after, model = add(session, "paper", "turn_on_bias")
    assert before.fit.model.ids == ["scale", "bias"]
    assert after.fit.model.ids == model.ids == ["scale", "bias", "turn_on_bias"]
    assert model.value("turn_on_bias", "z", "sd_dps") > 0.01
