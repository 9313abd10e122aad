"""What no reader of an answer should notice: the last digits of the readings, and the order of runs and columns.

Verdict, names and warnings are equal, and figures agree within half of their errors. What limits this is the search for
the noise: its likelihood is flat, and the search stops elsewhere in its flat top, by 0.04 of an error on one processor and
by 0.2 on another. Where an effect is missing or power cycles are few, figures move by up to one of their errors
(``tests/pins/compare.py``).
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.api import Model, Session, diagnose, simulate
from known import ON_Z
from pins import compare, kept

pytestmark = pytest.mark.slow
HALF = 0.5
LAST = 1e-12
"""Of a reading, by which it is disturbed: some thousand roundings of a double."""
SESSIONS: dict[str, tuple[str, tuple[str, ...], dict[str, Any]]] = {
    "ripple": ("paper", ("table_ripple",), {"scenarios": 4, "seconds": 10.0}),
    "asymmetry": ("full", ("scale_asymmetry:k=0.002",), {"scenarios": 4, "seconds": 4.0}),
}


def disturbed(session: Session, folder: Path) -> Session:
    """Each reading changed by a chance part of itself."""
    rng = np.random.default_rng(3)

    def shaken(table: pl.DataFrame) -> pl.DataFrame:
        return table.with_columns(pl.col(f"g{a}_dps") * (1 + LAST * rng.normal(size=table.height)) for a in "xyz")

    return session.with_runs([replace(run, frame=shaken(run.table)) for run in session.runs])


def other_order_of_runs(session: Session, folder: Path) -> Session:
    order = np.random.default_rng(4).permutation(len(session.runs))
    return session.with_runs([session.runs[i] for i in order])


def other_order_of_columns(session: Session, folder: Path) -> Session:
    """Written with the columns of every file in another order, and read again."""
    session.save(folder / "session", parquet=True)
    for path in (folder / "session").glob("*.parquet"):
        table = pl.read_parquet(path)
        table.select(sorted(table.columns, reverse=True)).write_parquet(path)
    return Session.open(folder / "session")


CHANGES: list[Callable[[Session, Path], Session]] = [disturbed, other_order_of_runs, other_order_of_columns]


def told(session: Session, model: Model | None) -> dict[str, Any]:
    found = diagnose(session, model)
    return {"compare": kept.of_compare(found.comparison.to_json()), "diagnose": kept.of_diagnose(found.to_json())}


ASKED = [("ripple", ON_Z), *(pytest.param((name, None), marks=pytest.mark.wide) for name in SESSIONS)]
"""On the axis of the effect, and with ``make wide`` on all three."""


@pytest.fixture(scope="module", params=ASKED, ids=lambda of: f"{of[0]}-{'all' if of[1] is None else 'z'}")
def asked(request: pytest.FixtureRequest) -> tuple[Session, Model | None]:
    name, model = request.param
    campaign, effects, size = SESSIONS[name]
    return simulate(None, campaign, effects, 11, **size)[0], model


@pytest.fixture(scope="module")
def answer(asked: tuple[Session, Model | None]) -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compare, "DIGITS", 9)
        return told(*asked)


@pytest.mark.wide
@pytest.mark.parametrize("change", CHANGES)
def test_an_answer_does_not_hang_on_last_digits_or_order(
    asked: tuple[Session, Model | None], answer: dict[str, Any], change: Callable[[Session, Path], Session], tmp_path: Path,
    monkeypatch: Any,
) -> None:  # fmt: skip
    session, model = asked
    monkeypatch.setattr(compare, "DIGITS", 9)
    assert list(compare.differences(answer, told(change(session, tmp_path), model), errors=HALF)) == []
