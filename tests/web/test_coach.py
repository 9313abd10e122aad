"""What the coach tells the person at the table, and which answer stands large."""

from __future__ import annotations

from typing import Any

import pytest

from gyrocal.web.coach import advice, answer, words

HELLO = {"table_dps": "78"}


def sensor(state: str, **more: Any) -> dict[str, Any]:
    return {"state": state, "face": "", "waits": "", "run_s": 0.0, "hello": HELLO} | more


@pytest.mark.parametrize(
    ("status", "stage", "said"),
    [
        (sensor("idle", waits="sensor"), "wait", "The sensor does not answer."),
        (sensor("idle", waits="start"), "wait", "face up and turn the table at 78 deg/s"),
        (sensor("idle", waits="unsteady"), "wait", "Stop the table for a moment."),
        (sensor("recording", run_s=3.0, face="up"), "turn", "Keep the table turning."),
        (sensor("recording", run_s=6.0, face="up", waits="unsteady"), "flip", "Flip now"),
        (sensor("flip", waits="flip", second=True), "flip", "Flip now"),
        (sensor("recording", run_s=5.9, face="down", second=True), "turn", "Keep the table turning."),
        (sensor("recording", run_s=6.1, face="down", second=True), "done", "the answer is complete"),
        (sensor("done"), "done", "Both faces are measured."),
    ],
)
def test_it_says_what_to_do_now(status: dict[str, Any], stage: str, said: str) -> None:
    found = advice(status, replays=False, ended=False)
    assert (found.stage, said in found.tell) == (stage, True), found


def test_nobody_is_told_to_flip_a_simulated_sensor() -> None:
    for status in (sensor("flip"), sensor("recording", run_s=9.0), sensor("idle")):
        assert advice(status, replays=True, ended=False).stage in ("wait", "turn")


def test_a_run_of_the_device_is_not_called_a_recording() -> None:
    assert words(sensor("recording", face="up")) == "measuring up"


def test_the_large_answer_is_the_latest_of_the_richest_method() -> None:
    results = [
        {"method": "baseline", "seconds": 6.0, "scale": 0.1}, {"method": "cnn", "seconds": 4.0, "scale": 0.2},
        {"method": "cnn", "seconds": 6.0, "scale": 0.3}, {"method": "model", "seconds": 6.0, "scale": None},
    ]  # fmt: skip
    assert answer(results) == results[2]
    assert answer([]) is None
