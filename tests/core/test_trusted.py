"""No wrong answer under a green light: what is flagged corrects nothing, and the light is green for trusted answers alone."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal_firmware import INCLUDE

from .conftest import HERE, LSB_DPS, Build, Sentence, make_run, run, sentences, ticks, without_gyrocal, write_rows
from .test_device import DOWN, STILL, UP, errors, leds
from .test_kept import PAIR

CORRECTED = "noise 0\n> stream corrected\nrun 0.2\n> stream off\nnoise 5\n"


@pytest.fixture(scope="module")
def bench(build: Build) -> Path:
    return build(HERE / "bench.c")


def halves(up: int, down: int, up_gravity: int = 16393, seconds: float = 6.5) -> str:
    """Two runs by hand, at these counts."""
    return (
        f"world 0 0 0 {up} 0 0 {up_gravity}\n> start up\nrun {seconds}\n> stop\n"
        f"world 0 0 0 {down} 0 0 -16393\n> start down\nrun {seconds}\n> stop\n"
    )


def flags(text: str) -> list[set[str]]:
    return [set(s["flags"].split("+")) - {""} for s in sentences(text, "CAL")]


def corrected(text: str) -> list[float]:
    """The corrected rates about z, each value once."""
    return sorted({s.number("3") for s in sentences(text, "GYR")})


def test_a_sound_pair_is_trusted_and_green(bench: Path) -> None:
    text = run(bench, f"noise 5\npower\n{PAIR}")
    at_6_s = [s for s in sentences(text, "CAL") if s["seconds"] == "6"]
    assert [(s["method"], s["flags"], s["trusted"]) for s in at_6_s] == [("baseline", "", "1"), ("cnn", "", "1")]
    assert leds(text)[-1] == "done"


@pytest.mark.parametrize(
    ("script", "flag"),
    [
        (halves(11429, -11429), "implausible"),  # a table at 100 dps, said to be at 78
        (halves(12, -8), "implausible"),  # a table that stands still
        (halves(8914 + 6000, -8914 + 6000), "implausible"),  # a bias of 52 dps
        (halves(8950, -8960, up_gravity=-16393), "direction"),  # gravity says the other face
        ("noise 0\n" + halves(8950, -8960), "constant_reading"),  # data ready, and always the same
        (halves(28700, -28700), "clipped"),
        (halves(8950, -8960).replace("run 6.5", "run 1\nbusy 0.1\nrun 5.4", 1), "missed"),
        (halves(8950, -8960).replace("run 6.5", "run 1\nworld 0 0 0 8990 0 0 16393\nrun 5.5", 1), "misfit"),
        (halves(8950, -8960).replace("run 6.5", "run 1\nnoise 0\nrun 0.6\nnoise 5\nrun 4.9", 1), "constant_reading"),
    ],
)
def test_what_speaks_against_an_answer_is_said(bench: Path, script: str, flag: str) -> None:
    text = run(bench, f"noise 5\npower\n{script}> stream corrected\n")
    assert flags(text)
    assert all(flag in f for f in flags(text)), flags(text)
    assert {s["trusted"] for s in sentences(text, "CAL")} == {"0"}
    assert leds(text)[-1] == "misfit"
    assert errors(text)[-1] == "not_calibrated"


@pytest.mark.parametrize("second", [1, 5])
@pytest.mark.parametrize("spikes", [1, 3])
def test_a_spike_leaves_no_trusted_answer(bench: Path, second: int, spikes: int) -> None:
    """One reading of 249 deg/s hides in the misfit: it makes noise and blocks larger alike."""
    spike = f"world 0 0 0 28457 0 0 16393\nrun 0.0069\n{UP}run 0.05\n" * spikes
    pair = halves(8950, -8960).replace("run 6.5", f"run {second}\n{spike}run 6.2", 1)
    text = run(bench, f"noise 5\npower\n{pair}")
    after = [f for s, f in zip(sentences(text, "CAL"), flags(text), strict=True) if s.number("seconds") >= second]
    assert after
    assert all("misfit" in f for f in after), after
    assert leds(text)[-1] == "misfit"


def test_noise_of_other_kinds_is_not_taken_for_spikes(sim: Callable[..., str], tmp_path: Path) -> None:
    """White noise from less than a count to hundreds: nobody is accused."""
    rng = np.random.default_rng(8)
    for sd in (0.3, 0.5, 5, 300):
        runs = [make_run(rng, np.full(900, f * 78.3), ticks(900), f, table_dps=78.0) for f in (1, -1)]
        for r in runs:
            r["counts"][:, 3] = np.rint(r["face"] * 78.3 / LSB_DPS + rng.normal(0, sd, 900))
        text = sim(write_rows(tmp_path / "a.rows", runs))
        assert [f & {"misfit"} for f in flags(text)] == [set()] * len(flags(text)), sd


@pytest.mark.parametrize(
    ("rate_hz", "equal", "still"), [(416.0, 60, False), (416.0, 230, True), (52.0, 32, False), (52.0, 48, True)]
)
@pytest.mark.parametrize("first", [0, 50])
def test_a_reading_stands_still_if_half_a_second_and_40_samples_are_equal(
    sim: Callable[..., str], tmp_path: Path, rate_hz: float, equal: int, still: bool, first: int
) -> None:
    """From the first sample of a run on, and later in it."""
    rng, n = np.random.default_rng(5), int(6.5 * rate_hz)
    runs = [make_run(rng, np.full(n, f * 78.0), ticks(n, rate_hz), f) for f in (1, -1)]
    for r in runs:
        r["counts"][first : first + equal, 3] = r["counts"][first, 3]
    said = flags(sim(write_rows(tmp_path / "a.rows", runs, rate_hz)))
    assert ["constant_reading" in f for f in said] == [still] * len(said) != []


def test_a_flagged_pair_never_replaces_a_good_one(bench: Path) -> None:
    bad = halves(9050, -8800).replace("run 6.5", "run 1\nworld 0 0 0 9100 0 0 16393\nrun 5.5", 1)
    good = run(bench, f"noise 5\npower\n{PAIR}{CORRECTED}")
    text = run(bench, f"noise 5\npower\n{PAIR}{bad}{DOWN}{CORRECTED}power\n{CORRECTED}")
    assert leds(text)[-2:] == ["misfit", "idle"]
    assert corrected(text) == corrected(good) != []


def test_undo_brings_the_correction_before_back(bench: Path) -> None:
    other = f"{halves(9000, -9010)}{DOWN}"
    first = corrected(run(bench, f"noise 5\npower\n{PAIR}{CORRECTED}"))
    text = run(bench, f"noise 5\npower\n> undo\n{PAIR}{other}{CORRECTED}")
    assert errors(text) == ["no_undo"]
    assert corrected(text) != first
    text = run(bench, f"noise 5\npower\n{PAIR}{other}> undo\n> undo\npower\n{CORRECTED}> undo\n")
    assert corrected(text) == first
    assert [s["axis"] for s in sentences(text, "ACK") if s["cmd"] == "undo"] == ["z"]
    assert errors(text) == ["no_undo"] * 2
    assert errors(run(bench, f"noise 5\npower\n{PAIR}> undo\n> stream corrected\n")) == ["not_calibrated"]


def test_a_rest_that_is_flagged_renews_no_bias(bench: Path) -> None:
    jump = "> set table_dps 0\n> start up\nrun 2\nworld 0 0 0 90 0 0 16393\nrun 2\n> stop\n"
    good = run(bench, f"noise 5\npower\n{PAIR}{CORRECTED}")
    text = run(bench, f"noise 5\npower\n{PAIR}{STILL}{jump}{DOWN}{CORRECTED}")
    assert flags(text)[-1] == {"misfit"}
    assert corrected(text) == corrected(good)


def test_a_bias_of_two_degrees_a_second_is_answered_and_corrected(bench: Path) -> None:
    """Scale and bias are no part of the network's range; what is beyond it: test_sim_answers."""
    text = run(bench, f"noise 5\npower\n{halves(8914 + 263, -8914 + 263)}{CORRECTED}")
    assert errors(text) == []
    best = next(s for s in sentences(text, "CAL") if (s["method"], s["seconds"]) == ("cnn", "6"))
    assert (best["flags"], best["trusted"]) == ("", "1")
    assert best.number("bias_dps") == pytest.approx(2.3, abs=0.05)
    want = ((-8914 + 263) * LSB_DPS - best.number("bias_dps")) / (1 + best.number("scale"))
    np.testing.assert_allclose(corrected(text), want, rtol=1e-8)


def test_network_paper_never_corrects(build: Build, tmp_path: Path) -> None:
    text = run(build(HERE / "bench.c", without_gyrocal(tmp_path / "include")), f"noise 5\npower\n{PAIR}{CORRECTED}")
    answers = sentences(text, "CAL")
    assert answers[-1]["method"] == "cnn"
    best = next(s for s in reversed(answers) if s["method"] == "baseline")
    want = (-8960 * LSB_DPS - best.number("bias_dps")) / (1 + best.number("scale"))
    np.testing.assert_allclose(corrected(text), want, rtol=1e-8)


@pytest.mark.parametrize("forged", ["method 77", "method -1", "axis 3", "axis -1"])
def test_what_was_kept_is_looked_at_before_it_is_used(bench: Path, forged: str) -> None:
    text = run(bench, f"power\n{PAIR}forge {forged}\npower\n> dump\nrun 2\n> stream corrected\nrun 0.1\n")
    assert not sentences(text, "OLD")
    assert sentences(text, "WIN")
    assert sentences(text, "GYR")  # what it corrects was whole


def test_results_of_another_network_are_invalid(bench: Path) -> None:
    text = run(bench, f"power\n{PAIR}forge net 12345\npower\n> dump\nrun 2\n> stream corrected\n")
    assert not sentences(text, "OLD")
    assert errors(text) == ["not_calibrated"]


def test_a_name_of_500_letters_leaves_the_greeting_whole(build: Build, tmp_path: Path) -> None:
    header = (INCLUDE / "calibration.h").read_text()
    name = header.split('.name = "')[1].split('"')[0]
    (tmp_path / "calibration.h").write_text(header.replace(f'.name = "{name}"', f'.name = "{"n" * 500}"'))
    program = build(HERE / "bench.c", tmp_path)
    change = "> set rate_hz 1387.12345\n> set table_dps -1234.56789\n> set turn_deg -123456.789\n> hello\n"
    for hello in sentences(run(program, f"power\n{change}"), "HEL"):
        assert hello["net"] == "gyrocal"
        assert set(hello["cal"]) == {"n"}
        assert len(hello["cal"]) >= 16


@pytest.mark.parametrize("field", ["white_sd_dps", "ou_sd_dps", "ou_tau_s"])
def test_a_calibration_that_is_not_finite_is_refused(build: Build, tmp_path: Path, field: str) -> None:
    header = (INCLUDE / "calibration.h").read_text()
    lines = [line for line in header.splitlines() if f".{field} " not in line]
    at = next(i for i, line in enumerate(lines) if ".name = " in line)
    lines.insert(at, f"    .{field} = INFINITY,")
    (tmp_path / "calibration.h").write_text("#include <math.h>\n" + "\n".join(lines) + "\n")
    text = run(build(HERE / "bench.c", tmp_path), f"noise 5\npower\n{PAIR}")
    assert errors(text) == ["calibration_number"]
    assert all(s.number("scale") == s.number("scale") for s in sentences(text, "CAL"))


def test_commands_end_by_either_sign_or_both(bench: Path) -> None:
    text = run(bench, "power\n> status\rstatus\r\n> hello\n> \n> stop\r\n")
    said = [s["cmd"] if s.tag == "ACK" else s["name"] for s in sentences(text) if s.tag in ("ACK", "ERR")]
    assert said == ["status", "status", "hello", "no_run"]


def test_the_answer_says_what_was_taken(bench: Path) -> None:
    given = {
        "set table_dps 78": ("table_dps", "78"),
        "set table_dps none": ("table_dps", ""),
        "set axis y": ("axis", "y"),
        "auto on": ("auto", "on"),
        "stream raw": ("stream", "raw"),
        "start up": ("face", "up"),
    }
    text = run(bench, f"{STILL}power\n" + "".join(f"> {c}\n" for c in given))
    taken = [(name, value) for s in sentences(text, "ACK") for name, value in s.items() if name != "cmd"]
    assert taken == list(given.values())


def status(text: str) -> list[tuple[str, str]]:
    return [(s["waits"], s["gravity"]) for s in sentences(text, "STA")]


def test_status_says_what_it_waits_for_and_measures(bench: Path) -> None:
    by_hand = f"{STILL}power\nrun 0.3\n> status\n{UP}> start up\nrun 2.5\n> status\n> stop\n> status\n"
    text = run(bench, by_hand)
    assert status(text) == [("start", "up"), ("stop", "up"), ("start", "up")]
    assert [s.number("rate_dps") for s in sentences(text, "STA")[:2]] == pytest.approx([0, 8950 * LSB_DPS])
    stopped = f"{UP}run 3\n> stop\nrun 1\n> status\n"
    alone = f"{STILL}power\n> auto on\nrun 1\n> status\n{UP}run 3\n> status\n{STILL}run 1\n> status\n{stopped}"
    assert [w for w, _ in status(run(bench, alone))] == ["steady", "unsteady", "flip", "unsteady"]
    assert status(run(bench, "fault wrong_id on\npower\n> status\n")) == [("sensor", "")]


def test_flash_is_not_written_in_a_run(bench: Path) -> None:
    text = run(bench, f"{UP}noise 5\npower\n> start up\nrun 1\n> auto on\nrun 1.5\n> stop\npower\n> get auto\n")
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("$RUN") and "state=start" in line)
    end = next(i for i, line in enumerate(lines) if line.startswith("$RUN") and "state=end" in line)
    stores = [i for i, line in enumerate(lines) if line.startswith("# store")]
    assert not [i for i in stores if start < i < end]
    assert [lines[i] for i in stores if i > end] == ["# store windowsb", "# store settingsb"]
    assert sentences(text, "ACK")[-1]["auto"] == "on"


def test_reset_ends_a_dump(bench: Path) -> None:
    text = run(bench, f"power\n{PAIR}> dump\nrun 0.05\n> reset\nrun 1\n")
    (reset,) = (s for s in sentences(text, "ACK") if s["cmd"] == "reset")
    lines = [s for s in sentences(text) if s.tag in ("OLD", "WIN")]
    assert lines
    assert all(s.seq < reset.seq for s in lines)


def test_gravity_that_contradicts_the_face_is_told(bench: Path) -> None:
    text = run(bench, f"{DOWN}noise 5\npower\n> start up\nrun 1\n> stop\n")
    assert errors(text)[0] == "wrong_face"
    assert errors(text).count("wrong_face") == 1
    told = next(s for s in sentences(text, "ERR"))
    assert told.t_us - sentences(text, "RUN")[0].t_us < 400_000


def times_of(said: list[Sentence]) -> np.ndarray:
    return np.array([s.t_us for s in said], dtype=np.int64)


@pytest.mark.parametrize("fifo", ["", "> set rate_hz 104\n> set fifo 16\n"])
def test_a_clock_that_goes_back_does_no_harm(bench: Path, fifo: str) -> None:
    text = run(bench, f"{UP}noise 5\npower\n{fifo}> stream raw\nrun 3\nback 2\nrun 3\n> status\n")
    t_us = times_of(sentences(text, "RAW"))
    assert np.all(np.diff(t_us) >= 0)
    assert t_us[-1] > t_us[0] + 2_500_000
    assert int(sentences(text, "STA")[0]["missed"]) < 3


def test_a_fifo_that_fills_faster_than_it_is_read_does_not_hold_the_device(bench: Path) -> None:
    """A part whose clock runs fifty times too fast: commands are heard all the same."""
    text = run(bench, f"clock 50\n{UP}power\n> set rate_hz 104\n> set fifo 16\nrun 0.5\n> status\n")
    assert int(sentences(text, "STA")[0]["overruns"]) > 0
