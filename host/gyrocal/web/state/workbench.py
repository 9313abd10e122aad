"""The state that all tabs share: session, sequence of models, diagnosis, device. The worker process does long jobs."""

from __future__ import annotations

import contextlib
import random
import shutil
import tempfile
from collections.abc import Callable, Coroutine, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from gyrocal.errors import GyrocalError
from gyrocal.web.device.live import Live
from gyrocal.web.state.jobs import SEARCHES, Jobs
from gyrocal.web.state.on_page import on_page
from gyrocal.web.state.places import Places
from gyrocal.web.state.training import Training
from gyrocal.web.values.models import BY_HAND, Models, Recipe, Step, doubted, read_models, write_models
from gyrocal.web.values.story import story
from gyrocal.web.values.views import CalibrationView, DiagnosisView, ExportView, ModelView, Recording, SessionView, TrainedView

if TYPE_CHECKING:
    from gyrocal.web.state.traces import Traces
    from gyrocal.web.values.excess_by_step import Fall
    from gyrocal.web.values.views import Attempt
    from gyrocal.web.worker.by_gravity import GravityView
    from gyrocal.web.worker.mend import Mend

Topic = Literal[
    "session", "runs", "model", "diagnosis", "calibration", "training", "export", "job", "device", "message", "scheme"
]


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
        self.excluded: frozenset[str] = frozenset()
        """The files of the runs that are left out of every fit."""
        self.models = Models()
        self.gravity: GravityView | None = None
        """The open session if its reference is gravity; :attr:`session` is None then."""
        self.steps: list[Step] = []
        self.undone: list[Step] = []
        self._views: dict[str, ModelView] = {}
        """Every model that was compared with the current choice of runs."""
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
    def not_yet(self) -> str:
        """Why there is no model to show."""
        if self.session is not None:
            return "Comparing the model with the recordings…" if self.jobs.current else "The model has not been compared."
        return "Reading the session…" if self.opening else "Open a session first."

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
        return self.jobs.current is not None and self.jobs.current.method in SEARCHES

    def network(self, axis: str) -> TrainedView | None:
        """The network that was trained for the current model."""
        return self._networks.get((self.steps[-1].view.toml, axis)) if self.steps else None

    @property
    def step(self) -> Step | None:
        return self.steps[-1] if self.steps else None

    @property
    def last_run(self) -> str | None:
        """The file of the only run in the fits, which cannot be left out; None if there are several."""
        used = [] if self.session is None else [run.file for run in self.session.runs if run.file not in self.excluded]
        return used[0] if len(used) == 1 else None

    @property
    def recording(self) -> Recording:
        """The open session without the runs that are left out."""
        assert self.session is not None
        return Recording(self.session.path, self.excluded)

    # What a person can ask for. Each ends with a word to the person where it fails; none raises.

    async def open(self, folder: str | Path) -> None:
        """Read a session and compare the first model with it."""
        with self._telling():
            path = self.places.session(folder)
            self.jobs.cancel()
            self._forget()
            title, self.opening = f"Opening {self.places.name(path)}", True
            try:
                if self.places.is_by_gravity(path):
                    self.gravity = await self.jobs.run(title, "look_by_gravity", path)
                    return
                self.session = await self.jobs.run(title, "open", path)
            finally:
                self.opening = False
                self.changed("session")
            from gyrocal.web.state.traces import Traces

            self.traces = Traces(self.session)
            self.models = read_models(path)
            self.excluded = self.models.excluded & {run.file for run in self.session.runs}
            self.changed("session")
            await self._show_steps(self.models.of[self.models.current])

    def open_named(self, name: str) -> Coroutine[Any, Any, None] | None:
        """What opens the session of this name, if it is another one. The former one is gone at once, with its buttons."""
        found = next((folder for folder in self.places.sessions() if self.places.name(folder) == name), None)
        if found is None or self.opening or (self.session is not None and self.session.path == found):
            return None
        self.jobs.cancel()  # before its folders are gone
        self._forget()
        self.opening = True
        return self.open(found)

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

    async def diagnose(self) -> None:
        with self._telling():
            if self.session is not None and self.step is not None:
                source = self.step.source
                self.found(source, await self.jobs.run("Looking for what is missing", "diagnose", self.recording, source))

    def found(self, source: str, view: DiagnosisView) -> None:
        """Show what the model of this source lacks as soon as it is the current one."""
        self._diagnoses[source] = view
        self.changed("diagnosis")

    async def add(self, effect: str, title: str, formula: str = "") -> str:
        """Add an effect (its id, or a formula) to the model. Undo removes it again. Returns why it was refused, if it was."""
        with self._telling():
            if self.session is None or self.step is None:
                return ""
            cards = () if self.diagnosis is None else self.diagnosis.of(effect)
            asked = (self.recording, self.step.source, effect, title, doubted(self.steps))
            found: Attempt = await self.jobs.run(f"Adding {title.lower()}", "add", *asked)
            if found.view is None:
                return " ".join([found.refused, *(f"What it excludes: {told}." for told in found.limits)])
            self.before = found.before
            kept = (tuple(cards[0].doubts if cards else (BY_HAND,)), "", cards, tuple(found.limits), (), found.proves)
            await self.take(Step(Recipe(found.view.toml, effect, title, False, formula, *kept), found.view))
        return ""

    async def keep(self, name: str) -> None:
        """Find a formula for what is unknown, and add it as an effect of that name."""
        with self._telling():
            if self.session is None or self.step is None:
                return
            formula, view = await self.jobs.run("Looking for a formula", "keep", self.recording, self.step.source, name)
            await self.take(Step(Recipe(view.toml, name, name, formula=formula), view))

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
                view = await self.jobs.run(name, "without", self.recording, self.step.source, effect)
                source = view.toml
            await self.take(Step(Recipe(source, effect, title, removed=True), view))

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
                parity = await self.jobs.run("Checking the trained network", "verify", folder)
                self._networks[toml, axis] = TrainedView(folder, errors, parity)
                self.exported = None
            finally:
                self.training = None
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
                shown = self.fall(), story(self.steps), self.diagnosis, self.calibration
                model = self.step.source, self.step.view.toml
                return str(await self.jobs.run("Writing the report", "report", self.recording, *model, *shown))
        return None

    async def undo(self) -> None:
        await self._move(self.steps, self.undone, 1)

    async def redo(self) -> None:
        await self._move(self.undone, self.steps, 0)

    async def _move(self, source: list[Step], to: list[Step], stay: int) -> None:
        with self._telling():
            if len(source) > stay:
                to.append(source.pop())
                self._remember()
                await self._show_model()

    async def include(self, file: str, included: bool) -> None:
        """Leave a run out of every fit, or take it in again, and fit the models of the current sequence anew."""
        with self._telling():
            if self.session is None or not self.steps or included == (file not in self.excluded):
                return
            runs = {run.file for run in self.session.runs}
            excluded = self.excluded - {file} if included else self.excluded | {file}
            if runs <= excluded:
                self.say("One run at least stays in the fit.")
                return
            self.excluded = frozenset(excluded)
            self._views, self._diagnoses, self._calibrations = {}, {}, {}
            self._remember()
            self.changed("runs")
            await self._show_steps([step.recipe for step in self.steps])

    async def mend(self, mend: Mend) -> None:
        """Mend the session in a way that the user has confirmed, and open it again."""
        with self._telling():
            if self.session is None:
                return
            if mend.kind == "leave_out" and mend.file is not None:
                await self.include(mend.file, False)
                return
            out = self.places.free(f"{self.session.path.name}-mended")
            await self.open(await self.jobs.run(mend.label, "mend", self.session.path, mend, out))

    async def branch(self, name: str) -> None:
        """Keep the current model under its name, and go on with a copy under a new one."""
        name = " ".join(name.split())
        with self._telling():
            if self.steps and name and name not in self.models.of:
                self.models = self.models.with_current(name, self._recipes())
                self._remember()
                self.changed("model")
            elif name in self.models.of:
                self.say(f"There is a model called {name} already; choose another name.")

    async def switch(self, name: str) -> None:
        """Show another of the named models."""
        with self._telling():
            if name in self.models.of and name != self.models.current and self.steps:
                self.models = replace(self.models, current=name)
                self.undone.clear()
                await self._show_steps(self.models.of[name])
                self._remember()

    async def forget(self, name: str) -> None:
        """Remove a named model that is not shown."""
        with self._telling():
            if name in self.models.of and name != self.models.current:
                self.models = replace(self.models, of={k: v for k, v in self.models.of.items() if k != name})
                self._remember()
                self.changed("model")

    # What is shown of it.

    def fall(self) -> Fall | None:
        """The excess error step by step; None if nothing is held out or the session is judged by angle."""
        from gyrocal.web.values.excess_by_step import fall  # the engine, which is loaded by now

        return fall([(step.label, step.view.levels) for step in self.steps])

    def named_views(self) -> dict[str, ModelView | None]:
        """The last model of each name; None for one that has not been fitted since the session was opened."""
        return {
            name: self.steps[-1].view if name == self.models.current else self._views.get(recipes[-1].source)
            for name, recipes in self.models.of.items()
        }

    # How it comes about.

    def _forget(self) -> None:
        rooms = [] if self.session is None else [*self.scratch.glob("[0-9]*")]  # traces of the last session
        self.session = self.traces = self.gravity = self.before = self.exported = None
        self._diagnoses, self._calibrations = {}, {}
        self.steps, self.undone, self._views = [], [], {}
        self.excluded, self.models = frozenset(), Models()
        for room in rooms:
            shutil.rmtree(room, ignore_errors=True)
        self.changed("session")

    async def _show_steps(self, recipes: Sequence[Recipe]) -> None:
        """Compare the models of a sequence with the session, and show the last one."""
        assert self.session is not None
        steps = []
        for recipe in recipes:
            if recipe.source not in self._views:
                name = "Comparing the model with the recordings"
                self._views[recipe.source] = await self.jobs.run(name, "compare", self.recording, recipe.source)
            steps.append(Step(recipe, self._views[recipe.source]))
        self.steps = steps
        self.undone.clear()
        await self._show_model()

    async def take(self, *steps: Step) -> None:
        """Go on with new models, each of which follows from the one before."""
        with self._telling():
            self.steps += steps
            self.undone.clear()
            self._views |= {step.source: step.view for step in steps}
            self._remember()
            await self._show_model()

    def _recipes(self) -> tuple[Recipe, ...]:
        return tuple(step.recipe for step in self.steps)

    def _remember(self) -> None:
        """Keep the models and the choice of runs beside the session."""
        assert self.session is not None
        of = {**self.models.of, self.models.current: self._recipes()}
        self.models = replace(self.models, of=of, excluded=self.excluded)
        problem = write_models(self.session.path, self.models)
        if problem:
            self.say(problem)

    async def _show_model(self) -> None:
        """Show the last step as the current model. Its calibration follows when the worker has computed it."""
        assert self.traces is not None
        step = self.steps[-1]
        self.traces.take(step.view)
        self.exported = None
        self.changed("model")
        models = self._calibrated_models()
        if models in self._calibrations:
            return
        named = {"model at first": models[0]} | ({"model now": models[1]} if len(self.steps) > 1 else {})
        found = await self.jobs.run("Calibrating", "calibrate", self.recording, named)
        self._calibrations[models] = found
        self.changed("calibration")

    @contextlib.contextmanager
    def _telling(self) -> Any:
        try:
            yield
        except GyrocalError as error:
            if str(error):  # a job that waited and was cancelled says nothing
                self.say(on_page(str(error)))
        self.changed("job")
