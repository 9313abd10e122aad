"""The sentences of probabilities say what the figures of a diagnosis say."""

from typing import Any

from gyrocal.present.probability import in_words, left_over, of_100, probability_rows, sentence, set_rows


def found(axis: str, effects: list[str], unnamed: list[str], probability: float) -> dict[str, Any]:
    return {"axis": axis, "effects": effects, "unnamed": unnamed, "probability": probability}


def test_a_probability_is_told_as_a_count_of_a_hundred_answers() -> None:
    assert of_100(0.958) == "96 of 100 such answers are right"
    assert of_100(0.002) == "fewer than 1 of 100 such answers is right"


PASSED: dict[str, Any] = {"share": 0.97, "same_in_parts_p": 0.3, "difference": 0.0, "parts": ["time", "speed"]}
FAILED: dict[str, Any] = {"share": 0.2, "same_in_parts_p": 1e-6, "difference": 0.9, "parts": ["temperature", "time"]}


def test_checks_that_pass_and_fail_are_told_apart() -> None:
    judged = {"probability": 0.9, "checks": PASSED}
    assert [name for name, _ in probability_rows(judged)] == ["probability", "its share", "the same in parts"]
    rows = dict(probability_rows({"probability": 0.2, "checks": FAILED}))
    assert "so little" in rows["its share"]
    assert rows["not the same in parts"] == (
        "differs between cold and warm by 90 % of itself, more than chance (p = 1e-06): another cause may look like it"
    )
    assert probability_rows({"probability": None, "checks": None}) == []
    assert probability_rows({"effect": "lag"}) == []  # kept by an earlier version
    assert [name for name, _ in probability_rows({"probability": 0.5, "checks": None})] == ["probability"]


def test_a_small_difference_that_chance_does_not_explain_is_told_as_one() -> None:
    rows = dict(probability_rows({"probability": 0.9, "checks": FAILED | {"difference": 0.08, "passed": True}}))
    assert rows["nearly the same in parts"] == (
        "differs between cold and warm by 8 % of itself, more than chance (p = 1e-06), and less than the 18 % that a model may "
        "be off"
    )


def test_an_answer_that_an_earlier_version_kept_names_no_parts() -> None:
    kept = {name: value for name, value in PASSED.items() if name != "parts"}
    judged = {"effect": "lag", "axis": "z", "probability": 0.9, "checks": kept}
    assert "between the parts that were compared" in sentence(judged)
    kept = {name: value for name, value in FAILED.items() if name not in ("parts", "difference")}
    rows = dict(probability_rows({"probability": 0.2, "checks": kept}))
    assert rows["not the same in parts"].startswith("differs between parts of the data, more than chance")


def test_the_terminal_tells_probability_and_checks_in_one_line() -> None:
    judged = {"effect": "warmup", "axis": "z", "probability": 0.958, "checks": PASSED}
    assert sentence(judged) == (
        "warmup on z: 96 of 100 such answers are right; its share: 97 % of "
        "what it and a disturbance without a name describe together; the same between "
        "the first and the last half of the runs, and slow and fast, as far as the recordings show (p = 0.3)."
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
