"""Axes side by side: the same answers, and a failure is not lost."""

import os
import subprocess
import sys
import threading

import pytest

from gyrocal import threads
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.simulation.simulate import simulate


def test_a_diagnosis_is_the_same_with_its_axes_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    session = simulate(None, "paper", ["table_ripple"], 2, scenarios=2, seconds=5)[0]
    one_by_one = diagnose(session).to_json()
    at_work = set()
    monkeypatch.setattr(threads, "MANY_ROWS", 0)
    side_by_side = diagnose(session, progress=lambda _: at_work.add(threading.get_ident())).to_json()
    assert side_by_side == one_by_one
    assert len(at_work) > 2


def test_what_fails_on_one_axis_fails() -> None:
    with pytest.raises(ZeroDivisionError):
        threads.each(lambda x: 1 / x, [2, 1, 0], threads.MANY_ROWS)
    assert threads.each(lambda x: 2 * x, [3, 1], threads.MANY_ROWS) == threads.each(lambda x: 2 * x, [3, 1], 1) == [6, 2]
    assert threads.each(lambda x: x, [], threads.MANY_ROWS) == []


def said_by(code: str) -> str:
    """What a process prints that is told no number of threads."""
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    return subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True).stdout


def test_a_blas_that_is_loaded_on_the_way_has_one_thread_too() -> None:
    code = (
        "from threadpoolctl import threadpool_info\n"
        "from gyrocal.threads import one_thread\n"
        "def work():\n"
        "    import scipy.linalg, scipy.optimize\n"
        "    return [p['num_threads'] for p in threadpool_info() if p['user_api'] == 'blas']\n"
        "print(sorted({*one_thread(work)()}))\n"
    )
    assert said_by(code) == "[1]\n"


def test_the_command_line_loads_linear_algebra_with_one_thread() -> None:
    """Files are read and references smoothed before a fit limits its threads."""
    code = (
        "import sys\n"
        "from gyrocal.__main__ import main\n"
        "sys.argv = ['gyrocal', 'version']\n"
        "main()\n"
        "import numpy\n"
        "from threadpoolctl import threadpool_info\n"
        "print(*(p['num_threads'] for p in threadpool_info() if p['user_api'] == 'blas'))\n"
    )
    assert said_by(code).splitlines()[-1] == "1"
