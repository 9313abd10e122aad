"""The state that all tabs share: session, sequence of models, diagnosis, device. The worker process does long jobs."""

from __future__ import annotations

import contextlib
import math
import random
import shutil
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from gyrocal.errors import GyrocalError
from gyrocal.web.jobs import Cancelled, Jobs
from gyrocal.web.live import Live
from gyrocal.web.places import Places
from gyrocal.web.training import Training
from gyrocal.web.views import Bar, CalibrationView, DiagnosisView, ExportView, ModelView, SessionView, TrainedView

if TYPE_CHECKING:
    from gyrocal.web.by_gravity import GravityView
    from gyrocal.web.traces import Traces

Topic = Literal["session", "model", "diagnosis", "calibration", "training", "export", "job", "device", "message"]

START = "default"


@dataclass(frozen=True)
class Step:
    """One model of the sequence: the first one, or the result of adding or removing an effect."""

    source: str
    """The model for the engine: the name of a built-in model, or TOML text."""
    view: ModelView
    effect: str = ""
    title: str = "model at first"
    removed: bool = False
    formula: str = ""
    """The formula of an effect that is not in the library."""


class Workbench:
    """The shared state. ``changed(topic)`` is called in the event loop; ``message`` is the latest message to the user."""

    def __init__(self, roots: Iterable[Path], changed: Callable[[Topic], None]) -> None:
        self.places = Places(roots)
        self.scratch = Path(tempfile.mkdtemp(prefix="gyrocal-workbench-"))
        self.changed = changed
        self.jobs = Jobs(self.scratch, lambda: changed("job"))
        self.live = Live(lambda: changed("device"))
        self.message = ""
        self.opening = False
        self.session: SessionView | None = None
        self.traces: Traces | None = None
        self.gravity: GravityView | None = None
        """The open session if its reference is gravity; :attr:`session` is None then."""
        self.steps: list[Step] = []
        self.undone: list[Step] = []
        self.diagnosed: DiagnosisView | None = None
        """The last diagnosis, for the report. :attr:`diagnosis` is that of the current model."""
        self._diagnoses: dict[str, DiagnosisView] = {}
        self._calibrations: dict[tuple[str, str], CalibrationView] = {}
        self.training: Training | None = None
        """The training in progress, which runs beside all other jobs."""
        self._networks: dict[tuple[str, str], TrainedView] = {}
        self.exported: ExportView | None = None
        self.before: dict[str, Any] | None = None
        """The value of `before` in `gyrocal add --json` for the latest step."""

    def close(self) -> None:
        if self.training is not None:
            self.training.close()
        self.live.close()
        self.jobs.close()
        shutil.rmtree(self.scratch, ignore_errors=True)

    def say(self, text: str) -> None:
        self.message = text
        self.changed("message")

    @property
    def diagnosis(self) -> DiagnosisView | None:
        return self._diagnoses.get(self.steps[-1].source) if self.steps else None

    @property
    def calibration(self) -> CalibrationView | None:
        return self._calibrations.get(self._calibrated_models()) if self.steps else None

    def _calibrated_models(self) -> tuple[str, str]:
        return self.steps[0].view.toml, self.steps[-1].view.toml

    @property
    def searching(self) -> bool:
        """True while the model is diagnosed or changed. A request made now would concern the previous model."""
        return self.jobs.current is not None and self.jobs.current.method in ("diagnose", "add", "keep", "without")

    def network(self, axis: str) -> TrainedView | None:
        """The network that was trained for the current model."""
        return self._networks.get((self.steps[-1].view.toml, axis)) if self.steps else None

    @property
    def step(self) -> Step | None:
        return self.steps[-1] if self.steps else None

    # What a person can ask for. Each ends with a word to the person where it fails; none raises.

    async def open(self, folder: str | Path) -> None:
        """Read a session and compare the first model with it."""
        with self._telling():
            path = self.places.session(folder)
            self.jobs.cancel()
            self._forget()
            if self.places.is_by_gravity(path):
                title = f"Opening {self.places.name(path)}, a session by gravity"
                self.gravity = await self.jobs.run(title, "look_by_gravity", path)
                self.changed("session")
                return
            self.opening = True
            try:
                self.session = await self.jobs.run(f"Opening {self.places.name(path)}", "open", path)
            finally:
                self.opening = False
                self.changed("session")
            from gyrocal.web.traces import Traces

            self.traces = Traces(self.session)
            self.changed("session")
            await self._compare()

    async def simulate(self, effects: list[str], scenarios: int = 6, seconds: float = 40.0) -> None:
        """Simulate a session with a hidden effect, for trying out the workbench."""
        with self._telling():
            seed = random.randrange(1, 10_000)
            out = self.places.free("simulated")
            await self.jobs.run("Simulating a recording", "simulate", out, effects, seed, scenarios, seconds)
            await self.open(out)

    async def ask(self, title: str, method: str, *args: Any) -> Any:
        """The answer of a method of the worker; None if it failed, which the user is told."""
        with self._telling():
            return await self.jobs.run(title, method, *args)
        return None

    async def diagnose(self) -> None:
        with self._telling():
            if self.session is not None and self.step is not None:
                source = self.step.source
                found = await self.jobs.run("Looking for what is missing", "diagnose", self.session.path, source)
                self._diagnoses[source] = self.diagnosed = found
                self.changed("diagnosis")

    async def add(self, effect: str, title: str, formula: str = "") -> None:
        """Add an effect (its id, or a formula) to the model. Undo removes it again."""
        with self._telling():
            if self.session is None or self.step is None:
                return
            before, view = await self.jobs.run(f"Adding {title.lower()}", "add", self.session.path, self.step.source, effect)
            self.before = before
            await self._take(Step(view.toml, view, effect, title, formula=formula))

    async def keep(self, name: str) -> None:
        """Find a formula for what is unknown, and add it as an effect of that name."""
        with self._telling():
            if self.session is None or self.step is None:
                return
            formula, view = await self.jobs.run("Looking for a formula", "keep", self.session.path, self.step.source, name)
            await self._take(Step(view.toml, view, name, name, formula=formula))

    async def remove(self, effect: str, title: str) -> None:
        """Remove an effect from the model. The result may be an earlier model, or one that must be fitted."""
        with self._telling():
            if self.session is None or self.step is None:
                return
            left = {i for i, _, _ in self.step.view.effects} - {effect}
            known = next((s for s in reversed(self.steps) if {i for i, _, _ in s.view.effects} == left), None)
            if known is not None:
                source, view = known.source, known.view
            else:
                name = f"Removing {title.lower()}"
                view = await self.jobs.run(name, "without", self.session.path, self.step.source, effect)
                source = view.toml
            await self._take(Step(source, view, effect, title, removed=True))

    async def train(self, name: str, axis: str, epochs: int) -> None:
        """Train a network for the current model in a new folder. Fits may run at the same time."""
        with self._telling():
            if self.step is None or self.training is not None:
                return
            toml, folder = self.step.view.toml, self.places.new(name)
            model = self.scratch / "trained.toml"
            model.write_text(toml, encoding="utf-8")
            self.training = Training(model, axis, epochs, folder, lambda: self.changed("training"))
            self.changed("training")
            try:
                errors = await self.training.run()
            finally:
                self.training = None
                self.changed("training")
            parity = await self.jobs.run("Checking the trained network", "verify", folder)
            self._networks[toml, axis] = TrainedView(folder, errors, parity)
            self.exported = None
            self.changed("training")
            self.say(f"The network is trained and in {self.places.name(folder)}.")

    async def export(self, name: str, axis: str) -> None:
        """Write a firmware project with this model's header, and verify the C network against onnxruntime."""
        with self._telling():
            if self.session is not None and self.step is not None:
                folder, toml, trained = self.places.new(name), self.step.view.toml, self.network(axis)
                network = None if trained is None else trained.folder
                self.exported = await self.jobs.run("Writing the firmware project", "export", folder, toml, axis, network)
                self.changed("export")

    async def report(self) -> str | None:
        """Write everything on the screen as one HTML file and return its path; None if it failed."""
        with self._telling():
            if self.session is not None and self.step is not None:
                text: str = await self.jobs.run(
                    "Writing the report", "report", self.session.path, self.step.source, self.step.view.toml,
                    self.waterfall(), self.floor_mdps(), self.diagnosed, self.calibration,
                )  # fmt: skip
                return text
        return None

    async def undo(self) -> None:
        with self._telling():
            if len(self.steps) > 1:
                self.undone.append(self.steps.pop())
                await self._show_model()

    async def redo(self) -> None:
        with self._telling():
            if self.undone:
                self.steps.append(self.undone.pop())
                await self._show_model()

    # What is shown of it.

    def waterfall(self) -> list[Bar]:
        """The excess error step by step, over the floor of the richest model, as in `gyrocal add`; empty if judged by angle."""
        if not self.steps or self.steps[0].view.compared.get("rms_dps") is None:
            return []
        richest = max(self.steps, key=lambda s: len(s.view.compared["parameters"]))
        floor = richest.view.compared["floor_dps"]
        excess = [1e3 * math.sqrt(max(0.0, s.view.compared["rms_dps"] ** 2 - floor**2)) for s in self.steps]
        bars = [Bar(self.steps[0].title, 0.0, excess[0])]
        for step, old, new in zip(self.steps[1:], excess, excess[1:], strict=False):
            bars.append(Bar(("without " if step.removed else "") + step.title, old, new))
        return bars

    def floor_mdps(self) -> float:
        return 1e3 * max(self.steps, key=lambda s: len(s.view.compared["parameters"])).view.compared.get("floor_dps", 0.0)

    # How it comes about.

    def _forget(self) -> None:
        self.session = self.traces = self.gravity = self.diagnosed = self.before = self.exported = None
        self._diagnoses, self._calibrations = {}, {}
        self.steps, self.undone = [], []
        for room in self.scratch.glob("[0-9]*"):  # traces of the last session
            shutil.rmtree(room, ignore_errors=True)
        self.changed("session")

    async def _compare(self) -> None:
        assert self.session is not None
        view = await self.jobs.run("Comparing the model with the recordings", "compare", self.session.path, START)
        await self._take(Step(START, view))

    async def _take(self, step: Step) -> None:
        self.steps.append(step)
        self.undone.clear()
        await self._show_model()

    async def _show_model(self) -> None:
        """Show the last step as the current model. Its calibration follows when the worker has computed it."""
        assert self.session is not None
        assert self.traces is not None
        step = self.steps[-1]
        self.traces.take(step.view)
        self.exported = None
        self.changed("model")
        models = self._calibrated_models()
        if models in self._calibrations:
            return
        named = {"model at first": models[0]} | ({"model now": models[1]} if len(self.steps) > 1 else {})
        found = await self.jobs.run("Calibrating", "calibrate", self.session.path, named)
        self._calibrations[models] = found
        self.changed("calibration")

    @contextlib.contextmanager
    def _telling(self) -> Any:
        try:
            yield
        except Cancelled as stopped:
            if str(stopped):
                self.say(str(stopped))
        except GyrocalError as error:
            self.say(str(error))
        self.changed("job")
