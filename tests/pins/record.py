"""Record what the commands answer on eight small sessions, so that a change of layout can be told from a change of behaviour.

``python tests/pins/record.py`` writes ``tests/pins/<session>.json`` anew; with names of sessions, only these. ``--check``
compares instead of writing, and exits with 1 where an answer changed. A deliberate change of behaviour is recorded again, and
the difference that git shows is part of its commit. ``kept.py`` chooses what is recorded, and ``compare.py`` what is the same.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from gyrocal.api import Run, Session, simulate
from gyrocal.cli import main
from gyrocal.device.simulated import replay
from pins import kept
from pins.compare import differences

HERE = Path(__file__).resolve().parent
ADDED_EFFECT = {"swing": "lag", "turns": "bias_temperature", "rest": "bias_temperature"}
"""What ``add`` adds; elsewhere the ripple of the table."""
EXPLAINED = ("paper", "rest", "table2")
"""Sessions whose story ``explain`` tells."""
SEED = 11


def of_campaign(campaign: str, effects: tuple[str, ...], scenarios: int, seconds: float) -> Callable[[Path], None]:
    """A function that writes a simulated session into a folder."""
    return lambda folder: void(simulate(folder, campaign, effects, SEED, scenarios=scenarios, seconds=seconds))


def void(_: object) -> None:
    """Drop a value where a function must return none."""


def rest_only(folder: Path) -> None:
    """The runs at rest of the campaign ``full``, with a temperature drift of the bias."""
    effect = ("bias_temperature:k1_dps_per_c=0.02",)
    session, _ = simulate(None, "full", effect, SEED, scenarios=3, seconds=20.0)
    still = [run for run in session.runs if run.table_rate_dps == 0]
    session.with_runs(still).save(folder)


def noisy_and_clipped(folder: Path) -> None:
    """White noise of 0.6 deg/s, one reading in 200 thrown off, and clipping at 79 deg/s."""
    rng = np.random.default_rng(SEED)
    session, _ = simulate(None, "paper", (), SEED, scenarios=4, seconds=12.0)

    def disturbed(run: Run) -> pl.DataFrame:
        y_dps = run.gyro_dps + rng.normal(0, 0.6, run.gyro_dps.shape)
        y_dps[rng.random(len(run)) < 0.005] += 5.0
        y_dps = np.round(np.clip(y_dps, -79.0, 79.0), 6)
        return run.table.with_columns(pl.Series(f"g{axis}_dps", y_dps[:, i]) for i, axis in enumerate("xyz"))

    runs = tuple(replace(run, frame=disturbed(run), lsb_dps=None) for run in session.runs)
    Session(145.0, runs, full_scale_dps=79.0).save(folder)


def known_turns(folder: Path) -> None:
    """Others' recording, imported: turned by hand by 360 deg and back, with a rest before, three power cycles."""
    rng = np.random.default_rng(SEED)
    rate_hz, n = 50.0, 600
    t_s = np.arange(n) / rate_hz
    hump = np.where((t_s > 4) & (t_s < 8), np.sin(np.pi * (t_s - 4) / 4) ** 2, 0.0)
    for cycle in range(3):
        for turn_deg in (360.0, -360.0):
            rate_dps = turn_deg * hump / (hump.sum() / rate_hz)
            y_dps = 1.006 * rate_dps + 0.08 + 0.01 * cycle + rng.normal(0, 0.05, n)
            name = f"{cycle}_{'there' if turn_deg > 0 else 'back'}"
            source = folder.parent / f"{name}.csv"
            rest_dps = rng.normal(0.02, 0.05, (2, n))
            columns = {"t": t_s, "x": rest_dps[0], "y": rest_dps[1], "z": y_dps, "temp": 24 + 0.02 * t_s + cycle}
            pl.DataFrame({key: np.round(value, 6) for key, value in columns.items()}).write_csv(source)
            cuts = ["--run", f"{name}_rest:0s:3.5s", "--run", f"{name}_turn:3.5s:12s"]
            meta = ["--run-meta", "*_rest:rate=0", "--run-meta", f"*_turn:turn={turn_deg:g}"]
            gyro = [part for axis in "xyz" for part in ("--map", f"g{axis}_dps={axis}")]
            command(
                "import", str(source), str(folder), "--map", "t_s=t", *gyro, "--map", "temp_c=temp", *cuts, *meta,
                "--scenario", f"s{cycle}", "--day", str(cycle + 1), *(["--append"] if folder.exists() else []),
            )  # fmt: skip


SESSIONS: dict[str, Callable[[Path], None]] = {
    "paper": of_campaign("paper", ("table_ripple", "bias_temperature:k1_dps_per_c=0.02"), 6, 15.0),
    "full": of_campaign("full", ("scale_asymmetry:k=0.002", "vibration_tone:f_hz=17,A_dps=0.1"), 2, 8.0),
    "swing": of_campaign("swing", ("lag:tau_s=0.02",), 2, 20.0),
    "bench": of_campaign("bench", ("misalignment:m=0.01", "g_sensitivity"), 1, 8.0),
    "table2": of_campaign("table2", (), 5, 10.0),
    "turns": known_turns,
    "rest": rest_only,
    "noisy": noisy_and_clipped,
}


def command(*arguments: str) -> tuple[int, str]:
    """Exit code and standard output of ``gyrocal ARGUMENTS``."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        code = main(list(arguments))
    return code, out.getvalue()


def answer(kept: Callable[[Any], Any], *arguments: str) -> Any:
    """What is pinned of a command's answer; where it failed, its exit code."""
    code, text = command(*arguments, "--json")
    return kept(json.loads(text)) if code == 0 else {"exit_code": code}


def record(name: str, folder: Path) -> dict[str, Any]:
    """Everything that is pinned of one session, which is made in ``folder`` if it is not there."""
    path, model = folder / name, folder / f"{name}.toml"
    if not path.exists():
        SESSIONS[name](path)
    recorded = {
        "compare": answer(kept.of_compare, "compare", str(path)),
        "diagnose": answer(kept.of_diagnose, "diagnose", str(path)),
        "add": answer(kept.of_add, "add", ADDED_EFFECT.get(name, "table_ripple"), str(path), "--model", str(model)),
        "calibrate": answer(kept.of_calibrate, "calibrate", str(path)),
    }
    if name in EXPLAINED:
        recorded["explain"] = answer(kept.of_explain, "explain", str(path), "--model", str(folder / "explained.toml"))
    if model.exists():
        again = answer(kept.of_compare, "compare", str(path), "--model", str(model))
        recorded["compare_with_model"] = {"as_added": again == recorded["add"].get("after")}
        recorded["calibrate_with_model"] = answer(kept.of_calibrate_with_model, "calibrate", str(path), "--model", str(model))
    if name == "table2":
        recorded |= of_the_device(path, model, folder)
    return recorded


def of_the_device(session: Path, model: Path, folder: Path) -> dict[str, Any]:
    """The exported headers and every ``$CAL`` of a replay through the core that includes them."""
    out = folder / "export"
    code, _ = command("export", "--model", str(model), "--out", str(out))
    if code:
        return {"export": {"exit_code": code}}
    said = replay(session, stream="off", include_dir=out)
    return {
        "calibration.h": kept.header((out / "calibration.h").read_text(encoding="utf-8")),
        "weights.h": {"sha256": hashlib.sha256((out / "weights.h").read_bytes()).hexdigest()},
        "cal": kept.of_the_device({key: as_number(text) for key, text in s.fields.items()} for s in said if s.tag == "CAL"),
    }


def as_number(text: str) -> int | float | str:
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def check(name: str, folder: Path) -> list[str]:
    """The differences of one session from its file."""
    pinned = json.loads((HERE / f"{name}.json").read_text(encoding="utf-8"))
    return [f"{name}{line}" for line in differences(pinned, record(name, folder))]


def run(names: list[str], checking: bool) -> int:
    failed = False
    for name in names or list(SESSIONS):
        with tempfile.TemporaryDirectory() as folder:
            if checking:
                lines = check(name, Path(folder))
                print("\n".join(lines) if lines else f"{name}: as pinned")
                failed |= bool(lines)
            else:
                text = json.dumps(record(name, Path(folder)), indent=1, ensure_ascii=False)
                (HERE / f"{name}.json").write_text(text + "\n", encoding="utf-8")
                print(f"{name}: recorded")
    return int(failed)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("names", nargs="*", help=f"of sessions: {', '.join(SESSIONS)}; none: all")
    parser.add_argument("--check", action="store_true", help="compare with what is recorded")
    given = parser.parse_args()
    sys.exit(run(given.names, given.check))
