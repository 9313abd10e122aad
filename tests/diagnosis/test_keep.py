"""What the library does not explain is kept as a formula, and the error falls nearly as far as for one who knows its shape."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gyrocal.cli import main
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.answer.formula_search import keep, propose, select
from gyrocal.effects import base
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from gyrocal.variables.base import variables
from gyrocal.variables.terms import hinges
from known import ON_Z, add_measured
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers", "tests_alone")]
Array = NDArray[np.float64]
RATES_DPS = (0.0, 40.0, -60.0, 90.0, -150.0)


def recording(signal: Callable[[dict[str, Array]], Array], encoder: bool = True, seed: int = 1) -> Session:
    """Fifteen runs of three days, each a power cycle of 30 s at 50 Hz; ``signal`` [n] of the run's quantities is on z."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(1500) / 50
    runs = []
    for i in range(15):
        rate_dps = RATES_DPS[i % 5]
        angle_deg = rng.uniform(0, 360) + rate_dps * t_s
        temp_c = 30 + 8 * np.sin(2 * np.pi * t_s / 37 + i)
        quantities = {"t": t_s, "angle_deg": angle_deg, "temp_c": temp_c, "rate_dps": np.full(t_s.size, rate_dps)}
        gyro = rng.normal(0, 0.02, (t_s.size, 3)) + rng.normal(0, 0.005, 3) - 0.05
        gyro[:, 2] += 1.004 * rate_dps + signal(quantities)
        columns = {"temp_c": temp_c + rng.normal(0, 0.02, t_s.size)} | ({"table_angle_deg": angle_deg} if encoder else {})
        runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario=f"s{i}", day=1 + i // 5, **columns))
    return make_session(*runs)


PLANTED = {
    "a sawtooth in the table's angle": (
        lambda q: 0.02 * ((q["angle_deg"] / 360) % 1 - 0.5), True, "table_angle", "k*(turn - 0.5)",
    ),
    "a resonance at one temperature": (
        lambda q: 0.03 * np.exp(-(((q["temp_c"] - 33) / 0.7) ** 2)), True, "temperature", "k*exp(-((temp_c - 33)/0.7)**2)",
    ),
    "a gear of five teeth": (
        lambda q: 0.01 * np.sin(5 * np.deg2rad(q["angle_deg"])) * (q["rate_dps"] != 0), False, "table_angle",
        "a*cos(5*theta) + b*sin(5*theta); each run",
    ),
}  # fmt: skip


@pytest.mark.wide
@pytest.mark.parametrize("what", [pytest.param(what, marks=[pytest.mark.wide] * ("resonance" not in what)) for what in PLANTED])
def test_the_error_falls_nearly_as_far_as_with_the_true_shape(what: str, library: dict[str, object]) -> None:
    del library["order_tone"]  # the library would name the gear
    signal, encoder, against, truth = PLANTED[what]
    session = recording(signal, encoder)
    found, before, after, model = keep(session, ON_Z)
    assert (found.axis, found.against) == ("z", against)
    oracle_before, oracle_after, _ = add_measured(session, ON_Z, truth)
    fallen = before.per_axis["z"].rms_dps ** 2 - after.per_axis["z"].rms_dps ** 2
    possible = oracle_before.per_axis["z"].rms_dps ** 2 - oracle_after.per_axis["z"].rms_dps ** 2
    assert possible > 0
    assert fallen > 0.8 * possible
    assert not [f for f in after.where if f.axis == "z"]
    assert found.formula.partition(": ")[2] in model.toml()


def test_nothing_is_kept_where_nothing_is_unknown() -> None:
    with pytest.raises(InputError, match="nothing to keep: the model is adequate"):
        keep(recording(lambda q: np.zeros(q["t"].size)), ON_Z)


def test_what_has_a_name_is_not_kept_under_another() -> None:
    with pytest.raises(InputError, match="gyrocal add bias_temperature"):
        propose(diagnose(recording(lambda q: 0.01 * (q["temp_c"] - 25)), ON_Z))


def test_the_terms_that_were_planted_are_chosen() -> None:
    session = recording(lambda q: 0.03 * np.maximum(q["temp_c"] - 30, 0) - 0.03 * np.maximum(q["temp_c"] - 34, 0))
    current = fit(session, Model.builtin("default")).axes["z"]
    terms = [f"max(temp_c - {k}, 0)" for k in (24, 26, 28, 30, 32, 34, 36)]
    assert select(current, "z", ["temp_c", *terms]) == ["max(temp_c - 30, 0)", "max(temp_c - 34, 0)"]
    assert select(current, "z", ["(rate/100)**2", "abs(rate/100)"]) == []


@pytest.mark.parametrize(("name", "symbol"), [(v.name, symbol) for v in variables().values() for symbol in v.searched])
def test_the_library_s_terms_are_formulas(name: str, symbol: str) -> None:
    variable = variables()[name]
    values = np.linspace(-5 if name in ("temperature", "rate", "acceleration") else 0, 60, 200)
    for terms in (variable([]).terms(symbol, values), hinges(symbol, values)):
        kind = FormulaEffect(" + ".join(f"k{i}*{t}" for i, t in enumerate(terms)))
        assert len(terms) > 1
        assert len(kind.linear) == len(terms)
        assert set(kind.variables) <= variable.symbols.keys()


@pytest.mark.wide
def test_keep_as_scripts_see_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session, model = str(tmp_path / "s"), str(tmp_path / "m.toml")
    signal = PLANTED["a sawtooth in the table's angle"][0]
    recording(signal).save(session)
    ON_Z.save(model)
    own = tmp_path / "effects"
    own.mkdir()
    (own / "beside.py").write_text("raise SystemExit('run without being asked for')\n")
    words = ["keep", session, "--model", model, "--name", "saw"]
    try:
        assert main([*words, "--file", str(own / "saw.py"), "--trust", "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["against"] == "table_angle"
        assert told["formula"].startswith("saw: k1*")
        assert told["after"]["excess_dps"] < told["before"]["excess_dps"]
        base.effects().pop("saw")
        (own / "beside.py").unlink()
        assert main(["compare", session, "--model", model]) == 2  # code: only when asked for
        capsys.readouterr()
        assert main(["compare", session, "--model", model, "--effects", str(own), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["verdict"] == "adequate"
        assert main([*words, "--effects", str(own)]) == 2  # the name is taken
    finally:
        base.effects().pop("saw", None)


@pytest.mark.wide
@pytest.mark.parametrize("row", [0, pytest.param(700, marks=pytest.mark.wide)])
def test_one_reading_is_never_kept(row: int) -> None:
    """A single bad reading, first of a run or within it, is no shape of any variable."""
    runs: list[float] = []

    def signal(quantities: dict[str, Array]) -> Array:
        runs.append(0.0)
        return np.where((np.arange(quantities["t"].size) == row) & (len(runs) == 8), 3.0, 0.0)

    with pytest.raises(InputError):
        propose(diagnose(recording(signal), ON_Z))
