"""Pictures of real recordings by others: the residual against the accused variable, before and after `explain`.

    python benchmarks/real_pictures.py docs/images

prints what `gyrocal explain` prints of two recordings that ``benchmarks/real.py`` grades, and draws ``real_chamber.png`` and
``real_stepper.png``.

    python benchmarks/real_pictures.py docs/images --gallery

draws five of the recordings themselves, as `gyrocal plot` does, for docs/gallery.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import real

from gyrocal.diagnosis.answer.explain import Explanation, explain
from gyrocal.diagnosis.residual.levels import Cleaned
from gyrocal.effects.quantities import rate_slope_dps_s
from gyrocal.present.explanation import print_explanation
from gyrocal.present.preview import preview
from gyrocal.recording.session import AXES, Array, Run, Session

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Quantity = Callable[[Run, int], Array]
PANELS: dict[str, list[tuple[str, str, Quantity, int]]] = {
    "chamber": [
        ("x", "temperature, °C", lambda run, axis: np.asarray(run.temp_c), 10),
        ("y", "temperature, °C", lambda run, axis: np.asarray(run.temp_c), 10),
    ],
    "stepper": [
        ("y", "change of the rate, deg/s²", lambda run, axis: rate_slope_dps_s(run, axis), 1),
        ("x", "rate about y, deg/s", lambda run, axis: run.rate_dps, 1),
    ],
}
"""For each recording: axis, label and values of the accused variable, and the number of samples of a drawn mean."""


class _Opened(Exception):
    """Carries the first session of a recording out of its grading."""


def first_session(name: str, work: Path) -> Session:
    """The first session that a recording's grading explains."""
    folder, grade = real.RECORDINGS[name]

    def stop(session: Session, **_: Any) -> Explanation:
        raise _Opened(session)

    real.explain = stop  # type: ignore[attr-defined]
    try:
        list(grade(real.REALDATA / folder, work))
    except _Opened as opened:
        return opened.args[0]  # type: ignore[no-any-return]
    raise LookupError(name)


def draw(name: str, found: Explanation, folder: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(PANELS[name]), figsize=(10, 3.6), layout="constrained")
    for panel, (axis, label, quantity, together) in zip(axes, PANELS[name], strict=True):
        for told, diagnosis, colour in (("before", found.first, "tab:orange"), ("after", found.last, "tab:blue")):
            _scatter(panel, diagnosis.comparison.fit, axis, quantity, together, told, colour)
        panel.set(xlabel=label, ylabel=f"residual of {axis}, deg/s")
        panel.legend(loc="best")
    figure.savefig(folder / f"real_{name}.png", dpi=90)


def _scatter(panel: Axes, fit: Any, axis: str, quantity: Quantity, together: int, told: str, colour: str) -> None:
    by_run = Cleaned.of(fit, axis).by_run
    for block in fit.blocks:
        values, residual = quantity(block.run, AXES.index(axis)), by_run[block.run.index]
        whole = residual.size // together * together
        values, residual = (v[:whole].reshape(-1, together).mean(axis=1) for v in (values, residual))
        inner = np.abs(values - np.median(values)) <= np.quantile(np.abs(values - np.median(values)), 0.995)
        shown = inner & (np.arange(inner.size) % max(1, inner.size // 4000) == 0)
        panel.plot(values[shown], residual[shown], ".", markersize=2, color=colour, alpha=0.6, label=told)


GALLERY = ("chamber", "Ferraris", "MPU-6050 at rest", "stepper", "motion capture")


def gallery(folder: Path) -> None:
    for name in GALLERY:
        with tempfile.TemporaryDirectory() as work:
            figure = preview(first_session(name, Path(work)))
            figure.savefig(folder / f"recording_{name.replace(' ', '_').lower()}.png", dpi=55)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("recording", nargs="*", default=list(PANELS))
    parser.add_argument("--gallery", action="store_true", help="draw the recordings themselves")
    given = parser.parse_args()
    if given.gallery:
        gallery(given.folder)
        return 0
    for name in given.recording:
        with tempfile.TemporaryDirectory() as work:
            found = explain(first_session(name, Path(work)))
            print_explanation(found, Path(name), Path(f"{name}.toml"))
            draw(name, found, given.folder)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
