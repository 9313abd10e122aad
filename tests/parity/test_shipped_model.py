"""The model that ships for the campaign table2: its header is its export, the C core answers as the host, near the limit."""

from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration import limit
from gyrocal.calibration.estimator import Posterior, calibration_of
from gyrocal.calibration.header import render
from gyrocal.calibration.scenarios import answers
from gyrocal.core.estimator import CoreEstimator
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import paper_windows

MODEL = Path(str(files("gyrocal"))) / "data" / "table2" / "model.toml"
HEADER = MODEL.with_name("calibration.h")
SECONDS = (2.0, 4.0, 6.0)


@pytest.fixture(autouse=True)
def _cc(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")


def both(header: Path) -> Iterator[tuple[float, np.ndarray, Posterior]]:
    """After 2, 4 and 6 s: the C core's answers with a header, and the host's by the model that ships."""
    data = paper_windows(300, 31)
    found = CoreEstimator(header).answers(data["up"], data["down"], SECONDS, limit.PROTOCOL)
    model = calibration_of(Model.open(MODEL), "z")
    for k, seconds in enumerate(SECONDS):
        yield seconds, found[k], answers(model, data["up"], data["down"], seconds, limit.PROTOCOL)


def in_standard_errors(c: np.ndarray, p: Posterior) -> float:
    """The largest difference of scale and bias."""
    scale, bias = (c[:, 0] - p.scale) / p.scale_se, (c[:, 2] - p.bias_dps) / p.bias_se_dps
    return float(np.abs([scale, bias]).max())


def test_the_header_is_what_export_makes_of_the_model() -> None:
    assert HEADER.read_text(encoding="utf-8") == render(Model.open(MODEL), "z")


def test_the_core_answers_as_the_host() -> None:
    for seconds, c, p in both(HEADER):
        assert in_standard_errors(c, p) < 1e-4
        np.testing.assert_allclose(c[:, 1], p.scale_se, rtol=1e-5)
        np.testing.assert_allclose(c[:, 3], p.bias_se_dps, rtol=1e-5)
        np.testing.assert_allclose(c[:, 4], np.sqrt(p.chi2 / (8 * seconds)), rtol=1e-5)


@pytest.mark.parametrize("parameter", [-2, -1])
def test_a_prior_of_the_wrong_sign_is_noticed(parameter: int, tmp_path: Path) -> None:
    text = HEADER.read_text()
    line = next(row for row in text.splitlines() if "gyrocal_prior_mean[]" in row)
    means = line[line.index("{") + 1 : line.index("}")].split(", ")
    means[parameter] = str(-float(means[parameter]))
    broken = tmp_path / "calibration.h"
    broken.write_text(text.replace(line, f"{line[: line.index('{')]}{{{', '.join(means)}}};"))
    assert max(in_standard_errors(c, p) for _, c, p in both(broken)) > 0.01


def test_within_a_twentieth_of_the_limit_at_4_and_6_s() -> None:
    data = paper_windows(2000, 991_000)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    found = CoreEstimator(HEADER).answers(data["up"], data["down"], SECONDS, limit.PROTOCOL)
    for k, seconds in enumerate(SECONDS):
        best = limit.limit(data["up"], data["down"], seconds, grid=12)
        least = np.abs(np.column_stack([best.scale, best.bias_dps]) - truth).mean(0)
        assert np.all(np.abs(found[k][:, [0, 2]] - truth).mean(0) < (1.08 if seconds == 2.0 else 1.05) * least)


def test_what_is_no_calibration_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="gyrocal export"):
        CoreEstimator(tmp_path / "absent.h")
    strange = tmp_path / "calibration.h"
    strange.write_text("int x;\n")
    with pytest.raises(InputError, match="not a calibration"):
        CoreEstimator(strange)
    core, quiet = CoreEstimator(HEADER), np.zeros((1, 300))
    with pytest.raises(InputError, match="samples"):
        core.answers(quiet, quiet[:, 1:], SECONDS, limit.PROTOCOL)
    with pytest.raises(InputError, match="ascending"):
        core.answers(quiet, quiet, (4.0, 2.0), limit.PROTOCOL)
