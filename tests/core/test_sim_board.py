"""The board around the core: nobody reads its port, it sleeps between samples, it starts again, its flash fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from .conftest import HERE, Build, Sentence, make_pair, make_run, run, sentences, ticks, write_rows

Sim = Callable[..., str]
USB_BYTES = 4096


def content(said: list[Sentence], tag: str) -> list[dict[str, str]]:
    return [dict(s) for s in said if s.tag == tag]


def missing(said: list[Sentence]) -> int:
    return int(said[0].seq + (np.diff([s.seq for s in said]) - 1).sum())


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    return write_rows(tmp_path / "pair.rows", make_pair(np.random.default_rng(5), n=943))


@pytest.mark.parametrize("when", [":3", ":9", "@2:3", "@5:7", ":1*6"])
def test_while_nobody_reads_only_sentences_are_lost(sim: Sim, pair: Path, when: str) -> None:
    """Runs of 6.5 s: from power-on into the first or the second, in the middle, over the turn, and again and again."""
    sound = sentences(sim(pair, "--stream", "raw"))
    said = sentences(sim(pair, "--stream", "raw", "--fault", f"unheard{when}"))
    heard = {s.seq: s for s in said}
    assert len(heard) == len(said) < len(sound)
    assert len(said) + missing(said) == len(sound)  # numbered, so that the reader counts them
    assert all(dict(heard[s.seq]) == dict(s) and heard[s.seq].t_us == s.t_us for s in sound if s.seq in heard)
    assert content(sound, "CAL")[-1] in content(said, "CAL")
    assert [s for s in said if s.tag == "RUN"][-1]["missed"] == "0"


def test_a_reader_who_comes_late_finds_what_the_port_held_and_then_the_present(sim: Sim, pair: Path) -> None:
    said = sim(pair, "--stream", "raw", "--fault", "unheard:3").splitlines(keepends=True)
    numbers = [s.seq for s in sentences("".join(said))]
    gap = int(np.argmax(np.diff(numbers) > 1)) + 1
    assert USB_BYTES - 320 < len("".join(said[:gap])) <= USB_BYTES
    first = next(s for s in sentences("".join(said)) if s.tag == "RAW" and s["0"] == "0")
    assert sentences(said[gap])[0].t_us - first.t_us == pytest.approx(3e6, abs=1e4)


def test_neither_a_calibration_nor_a_store_waits_for_a_reader(sim: Sim, pair: Path) -> None:
    """With flash, which `supply` gives the board. Nobody reads from the first sample into the last second of the second run."""
    heard, unheard = (
        sentences(sim(pair, "--stream", "raw", "--fault", "supply@999", *more)) for more in ([], ["--fault", "unheard@0:12.5"])
    )
    ends = [[(s.t_us, dict(s)) for s in said if s.tag == "RUN"][-1] for said in (heard, unheard)]
    assert ends[0] == ends[1]
    assert content(heard, "CAL")[-1] == content(unheard, "CAL")[-1]


@pytest.mark.parametrize(("rate_hz", "fifo"), [(145.0, 0), (104.0, 0), (104.0, 8)])
def test_sleep_that_is_shorter_than_the_wait_costs_nothing(sim: Sim, tmp_path: Path, rate_hz: float, fifo: int) -> None:
    """Polled, by data-ready and with the FIFO, whose batch of 8 comes each 77 ms."""
    made = make_run(np.random.default_rng(6), np.full(600, 78.0), ticks(600, rate_hz))
    rows = write_rows(tmp_path / "a.rows", [made], rate_hz)
    options = ["--stream", "raw", "--fifo", str(fifo)]
    assert sim(rows, *options, "--sleep", "60" if fifo else "4") == sim(rows, *options)


def numbered(tmp_path: Path, n: int, rate_hz: float) -> tuple[Path, dict]:
    """Rows whose third rate is their number."""
    counts = np.zeros((n, 7), np.int16)
    counts[:, 3], counts[:, 6] = np.arange(n), 16393
    row = {"t_us": ticks(n, rate_hz), "counts": counts, "table_dps": np.nan}
    return write_rows(tmp_path / "a.rows", [row], rate_hz), row


def taken(text: str) -> list[Sentence]:
    """The samples of the run. After the last row, the sensor goes on to show it, and the device may take one sample of that."""
    raw = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    return raw[:-1] if raw[-1]["3"] == raw[-2]["3"] else raw


@pytest.mark.parametrize("rate_hz", [145.0, 104.0])
@pytest.mark.parametrize("sleep_ms", [10, 25, 200, 3000])
def test_samples_that_came_in_sleep_are_missing_and_counted(sim: Sim, tmp_path: Path, rate_hz: float, sleep_ms: int) -> None:
    """Without the FIFO, polled and by data-ready. No sample is made up, and each keeps the time of its row."""
    rows, row = numbered(tmp_path, int(20 * rate_hz), rate_hz)
    text = sim(rows, "--stream", "raw", "--sleep", str(sleep_ms))
    got = taken(text)
    took = np.array([int(s["3"]) for s in got])
    slept = int(np.ceil(sleep_ms * 1e-3 * rate_hz))
    assert set(np.diff(took)) <= {slept, slept + 1}
    at_us = np.array([s.t_us for s in got])
    np.testing.assert_array_equal(at_us - at_us[0], row["t_us"][took] - row["t_us"][took[0]])
    (end,) = (s for s in sentences(text, "RUN") if s["state"] == "end")
    more = int(end["n"]) - len(got)  # of the sensor at rest, after the last row
    assert more in (0, 1)
    missing = took[-1] - took[0] + 1 - len(took)
    assert missing > len(took) * 0.3
    assert missing <= int(end["missed"]) <= missing + more * (slept + 1)


def test_by_data_ready_a_sample_after_a_sleep_is_dated_at_most_a_period_late(build: Build) -> None:
    """The part has a clock of its own, and the device looks half a period after it awakes. A rate that changed a period before
    the look is seen by all samples, one that changed half a period before it by about half of them: the others are older."""
    period_s, rounds = 64 / 6667, 200
    for change_s, low, high in ((0.52 * period_s, rounds, rounds), (0.0, 0.35 * rounds, 0.65 * rounds)):
        script = "world 0 0 0 0 0 0 16393\npower\n> set rate_hz 104\n> stream raw\nrun 1\n"
        for k in range(1, rounds + 1):
            script += f"busy {0.0301 - change_s}\nworld 0 0 0 {k} 0 0 16393\nbusy {change_s}\nrun 0.0001\n"
        text = run(build(HERE / "bench.c"), f"{script}> status\n")
        slept = sentences(text, "RAW")[-rounds:]
        assert low <= sum(int(s["3"]) == k for k, s in enumerate(slept, 1)) <= high
        assert all(int(s["3"]) in (k - 1, k) for k, s in enumerate(slept, 1))
        periods = np.rint(np.diff([s.t_us for s in sentences(text, "RAW")][-rounds - 1 :]) / (1e6 * period_s))
        assert int(sentences(text, "STA")[0]["missed"]) == pytest.approx((periods - 1).sum(), abs=1)


@pytest.mark.parametrize(("sleep_ms", "overruns"), [(500, False), (1500, False), (6000, True)])
def test_the_fifo_keeps_what_came_in_sleep_up_to_its_depth(sim: Sim, tmp_path: Path, sleep_ms: int, overruns: bool) -> None:
    n, rate_hz = 104 * 20, 104.0
    rows, row = numbered(tmp_path, n, rate_hz)
    text = sim(rows, "--stream", "raw", "--fifo", "8", "--sleep", str(sleep_ms))
    got = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    took = np.array([int(s["3"]) for s in got])
    assert (np.diff(took) > 0).all()
    assert (len(got) == n) != overruns
    errors = {s["name"] for s in sentences(text, "ERR") if s.t_us < got[-1].t_us}
    assert errors == ({"fifo_overrun"} if overruns else set())
    (end,) = (s for s in sentences(text, "RUN") if s["state"] == "end")
    assert int(end["n"]) == len(got)
    assert int(end["missed"]) == pytest.approx(took[-1] - took[0] + 1 - len(got), abs=3)
    off_us = np.array([s.t_us for s in got]) - row["t_us"][took]
    if overruns:  # after the last row none comes while the whole FIFO is read, which no sensor does
        off_us = off_us[: np.flatnonzero(np.diff(took) > 1)[-1]]
    assert np.ptp(off_us) < 1.5e6 / rate_hz


@pytest.mark.parametrize("sleep_ms", [25, 200])
def test_of_a_board_that_sleeps_through_most_samples_there_is_no_answer(sim: Sim, pair: Path, sleep_ms: int) -> None:
    text = sim(pair, "--sleep", str(sleep_ms))
    assert not sentences(text, "CAL")
    assert {s["name"] for s in sentences(text, "ERR")} == {"too_short"}


@pytest.mark.parametrize("sleep_ms", [8, 12])
def test_an_answer_of_a_board_that_sleeps_through_half_of_the_samples_is_flagged_and_right(
    sim: Sim, pair: Path, sleep_ms: int
) -> None:
    answers = sentences(sim(pair, "--sleep", str(sleep_ms)), "CAL")
    assert answers
    for answer in answers:
        assert answer["trusted"] == "0"
        assert "missed" in answer["flags"].split("+")
        assert abs(answer.number("scale") - 0.004) < 5 * answer.number("scale_se")
        assert abs(answer.number("bias_dps") + 0.05) < 5 * answer.number("bias_se_dps")


@pytest.mark.parametrize(("fault", "away_s"), [("hang", 10.0), ("supply", 0.0)])
@pytest.mark.parametrize("at_s", [0.0, 3.0, 6.2, 9.0])
def test_a_board_that_starts_again_has_its_settings_and_calibrates(
    sim: Sim, tmp_path: Path, fault: str, away_s: float, at_s: float
) -> None:
    """In the first run of a pair or the second. The next pair is answered; no pair is made of runs before and after."""
    rows = write_rows(tmp_path / "a.rows", make_pair(np.random.default_rng(7), n=943) * 2)
    said = sentences(sim(rows, "--stream", "raw", "--fault", f"{fault}@{at_s}"))
    starts = [i for i, s in enumerate(said) if s.tag == "HEL" and s.seq == 0]
    assert len(starts) == 2
    before, after = said[: starts[1]], said[starts[1] :]
    assert {(s["rate_hz"], s["axis"], s["table_dps"]) for s in after if s.tag == "HEL" and s.seq > 0} == {("145", "z", "78")}
    assert [s["state"] for s in before if s.tag == "RUN"][-1] == "start"  # its end is never told
    baseline = [s for s in after if s.tag == "CAL" and s["method"] == "baseline"]
    assert (baseline[-1]["seconds"], baseline[-1]["trusted"]) == ("6", "1")
    assert len(baseline) == 3 * (sum(s.tag == "RUN" and s["state"] == "start" for s in after) // 2)


def test_a_flash_that_fails_is_told_once_a_write_and_stops_nothing(sim: Sim, pair: Path) -> None:
    sound, said = (sentences(sim(pair, "--fault", fault)) for fault in ("supply@999", "flash_fails"))
    assert content(said, "CAL") == content(sound, "CAL") != []
    names = [s["name"] for s in said if s.tag == "ERR"]
    assert set(names) == {"store_failed"}
    assert len(names) == 2 + sum(s.tag == "ACK" and s["cmd"] == "set" for s in said)
