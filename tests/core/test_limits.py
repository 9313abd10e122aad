"""The core beyond what the device asks of it: its mathematics against numpy's, its texts, and tables that do not fit."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from gyrocal.device.wire import encode
from gyrocal_firmware import CORE

from .conftest import Build, run

NAN, INF = float("nan"), float("inf")
ERRORS = {
    int(code): (name, advice)
    for code, name, advice in re.findall(
        r'X\(GC_E_\w+, (-\d+), "(\w+)", "([^"]+)"\)', (CORE / "gc_error.h").read_text(encoding="utf-8")
    )
}


@pytest.fixture(scope="module")
def limits(build: Build) -> Path:
    return build(Path(__file__).with_name("limits.c"))


def bits(x: float, kind: type[np.floating]) -> str:
    return f"{int(np.asarray(x, kind).view(np.uint32 if kind is np.float32 else np.uint64)):x}"


def values(limits: Path, function: str, x: list[float], kind: type[np.floating]) -> np.ndarray:
    jobs = "".join(f"{function} {bits(each, kind)}\n" for each in x)
    return np.array([float(line) for line in run(limits, jobs).split()])


@pytest.mark.parametrize(("function", "reference"), [("exp", np.exp), ("tanh", np.tanh)])
def test_the_ends_of_float_functions_are_those_of_numpy(limits: Path, function: str, reference: np.ufunc) -> None:
    x = [NAN, INF, -INF, 88.8, 88.7, 88.4, -87.0, -87.4, -200.0, 9.0, 9.1, -9.1, 50.0, -50.0, 1e-30, 0.0, -0.0]
    with np.errstate(over="ignore"):
        expected = reference(np.array(x, np.float32)).astype(float)
    expected[np.abs(expected) < np.finfo(np.float32).tiny] = 0.0  # no denormal answers
    if function == "tanh":
        expected[x.index(1e-30)] = 0.0  # 1 - 2 / (exp(2 x) + 1): an error of 1e-7 of 1
    np.testing.assert_allclose(values(limits, function, x, np.float32), expected, rtol=3e-7, atol=1.5e-7)


def test_angles_without_a_direction_have_no_sine_and_whole_turns_are_none(limits: Path) -> None:
    large = [8388608.0, -8388608.0, 3e38, -3e38]
    for function, whole in (("sin", 0.0), ("cos", 1.0)):
        got = values(limits, function, [NAN, INF, -INF, *large], np.float32)
        assert np.isnan(got[:3]).all()
        assert got[3:].tolist() == [whole] * 4


def test_double_functions_hold_for_every_size(limits: Path) -> None:
    x = [1.0, 2.0, 1e-300, 1e300, 5e-324, 2.2e-308, 2.3e-308, 0.7071, 1.4143]
    np.testing.assert_allclose(values(limits, "log", x, np.float64), np.log(x), rtol=1e-12, atol=1e-12)
    x = [0.0, 1e-9, 0.3, 30.0, 699.0, 701.0, 1e9]
    np.testing.assert_allclose(values(limits, "decay", x, np.float64), np.exp(-np.array(x)), rtol=1e-12, atol=1e-300)


def test_every_error_has_the_text_of_the_list(limits: Path) -> None:
    assert len(ERRORS) > 45
    lines = run(limits, "".join(f"code {code}\n" for code in [*ERRORS, 0, -999, 7])).splitlines()
    assert lines == [*(f"{name}|{advice}" for name, advice in ERRORS.values()), "ok|nothing to do",
                     *["unknown|update firmware and host to one version"] * 2]  # fmt: skip
    assert len({name for name, _ in ERRORS.values()}) == len(ERRORS)
    for name, advice in ERRORS.values():  # the wire has no commas, and a blank is an underscore there
        assert not set(advice) & set(",*$="), name


def test_a_field_is_found_by_its_name(limits: Path) -> None:
    sentence = encode("STA", 7, 12345, 0, {"state": "idle", "n": 3}).decode().strip()
    jobs = "".join(f"field {name} {sentence}\n" for name in ("state", "n", "sta", "missing"))
    assert run(limits, jobs).split() == ["idle", "3", "-", "-"]
    positional = encode("RAW", 7, 12345, 0, [1, 2, 3]).decode().strip()
    assert run(limits, f"field n {positional}\n").split() == ["-"]


CASES = {
    "solve_short_first": "too_short", "solve_short_second": "too_short", "solve_one_rate": "unidentified", "solve": "ok",
    "rest_short": "too_short", "rest": "ok",
    "paper": "ok", "paper_nan": "net_input", "paper_rate_up": "net_table_rate", "paper_rate_down": "net_table_rate",
    "paper_no_window": "net_window", "paper_clips": "ok",
    "check_paper": "ok", "check_no_window": "net_window", "check_window": "net_window", "check_outputs": "net_window",
    "check_scratch": "net_memory",
    "answer": "ok", "answer_one_sense": "net_table_rate", "answer_other_senses": "net_table_rate", "alone": "ok",
    "alone_rate": "net_table_rate", "no_network": "ok",
    "face_at_once": "ok", "face_without_count": "net_range",
    **{f"too_large{k}": "net_memory" for k in range(5)},
    "settings": "ok", "no_store": "store_failed",
    "columns": "ok", "too_many_run": "too_many_columns", "too_many_shared": "too_many_columns",
    "too_many_alternatives": "too_many_columns",
}  # fmt: skip


def test_what_does_not_fit_is_refused_by_its_name(limits: Path) -> None:
    got = run(limits, "".join(f"{case}\n" for case in CASES)).splitlines()
    assert dict(zip(CASES, got, strict=True)) == CASES


def test_no_number_of_a_calibration_may_be_without_end(limits: Path) -> None:
    """Each number of a calibration in turn; the first is the white noise, for which NaN is no noise."""
    jobs = [(which, x) for which in range(9) for x in ("inf", "-inf", "nan", "0.5")]
    got = run(limits, "".join(f"calibration{which} {x}\n" for which, x in jobs)).splitlines()
    for (which, x), error in zip(jobs, got, strict=True):
        none = which == 0 and x in ("nan", "-inf")
        assert error == ("ok" if x == "0.5" else "no_white_noise" if none else "calibration_number"), (which, x)


def test_numbers_of_any_length_and_exponent_are_read_as_python_reads_them(build: Build) -> None:
    """Within one part in 1e14: the core reads numbers in decimal, without correct rounding."""
    texts = ["123456789012345678901234567890", "0.00000000000000000000000000012345678901234567890123", "9" * 60, "1e99",
             "1e-299", "3e-305", "1e-350", "1e-400", "1e-99999999", "0e99999999", "25E-1", "1" + "0" * 50 + "e-50"]  # fmt: skip
    got = run(build(Path(__file__).with_name("codec.c")), "".join(f"number {text}\n" for text in texts)).split()
    np.testing.assert_allclose([struct.unpack(">d", bytes.fromhex(t))[0] for t in got], [float(t) for t in texts], rtol=1e-14)
