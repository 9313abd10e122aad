"""The worker: results, progress, errors, a stop at any moment."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gyrocal.errors import GyrocalError
from gyrocal.simulation.simulate import simulate
from gyrocal.web.state.jobs import Cancelled, Jobs
from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.views import Recording

from .loop import finish


def test_results_errors_and_a_stop(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    simulate(folder, scenarios=3, seconds=20, effects=["table_ripple"])

    async def story() -> None:
        words: list[str] = []
        jobs = Jobs(tmp_path / "scratch", lambda: words.append(jobs.current.text if jobs.current else "-"))
        try:
            opened = await jobs.run("open", "open", folder)
            assert opened.rows == 6 * 2900
            with pytest.raises(GyrocalError, match=r"no such file; a session is a folder"):
                await jobs.run("open", "open", tmp_path / "none")
            with pytest.raises(GyrocalError, match="model nonsense: neither"):
                await jobs.run("compare", "compare", Recording(folder), "nonsense")

            words.clear()
            running = asyncio.create_task(jobs.run("look", "diagnose", Recording(folder), "default"))
            waiting = asyncio.create_task(jobs.run("look", "compare", Recording(folder), "default"))
            while not any("fitting" in w for w in words):
                await asyncio.sleep(0.01)
            assert jobs.current is not None
            assert jobs.current.title == "look"
            jobs.cancel()
            for task in (running, waiting):
                with pytest.raises(Cancelled):
                    await task
            assert not any("weighing" in w for w in words)  # what comes last: it was not waited for
            assert jobs.current is None

            again = await jobs.run("open", "open", folder)  # a new worker, as good as the old
            assert again.rows == opened.rows
            assert again.traces != opened.traces
        finally:
            jobs.close()

    finish(story())


def test_a_stop_that_comes_with_the_answer_leaves_a_worker_that_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "s"
    simulate(folder, scenarios=1, seconds=5)

    async def story() -> None:
        jobs = Jobs(tmp_path / "scratch", lambda: None)
        converse = jobs._converse

        async def stopped_at_the_end(*asked: Any) -> Any:
            answer = await converse(*asked)
            jobs.cancel()
            return answer

        try:
            with monkeypatch.context() as late:
                late.setattr(jobs, "_converse", stopped_at_the_end)
                with pytest.raises(Cancelled, match="open: stopped"):
                    await jobs.run("open", "open", folder)
            assert (await jobs.run("open", "open", folder)).rows == 2 * 725
        finally:
            jobs.close()

    finish(story())


@pytest.mark.wide
def test_a_job_that_was_sent_ahead_is_done_once_and_gives_way_to_another(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    simulate(folder, scenarios=1, seconds=5)

    async def story() -> None:
        jobs = Jobs(tmp_path / "scratch", lambda: None)
        try:
            jobs.prepare("open", folder)
            opened = await jobs.run("open", "open", folder)
            assert opened.rows == 2 * 725
            assert len(list((tmp_path / "scratch").iterdir())) == 1
        finally:
            jobs.close()
        jobs = Jobs(tmp_path / "scratch", lambda: None)
        try:
            jobs.prepare("open", tmp_path / "none")
            assert (await jobs.run("open", "open", folder)).rows == 2 * 725
        finally:
            jobs.close()

    finish(story())


@pytest.mark.wide
def test_a_session_that_was_read_ahead_is_shown(tmp_path: Path) -> None:
    simulate(tmp_path / "s", scenarios=1, seconds=5)

    async def story() -> None:
        bench = Workbench([tmp_path], lambda topic: None)
        try:
            bench.jobs.prepare("open", bench.places.session(tmp_path / "s"))
            while not list(bench.scratch.glob("*/measured/samples.npy")):  # it is done before it is asked for
                await asyncio.sleep(0.05)
            await bench.open(tmp_path / "s")
            assert not bench.message
            assert bench.step is not None
        finally:
            bench.close()

    finish(story())
