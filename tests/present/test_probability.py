"""The sentences of probabilities say what the figures of a diagnosis say."""

from typing import Any

from gyrocal.present.probability import in_words, left_over, of_100, probability_rows, sentence, set_rows


def found(axis: str, effects: list[str], unnamed: list[str], probability: float) -> dict[str, Any]:
    return {"axis": axis, "effects": effects, "unnamed": unnamed, "probability": probability}


def test_a_probability_is_told_as_a_count_of_a_hundred_answers() -> None:
    assert of_100(0.958) == "96 of 100 such answers are right"
    assert of_100(0.002) == "fewer than 1 of 100 such answers is right"


def test_checks_that_pass_and_fail_are_told_apart() -> None:
    judged = {"probability": 0.9, "checks": {"share": 0.97, "same_in_parts_p": 0.3}}
    assert [name for name, _ in probability_rows(judged)] == ["probability", "its share", "the same in parts"]
    failed = {"probability": 0.2, "checks": {"share": 0.2, "same_in_parts_p": 1e-6, "difference": 0.9}}
    rows = dict(probability_rows(failed))
    assert "so little" in rows["its share"]
    assert "p = 1e-06" in rows["not the same in parts"]
    hardly = dict(probability_rows({"probability": 0.9, "checks": failed["checks"] | {"difference": 0.15}}))
    assert "within 15 %" in hardly["the same in parts"]
    assert probability_rows({"probability": None, "checks": None}) == []
    assert probability_rows({"effect": "lag"}) == []  # kept by an earlier version
    assert [name for name, _ in probability_rows({"probability": 0.5, "checks": None})] == ["probability"]


def test_the_terminal_tells_probability_and_checks_in_one_line() -> None:
    judged = {
        "effect": "warmup", "axis": "z", "probability": 0.958, "checks": {"share": 0.97, "same_in_parts_p": 0.3}
    }  # fmt: skip
    assert sentence(judged) == (
        "warmup on z: 96 of 100 such answers are right; its share: 97 % of "
        "what it and a disturbance without a name describe together; the "
        "same in the first and the last half, slow and fast, in both directions, cold and warm, as far as the recordings show "
        "(p = 0.3)."
    )
    assert sentence({"effect": "lag", "axis": "z", "probability": None, "checks": None}) == ""


def test_the_sets_of_an_axis_stand_in_order_and_noise_alone_is_left_out() -> None:
    told = [
        found("x", [], [], 0.9), found("z", ["drift"], [], 0.2), found("z", ["warmup"], ["temperature"], 0.7),
        found("z", [], [], 0.01),
    ]  # fmt: skip
    assert set_rows(told) == [
        ["z", "warmup and something without a name, against temperature", "70"], ["z", "drift", "20"]
    ]  # fmt: skip
    assert in_words(told[0]) == "noise alone"


def test_what_is_left_over_is_told_from_half_of_the_probability_on() -> None:
    little = [found("z", ["drift"], [], 0.6), found("z", [], ["rate_slope"], 0.3)]
    assert left_over(little) == ""
    much = [found("z", ["drift"], ["rate_slope"], 0.4), found("z", [], ["rate_slope"], 0.3)]
    assert left_over(much) == "Something is left over that no effect describes: on z, against rate slope."
