"""What the device keeps: answers and raw windows over power-off, dumped whole, and the corrected stream."""

from pathlib import Path

import numpy as np
import pytest

from .conftest import HERE, Build, Sentence, run, sentences
from .test_device import DOWN, STILL, UP, errors

PAIR = f"{UP}noise 5\n> start up\nrun 6.5\n> stop\n{DOWN}> start down\nrun 6.5\n> stop\n"
LSB_DPS = 0.00875


@pytest.fixture(scope="module")
def bench(build: Build) -> Path:
    return build(HERE / "bench.c")


def counts(windows: list[Sentence], face: str) -> list[int]:
    """A window's counts, from its lines."""
    lines = [s for s in windows if s["face"] == face]
    got = [int(s[k]) for s in lines for k in sorted((k for k in s if k.isdigit()), key=int)]
    assert {int(s["n"]) for s in lines} <= {len(got)}
    assert [int(s["at"]) for s in lines] == list(range(0, len(got), 16))
    return got


def test_dump_tells_the_answers_and_the_counts_behind_them(bench: Path) -> None:
    text = run(bench, f"power\n> stream raw\n{PAIR}> stream off\n> dump\nrun 2\n")
    answers, old, windows = (sentences(text, tag) for tag in ("CAL", "OLD", "WIN"))
    assert [dict(s) for s in old] == [dict(s) for s in answers]
    assert len(old) == 6
    (ack,) = (s for s in sentences(text, "ACK") if s["cmd"] == "dump")
    assert int(ack["lines"]) == len(old) + len(windows) == 6 + 2 * 55
    raw = [s for s in sentences(text, "RAW") if s["0"] != "-1"]
    starts = [i for i, s in enumerate(raw) if s["0"] == "0"]
    for face, start in zip(("up", "down"), starts, strict=True):
        assert counts(windows, face) == [int(s["3"]) for s in raw[start : start + 870]]
    assert {(s["axis"], s["rate_hz"], s["lsb_dps"]) for s in windows} == {("z", "145", "0.00875")}
    assert {s["w_dps"] for s in windows if s["face"] == "down"} == {"-78"}
    assert [s.seq for s in sentences(text)] == list(range(len(sentences(text))))


def test_all_of_it_survives_power_off(bench: Path) -> None:
    text = run(bench, f"power\n{PAIR}> dump\nrun 2\npower\n> dump\nrun 2\n")
    for tag in ("OLD", "WIN"):
        said = [dict(s) for s in sentences(text, tag)]
        assert said[: len(said) // 2] == said[len(said) // 2 :] != []
    forgotten = run(bench, f"power\n{PAIR}> reset\npower\n> dump\nrun 2\n")
    assert not sentences(forgotten, "OLD")
    assert not sentences(forgotten, "WIN")
    assert errors(run(bench, f"power\nstore fails\n{PAIR}")) == ["store_failed"] * 2  # once a run


def test_a_full_line_makes_the_dump_wait_not_lose(bench: Path) -> None:
    text = run(bench, f"power\n{PAIR}> dump\nrun 0.05\ndrop 30\nrun 2\n> status\n")
    assert len(sentences(text, "WIN")) == 110
    assert [s.seq for s in sentences(text)] == list(range(len(sentences(text))))
    assert sentences(text, "STA")[-1]["lost"] == "0"


def test_dump_is_refused_in_a_run_and_ends_with_the_next(bench: Path) -> None:
    assert errors(run(bench, f"{UP}power\n> start up\nrun 1\n> dump\n")) == ["recording"]
    text = run(bench, f"power\n{PAIR}> dump\nrun 0.05\n> start down\nrun 1\n> stop\nrun 1\n")
    assert 0 < len(sentences(text, "WIN")) < 110
    assert max(s.t_us for s in sentences(text, "WIN")) < sentences(text, "RUN")[-2].t_us


def test_the_oldest_answers_give_way(bench: Path) -> None:
    text = run(bench, f"power\n{PAIR * 6}> dump\nrun 2\n")
    answers = [dict(s) for s in sentences(text, "CAL")]
    assert len(answers) == 36
    assert [dict(s) for s in sentences(text, "OLD")] == answers[-30:]


def test_corrected_rates_are_the_reading_less_bias_and_scale(bench: Path) -> None:
    text = run(
        bench, f"power\n> stream corrected\n{PAIR}> stream corrected\nnoise 0\nrun 0.5\npower\n> stream corrected\nrun 0.5\n"
    )
    assert errors(text) == ["not_calibrated"]
    best = sentences(text, "CAL")[-1]  # at 6 s by the network, the richest that answered
    assert (best["method"], best["seconds"]) == ("cnn", "6")
    rates = sentences(text, "GYR")
    assert {s["0"] for s in rates} == {"-1"}
    assert {s["1"] + s["2"] for s in rates} == {""}  # axes without a calibration
    want = (-8960 * LSB_DPS - best.number("bias_dps")) / (1 + best.number("scale"))
    np.testing.assert_allclose([s.number("3") for s in rates], want, rtol=1e-8)
    assert len(rates) == pytest.approx(2 * 0.5 * 145, abs=12)
    assert want == pytest.approx(-78.0, abs=0.2)


def test_a_run_at_rest_renews_the_bias(bench: Path) -> None:
    rest = f"{STILL.replace('0 0 0 0', '0 0 0 40')}> set table_dps 0\n> start up\nrun 3\n> stop\n"
    text = run(bench, f"power\n{PAIR}{rest}> stream corrected\nrun 0.3\n")
    scale = [s for s in sentences(text, "CAL") if s["method"] == "cnn"][-1].number("scale")
    (at_rest,) = (s for s in sentences(text, "CAL") if s["method"] == "rest")
    said = sentences(text, "GYR")
    measured = np.array([s.number("3") for s in said]) * (1 + scale) + at_rest.number("bias_dps")
    np.testing.assert_allclose(measured / LSB_DPS, np.round(measured / LSB_DPS), atol=1e-4)
    assert abs(np.mean([s.number("3") for s in said])) < 5 * 5 * LSB_DPS / np.sqrt(len(said))


def test_after_a_reset_there_is_nothing_to_undo(bench: Path) -> None:
    assert errors(run(bench, f"power\n{PAIR}> reset\n> undo\n")) == ["no_undo"]


def test_the_error_of_a_turn_grows_with_the_seconds_that_the_bias_of_a_short_rest_is_taken_for(bench: Path) -> None:
    """An unknown bias turns the reading by its error times the seconds of the turn, its rest included."""
    rest = f"{STILL}noise 5\npower\n> set table_dps 0\n> start up\nrun 3\n> stop\n"
    turn = f"> set table_dps none\n> set turn_deg 90\n> start up\n{UP}run 1.15\n{STILL}run 20\n> stop\n"
    said = {s["method"]: s for s in sentences(run(bench, rest + turn), "CAL")}
    by_bias = said["rest"].number("bias_se_dps") * 21.15 / 90
    assert by_bias < said["turn"].number("scale_se") < 1.2 * by_bias  # white noise adds a few percent


def test_a_turn_on_the_wrong_face_is_told(bench: Path) -> None:
    rest = f"{STILL}noise 5\npower\n> set table_dps 0\n> start up\nrun 3\n> stop\n"
    turn = f"> set table_dps none\n> set turn_deg 90\n> start {{}}\n{UP}run 1.15\n{STILL}run 1\n> stop\n"
    assert "wrong_face" not in errors(run(bench, rest + turn.format("up")))
    assert "wrong_face" in errors(run(bench, rest + turn.format("down")))


def test_a_rest_or_a_turn_without_samples_is_too_short(bench: Path) -> None:
    rest = f"{STILL}noise 5\npower\n> set table_dps 0\n> start up\n"
    assert errors(run(bench, f"{rest}> stop\n")) == ["too_short"]
    turn = "> set table_dps none\n> set turn_deg 90\n> start up\n> stop\n"
    assert errors(run(bench, f"{rest}run 3\n> stop\n{turn}")) == ["too_short"]


def test_reset_ends_the_corrected_stream_and_undo_waits_for_the_end_of_a_run(bench: Path) -> None:
    text = run(bench, f"power\n{PAIR}> stream corrected\nrun 0.1\n> reset\nrun 0.5\n> start up\n> undo\nrun 0.1\n")
    assert sentences(text, "GYR")
    assert not sentences(text[text.index("cmd=reset") :], "GYR")
    assert errors(text) == ["recording"]
