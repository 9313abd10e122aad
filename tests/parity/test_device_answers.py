"""`$CAL` over the serial port equals `calibrate` on the same rows, to float rounding; and would not with a broken sign."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from gyrocal.calibration import header
from gyrocal.calibration.calibrate import Estimate, calibrate
from gyrocal.cli import main
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder
from gyrocal.device.simulated import SimulatedDevice, replay
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

ROUNDING = {"baseline": (1e-8, 1e-8), "model": (1e-7, 1e-7), "cnn": (1e-7, 1e-5)}
"""Relative-ish limits on scale (fraction) and bias (deg/s): nine digits on the wire, the network in float32."""


@pytest.fixture(scope="module")
def model() -> Model:
    campaign, _ = simulate(None, "table2", seed=5, scenarios=9, seconds=25.0)
    start = Model.builtin("default").with_term(Term("table_ripple", "z", {"amplitude_1": 0.0}))
    fitted = fit(campaign, start.with_term(Term("spin_up", "z", {"A": 0.0, "tau_s": 2.0})), axes=["z"]).model
    term = fitted.term("spin_up", "z")
    assert term is not None
    return fitted.with_term(replace(term, values={**term.values, "tau_s_sd": 0.5 * term.values["tau_s"]}))


@pytest.fixture(scope="module")
def replayed(model: Model, tmp_path_factory: pytest.TempPathFactory, require_tool) -> tuple[Session, list[dict]]:
    """A session as it came back over the port, and the `$CAL` sentences that came with it."""
    require_tool("cc")
    folder = tmp_path_factory.mktemp("replayed")
    header.write(model, folder / "include" / "calibration.h")
    session, _ = simulate(None, "table2", seed=6, scenarios=4, seconds=7.0)
    with SimulatedDevice(session, include_dir=folder / "include") as device, Link(device.port) as link:
        report = Recorder(link, folder / "s", wanted=None).record()
    assert (report.lost_sentences, report.bad_sentences) == (0, 0)
    return Session.open(folder / "s"), report.results


def largest_difference(host: list[Estimate], device: list[dict], method: str) -> tuple[float, float]:
    ours = [e for e in host if e.method == method]
    theirs = sorted((c for c in device if c["method"] == method), key=lambda c: c["seconds"])
    assert len(ours) == len(theirs) == 12
    pairs = list(zip(ours, theirs, strict=True))
    assert all(e.seconds == c["seconds"] and e.axis == c["axis"] for e, c in pairs)
    return max(abs(e.scale - c["scale"]) for e, c in pairs), max(abs(e.bias_dps - c["bias_dps"]) for e, c in pairs)


@pytest.mark.parametrize("method", ["baseline", "cnn", "model"])
def test_the_device_answers_as_the_host_does(replayed: tuple[Session, list[dict]], model: Model, method: str) -> None:
    session, said = replayed
    scale, bias_dps = largest_difference(calibrate(session, None, [method], model), said, method)
    assert scale <= ROUNDING[method][0]
    assert bias_dps <= ROUNDING[method][1]


@pytest.mark.parametrize("method", ["baseline", "cnn", "model"])
def test_standard_errors_misfit_and_flags_agree_too(replayed: tuple[Session, list[dict]], model: Model, method: str) -> None:
    session, said = replayed
    host = [e for e in calibrate(session, None, [method], model) if e.method == method]
    device = sorted((c for c in said if c["method"] == method), key=lambda c: c["seconds"])
    for e, c in zip(host, device, strict=True):
        assert c["scale_se"] == pytest.approx(e.scale_se, rel=1e-6)
        assert c["bias_se_dps"] == pytest.approx(e.bias_se_dps, rel=1e-6)
        assert c["misfit"] == pytest.approx(e.misfit, rel=1e-5)
        assert tuple(filter(None, (c["flags"] or "").split("+"))) == e.flags
        assert c["trusted"] == e.trusted


@pytest.mark.parametrize("method", ["baseline", "cnn", "model"])
def test_a_broken_sign_does_not_pass(replayed: tuple[Session, list[dict]], model: Model, method: str) -> None:
    session, said = replayed
    turned = session.with_runs(replace(r, face="down" if r.face == "up" else "up", frame=r.table) for r in session.runs)
    scale, bias_dps = largest_difference(calibrate(turned, None, [method], model), said, method)
    assert scale > 100 * ROUNDING[method][0] or bias_dps > 100 * ROUNDING[method][1]


def test_what_takes_long_comes_in_parts(model: Model, tmp_path: Path, require_tool) -> None:
    """Fourteen parts of the baseline's standard errors, six alternatives of the model's answer, a part a sample, so that none
    is missed meanwhile; then the network's, a face in eight. At the end of a run that is over sooner, all that is left at
    once."""
    require_tool("cc")
    header.write(model, tmp_path / "calibration.h")
    whole, _ = simulate(None, "table2", seed=7, scenarios=1, seconds=7.0)
    short = whole.with_runs(r.part(0, n) for r, n in zip(whole.runs, (1015, 873), strict=True))
    said = [[s for s in replay(of, include_dir=tmp_path) if s.tag in ("RAW", "CAL")] for of in (whole, short)]
    for sentences, gaps in zip(said, ([6, 16] * 3, [6, 16] * 2 + [0, 0]), strict=True):
        at = [i for i, s in enumerate(sentences) if s.tag == "CAL"]
        methods = [sentences[i].fields["method"] for i in at]
        assert methods == ["baseline", "model", "cnn"] * 3
        assert [sentences[i - 1].text.partition(",")[0] for i in at[::3]][:2] == ["304", "594"]
        between = [b - a - 1 for a, b in pairwise(at)]
        assert [n for k, n in enumerate(between) if k % 3 != 2] == gaps
    answers = [[s.fields for s in of if s.tag == "CAL" and s.fields["method"] == "model"] for of in said]
    assert [a["scale"] for a in answers[0]] == [a["scale"] for a in answers[1]]


def test_a_gap_silences_the_network_on_both(tmp_path: Path, require_tool, capsys: pytest.CaptureFixture[str]) -> None:
    """One sample is missing, each time elsewhere: the same windows are answered by the device and by the host, no other."""
    require_tool("cc")
    whole, _ = simulate(None, "paper", seed=8, scenarios=8, seconds=7.0)
    runs = []
    for run in whole.runs:
        gap_at = (0, 1, 289, 290, 579, 580, 869, 870)[run.index // 2] if run.index % 2 else 0
        table = run.table if gap_at == 0 else run.table[:gap_at].vstack(run.table[gap_at + 1 :])
        runs.append(replace(run, frame=table))
    session = whole.with_runs(runs)
    said = replay(session, stream="off")
    device = [s.real("seconds") for s in said if s.tag == "CAL" and s.fields["method"] == "cnn"]
    host = calibrate(session, None, ["cnn"])
    scenarios = [[e.seconds for e in host if e.scenario == name] for name in session.scenarios]
    assert scenarios == [[2, 4, 6], [], [], [2], [2], [2, 4], [2, 4], [2, 4, 6]]
    assert device == [seconds for answered in scenarios for seconds in answered]
    assert [s.fields["name"] for s in said if s.tag == "ERR"] == ["net_gap"] * 6

    session.with_runs(runs[2:4]).save(tmp_path / "gap")
    assert main(["calibrate", str(tmp_path / "gap"), "--method", "cnn"]) == 2
    assert "samples are missing" in capsys.readouterr().err


def test_recording_is_what_was_replayed(replayed: tuple[Session, list[dict]], tmp_path: Path) -> None:
    session, _ = replayed
    original, _ = simulate(None, "table2", seed=6, scenarios=4, seconds=7.0)
    for got, want in zip(session.runs, original.runs, strict=True):
        assert (got.face, got.scenario, got.axis, got.table_rate_dps) == (
            want.face,
            want.scenario,
            want.axis,
            want.table_rate_dps,
        )
        assert abs(got.gyro_dps - want.gyro_dps).max() < 1e-6
        assert abs(got.t_us - want.t_us).max() <= 1
        assert abs(got.temp_c - want.temp_c).max() < 1e-5


def test_a_run_that_moves_is_seen_on_both(require_tool) -> None:
    """A warm-up shows in the last turn of the run that was recorded first, and not in the seconds of the answer."""
    require_tool("cc")
    session, _ = simulate(None, "paper", ["warmup:A_dps=0.05,tau_s=60"], seed=9, scenarios=2, seconds=30.0)
    device = [s.fields for s in replay(session, stream="off") if s.tag == "CAL"]
    host = calibrate(session, None, ["baseline", "cnn"])
    assert len(host) == len(device) == 12
    for e in host:
        (c,) = (
            c for i, c in enumerate(device)
            if c["method"] == e.method and float(c["seconds"]) == e.seconds and i // 6 == session.scenarios.index(e.scenario)
        )  # fmt: skip
        assert float(c["misfit"]) == pytest.approx(e.misfit, rel=1e-5)
        assert tuple(filter(None, (c["flags"] or "").split("+"))) == e.flags
    assert sum(e.flags == ("misfit",) for e in host) >= 6
