"""Constants that Python repeats are those of the core's files: each is read there, not remembered."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal.calibration import calibrate, estimator, header, network, pairs, trust, uncertainty
from gyrocal.device import monitor, port, rows, wire
from gyrocal.policy import POLICY
from gyrocal.recording import session

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware/gyrocal_firmware"
FILES = [p for folder in ("lib", "src") for p in sorted((FIRMWARE / folder).rglob("*.[ch]"))]
DEFINE = re.compile(r"^#define[ \t]+(\w+)(\(\w+\))?[ \t]+(.+?)(?:[ \t]*/\*.*)?$", re.M)
FIELD = re.compile(r"^[ \t]+\.(\w+)() = ([^,\n]+),", re.M)


def of_the_lsm6dso(path: Path) -> bool:
    """True for the driver whose table counts where several have a field of one name: it is read last."""
    return path.stem == "gc_lsm6dso"


DEFINED = {
    m[1]: (m[2], m[3])
    for p in sorted(FILES, key=of_the_lsm6dso)
    for form in (DEFINE, FIELD)
    for m in form.finditer(p.read_text(encoding="utf-8"))
}
"""Macros, and fields of tables such as a part's ``.lsb_g``: name -> (parameter, text)."""
SUFFIX = re.compile(r"(?<=[0-9.])[uUlLf]+\b")


def expression(*names: str) -> tuple[str, str]:
    """Parameter and text, as Python reads it, of the first of these names that the firmware defines."""
    name = next((n for n in names if n in DEFINED), None)
    assert name is not None, f"the firmware defines none of {', '.join(names)}"
    parameter, text = DEFINED[name]
    return (parameter or "").strip("()"), SUFFIX.sub("", re.sub(r"\(u?int\d+_t\)", "", text))


def number(*names: str) -> float:
    """The value of a macro without parameters."""
    return float(eval(expression(*names)[1], {}, {}))


def function(name: str) -> Callable[[float], float]:
    """A macro with one parameter."""
    parameter, text = expression(name)
    known = {"sqrt": math.sqrt, "GC_MISFIT_ERRORS": number("GC_MISFIT_ERRORS")}
    return lambda value: float(eval(text, known, {parameter: value}))


CONSTANTS = {
    "block of the estimator, us": (estimator.BLOCK_US, ("GC_BLOCK_US",)),
    "columns of effects": (estimator.MAX_COLUMNS, ("GC_MAX_EFFECT_COLUMNS",)),
    "arguments of an effect": (header.ARGUMENTS, ("GC_EFFECT_ARGS",)),
    "a gap, in periods": (session.GAP_PERIODS, ("GC_GAP_PERIODS",)),
    "a steady rate, of the rate": (pairs.STEADY, ("STEADY_FRACTION", "STAY_FRACTION")),
    "rates that the network takes, of the table's": (POLICY.network_table_rate, ("RATE_TOLERANCE",)),
    "ripple, of the rate": (uncertainty.RIPPLE, ("RIPPLE",)),
    "warm-up, dps": (uncertainty.WARMUP_DPS, ("WARMUP_DPS",)),
    "drift, dps": (uncertainty.DRIFT_SD_DPS, ("DRIFT_SD_DPS",)),
    "drift, s": (uncertainty.DRIFT_TAU_S, ("DRIFT_TAU_S",)),
    "an effect acts, probability": (uncertainty.PRESENT, ("PRESENT",)),
    "least noise, dps": (uncertainty.SMALLEST_SD_DPS, ("SMALLEST_SD_DPS",)),
    "means that show noise at long times, Hz": (uncertainty.SHORT_HZ, ("SHORT_HZ",)),
    "noise is correlated, standard errors": (uncertainty.CORRELATED, ("CORRELATED",)),
    "latest reading held against an answer, us": (uncertainty.LATEST_US, ("LATEST_US",)),
    "end of a run that is not, us": (uncertainty.STOPS_US, ("STOPS_US",)),
    "too large a misfit, standard deviations": (POLICY.misfit_errors, ("GC_MISFIT_ERRORS",)),
    "an answer disagrees, of its standard error": (POLICY.network_disagrees, ("DISAGREES",)),
    "largest plausible scale": (POLICY.largest_scale, ("LARGEST_SCALE",)),
    "largest plausible bias, dps": (POLICY.largest_bias_dps, ("LARGEST_BIAS_DPS",)),
    "a reading stands still, us": (1e6 * POLICY.frozen_s, ("STILL_US",)),
    "a reading stands still, samples": (POLICY.frozen_samples, ("STILL_SAMPLES",)),
    "noise of the sensor, dps": (trust.EXPECTED_SD_DPS, ("GC_LSM6DSO_NOISE_DPS", "noise_dps")),
    "checkpoints": (len(network.STAGES_S), ("GC_CHECKPOINTS",)),
    "protocol": (wire.PROTOCOL, ("GC_WIRE_PROTOCOL",)),
    "longest line, bytes": (wire.MAX_LINE, ("GC_WIRE_MAX",)),
    "most fields of a sentence": (wire.MAX_FIELDS, ("GC_WIRE_MAX_FIELDS",)),
    "baud": (port.BAUD, ("BAUD",)),
    "one count of acceleration, g": (rows.LSB_G, ("GC_LSM6DSO_LSB_G", "lsb_g")),
    "one count of temperature, degC": (1 / rows.COUNTS_PER_C, ("GC_LSM6DSO_LSB_C", "lsb_c")),
    "temperature at zero counts, degC": (rows.ZERO_C, ("GC_LSM6DSO_ZERO_C", "zero_c")),
}


@pytest.mark.parametrize("what", CONSTANTS)
def test_python_repeats_the_firmware_s_constant(what: str) -> None:
    python, names = CONSTANTS[what]
    assert python == number(*names)


@pytest.mark.parametrize("stages_s", [network.STAGES_S, calibrate.DEFAULT_SECONDS])
def test_answers_come_at_the_checkpoints(stages_s: tuple[float, ...]) -> None:
    checkpoint_us = function("GC_CHECKPOINT_US")
    assert [1e6 * s for s in stages_s] == [checkpoint_us(k) for k in range(int(number("GC_CHECKPOINTS")))]


@pytest.mark.parametrize(
    ("name", "python"), [("spin_up", uncertainty.SPIN_UP), ("transient_tau_s", uncertainty.TRANSIENT_TAU_S)]
)
def test_the_transients_of_the_standard_errors_are_the_device_s(name: str, python: tuple[float, ...]) -> None:
    text = (FIRMWARE / "lib/gyrocal_core/gc_trust.c").read_text(encoding="utf-8")
    found = re.search(rf"static const double {name}\[\w*\] = {{([^}}]+)}};", text)
    assert found is not None
    assert tuple(float(word) for word in found[1].split(",")) == python


@pytest.mark.parametrize("seconds", [2.0, 4.0, 6.0])
def test_the_misfit_s_limit_is_the_device_s(seconds: float) -> None:
    both_faces = 2 * 1e6 * seconds / number("GC_BLOCK_US")
    assert monitor.misfit_limit(seconds) == pytest.approx(function("GC_MISFIT_LIMIT")(both_faces), rel=1e-15)


def test_the_simulated_part_has_the_driver_s_ranges() -> None:
    ranges = re.findall(r"\{(\d+\.0), (0\.0\d+), 0x[0-9A-F]{2}\}", "".join(p.read_text(encoding="utf-8") for p in FILES))
    assert {float(scale): float(lsb) for scale, lsb in ranges} == rows.LSB_DPS


def test_a_constant_that_is_gone_is_missed() -> None:
    with pytest.raises(AssertionError, match="defines none of GC_NOWHERE"):
        number("GC_NOWHERE")
