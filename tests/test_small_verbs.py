"""Other names of verbs, arguments in either order, and the small verbs: version, effects, info, plot and allan."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal import __version__
from gyrocal.api import Session, allan, effects
from gyrocal.cli import ALIASES, command_modules, main

SWING = Path(__file__).resolve().parents[1] / "docs" / "examples" / "swing.csv.gz"
MODEL = str(files("gyrocal") / "data" / "table2" / "model.toml")


pytestmark = pytest.mark.usefixtures("known_answers")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("small") / "s"
    words = ["--scenarios", "3", "--seconds", "6", "--effect", "table_ripple:amplitude_1=0.003"]
    assert main(["simulate", str(path), *words]) == 0
    return str(path)


def told(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_other_names_do_the_same(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert set(ALIASES.values()) <= set(command_modules())
    assert not set(ALIASES) & set(command_modules())
    words = [session, "--seconds", "4", "--method", "baseline"]
    assert told(capsys, "fit", *words) == told(capsys, "calibrate", *words)
    assert told(capsys, "correct", session, "--model", MODEL, "--out", str(tmp_path / "out"))["rows"] == 5220
    assert main(["gui", "--help"]) == 0
    assert "local page" in capsys.readouterr().out
    assert main(["fit"]) == 2
    assert "Missing argument 'SESSION'. See: gyrocal fit --help" in capsys.readouterr().err
    assert main(["--help"]) == 0
    assert "Also: correct for apply, fit for calibrate, gui for workbench." in " ".join(capsys.readouterr().out.split())


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["version"]) == 0
    assert capsys.readouterr().out == f"gyrocal {__version__}\n"


def test_a_session_may_be_named_by_its_file(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert told(capsys, "compare", f"{session}/session.toml") == told(capsys, "compare", session)


@pytest.mark.usefixtures("measured_adds")
def test_add_takes_its_arguments_in_either_order(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = str(tmp_path / "1.toml"), str(tmp_path / "2.toml")
    assert told(capsys, "add", "table_ripple", session, "--model", one) == told(
        capsys, "add", session, "table_ripple", "--model", other
    )
    assert Path(one).read_text() == Path(other).read_text()


def test_effects_lists_the_library(capsys: pytest.CaptureFixture[str]) -> None:
    assert [e["effect"] for e in told(capsys, "effects")["effects"]] == list(effects())
    (one,) = told(capsys, "effects", "warmup")["effects"]
    assert one["equation"] == "A_dps·exp(-p/tau_s)"
    assert [p["name"] for p in one["parameters"]] == ["A_dps", "tau_s"]
    assert main(["effects", "warmup"]) == 0
    assert "10 to 120" in capsys.readouterr().out
    assert main(["effects", "warm"]) == 2
    assert "did you mean warmup?" in capsys.readouterr().err


def test_allan_of_a_session(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = told(capsys, "allan", session, "--taus", "0.2,1")
    taus_s, deviations_dps = allan(session, "z", [0.2, 1.0])
    assert found["axis"] == "z"
    assert found["tau_s"] == pytest.approx(taus_s)
    assert found["deviation_dps"] == pytest.approx(deviations_dps)
    assert main(["allan", session, "--axis", "x"]) == 0
    assert "Allan deviation about x" in capsys.readouterr().out
    for wrong, reason in (("9", "--taus 9: it cannot be shown"), ("a", "--taus a: seconds, or several with commas")):
        assert main(["allan", session, "--taus", wrong]) == 2
        assert reason in capsys.readouterr().err


def test_allan_states_the_figures_of_a_datasheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """White noise of 50 mdps at 100 Hz, and beside it a walk of the bias, which makes the curve rise again."""
    rng, n = np.random.default_rng(2), 120_000
    white, walk = rng.normal(0.0, 0.05, (n, 3)), np.cumsum(rng.normal(0.0, 2e-4, (n, 3)), axis=0)
    for name, gyro in (("white", white), ("walking", white + walk)):
        frame = {"t_s": np.arange(n) / 100, **{f"g{a}_dps": gyro[:, i] for i, a in enumerate("xyz")}}
        Session.from_frames([frame], [{"face": "up", "table_rate_dps": 0.0}]).save(tmp_path / name)
    found = told(capsys, "allan", str(tmp_path / "white"))["figures"]
    assert found["noise_density_dps_per_rthz"] == pytest.approx(0.05 / 10, rel=0.03)
    assert found["angle_random_walk_deg_per_rth"] == pytest.approx(60 * 0.05 / 10, rel=0.03)
    curve = told(capsys, "allan", str(tmp_path / "walking"))
    lowest = int(np.argmin(curve["deviation_dps"]))
    assert (curve["figures"]["at_s"], curve["figures"]["bottom"]) == (curve["tau_s"][lowest], True)
    assert curve["figures"]["bias_instability_dps"] == pytest.approx(curve["deviation_dps"][lowest] / 0.664, rel=1e-3)
    assert curve["figures"]["noise_density_dps_per_rthz"] == pytest.approx(0.05 / 10, rel=0.05)
    assert main(["allan", str(tmp_path / "white")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "angle random walk: 0.299 deg/√h; noise density: 4.99 mdps/√Hz for Kalibr, 7.05 in a datasheet" in said
    assert "the curve has no certain bottom" in said


def test_info_says_what_a_session_holds(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    found, opened = told(capsys, "info", f"{session}/session.toml"), Session.open(session)
    assert found["kind"] == "session"
    assert [run["samples"] for run in found["runs"]] == [len(run) for run in opened.runs]
    assert main(["info", session]) == 0
    assert "a session of 6 runs, axis z, 145 Hz" in capsys.readouterr().out


def test_info_says_what_a_model_a_plan_and_a_log_hold(
    session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = told(capsys, "info", MODEL)
    assert (model["kind"], model["model"][:2]) == ("model", ["scale", "bias"])
    assert main(["plan", session, "--measure", "scale", "--minutes", "2", "--out", str(tmp_path / "plan.toml")]) == 0
    assert told(capsys, "info", str(tmp_path / "plan.toml"))["kind"] == "plan"
    log = told(capsys, "info", str(SWING))
    assert (log["kind"], log["rows"], log["guessed"][0]) == ("log", 4350, "t_s=time_ms:ms")
    np.savez(tmp_path / "a.npz", t=np.arange(50) / 10, pressure=np.arange(50.0))
    unknown = told(capsys, "info", str(tmp_path / "a.npz"))
    assert (unknown["columns"], unknown["guessed"]) == (["t", "pressure"], [])
    assert "no gyroscope is recognized" in unknown["unknown"]
    plan = str(tmp_path / "plan.toml")
    for source, says in ((MODEL, "a model, default"), (plan, "a plan of"), (str(SWING), "would take: --map")):
        assert main(["info", source]) == 0
        assert says in capsys.readouterr().out
    assert main(["info", str(tmp_path / "none.csv")]) == 2
    assert "No such file" in capsys.readouterr().err


def test_info_says_what_is_no_recording(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = told(capsys, "info", f"{session}.truth.json")
    assert (truth["kind"], "runs" in truth["keys"]) == ("json", True)
    above = str(Path(session).parent)
    assert told(capsys, "info", above) == {"kind": "sessions", "sessions": ["s"]}
    assert main(["info", above]) == 0
    assert "a folder of 1 session: s" in capsys.readouterr().out
    (tmp_path / "broken.json").write_text("{")
    assert main(["info", str(tmp_path / "broken.json")]) == 2
    assert "no JSON" in capsys.readouterr().err


def test_plot_draws_a_session_and_a_model(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", session, str(tmp_path / "s.png")]) == 0
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")
    assert main(["plot", MODEL, str(tmp_path / "m.svg")]) == 0
    assert "<svg" in (tmp_path / "m.svg").read_text()
    assert main(["plot", session, str(tmp_path / "s.csv")]) == 2
    assert "give a picture's name" in capsys.readouterr().err
    assert not (tmp_path / "s.csv").exists()


def test_plot_draws_the_readings_of_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", str(SWING), "-o", str(tmp_path / "log.png")]) == 0
    assert (tmp_path / "log.png").read_bytes().startswith(b"\x89PNG")
    assert main(["plot", str(tmp_path / "none.csv"), "-o", str(tmp_path / "none.png")]) == 2
    assert "none.csv: No such file" in capsys.readouterr().err


def test_add_says_which_of_its_two_arguments_is_not_there(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["none", "warmup"], ["warmup", "none"]):
        assert main(["add", *words]) == 2
        assert "none/session.toml: no such file" in capsys.readouterr().err
    assert main(["add", "warmpu", session]) == 2
    assert "no effect 'warmpu' (did you mean warmup?)" in capsys.readouterr().err
