"""A demonstration without hardware: a hidden effect is detected, named and added, and the device's error falls.

A campaign is recorded from the simulated device through its virtual serial port. Its turntable has a ripple that is missing in
the device's calibration. The recording is compared with the model, the effect is named and added, and new headers are written.
The device is built again with them, and calibrates new scenarios on which nothing was fitted.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.calibration import header
from gyrocal.calibration.calibrate import Estimate
from gyrocal.core.verify import verify
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder
from gyrocal.device.simulated import SimulatedDevice, replay
from gyrocal.device.wire import Sentence
from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.digits import percentage
from gyrocal.error_model.model import Model
from gyrocal.errors import GyrocalError, InputError
from gyrocal.present.output import mdps, stdout, table
from gyrocal.recording.session import Session
from gyrocal.simulation.campaigns import RIPPLE
from gyrocal.simulation.simulate import simulate

HIDDEN = RIPPLE
MARK = ".gyrocal-demo"
CAMPAIGN_SCENARIOS, CAMPAIGN_SECONDS = 9, 30.0
TEST_SCENARIOS, TEST_SECONDS = 24, 7.0
SECONDS = (2.0, 4.0, 6.0)
MISFIT = (
    "A misfit of 1 means that noise explains what an answer leaves over. Where scale and bias alone (baseline) leave more, the "
    "device does not trust the answer. The network (cnn) was trained on tables that ripple, and its misfit allows for a ripple."
)

Progress = Callable[[str], None]
Errors = dict[str, dict[float, tuple[float, float]]]


@dataclass(frozen=True)
class Answers:
    """The device's answers for new scenarios, and their mean errors against the truth."""

    estimates: list[Estimate]
    errors: Errors

    @property
    def methods(self) -> list[str]:
        """The methods that answered, in the device's order."""
        return list(dict.fromkeys(e.method for e in self.estimates))

    def of(self, method: str, seconds: float) -> list[Estimate]:
        """One method's estimates from the first seconds of each run."""
        return [e for e in self.estimates if e.method == method and e.seconds == seconds]

    def error(self, method: str, seconds: float) -> tuple[float | None, float | None]:
        """Mean errors of scale and bias, deg/s; None where the method gave no answer."""
        return self.errors.get(method, {}).get(seconds, (None, None))

    def misfit(self, method: str, seconds: float) -> float | None:
        """The median misfit."""
        known = [e.misfit for e in self.of(method, seconds) if e.misfit is not None]
        return float(np.median(known)) if known else None

    def trusted(self, method: str, seconds: float) -> int:
        """How many of the estimates the device trusts."""
        return sum(e.trusted for e in self.of(method, seconds))


@dataclass(frozen=True)
class Story:
    """Everything the demo shows."""

    truth: dict[str, float]
    before: Answers
    diagnosis: Diagnosis
    compared: tuple[Comparison, Comparison]
    after: Answers
    parity: dict[str, Any]
    model: Model
    folder: Path = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        def part(comparison: Comparison, answers: Answers) -> dict[str, Any]:
            return {"compare": comparison.to_json(), "estimates": [e.to_json() for e in answers.estimates]}

        return {
            "truth": self.truth,
            "before": part(self.compared[0], self.before),
            "diagnosis": self.diagnosis.to_json(),
            "after": part(self.compared[1], self.after),
            "parity": self.parity,
        }


def demo(folder: Path, seed: int = 1, progress: Progress = lambda _: None) -> Story:
    """Run the story; recordings, model, headers and picture are left in ``folder``, which must be new."""
    _fresh_folder(folder)
    progress("simulating a campaign with a hidden ripple of the table's speed")
    hidden, _ = simulate(
        None, "paper", [HIDDEN], seed, scenarios=CAMPAIGN_SCENARIOS, seconds=CAMPAIGN_SECONDS, vary=True
    )
    # the same sensor with one truth, so that every answer can be compared with it
    fresh, truth = simulate(
        None, "paper", [HIDDEN], seed + 1000, scenarios=TEST_SCENARIOS, seconds=TEST_SECONDS, turn_on_sd_dps=0.0, sensor=seed
    )  # fmt: skip
    truths = {run.scenario: t for run, t in zip(fresh.runs, truth["runs"], strict=True)}

    progress("building the firmware's core as a simulated device, recording from its port")
    recorded = record_from_port(hidden, folder / "recorded")

    progress("asking the device for answers with its present model: eq. (4)")
    before = _answers(replay(fresh, stream="off"), fresh, truths)

    explanation = explain(recorded, progress=progress)
    diagnosis, model = explanation.first, explanation.model
    if not explanation.steps:
        raise GyrocalError(f"the demo's effect was not found: verdict {diagnosis.verdict}; try another --seed")
    compared = explanation.steps[0].before, explanation.steps[-1].after
    model.save(folder / "model.toml")

    progress("writing headers, building the device with them, running it again")
    include = folder / "include"
    header.write(model, include / "calibration.h")
    after = _answers(replay(fresh, stream="off", include_dir=include), fresh, truths)

    progress("comparing the C network with onnxruntime")
    story = Story(
        {"scale": truth["runs"][0]["scale"][2], "bias_dps": truth["runs"][0]["bias_dps"][2]},
        before, diagnosis, compared, after, _parity(seed), model, folder,
    )  # fmt: skip
    draw(story)
    return story


def _fresh_folder(folder: Path) -> None:
    """An empty folder. The folder of an earlier demo is replaced, any other folder is an error."""
    if folder.exists():
        if not (folder / MARK).is_file():
            raise InputError(f"{folder}: exists already and was not written by a demo; choose another folder with --out")
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    (folder / MARK).write_text("This folder is made anew by each `gyrocal demo`.\n", encoding="utf-8")


def record_from_port(session: Session, out: Path) -> Session:
    """Replay a session, day by day, through the device's virtual port, and record what comes."""
    for day in session.days:
        runs = [run for run in session.runs if run.day == day]
        with SimulatedDevice(session.with_runs(runs)) as device, Link(device.port) as link:
            Recorder(link, out, wanted=None, scenario=runs[0].scenario, day=day).record()
    return Session.open(out)


def _answers(sentences: Iterable[Sentence], fresh: Session, truths: dict[str, Any]) -> Answers:
    """``$CAL`` sentences as estimates. The device calibrates a scenario when its second run is in."""
    scenarios = iter(fresh.scenarios)
    current = ""
    estimates: list[Estimate] = []
    for sentence in sentences:
        if sentence.tag == "RUN" and sentence.fields["state"] == "start" and sentence.fields["face"] == "up":
            current = next(scenarios)
        if sentence.tag != "CAL":
            continue
        said = sentence.fields
        seconds = float(said["seconds"])
        scale, bias_dps = sentence.real("scale"), sentence.real("bias_dps")
        estimates.append(
            Estimate(
                current,
                said["method"],
                seconds,
                said["axis"],
                scale,
                sentence.real("scale_se"),
                bias_dps,
                sentence.real("bias_se_dps"),
                sentence.real("misfit"),
                tuple(filter(None, said.get("flags", "").split("+"))),
            )
        )
    return Answers(estimates, errors(estimates, truths))


def errors(estimates: Iterable[Estimate], truths: dict[str, Any]) -> Errors:
    """Mean absolute error of scale and bias (deg/s) by method and seconds."""
    found: dict[str, dict[float, list[tuple[float, float]]]] = {}
    for e in estimates:
        truth = truths[e.scenario]
        if e.scale is None or e.bias_dps is None:
            continue
        error = (abs(e.scale - truth["scale"][2]), abs(e.bias_dps - truth["bias_dps"][2]))
        found.setdefault(e.method, {}).setdefault(e.seconds, []).append(error)
    return {
        m: {s: (float(np.mean([x[0] for x in v])), float(np.mean([x[1] for x in v]))) for s, v in by.items()}
        for m, by in found.items()
    }  # fmt: skip


def _parity(seed: int) -> dict[str, Any]:
    """The shipped network in C against onnxruntime."""
    found = verify(seed=seed)
    return {"max_abs_diff": found["max_abs_diff"], "ok": found["ok"], "windows": found["windows"]}


def draw(story: Story) -> None:
    """``errors.png``: the device's mean error before and after, against seconds."""
    from gyrocal.present import pictures

    lines = {f"{m}, before": story.before.errors[m] for m in ("baseline", "cnn") if m in story.before.errors}
    lines |= {"model, with the effect added": story.after.errors["model"]}
    figure = pictures.calibration_errors(lines, "The device's calibration error before and after the effect was added")
    figure.savefig(story.folder / "errors.png")


def _error_words(error: tuple[float | None, float | None]) -> tuple[str, str]:
    """Errors of scale, percent, and bias, thousandths of deg/s."""
    scale, bias_dps = error
    return "-" if scale is None else f"{scale * 100:.4f}", mdps(bias_dps)


def _trust_words(answers: Answers, method: str, seconds: float) -> tuple[str, str]:
    """The median misfit, and how many of the answers the device trusts."""
    misfit = answers.misfit(method, seconds)
    return "-" if misfit is None else f"{misfit:.1f}", str(answers.trusted(method, seconds))


def show(story: Story) -> None:
    """The story on the terminal."""
    from gyrocal.present.report import print_before_after, print_comparison, sizes, verdict_text

    stdout.print("\n1. The device calibrates with eq. (4): scale, bias, white noise", style="bold")
    rows = [
        [m, f"{s:g}", *_error_words(story.before.error(m, s)), *_trust_words(story.before, m, s)]
        for m in story.before.methods for s in SECONDS
    ]  # fmt: skip
    table(
        f"mean error of {TEST_SCENARIOS} scenarios against the truth, and how many answers the device trusts",
        ["method:", "seconds", "scale %", "bias mdps", "misfit", "trusted"],
        rows,
    )
    stdout.print(MISFIT)

    stdout.print("\n2. The recording compared with the model", style="bold")
    print_comparison(story.compared[0])

    stdout.print("\n3. What is missing?", style="bold")
    best = story.diagnosis.best
    assert best is not None
    stdout.print(verdict_text(story.diagnosis))
    gain_se = "" if best.gain_se is None else f" ± {best.gain_se:.0f}"
    stdout.print(f"Held-out gain in log-likelihood: {best.gain:.0f}{gain_se}; {sizes(best)}")

    stdout.print("\n4. Added to the model", style="bold")
    print_before_after(*story.compared, story.folder / "model.toml")

    stdout.print("\n5. Headers written, the device run again on the same fresh scenarios", style="bold")
    rows = []
    for s in SECONDS:
        old, new = story.before.errors["baseline"][s], story.after.errors["model"][s]
        (old_scale, old_bias), (new_scale, new_bias) = _error_words(old), _error_words(new)
        less = percentage(float(1 - np.mean([new[0] / old[0], new[1] / old[1]])))
        rows.append([f"{s:g}", old_scale, new_scale, old_bias, new_bias, less, *_trust_words(story.after, "model", s)])
    table(
        "mean error of the device's answer, baseline before and model after",
        ["seconds", "scale % before", "after", "bias mdps before", "after", "less error", "misfit", "trusted"], rows,
    )  # fmt: skip
    told = "agree" if story.parity["ok"] else "DISAGREE"
    stdout.print(
        f"C network and onnxruntime {told} on {story.parity['windows']} windows: "
        f"largest difference {story.parity['max_abs_diff']:.1e}"
    )
    stdout.print(f"Recording, model, headers and errors.png are in {story.folder}/")
