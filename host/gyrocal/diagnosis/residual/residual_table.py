"""The residuals of a comparison as a table or a file."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.errors import InputError
from gyrocal.files import replacing
from gyrocal.inference import heldout
from gyrocal.recording.session import AXES


def residual_table(comparison: Comparison) -> pl.DataFrame:
    """Held-out predictions as a table with the columns file, t_s, axis, measured_dps and modelled_dps.

    The predictions are in sample if nothing can be held out. A sample without a reference has no row. A session that is judged
    by angle has measured_deg and modelled_deg, in a row for each sample or, for net angles, for each run and axis.
    """
    if comparison.angles is not None:
        return comparison.angles.table
    fitted = comparison.fit
    folds = heldout.folds(comparison.likeliest) if comparison.held_out != "none" else []
    if comparison.held_out == heldout.SESSION:
        folds = [heldout.whole(fitted)]
    source = heldout.predictions(fitted, folds) if folds else heldout.fitted(fitted)
    parts = [
        pl.DataFrame({
            "file": pl.repeat(p.run.file, p.modelled_dps.size, eager=True),
            "t_s": p.run.t_s[p.rows],
            "axis": pl.repeat(AXES[p.axis], p.modelled_dps.size, eager=True),
            "measured_dps": p.measured_dps,
            "modelled_dps": p.modelled_dps,
        }).filter(p.run.reached[p.rows])
        for p in source
    ]  # fmt: skip
    return pl.concat(parts)


def write_residuals(comparison: Comparison, path: Path) -> None:
    """Write :func:`residual_table` as Parquet or CSV, according to the file name's ending.

    The file is replaced only when it is complete. Raises InputError if it cannot be written.
    """
    frame = residual_table(comparison)
    try:
        with replacing(path) as partial:
            frame.write_parquet(partial) if path.suffix == ".parquet" else frame.write_csv(partial)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
