"""Every threshold of a verdict stands in the policy, with its meaning, its consequences and what chose it."""

import ast
import dataclasses
import re
from pathlib import Path

import pytest

from gyrocal.policy import JUDGEMENT, POLICY

ROOT = Path(__file__).resolve().parents[2]
HOST = ROOT / "host/gyrocal"
NO_THRESHOLDS = {
    "HANN_NEIGHBOURS",  # a property of the window
    "HIGHEST",  # of the block rate, below Nyquist
    "LEAST_PERIODS",  # below, a Hann window does not part a frequency from the mean
    "BITS",  # of the part's code
    "SHEPPARD",  # variance of rounding
    "HARMONICS", "LEAST", "LARGEST_NOISE",  # terms of the error of rounding that are small enough to be left out
    "RATE_UNIT_DPS",  # a unit
    "STANDARD_GRAVITY", "DEG",  # units
    "DAYS_A_YEAR",  # a unit
    "ROUNDING_DPS",  # of the numbers' own digits
    "(STRETCHES, LEAST_STRETCH, STILLEST)", "CLUSTERS", "WINDOW_S", "QUARTERS",  # parts of a run
    "MOST_POINTS", "(FEWEST_CYCLES, STEP)",  # limits and steps of a search
    "USUAL_RANGES_DPS", "NEXT_RANGES", "NEAR",  # of parts on the market, and ratios of these that a sentence names
    "WIDE",  # parts bands from lines, which are a percent wide
    "EXPECTED_SD_DPS", "EARTH_DPS", "(TYPICAL_DPS, FACTOR)", "PRIOR_SD",  # of parts and of the Earth
    "FLAT", "SIZES_DPS", "TAUS_S", "SIZES", "TIMES_S", "GRID", "PILOT",  # priors, and grids over which a likelihood is computed
    "ENTRIES", "LEAST_NOISE_G", "LEAST_NOISE_DPS", "NO_ERROR",  # indices; bounds of a division
    "STEPS", "CONVERGED", "ITERATIONS", "ROUNDS", "LONGEST_STEP", "(CONVERGED_DPS, MOST_ITERATIONS)",  # of iterations
    "STILLEST", "TRIM_S", "CHUNK_S", "BLOCK_S", "(TREMBLES, SHRUNK)",  # by which the noise at rest is estimated
    "TURNS_DEG", "STEP_DEG",  # a grid of movements, and of the integral over one
    "AHEAD", "PATIENCE_S", "RESUBMITTED",  # of tasks on several computers
    "CELLS", "(CENTRES, WIDTHS)", "KNEES_HZ", "STEP", "FURTHEST",  # grids over which a likelihood is computed
    "LARGEST_CONDITION", "ROBUST", "NEIGHBOURS",  # of the numbers' digits, of the normal distribution, of a window
    "TOLD",  # how many times a sentence lists, and which sets
    "BEYOND_ROUNDING", "LEAST_LEVEL", "LEAST_APART",  # of rounding, and bounds of a division
    "(LOW_KNEES_HZ, ORDERS)", "AMPLITUDES", "LEFT_OVER", "STATES",  # grids and priors
    "LEFT_BETWEEN", "LEAST_CHI2", "LEAST_OF_NOISE",  # of the computation of the evidence
    "FREE",  # a spread at which each power cycle has its own bias
    "ALIASES",  # images of a frequency
    "KNOTS", "FAILED", "NAMED", "UNNAMED", "NOISE", "SUREST_NOISE",  # measured shares of true names
}
"""Numbers of the layers that judge that are no thresholds."""
JUDGES = [
    *sorted((HOST / "diagnosis").rglob("*.py")), *sorted((HOST / "plausibility").glob("*.py")),
    *sorted((HOST / "gravity").glob("*.py")), *sorted((HOST / "fleet").glob("*.py")),
    *(HOST / f"evidence/{name}.py" for name in ("answer", "checked", "checks", "curve", "weights")),
    HOST / "inference/heldout.py", HOST / "recording/outliers.py", HOST / "calibration/trust.py",
]  # fmt: skip


def test_a_threshold_says_what_it_means_and_what_chose_it() -> None:
    for field in dataclasses.fields(POLICY):
        for word in ("meaning", "larger", "smaller", "chosen_by"):
            assert field.metadata[word], field.name
        tests = re.findall(r"pytest (\S+\.py)", field.metadata["chosen_by"])
        assert all((ROOT / path).is_file() for path in tests), field.name


def test_a_threshold_is_used() -> None:
    source = "\n".join(path.read_text(encoding="utf-8") for path in HOST.rglob("*.py"))
    used = set(re.findall(r"POLICY\.(\w+)", source))
    assert {field.name for field in dataclasses.fields(POLICY)} - used == set()


def test_both_alarms_stay_within_the_family_s() -> None:
    assert POLICY.misfit_alarm + POLICY.name_alarm <= 0.02


def test_the_policy_cannot_be_changed_in_passing() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        POLICY.explained = 0.5  # type: ignore[misc]


def numbers(path: Path) -> list[str]:
    """Names that a module gives a number, or a tuple of numbers, at its top level."""
    found = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            constants = [n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
            if any(isinstance(c, int | float) and not isinstance(c, bool) for c in constants):
                found += [ast.unparse(t) for t in (node.targets if isinstance(node, ast.Assign) else [node.target])]
    return found


@pytest.mark.parametrize("path", JUDGES, ids=lambda p: p.stem)
def test_no_other_number_decides(path: Path) -> None:
    allowed = NO_THRESHOLDS | ({"NEIGHBOURS"} if path.stem == "outliers" else set())
    assert set(numbers(path)) <= allowed


def test_numbers_are_seen(tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text('FDR = 0.05\nGAIN: float = 2\nWIDTHS = (1, 2)\nNAME = "x"\n', encoding="utf-8")
    assert numbers(module) == ["FDR", "GAIN", "WIDTHS"]


def test_what_was_not_measured_says_so() -> None:
    for field in dataclasses.fields(POLICY):
        chosen_by = field.metadata["chosen_by"]
        measured = any(word in chosen_by for word in ("gyrocal ", "pytest ", "python benchmarks/", "Rayleigh", "docs/"))
        assert measured or JUDGEMENT in chosen_by or "chosen by judgement" in chosen_by
