"""A result is computed once for the same runs, and again for others."""

from collections.abc import Sequence
from dataclasses import replace

from gyrocal.effects import byte_fault
from gyrocal.recording.once import once, once_a_run
from gyrocal.recording.session import Run
from gyrocal.simulation.simulate import simulate


def test_the_same_runs_and_axis_are_asked_once() -> None:
    asked = []

    @once
    def size(runs: Sequence[Run], axis: int) -> int:
        asked.append((len(runs), axis))
        return len(runs) + axis

    runs = simulate(None, "paper", scenarios=2, seconds=2.0)[0].runs
    assert [size(runs, 1), size(list(runs), 1), size(runs, 2), size(runs, 1)] == [5, 5, 6, 5]
    assert asked == [(4, 1), (4, 2)]
    changed = [replace(runs[0], lsb_dps=0.1), *runs[1:]]
    assert [size(changed, 1), size(runs[:2], 1), size([], 1)] == [5, 3, 1]
    assert asked[2:] == [(4, 1), (2, 1), (0, 1)]


def test_a_lost_carry_is_sought_once_for_an_axis() -> None:
    runs = simulate(None, "paper", ["byte_fault"], 3, scenarios=3, seconds=8.0)[0].runs
    found = byte_fault.lost_carry(runs, 2)
    assert found is byte_fault.lost_carry(runs, 2)


def test_a_result_of_a_run_is_kept_for_each_argument() -> None:
    asked = []

    @once_a_run
    def times(run: Run, factor: float) -> float:
        asked.append(factor)
        return factor * len(run)

    run = simulate(None, "paper", scenarios=1, seconds=2.0)[0].runs[0]
    assert [times(run, 2.0), times(run, 3.0), times(run, 2.0)] == [2.0 * len(run), 3.0 * len(run), 2.0 * len(run)]
    assert asked == [2.0, 3.0]
    assert times(replace(run, lsb_dps=0.1), 2.0) == 2.0 * len(run)
    assert asked == [2.0, 3.0, 2.0]
