"""The device's states and commands, on a bench: the emulated sensor, a script, what the device says and shows."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from .conftest import HERE, Build, run, sentences

UP = "world 0 0 0 8950 0 0 16393\n"
DOWN = "world 0 0 0 -8960 0 0 -16393\n"
STILL = "world 0 0 0 0 0 0 16393\n"


@pytest.fixture(scope="module")
def bench(build: Build) -> Path:
    return build(HERE / "bench.c")


def leds(text: str) -> list[str]:
    return [line.removeprefix("# led ") for line in text.splitlines() if line.startswith("# led ")]


def errors(text: str) -> list[str]:
    return [s["name"] for s in sentences(text, "ERR")]


def states(text: str) -> list[str]:
    return [s["state"] for s in sentences(text, "STA")]


def test_up_then_down_makes_a_pair(bench: Path) -> None:
    text = run(
        bench,
        f"{UP}noise 5\npower\n> status\n> start up\nrun 6.5\n> status\n> stop\n> status\n"
        f"{DOWN}> start down\nrun 6.5\n> stop\n> status\n> reset\n> status\n",
    )
    assert states(text) == ["idle", "recording", "flip", "done", "idle"]
    assert leds(text) == ["idle", "recording", "flip", "recording", "done", "idle"]
    assert not errors(text)
    cal = sentences(text, "CAL")
    assert [(s["method"], s["seconds"]) for s in cal] == [(m, t) for t in "246" for m in ("baseline", "cnn")]
    scale = (8950 + 8960) * 0.00875 / 156 - 1
    assert cal[4].number("scale") == pytest.approx(scale, abs=5 * cal[4].number("scale_se"))
    assert cal[4].number("bias_dps") == pytest.approx(-5 * 0.00875, abs=5 * cal[4].number("bias_se_dps"))
    second = sentences(text, "RUN")[2]
    later = next(s for s in cal if s["seconds"] == "2")
    assert later.t_us < second.t_us + 2_110_000  # in the samples that follow, not at the run's end


def test_answers_wait_for_a_pair_of_equal_rate_about_one_axis(bench: Path) -> None:
    first = f"{UP}noise 5\npower\n> start up\nrun 2.5\n> stop\n"
    down = "world 0 -8960 0 -8960 0 0 -16393\n"

    def second(world: str, *commands: str) -> str:
        return run(bench, f"{first}{world}" + "".join(f"> {c}\n" for c in commands) + "run 2.5\n> stop\n> status\n")

    assert sentences(second(down, "start down"), "CAL")
    assert sentences(second(down, "set table_dps 78.05", "start down"), "CAL")
    for setting in ("axis x", "table_dps 77", "full_scale_dps 500", "rate_hz 104"):
        text = second(down, f"set {setting}", "start down")
        assert not sentences(text, "CAL"), setting
        assert errors(text)[0] == "no_pair"
    # what counts is the sense of rotation about the sensed axis, not the face
    assert sentences(second(down, "set table_dps -78", "start up"), "CAL")
    for world, *commands in ((UP, "start up"), (UP, "set table_dps -78", "start down")):
        text = second(world, *commands)
        assert not sentences(text, "CAL")
        assert states(text) == ["flip"]


def test_a_second_run_that_is_too_short_keeps_the_first(bench: Path) -> None:
    text = run(
        bench,
        f"{UP}noise 5\npower\n> start up\nrun 2.5\n> stop\n{DOWN}> start down\nrun 1\n> stop\n> status\n"
        "> start down\nrun 2.5\n> stop\n> status\n",
    )
    assert errors(text) == ["too_short"]
    assert states(text) == ["flip", "done"]
    assert [s["method"] for s in sentences(text, "CAL")] == ["baseline", "cnn"]


def test_a_third_run_begins_a_new_pair(bench: Path) -> None:
    two = f"{UP}> start up\nrun 2.5\n> stop\n{DOWN}> start down\nrun 2.5\n> stop\n> status\n"
    script = two.replace("> stop\n", "> stop\n> status\n", 1)
    text = run(bench, f"{UP}noise 5\npower\n{two}{script}")
    assert states(text) == ["done", "flip", "done"]
    assert [s["method"] for s in sentences(text, "CAL")] == ["baseline", "cnn"] * 2


def test_misfit_shows_on_the_led(bench: Path) -> None:
    step = "world 0 0 0 -8900 0 0 -16393\n"
    up = f"{UP}noise 5\npower\n> start up\nrun 2.5\n> stop\n"
    text = run(bench, f"{up}{DOWN}> start down\nrun 1\n{step}run 1.5\n> stop\n> status\n")
    assert leds(text)[-1] == "misfit"
    assert sentences(text, "STA")[0].number("misfit") > 2


def test_every_command_is_answered_once(bench: Path) -> None:
    answers = {
        "hello": "hello",
        "status": "status",
        "start": "bad_argument",
        "start sideways": "bad_argument",
        "stop": "no_run",
        "auto": "bad_argument",
        "auto on": "auto",
        "auto off": "auto",
        "stream raw": "stream",
        "stream off": "stream",
        "stream": "bad_argument",
        "set": "bad_argument",
        "set rate_hz": "bad_argument",
        "set rate_hz fast": "bad_number",
        "set rate_hz 0": "bad_argument",
        "set rate_hz 1e6": "bad_argument",
        "set rate_hz 416": "set",
        "set rate_hz 145": "set",
        "set rate_hz none": "bad_number",
        "set colour 3": "bad_argument",
        "set axis y": "set",
        "set axis w": "bad_argument",
        "set table_dps -78": "set",
        "set table_dps none": "set",
        "set table_dps 1e9": "bad_argument",
        "set turn_deg 360": "set",
        "set turn_deg 0": "set",
        "set full_scale_dps 2000": "set",
        "set full_scale_dps 333": "bad_argument",
        "set accel_g 16": "set",
        "set accel_g 5": "bad_argument",
        "set accel_g 0": "set",
        "set low_pass 8": "set",
        "set low_pass 9": "bad_argument",
        "set low_pass 1.5": "bad_argument",
        "set low_pass 0": "set",
        "set axis x please": "bad_argument",
        "get rate_hz": "get",
        "get": "bad_argument",
        "get colour": "bad_argument",
        "a b c d e f": "bad_argument",
        "dance": "unknown_command",
        "x" * 80: "unknown_command",
        "x" * 81: "line_too_long",
        "  status  ": "status",
        "reset": "reset",
        "start up": "start",
        "start down": "recording",
        "set axis z": "recording",
        "reset ": "recording",
        "stop\r": "stop",
    }
    text = run(bench, STILL + "power\n" + "".join(f"> {c}\n" for c in answers))
    said = [s for s in sentences(text) if s.tag in ("ACK", "ERR")]
    assert [s["cmd"] if s.tag == "ACK" else s["name"] for s in said] == list(answers.values())


def test_settings_are_told_and_kept_over_power_off(bench: Path) -> None:
    change = "> set rate_hz 104\n> set full_scale_dps 1000\n> set axis x\n> set table_dps -30.5\n> set turn_deg 360\n"
    change += "> set accel_g 8\n> set low_pass 3\n"
    names = ("rate_hz", "full_scale_dps", "axis", "table_dps", "turn_deg", "accel_g", "low_pass")
    ask = "".join(f"> get {name}\n" for name in names)
    text = run(bench, f"power\n{change}power\n{ask}")
    said = [s for s in sentences(text, "ACK") if s["cmd"] == "get"]
    got = {name: value for s in said for name, value in s.items() if name != "cmd"}
    assert list(got) == list(names)
    assert list(got.values()) == ["104", "1000", "x", "-30.5", "360", "8", "3"]
    first, second = sentences(text, "HEL")
    assert (first["rate_hz"], first["odr_hz"], first["lsb_dps"], first["table_dps"]) == ("145", "416", "0.00875", "78")
    assert (second["rate_hz"], second["odr_hz"], second["lsb_dps"], second["axis"]) == ("104", "104", "0.035", "x")
    assert (first["accel_g"], first["low_pass"], first["lsb_g"]) == ("0", "0", "6.1e-05")
    assert (second["accel_g"], second["low_pass"], second["lsb_g"]) == ("8", "3", "0.000244")

    text = run(bench, f"power\nstore fails\n{change}")
    assert errors(text) == ["store_failed"] * 7


@pytest.mark.parametrize("fifo", ["", "> set rate_hz 104\n> set fifo 16\n"])
def test_gravity_is_seen_at_each_range_of_the_accelerometer(bench: Path, fifo: str) -> None:
    """One g along z is 16393 counts at 2 g."""
    script = f"world 0 0 0 0 0 0 16393\nnoise 5\npower\n{fifo}> stream raw\n"
    for accel_g in (2, 4, 8, 16):
        text = run(bench, f"{script}> set accel_g {accel_g}\nrun 1\n> status\n")
        counts = [int(s["6"]) for s in sentences(text, "RAW")][-20:]
        assert np.mean(counts) == pytest.approx(16393 * 2 / accel_g, abs=3)
        assert sentences(text, "STA")[-1]["gravity"] == "up"
        assert not errors(text)


@pytest.mark.parametrize("fifo", ["", "> set rate_hz 104\n> set fifo 16\n"])
def test_sampling_goes_on_behind_another_low_pass(bench: Path, fifo: str) -> None:
    text = run(bench, f"{STILL}noise 5\npower\n{fifo}> set low_pass 8\nrun 1\n> set low_pass 0\nrun 1\n> status\n")
    assert not errors(text)
    status = sentences(text, "STA")[-1]
    assert (status["resets"], status["missed"], status["stale"]) == ("0", "0", "0")


@pytest.mark.parametrize("rate_hz", ["145", "104", "208", "400", "12.5"])
def test_samples_come_at_the_rate_that_was_set(bench: Path, rate_hz: str) -> None:
    text = run(bench, f"{UP}power\n> set rate_hz {rate_hz}\n> stream raw\nrun 10\n")
    t = np.array([s.t_us for s in sentences(text, "RAW")])
    true_hz = 6667 / 512 if rate_hz == "12.5" else float(rate_hz)  # application note AN5192
    assert len(t) == pytest.approx(10 * true_hz, rel=0.02)
    assert np.median(np.diff(t)) == pytest.approx(1e6 / true_hz, abs=150)
    assert not errors(text)


def test_a_sample_that_is_late_is_taken_at_once(bench: Path) -> None:
    """Work of less than half a period between two samples costs none; longer work costs what it must, and that is counted."""
    busy = "busy {}\nrun 0.05\n"
    text = run(bench, f"{UP}power\n> stream raw\nrun 0.5\n{busy.format(0.009) * 20}> status\n")
    t = np.array([s.t_us for s in sentences(text, "RAW")])
    assert np.diff(t).max() < 1.5 * 1e6 / 145
    assert len(t) == pytest.approx((t[-1] - t[0]) * 145e-6 + 1, abs=1)
    assert sentences(text, "STA")[0]["missed"] == "0"
    text = run(bench, f"{UP}power\n> stream raw\n> start up\nrun 0.5\n{busy.format(0.1) * 3}> stop\n> status\n")
    t = np.array([s.t_us for s in sentences(text, "RAW")])
    missed = round((t[-1] - t[0]) * 145e-6) + 1 - len(t)
    assert 3 * 12 <= missed <= 3 * 14
    told = int(sentences(text, "STA")[0]["missed"])
    assert told == int(sentences(text, "RUN")[1]["missed"]) == pytest.approx(missed, abs=3)  # one a gap: its end was late


def test_an_interrupt_line_gives_each_sample_at_its_time(bench: Path) -> None:
    script = f"{UP}power\n> set rate_hz 104\n> stream raw\nrun 5\n> status\n"
    polled, wired = run(bench, script), run(bench, "line on\n" + script)
    late_us = []
    for text in (polled, wired):
        t = np.array([s.t_us for s in sentences(text, "RAW")])
        assert len(t) == pytest.approx(5 * 104, abs=3)
        assert sentences(text, "STA")[0]["stale"] == "0"
        late_us.append(np.abs(np.diff(t) - 64e6 / 6667).max())
    assert late_us[1] <= 2 < late_us[0]  # the poll looks every 0.1 ms
    assert "stale" in errors(run(bench, "line on\n" + script + "fault stale on\nrun 1\n"))


def test_a_run_starts_by_itself_when_all_is_steady(bench: Path) -> None:
    spinning_up = "".join(f"world 0 0 0 {8950 * k // 10} 0 0 16393\nrun 0.1\n" for k in range(5, 10))
    script = f"{STILL}noise 5\npower\n> auto on\nrun 1\n{spinning_up}> status\n{UP}run 0.3\n> status\nrun 0.4\n> status\n"
    script += f"run 3\n{STILL}run 0.1\n> status\nrun 0.4\n> status\n{DOWN}run 3\n> status\n{STILL}run 1\n> status\n"
    text = run(bench, script)
    assert states(text) == ["idle", "idle", "recording", "recording", "flip", "recording", "done"]
    told = [s["state"] + " " + s["face"] for s in sentences(text, "RUN")]
    assert told == ["start up", "end up", "start down", "end down"]
    assert [s["method"] for s in sentences(text, "CAL")] == ["baseline", "cnn"]
    assert not errors(text)


@pytest.mark.parametrize(
    ("up", "down", "told"),
    [
        (8914 + 263, -8914 + 263, set()),  # a bias of 2.3 dps
        (9360, -9360, {"table_rate"}),  # a scale of 5 %
        (8557, -8557, {"table_rate"}),  # a table 4 % slow
    ],
)
def test_a_run_starts_by_itself_at_whatever_steady_rate(bench: Path, up: int, down: int, told: set[str]) -> None:
    """Bias and scale are what is to be found: a rate that stays is enough, and one that is far off is told."""
    still = "world 0 0 0 0 0 0 -16393\n"
    text = run(
        bench,
        f"{STILL}noise 5\npower\n> auto on\nrun 1\nworld 0 0 0 {up} 0 0 16393\nrun 7\n{still}run 1\n"
        f"world 0 0 0 {down} 0 0 -16393\nrun 7\n{still}run 1\n> status\n",
    )
    assert states(text) == ["done"]
    assert [s["seconds"] for s in sentences(text, "CAL") if s["method"] == "baseline"] == ["2", "4", "6"]
    assert set(errors(text)) == told


def test_a_table_that_turns_the_wrong_way_is_told_once(bench: Path) -> None:
    against = "world 0 0 0 -8950 0 0 16393\n"
    text = run(bench, f"{STILL}noise 5\npower\n> auto on\nrun 1\n{against}run 5\n> status\n")
    assert errors(text) == ["wrong_direction"]
    assert not sentences(text, "RUN")


def test_it_does_not_start_by_itself_at_a_wrong_face_direction_or_request(bench: Path) -> None:
    edge = "world 0 0 0 8950 0 16393 0\n"
    against = "world 0 0 0 -8950 0 0 16393\n"
    unknown = f"> set table_dps none\n{UP}run 1\n> set table_dps 78\n> auto off\nrun 1\n"
    text = run(bench, f"{edge}power\n> auto on\nrun 1\n{against}run 1\n{unknown}> status\n")
    assert states(text) == ["idle"]
    # stopped by hand while the table goes on turning: it stays stopped
    text = run(bench, f"{UP}power\n> auto on\nrun 1\n> status\n> stop\nrun 2\n> status\n")
    assert states(text) == ["recording", "idle"]


def test_dropped_sentences_are_counted_and_leave_a_gap(bench: Path) -> None:
    text = run(bench, f"{UP}power\n> stream raw\nrun 0.5\ndrop 7\nrun 0.5\n> status\n")
    said = sentences(text)
    gaps = np.diff([s.seq for s in said])
    assert sorted(gaps)[-2:] == [1, 8]
    assert sentences(text, "STA")[0]["lost"] == "7"


def test_a_sensor_that_fails_at_boot_is_tried_again(bench: Path) -> None:
    for fault, name in (("wrong_id", "wrong_id"), ("stuck_reset", "reset_timeout"), ("short", "bus_short")):
        broken = f"{UP}fault {fault} on\npower\n> start up\nrun 2.5\n"
        text = run(bench, f"{broken}fault {fault} off\nrun 2\n> start up\nrun 1\n> status\n")
        told = errors(text)
        assert told[:2] == [name, "not_ready"]
        assert set(told) == {name, "not_ready"}
        assert states(text) == ["recording"]


def test_a_sensor_that_fails_for_long_is_set_up_again(bench: Path) -> None:
    for fault, name in (("nack", "bus_nack"), ("stale", "stale"), ("short", "bus_short")):
        fails = f"fault {fault} on\nrun 3\nfault {fault} off\n"
        text = run(bench, f"{UP}noise 5\npower\n> start up\nrun 1\n{fails}run 3\n> status\n")
        assert set(errors(text)) == {name}
        status = sentences(text, "STA")[0]
        assert status["state"] == "recording"
        assert int(status["resets"]) >= 1
        assert int(status["n"]) > 400


def test_readings_that_are_not_new_are_no_samples(bench: Path) -> None:
    frozen = "fault stale on\nrun 0.3\nfault stale off\n"
    text = run(bench, f"{UP}noise 5\npower\n> stream raw\n> start up\nrun 1\n{frozen}run 1\n> status\n> stop\n")
    readings = [(s["1"], s["2"], s["3"]) for s in sentences(text, "RAW")]
    assert all(a != b for a, b in pairwise(readings))
    n = int(sentences(text, "RUN")[1]["n"])
    assert n == pytest.approx(2 * 145, abs=3)
    assert int(sentences(text, "STA")[0]["stale"]) == pytest.approx(0.3 * 145, abs=3)
    assert errors(text) == ["stale"]


def test_a_stuck_bit_is_noticed_and_a_quiet_sensor_is_not_accused(bench: Path) -> None:
    script = "power\n> set table_dps 0\n> start up\nrun 3\n> stop\n"
    assert errors(run(bench, f"{STILL}noise 5\nfault stuck_bit on\n{script}")) == ["stuck_bit"]
    for noise in (0, 0.4, 5):
        assert errors(run(bench, f"{STILL}noise {noise}\n{script}")) == []


def test_a_part_of_another_range_is_suspected_at_rest(bench: Path) -> None:
    half = "world 0 0 0 0 0 0 8196\n"
    assert errors(run(bench, f"{half}noise 2\npower\n> set table_dps 0\n> start up\nrun 3\n> stop\n")) == ["not_one_g"]


def test_teleplot_lines(bench: Path) -> None:
    text = run(bench, f"{UP}power\n> stream teleplot\nrun 0.05\n")
    lines = [line for line in text.splitlines() if line.startswith(">")]
    assert lines[:3] == [">gx:0", ">gy:0", ">gz:78.3125"]


def test_after_a_run_the_state_says_its_length_three_times(bench: Path) -> None:
    """A reader who missed the end learns the length; a full output delays these sentences and loses none."""
    begin = f"{UP}noise 5\npower\n> stream raw\n> start up\nrun 1\n> stop\n"
    for blocked in (0, 300):
        text = run(bench, f"{begin}drop {blocked}\nrun 6\n> start up\nrun 2\n")
        states = sentences(text, "STA")
        end = sentences(text, "RUN")[1]
        assert {(s["state"], s["run_first"], s["run_n"]) for s in states} == {("idle", end["first"], end["n"])}
        after_s = [1e-6 * (s.t_us - end.t_us) for s in states]
        assert np.diff(after_s) == pytest.approx([1, 1], abs=0.02)
        assert after_s[0] == pytest.approx(1.54 if blocked else 1.0, abs=0.02)
    assert not sentences(run(bench, begin.replace("raw", "off") + "run 6\n"), "STA")
    assert "run_n" not in sentences(run(bench, "power\n> status\n"), "STA")[0]
    assert "run_n" not in sentences(run(bench, f"{begin}> reset\n> status\nrun 2\n"), "STA")[0]


def test_the_sensors_own_test_is_told_and_sampling_goes_on(bench: Path) -> None:
    """AN5192: each axis moves by 150 to 700 dps. The emulated mass moves by 400."""
    text = run(bench, f"{STILL}noise 5\npower\n> stream raw\nrun 1\n> selftest\nrun 1\n> status\n")
    found = sentences(text, "TST")
    assert [s["passed"] for s in found] == ["1"]
    assert [found[0].number(f"{axis}_dps") for axis in "xyz"] == pytest.approx([400.0] * 3, abs=0.5)
    assert (found[0].number("least_dps"), found[0].number("most_dps")) == (150.0, 700.0)
    later = [s for s in sentences(text, "RAW") if s.t_us > found[0].t_us]
    assert len(later) > 100
    assert max(abs(int(s["3"])) for s in later) < 100  # as before: nothing of the test is left
    assert not errors(text)
    assert sentences(text, "STA")[-1]["missed"] == "0"


@pytest.mark.parametrize("fifo", ["", "> set rate_hz 104\n> set fifo 16\n"])
def test_a_mass_that_does_not_move_fails_the_test_and_a_run_is_not_disturbed_by_one(bench: Path, fifo: str) -> None:
    script = f"{STILL}power\n{fifo}fault stuck_mass on\n> selftest\nrun 1\n{UP}> start up\nrun 1\n> selftest\nrun 1\n> stop\n"
    text = run(bench, script)
    found = sentences(text, "TST")
    assert [s["passed"] for s in found] == ["0"]
    assert [found[0].number(f"{axis}_dps") for axis in "xyz"] == [0.0] * 3
    assert errors(text) == ["recording"]
    end = sentences(text, "RUN")[-1]
    assert (end["state"], end["missed"]) == ("end", "0")


def test_a_sensor_that_goes_away_during_its_test_is_found_again(bench: Path) -> None:
    text = run(bench, f"{STILL}power\nfault stale on\n> selftest\nrun 1\nfault stale off\nrun 2\n> selftest\n")
    assert errors(text)[0] == "stale"
    assert [s["passed"] for s in sentences(text, "TST")] == ["1"]
