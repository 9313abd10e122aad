"""Single readings that lack one bit or carry, or have a byte of another sample: told from outliers of another cause."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from gyrocal.effects.base import effect
from gyrocal.effects.bias_jumps import outliers_of
from gyrocal.effects.reading_fault import Detected
from gyrocal.effects.single_bits import single_power
from gyrocal.recording.session import Run
from make_runs import make_run

LSB_DPS = 0.00875
NOISE_DPS = 0.05
Codes = np.ndarray[Any, np.dtype[np.int64]]
Fault = Callable[[Codes, np.random.Generator], Codes]


def runs(fault: Fault, seed: int, swing: bool = False, noise_dps: float = NOISE_DPS) -> list[Run]:
    """Ten runs of 12 s, at constant rates or in a swing, whose codes have a fault."""
    rng, made = np.random.default_rng(seed), []
    t_s = np.arange(1200) / 100
    for i, rate_dps in enumerate((0.0, 30.0, -30.0, 78.0, -78.0) * 2):
        rate = 60 * np.sin(2 * np.pi * 0.3 * t_s + i) if swing else np.full(t_s.size, rate_dps)
        y = rng.normal(0.37 + 0.02 * i, noise_dps, (t_s.size, 3)) + rate[:, None] * [0.003, -0.002, 1.004]
        codes = np.rint(y / LSB_DPS).astype(np.int64)
        faulty = np.column_stack([fault(codes[:, axis], rng) for axis in range(3)]) * LSB_DPS
        known: dict[str, Any] = {"rate_ref_dps": rate} if swing else {"table_rate_dps": rate_dps}
        made.append(make_run(t_s, faulty, scenario=f"s{i}", rate_hz=100.0, lsb_dps=LSB_DPS, **known))
    return made


def seldom(part: float, changed: Callable[[Codes], Codes]) -> Fault:
    return lambda codes, rng: np.where(rng.random(codes.size) < part, changed(codes), codes)


def told(made: Sequence[Run], effect_id: str, axis: int = 2) -> Detected | None:
    fault = effect(effect_id).fault
    assert fault is not None
    return fault.detect(made, axis)


@pytest.mark.parametrize("swing", [False, True])
@pytest.mark.parametrize(("bit", "part"), [(6, 0.01), (8, 0.005), (10, 0.005)])
@pytest.mark.parametrize("state", [0, 1])
def test_a_bit_that_is_seldom_lost_is_no_jump_of_the_bias(bit: int, part: float, state: int, swing: bool) -> None:
    made = runs(seldom(part, lambda c: c | 1 << bit if state else c & ~(1 << bit)), bit, swing)
    found = told(made, "byte_fault")
    assert found is not None
    assert found.values["bit"] == bit
    assert told(made, "bias_jumps") is None


def test_the_low_byte_of_the_sample_before_is_seen_in_motion() -> None:
    """The readings deviate by any number of counts, of which single jumps of the bias were made."""
    made = runs(seldom(0.01, lambda c: c >> 8 << 8 | np.append(c[:1], c[:-1]) & 255), 3, swing=True)
    found = told(made, "byte_fault")
    assert found is not None
    assert found.values["bit"] >= 8
    assert told(made, "bias_jumps") is None


@pytest.mark.parametrize("swing", [False, True])
@pytest.mark.parametrize("bit", [6, 8, 10])
def test_a_flipped_bit_is_set_in_readings_too_large_and_cleared_in_those_too_small(bit: int, swing: bool) -> None:
    made = runs(seldom(0.003, lambda c: c ^ 1 << bit), bit, swing)
    found = told(made, "byte_fault")
    assert found is not None
    assert found.values["bit"] == bit
    assert told(made, "bias_jumps") is None


def test_low_bits_taken_for_a_signed_number_are_seen_in_few_readings() -> None:
    """The noise crosses the border rarely, and by little: the low bits are in a small part of their range, on either side."""

    def fault(codes: Codes, rng: np.random.Generator) -> Codes:
        codes = codes - int(np.median(codes)) + rng.choice([21, -11])  # three standard deviations of the noise below a border
        return codes - ((codes & 32) << 1)

    made = runs(fault, 2, noise_dps=0.03)
    number = sum(int(np.count_nonzero(outliers_of(r, 2))) for r in made)
    assert 5 <= number < 19  # of as many as 19, one half of the low bits' range would show it
    assert single_power(made, 2) == (6, number)
    assert told(made, "bias_jumps") is None


@pytest.mark.parametrize("swing", [False, True])
@pytest.mark.parametrize("bit", [8, 10])
def test_a_few_readings_without_a_bit_are_no_sure_outliers(bit: int, swing: bool) -> None:
    """Three readings off by a power of two to one side: either cause is possible."""

    def fault(codes: Codes, rng: np.random.Generator) -> Codes:
        codes = codes.copy()
        rows = np.flatnonzero(codes >> bit & 1)
        if rng.random() < 0.5 and rows.size:
            codes[rng.choice(rows)] -= 1 << bit
        return codes

    made = runs(fault, 1, swing)
    found = told(made, "bias_jumps")
    assert found is None or found.chance > 1e-4


@pytest.mark.parametrize("sizes", ["both sides", "any size"])
def test_outliers_of_another_cause_stay_outliers(sizes: str) -> None:
    def fault(codes: Codes, rng: np.random.Generator) -> Codes:
        size = 256 * rng.choice((-1, 1), codes.size) if sizes == "both sides" else -rng.integers(100, 900, codes.size)
        return codes + np.where(rng.random(codes.size) < 0.003, size, 0)

    for seed in range(4):
        made = runs(fault, seed)
        assert told(made, "byte_fault") is None
        found = told(made, "bias_jumps")
        assert found is not None
        assert found.chance < 1e-8
