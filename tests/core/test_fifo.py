"""Samples out of the sensor's FIFO: whole, in order, at their times; what is lost is counted and told."""

from pathlib import Path

import numpy as np
import pytest

from .conftest import HERE, Build, run, sentences
from .test_device import DOWN, UP, errors

FIFO = "> set rate_hz 104\n> set fifo 16\n"
ROOT_HZ = 6667.0  # application note AN5192: 104 Hz stands for this / 64, and so on
PERIOD_US = 64e6 / ROOT_HZ
HOLDS_S = 512 / (2 * ROOT_HZ / 64 + ROOT_HZ / 128 + ROOT_HZ / 64 / 32)  # words: gyroscope, accelerometer, temperature, time


@pytest.fixture(scope="module")
def bench(build: Build) -> Path:
    return build(HERE / "bench.c")


def times_us(text: str) -> np.ndarray:
    return np.array([s.t_us for s in sentences(text, "RAW")])


def status(text: str, name: str) -> int:
    return int(sentences(text, "STA")[-1][name])


@pytest.mark.parametrize("rate_hz", ["12.5", "26", "52", "104", "208", "416", "833", "1666"])
def test_every_sample_comes_once_at_its_time(bench: Path, rate_hz: str) -> None:
    batch = min(100, int(float(rate_hz) / 4))
    first = "833" if rate_hz == "1666" else rate_hz  # without the FIFO 1666 is refused
    settings = f"> set rate_hz {first}\n> set fifo {batch}\n> set rate_hz {rate_hz}\n"
    script = f"{UP}noise 50\npower\n{settings}> stream raw\nrun 4\n> status\n"
    text = run(bench, script)
    t_us = times_us(text)
    true_hz = ROOT_HZ / 2.0 ** round(np.log2(ROOT_HZ / float(rate_hz)))
    assert len(t_us) == pytest.approx(4 * true_hz, abs=batch + 2)
    np.testing.assert_allclose(np.diff(t_us), 1e6 / true_hz, atol=1.0)
    readings = np.array([[int(s[str(k)]) for k in (1, 2, 3)] for s in sentences(text, "RAW")])
    assert (np.diff(readings, axis=0) != 0).any(axis=1).mean() > 0.99  # none twice
    assert {s["6"] for s in sentences(text, "RAW")} == {"16393"}
    assert not errors(text)
    assert (status(text, "missed"), status(text, "overruns"), status(text, "stale")) == (0, 0, 0)


FASTEST = "> set rate_hz 833\n> set fifo 64\n> set rate_hz 3333\n"


def test_a_rate_that_the_wire_does_not_carry_is_measured_and_its_stream_refused(bench: Path) -> None:
    """63 bits a sample, of which the bus of 400 kHz carries 3333 a second. The estimates are from all."""
    pair = f"> start up\nrun 2.5\n> stop\n{DOWN}> start down\nrun 2.5\n> stop\n> stream raw\n> status\n"
    text = run(bench, f"{UP}noise 50\npower\n{FASTEST}{pair}")
    assert set(errors(text)) == {"net_sample_rate", "stream_rate"}
    assert not sentences(text, "RAW")
    assert (status(text, "missed"), status(text, "overruns"), status(text, "stale")) == (0, 0, 0)
    for end in [s for s in sentences(text, "RUN") if s["state"] == "end"]:
        assert int(end["n"]) == pytest.approx(2.5 * ROOT_HZ / 2, abs=64)
        assert (int(end["n"]) - 1) / end.number("duration_s") == pytest.approx(ROOT_HZ / 2, rel=1e-4)
    answer = sentences(text, "CAL")[-1]
    scale = (8950 + 8960) * 0.00875 / 2 / 78 - 1
    assert answer.number("scale") == pytest.approx(scale, abs=5 * answer.number("scale_se"))
    assert 0.0 < answer.number("scale_se") < 1e-3


def test_the_accelerometer_follows_at_3333_hz(bench: Path) -> None:
    """It is stored at 104 Hz."""
    turned = "world 0 0 0 0 0 0 -16393\n"
    text = run(bench, f"world 0 0 0 0 0 0 16393\nnoise 5\npower\n{FASTEST}run 1\n> status\n{turned}run 1\n> status\n")
    assert [s["gravity"] for s in sentences(text, "STA")] == ["up", "down"]


def test_a_stream_ends_before_the_rate_goes_beyond_the_wire(bench: Path) -> None:
    slow = "> set rate_hz 833\n> set fifo 64\n> stream raw\n"
    text = run(bench, f"{UP}power\n{slow}> set rate_hz 3333\n> get rate_hz\n> stream off\n> set rate_hz 3333\n> get rate_hz\n")
    assert errors(text) == ["stream_rate"]
    assert [s["rate_hz"] for s in sentences(text, "ACK") if s["cmd"] == "get"] == ["833", "3333"]


def test_a_low_pass_that_the_rate_lacks_is_refused(bench: Path) -> None:
    """The strong ones end at 1667 Hz."""
    text = run(bench, f"{UP}power\n> set low_pass 8\n{FASTEST}> set low_pass 4\n> set rate_hz 3333\n> set low_pass 5\n")
    assert errors(text) == ["bad_argument"] * 2


def test_temperature_comes_with_the_samples(bench: Path) -> None:
    warm = "world 512 0 0 8950 0 0 16393\n"
    text = run(bench, f"{UP}power\n{FIFO}> stream raw\nrun 1\n{warm}run 1\n")
    temperature = np.array([int(s["7"]) for s in sentences(text, "RAW")])
    assert set(temperature) == {0, 512}
    assert np.count_nonzero(np.diff(temperature)) == 1
    assert temperature[0] == 0


@pytest.mark.parametrize("clock", [0.96, 0.99, 1.01, 1.04])
def test_the_chips_clock_is_followed_to_within_a_period(bench: Path, clock: float) -> None:
    """Its clock is off by up to some percent: no sample is ever in the future, more than a period old, or out of order."""
    text = run(bench, f"clock {clock}\n{UP}power\n{FIFO}> stream raw\nrun 20\n> status\n")
    t_us = times_us(text)
    true_us = PERIOD_US / clock
    assert len(t_us) == pytest.approx(20e6 / true_us, abs=18)
    assert np.diff(t_us).min() > 0
    late_us = t_us - np.arange(len(t_us)) * true_us
    assert np.ptp(late_us) <= 1.02 * PERIOD_US
    np.testing.assert_allclose(np.diff(t_us), true_us, rtol=0.05)  # what is put right is spread over a batch
    assert status(text, "missed") == 0


def test_a_pair_is_calibrated_as_without(bench: Path) -> None:
    pair = f"> start up\nrun 6.5\n> stop\n{DOWN}> start down\nrun 6.5\n> stop\n"
    single = run(bench, f"{UP}noise 5\npower\n> set rate_hz 104\n{pair}")
    text = run(bench, f"{UP}noise 5\npower\n{FIFO}{pair}")
    assert errors(text) == errors(single) == ["net_sample_rate"]
    answers, wanted = (sentences(t, "CAL") for t in (text, single))
    assert [(s["method"], s["seconds"]) for s in answers] == [("baseline", t) for t in "246"]
    for a, b in zip(answers, wanted, strict=True):
        assert a.number("scale") == pytest.approx(b.number("scale"), abs=6 * a.number("scale_se"))
        assert a.number("bias_dps") == pytest.approx(b.number("bias_dps"), abs=6 * a.number("bias_se_dps"))


def test_a_run_holds_the_samples_between_start_and_stop(bench: Path) -> None:
    """Start and stop are not rounded to a batch."""
    text = run(bench, f"{UP}power\n{FIFO}> stream raw\nrun 1\nbusy 0.09\n> start up\nrun 2\nbusy 0.07\n> stop\nrun 0.5\n")
    start, end = sentences(text, "RUN")
    inside = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    assert [int(s["0"]) for s in inside] == list(range(int(end["n"])))
    assert inside[0].t_us == pytest.approx(start.t_us, abs=2 * PERIOD_US)
    assert inside[-1].t_us == pytest.approx(end.t_us, abs=2 * PERIOD_US)
    assert end["missed"] == "0"


def test_a_busy_board_loses_nothing_until_the_fifo_is_full(bench: Path) -> None:
    script = "> stream raw\n> start up\nrun 1\nbusy {}\nrun 1\n> stop\n> status\n"
    single = run(bench, f"{UP}power\n> set rate_hz 104\n" + script.format(1.0))
    assert status(single, "missed") == pytest.approx(104, abs=2)
    assert sentences(single, "RUN")[1]["missed"] == str(status(single, "missed"))
    shorter = run(bench, f"{UP}power\n{FIFO}" + script.format(0.9 * HOLDS_S))
    assert (status(shorter, "missed"), status(shorter, "overruns")) == (0, 0)
    np.testing.assert_allclose(np.diff(times_us(shorter)), PERIOD_US, atol=1.0)
    assert not errors(shorter)


def test_an_overrun_is_told_counted_and_shows_in_the_times(bench: Path) -> None:
    busy_s = 5.005  # no sample comes just between the level and the first word, which would be an overrun more
    text = run(bench, f"{UP}power\n{FIFO}> stream raw\n> start up\nrun 1\nbusy {busy_s}\nrun 1\n> stop\n> status\n")
    assert errors(text) == ["fifo_overrun"]
    assert status(text, "overruns") == 1
    assert status(text, "resets") == 0
    t_us = times_us(text)
    (gap,) = np.flatnonzero(np.diff(t_us) > 1.5 * PERIOD_US)
    lost = 104 * (busy_s - HOLDS_S)
    assert np.diff(t_us)[gap] / PERIOD_US - 1 == pytest.approx(lost, abs=20)
    assert status(text, "missed") == round(np.diff(t_us)[gap] / PERIOD_US) - 1
    assert len(t_us) + status(text, "missed") == pytest.approx((t_us[-1] - t_us[0]) / PERIOD_US + 1, abs=1)
    assert sentences(text, "RUN")[1]["missed"] == str(status(text, "missed"))


@pytest.mark.parametrize("clock", [0.97, 1.0, 1.03])
@pytest.mark.parametrize(
    ("settings", "true_hz", "before_s", "busy_s"),
    [
        (FIFO, ROOT_HZ / 64, 2, 5.005),
        ("> set rate_hz 12.5\n> set fifo 3\n", ROOT_HZ / 512, 9, 20.01),
        (FASTEST, ROOT_HZ / 2, 1, 0.5),
    ],
)
def test_the_sensors_own_time_counts_what_an_overrun_lost(
    bench: Path, clock: float, settings: str, true_hz: float, before_s: float, busy_s: float
) -> None:
    """Its stamps count by its own clock, which is off the nominal rate: 12.5 stands for 13.02 Hz."""
    busy = f"> start up\nrun {before_s}\nbusy {busy_s}\nrun 1\n> stop\n> status\n"
    text = run(bench, f"clock {clock}\n{UP}power\n{settings}{busy}")
    end = sentences(text, "RUN")[1]
    assert "fifo_overrun" in errors(text)
    assert end["missed"] == str(status(text, "missed"))
    assert int(end["missed"]) > 30
    periods = int(end["n"]) - 1 + int(end["missed"])
    assert periods == pytest.approx(end.number("duration_s") * true_hz * clock, abs=0.6)


@pytest.mark.parametrize(("fault", "name"), [("nack", "bus_nack"), ("short", "bus_short")])
def test_a_bus_that_fails_for_a_while_loses_nothing(bench: Path, fault: str, name: str) -> None:
    script = f"> stream raw\nrun 1\nfault {fault} on\nrun 0.4\nfault {fault} off\nrun 1\n> status\n"
    text = run(bench, f"{UP}power\n{FIFO}{script}")
    assert errors(text) == [name]
    assert (status(text, "missed"), status(text, "resets")) == (0, 0)
    np.testing.assert_allclose(np.diff(times_us(text)), PERIOD_US, atol=1.0)


@pytest.mark.parametrize(
    ("fault", "name", "again"),
    [("bad_tags", "fifo_tag", 0), ("stale", "stale", 0), ("brownout", "config_lost", 1)],
)
def test_what_goes_wrong_with_the_fifo_has_a_name_and_passes(bench: Path, fault: str, name: str, again: int) -> None:
    passes = "" if fault == "brownout" else f"fault {fault} off\n"
    text = run(bench, f"{UP}power\n{FIFO}> stream raw\nrun 1\nfault {fault} on\nrun 0.3\n{passes}run 2\n> status\n")
    assert errors(text) == [name]
    t_us = times_us(text)
    assert np.diff(t_us).min() > 0
    assert t_us[-1] - t_us[0] == pytest.approx(3.2e6, abs=0.3e6)
    missed = status(text, "missed")
    assert 0 < missed < 60
    assert len(t_us) + missed == pytest.approx((t_us[-1] - t_us[0]) / PERIOD_US + 1, abs=2)
    assert status(text, "resets") == again


def test_the_interrupt_line_tells_of_a_batch(bench: Path) -> None:
    script = f"{UP}power\n{FIFO}> stream raw\nrun 3\n> status\n"
    text = run(bench, "line on\n" + script)
    t_us = times_us(text)
    np.testing.assert_allclose(np.diff(t_us), PERIOD_US, atol=1.0)
    assert status(text, "missed") == 0
    assert "stale" in errors(run(bench, "line on\n" + script + "fault stale on\nrun 1\n"))


def test_the_setting_is_checked_told_and_kept(bench: Path) -> None:
    refused = {"set fifo 16": "fifo_rate", "set fifo -1": "bad_argument", "set fifo 1.5": "bad_argument"}
    taken = {"set rate_hz 104": "set", "set fifo 27": "bad_argument", "set fifo 26": "set", "set rate_hz 145": "fifo_rate"}
    more = {"set rate_hz 1666": "set", "set fifo 129": "bad_argument", "set fifo 128": "set", "set rate_hz 208": "bad_argument"}
    answers = {**refused, **taken, **more}
    commands = "".join(f"> {c}\n" for c in answers)
    after = "power\n> get fifo\n> get rate_hz\n> set rate_hz 833\n> set fifo 0\n> set rate_hz 145\nrun 1\n"
    text = run(bench, f"power\n{commands}{after}")
    said = [s for s in sentences(text) if s.tag in ("ACK", "ERR")]
    told = [s["cmd"] if s.tag == "ACK" else s["name"] for s in said]
    assert told == [*answers.values(), "get", "get", "set", "set", "set"]
    kept = {name: value for s in said for name, value in s.items() if s.get("cmd") == "get" and name != "cmd"}
    assert kept == {"fifo": "128", "rate_hz": "1666"}


def test_single_samples_at_1666_hz_are_refused(bench: Path) -> None:
    """A bus of 400 kHz loses a tenth of them: the setting is refused, and so is leaving the FIFO at that rate."""
    commands = ["set rate_hz 1666", "get rate_hz", "set rate_hz 833", "set fifo 16", "set rate_hz 1666", "set fifo 0"]
    commands.append("get fifo")
    said = [s for s in sentences(run(bench, "power\n" + "".join(f"> {c}\n" for c in commands))) if s.tag in ("ACK", "ERR")]
    told = [s["cmd"] if s.tag == "ACK" else s["name"] for s in said]
    assert told == ["fifo_needed", "get", "set", "set", "set", "fifo_needed", "get"]
    assert (said[1]["rate_hz"], said[-1]["fifo"]) == ("145", "16")
    assert "set_a_slower_rate_hz_and_fifo_16" in said[0]["advice"]


def test_a_run_starts_and_ends_by_itself(bench: Path) -> None:
    still = "world 0 0 0 0 0 0 16393\n"
    text = run(bench, f"{still}noise 5\npower\n{FIFO}> auto on\nrun 1\n{UP}run 3\n{still}run 1\n> status\n")
    start, end = sentences(text, "RUN")
    assert (start["state"], end["state"], start["face"]) == ("start", "end", "up")
    assert int(end["n"]) == pytest.approx((3 - 0.4) * 104, abs=30)  # steady for four windows of 0.1 s, unsteady for two
    assert sentences(text, "STA")[0]["state"] == "flip"
