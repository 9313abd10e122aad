"""What one would reach for instead of gyrocal, on the sessions of ``gyrocal benchmark edge`` and the same candidates' columns.

    pip install -c constraints.txt '.[rivals]'
    python benchmarks/edge_rivals.py --out rivals.jsonl --stop 600
    python benchmarks/edge_rivals.py --out rivals.jsonl --stop 600 --beside work.jsonl --into docs/evidence.md

Each rival gets, on each axis, the means over a second of measured minus true rate and of all columns of every slow effect that
gyrocal can judge there, at the nonlinear values from which gyrocal starts. Scale and bias are projected out, and so is what
frame and clock of a three-axis reference leave: with one bias, or with a bias of each power cycle, which are two rows of the
table. Noise is white, and no coefficient is limited in size. An effect is named by whichever of its columns is chosen; the
functions below say when its name is sure. Left out are sessions without a rate that is known at every moment, and those that
hold an effect without a column (tones, dead bands, jumps, faults of the reading, waves at an unknown angle).

Cases that the file of ``--out`` holds are not run again. ``--beside`` takes gyrocal's own answers (``gyrocal benchmark edge
--out``) and grades all on the cases of both files. ``--into`` writes the tables between the marks of a page.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import edge, edge_table
from benchmarks.edge_table import Row

from gyrocal.effects.base import Effect, Objection, Role, effects, with_role
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.evidence.hypotheses import judged, of_reference
from gyrocal.inference.blocks import Blocks, reduce_session
from gyrocal.inference.registering import refined
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.threads import one_thread

BLOCK_S = 1.0
VANISHES, THE_SAME = 1e-8, 1e-9
"""Squared norm that is left of a column beside scale and bias, below which it is nothing; 1 - cosine of equal columns."""
BIAS = ("one bias", "a bias of each power cycle")
BIC_MARGIN, SURE_T, FOLDS = 10.0, 3.0, 5
HALVES, OFTEN = 100, 0.9
THRESHOLDS = np.geomspace(0.01, 3.0, 30)
MARKS = ("<!-- rivals -->", "<!-- end of rivals -->")


@dataclass(frozen=True, eq=False)
class Problem:
    """One axis: readings ``y`` [n] and standardised ``columns`` [n, p] beside scale and bias, with the effect of each column.

    ``forms`` lists each form of each effect: id, columns and number of parameters. ``known`` parameters were projected out.
    """

    y: Array
    columns: Array
    effect_of: tuple[str, ...]
    forms: tuple[tuple[str, tuple[int, ...], int], ...]
    known: int

    @cached_property
    def triangle(self) -> Array:
        """Columns and readings with the same products in p + 1 rows, shape [p + 1, p + 1]."""
        return np.asarray(np.linalg.qr(np.column_stack([self.columns, self.y]), mode="r"))

    def squares(self, chosen: Sequence[int]) -> float:
        """Sum of squares that least squares on the chosen columns leaves."""
        matrix, y = self.triangle[:, list(chosen)], self.triangle[:, -1]
        left = y - matrix @ np.linalg.lstsq(matrix, y, rcond=1e-10)[0]
        return float(left @ left)

    def bic(self, chosen: Sequence[int], parameters: int | None = None) -> float:
        """Schwarz's criterion of white noise, but for a constant."""
        k = len(chosen) if parameters is None else parameters
        return self.y.size * float(np.log(self.squares(chosen))) + k * float(np.log(self.y.size))

    def named(self, chosen: Sequence[int]) -> list[str]:
        """The effects of these columns."""
        return sorted({self.effect_of[j] for j in chosen})


Rival = Callable[[Problem], list[str]]


@lru_cache(1)
def _stepwise(problem: Problem) -> list[int]:
    """Forward and backward: the column whose coming or going lowers the BIC most, until none does."""
    chosen, best = list[int](), problem.bic([])
    while True:
        others = [j for j in range(len(problem.effect_of)) if j not in chosen]
        tried = [[*chosen, j] for j in others] + [[k for k in chosen if k != j] for j in chosen]
        scores = [problem.bic(each) for each in tried]
        if min(scores, default=np.inf) >= best - 1e-9:
            return chosen
        best, chosen = min(scores), tried[int(np.argmin(scores))]


def stepwise(problem: Problem) -> list[str]:
    """Stepwise regression by BIC. Sure: what stays."""
    return problem.named(_stepwise(problem))


def stepwise_sure(problem: Problem) -> list[str]:
    """The same. Sure: without the effect's columns, the BIC is higher by more than 10."""
    chosen = _stepwise(problem)
    without = {name: [j for j in chosen if problem.effect_of[j] != name] for name in problem.named(chosen)}
    return [name for name, others in without.items() if problem.bic(others) - problem.bic(chosen) > BIC_MARGIN]


def _best_forms(problem: Problem) -> dict[str, float]:
    """The BIC of each effect alone, in its best form, less that of noise alone."""
    none, found = problem.bic([]), dict[str, float]()
    for effect, chosen, parameters in problem.forms:
        found[effect] = min(problem.bic(chosen, parameters) - none, found.get(effect, np.inf))
    return found


def best_single(problem: Problem) -> list[str]:
    """The best single effect by BIC. Sure: 10 below noise alone."""
    found = _best_forms(problem)
    return sorted(name for name in found if found[name] == min(found.values()) < -BIC_MARGIN)[:1]


def best_single_apart(problem: Problem) -> list[str]:
    """The best single effect by BIC. Sure: 10 below noise alone and 10 below every other single effect."""
    first, second = sorted([*_best_forms(problem).values(), 0.0, 0.0])[:2]
    return best_single(problem) if second - first > BIC_MARGIN else []


@lru_cache(1)
def _lasso(problem: Problem) -> list[int]:
    from sklearn.linear_model import LassoCV

    found = LassoCV(cv=FOLDS, fit_intercept=False).fit(problem.columns, problem.y)
    return np.flatnonzero(found.coef_).tolist()


def lasso(problem: Problem) -> list[str]:
    """LASSO, its penalty by five-fold cross-validation over stretches of time. Sure: a coefficient that is not zero."""
    return problem.named(_lasso(problem))


def lasso_refitted(problem: Problem) -> list[str]:
    """The same, then least squares on the chosen columns. Sure: t beyond 3 in size.

    Neighbours on a grid and a wave's cosine and sine share one size, and each alone has a small t. An effect of several chosen
    columns is therefore judged by the F test of all of them, at the level of that t.
    """
    chosen = _lasso(problem)
    free = problem.y.size - problem.known - len(chosen)
    full, names = problem.squares(chosen), []
    for name in problem.named(chosen):
        others = [j for j in chosen if problem.effect_of[j] != name]
        gone = len(chosen) - len(others)
        ratio = (problem.squares(others) - full) / gone / (full / free)
        if f_distribution.sf(ratio, gone, free) < 2 * norm.sf(SURE_T):
            names.append(name)
    return names


def stability(problem: Problem) -> list[str]:
    """Stability selection (Meinshausen and Buhlmann, 2010). Sure: among the first q effects of nine tenths of 100 halves.

    q is such that their bound on the expected number of false names, q^2 / ((2 * 0.9 - 1) p) of p effects, is one.
    """
    from sklearn.linear_model import lars_path

    ids = sorted(set(problem.effect_of))
    most = max(1, int(np.sqrt((2 * OFTEN - 1) * len(ids))))
    random, counts = np.random.default_rng(0), dict.fromkeys(ids, 0)
    for _ in range(HALVES):
        half = random.permutation(problem.y.size)[: problem.y.size // 2]
        part = problem.columns[half]
        part = part / np.maximum(np.linalg.norm(part, axis=0), 1e-300)
        path = lars_path(part, problem.y[half], method="lasso", max_iter=4 * most)[2]
        entered: dict[str, None] = {}
        for step in path.T:
            new = [name for name in problem.named(np.flatnonzero(step).tolist()) if name not in entered]
            entered.update(dict.fromkeys(new[: most - len(entered)]))
        for name in entered:
            counts[name] += 1
    return [name for name in ids if counts[name] >= OFTEN * HALVES]


def stlsq(problem: Problem) -> list[str]:
    """PySINDy's sequentially thresholded least squares. Sure: a coefficient that is not zero.

    By BIC: the threshold, from a hundredth of the largest coefficient of one column alone to three times that, and the ridge,
    PySINDy's usual one or a hundredth of the number of means, because neighbours on a grid are nearly equal.
    """
    from pysindy import STLSQ

    n, x, y = problem.y.size, problem.triangle[:, :-1], problem.triangle[:, -1:]
    tried: dict[tuple[int, ...], float] = {(): problem.bic([])}
    for ridge in (0.05, n / 100):
        for threshold in THRESHOLDS * float(np.abs(x.T @ y).max() / n):
            kept = tuple(np.flatnonzero(STLSQ(threshold=threshold, alpha=ridge).fit(x, y).coef_[0]).tolist())
            tried.setdefault(kept, problem.bic(kept))
    return problem.named(min(tried, key=tried.__getitem__))


RIVALS: dict[str, Rival] = {
    "best single effect by BIC": best_single,
    "the same, also 10 below the next": best_single_apart,
    "stepwise by BIC": stepwise,
    "stepwise, 10 higher without": stepwise_sure,
    "LASSO, not zero": lasso,
    "LASSO, refitted, t beyond 3": lasso_refitted,
    "stability selection": stability,
    "PySINDy (STLSQ)": stlsq,
}


def problem_on(session: Sequence[Blocks], axis: int, cycles: bool) -> Problem:
    """The columns of one axis beside scale and bias; ``cycles``: beside a bias of each power cycle."""
    blocks = [b.about(AXES[axis]) for b in session]

    def of(effect: Effect, values: Mapping[str, float]) -> Array:
        return np.concatenate([b.mean(effect.columns(b.run, axis, values)) * (not effect.lacks(b.run)) for b in blocks])

    runs, cycle = [b.run for b in blocks], np.concatenate([np.full(b.t_s.size, b.scenario if cycles else 0) for b in blocks])
    known = [(cycle[:, None] == np.unique(cycle)).astype(float), of(with_role(Role.SCALE), {"scale": 0.0})]
    known += [np.concatenate([b.mean(form.columns(b.run, axis)) for b in blocks]) for form in of_reference(runs, axis)]
    base = _basis(np.column_stack(known))
    y = np.concatenate([b.y_dps[:, axis] for b in blocks])
    kept, effect_of, forms = list[Array](), list[str](), []
    for effect in (e for e in effects().values() if judged(e, runs, axis)):
        for values in (v for v in effect.variants(runs, axis) if Objection.UNSEEN not in effect.objections(v, runs, axis, ())):
            places = set()
            for column in of(effect, values).T:
                left = column - base @ (base.T @ column)
                if left @ left <= VANISHES * (column @ column):
                    continue
                left /= np.sqrt(np.mean(left**2))
                mine = (j for j in range(len(kept)) if effect_of[j] == effect.id)
                same = [j for j in mine if abs(kept[j] @ left) > (1 - THE_SAME) * left.size]
                if not same:
                    kept.append(left)
                    effect_of.append(effect.id)
                places.add(same[0] if same else len(kept) - 1)
            if places:
                forms.append((effect.id, tuple(sorted(places)), len(places) + len(effect.nonlinear)))
    columns = np.column_stack(kept) if kept else np.zeros((y.size, 0))
    return Problem(y - base @ (base.T @ y), columns, tuple(effect_of), tuple(forms), base.shape[1])


def _basis(columns: Array) -> Array:
    """An orthonormal basis of the space of the columns."""
    u, s, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
    return np.asarray(u[:, s > 1e-7 * s[0]])


def answer(session: Session, truth: Mapping[str, Any], rivals: Mapping[str, Rival]) -> dict[str, Any]:
    """The sure names of each rival, ``[effect, axis]``, or why the session is ``left_out``."""
    if truth["reference"] in ("turns", "gravity"):
        return {"left_out": "no rate is known at every moment", "names": {}}
    blocks = reduce_session(refined(session, Model.builtin("default")), BLOCK_S)
    on = {(bias, name): problem_on(blocks, AXES.index(name), bias != BIAS[0]) for bias in BIAS for name in AXES}
    columns = {(id_, axis) for (bias, axis), one in on.items() if bias == BIAS[0] for id_ in one.effect_of}
    if any(not columns & {tuple(right) for right in effect["right"]} for effect in truth["effects"]):
        return {"left_out": "an effect without a column", "names": {}}
    names: dict[str, list[list[str]]] = {f"{label}, {bias}": [] for bias in BIAS for label in rivals}
    for (bias, axis), one in on.items():
        for label, rival in rivals.items() if one.effect_of else ():
            names[f"{label}, {bias}"] += [[id_, axis] for id_ in rival(one)]
    return {"left_out": None, "names": names}


@one_thread
def judge(job: tuple[str, str, int], rivals: Mapping[str, Rival]) -> Row:
    """One case: draw it, write it, open it as a user does, and ask every rival. A failure is told in the row."""
    from edge import drawn, recording

    draw, begun = drawn.Draw(*job), time.process_time()
    row: Row = {"case": draw.name, "kind": draw.kind, "truth": None, "error": None, "left_out": None, "names": {}}
    try:
        case = draw.case()
        row["truth"] = drawn.truth(case)
        with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the solvers warn of columns that are nearly equal
            recording.write(case.made, case.readings, Path(scratch) / "session", case.random)
            row |= answer(Session.open(Path(scratch) / "session"), row["truth"], rivals)
    except Exception as error:
        row["error"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.process_time() - begun}


def of_rival(row: Row, rival: str) -> Row:
    """The row of a case with a rival's names as the sure ones, as ``benchmarks/edge_table.py`` grades it."""
    said = ({"effect": id_, "axis": axis, "decision": "add", "group": []} for id_, axis in row["names"][rival])
    return row | {"candidates": list(said)}


def answers(rows: Sequence[Row], beside: Sequence[Row] | None) -> dict[str, list[Row]]:
    """Rows of the same cases for each rival and, first, for gyrocal, if ``beside`` holds its answers."""
    kept = [row for row in rows if row["error"] is None and row["left_out"] is None]
    found = dict[str, list[Row]]()
    if beside is not None:
        own = {row["case"]: row for row in beside if row["error"] is None}
        kept = [row for row in kept if row["case"] in own and own[row["case"]]["truth"] == row["truth"]]
        found["gyrocal"] = [own[row["case"]] for row in kept]
    labels = list(kept[0]["names"]) if kept else []
    return found | {label: [of_rival(row, label) for row in kept] for label in labels}


def page(found: Mapping[str, Sequence[Row]]) -> str:
    """Two tables in Markdown: the names of each, with McNemar's exact one-sided tests against gyrocal; and by kind."""
    own, first = found.get("gyrocal"), next(iter(found.values()), [])
    kinds = list(dict.fromkeys(row["kind"] for row in first))
    count = ", ".join(f"{sum(row['kind'] == kind for row in first)} {kind}" for kind in kinds)
    header = ["", "sure", "wrong", "share wrong (95 % bound)", "reached", "p: gyrocal fewer wrong", "p: gyrocal reaches more"]
    lines = [f"{len(first)} sessions: {count}.", "", _line(header), _line(["---"] * len(header))]
    lines += [_line([label, *_whole(rows, own)]) for label, rows in found.items()]
    lines += ["", _line(["wrong of sure; reached", *kinds, "of null: with a disturbance"]), _line(["---"] * (len(kinds) + 2))]
    for label, rows in found.items():
        parts = [[row for row in rows if row["kind"] == kind] for kind in kinds]
        parts.append([row for row in rows if row["kind"] == "null" and row["truth"]["disturbance"] is not None])
        lines.append(_line([label, *map(_of_kind, parts)]))
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _reached(found: Mapping[str, Any]) -> str:
    return f"{found['reached']['count']} of {found['reached']['of']}"


def _of_kind(rows: Sequence[Row]) -> str:
    found = edge_table.names(rows)
    return f"{found['wrong']} of {found['sure']}" + (f"; {_reached(found)}" if found["reached"]["of"] else "")


def _whole(rows: Sequence[Row], own: Sequence[Row] | None) -> list[str]:
    found = edge_table.names(rows)
    share = "-" if found["wrong_share"] is None else f"{found['wrong_share']:.1%} (< {found['wrong_upper']:.1%})"
    tests = edge_table.compared(rows, own) if own is not None and own is not rows else {}
    p = [f"{tests[key]['p']:.2g}" if tests else "" for key in ("wrong", "reached")]
    return [str(found["sure"]), str(found["wrong"]), share, _reached(found), *p]


def write_into(file: Path, text: str) -> None:
    """Put a text between the marks of a page. Raises InputError if they are not there."""
    before, first, rest = file.read_text(encoding="utf-8").partition(MARKS[0])
    _, last, after = rest.partition(MARKS[1])
    if not first or not last:
        raise InputError(f"{file}: no line {MARKS[0]!r} and after it {MARKS[1]!r}; put them where the table belongs")
    file.write_text(f"{before}{first}\n\n{text}\n\n{last}{after}", encoding="utf-8")


def run(part: str, stop: int | None, out: Path) -> list[Row]:
    """The rows of the cases of a part, those that ``out`` lacks newly made."""
    from edge.drawn import Draw

    known = {row["case"]: row for row in edge_table.read(out)}
    jobs = edge.chosen(part, (), 0, stop)
    for count, job in enumerate(jobs, 1):
        if (name := Draw(*job).name) not in known:
            known[name] = row = judge(job, RIVALS)
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            told = row["error"] or row["left_out"] or "answered"
            print(f"{count}/{len(jobs)} {name} {told} {row['seconds']:.1f} s", file=sys.stderr, flush=True)
    return [known[Draw(*job).name] for job in jobs]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", default="work")
    parser.add_argument("--stop", type=int)
    parser.add_argument("--out", type=Path, required=True)
    for name in ("--beside", "--into"):
        parser.add_argument(name, type=Path)
    asked = parser.parse_args()
    if not all(map(find_spec, ("sklearn", "pysindy"))):
        sys.exit("error: the rivals need scikit-learn and PySINDy: pip install -c constraints.txt '.[rivals]'")
    try:
        rows = run(asked.part, asked.stop, asked.out)
        text = page(answers(rows, None if asked.beside is None else edge_table.read(asked.beside)))
        print(text) if asked.into is None else write_into(asked.into, text)
    except InputError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
