"""LASSO by cross-validation, then least squares with t beyond 3, with a bias of each power cycle. It needs scikit-learn."""

from pathlib import Path
from typing import Any

from benchmarks.edge_rivals import BLOCK_S, lasso_refitted, problem_on

from gyrocal.error_model.model import Model
from gyrocal.inference.blocks import reduce_session
from gyrocal.inference.registering import refined
from gyrocal.recording.session import AXES, Session


def answer(session: Path) -> dict[str, Any]:
    blocks = reduce_session(refined(Session.open(session), Model.builtin("default")), BLOCK_S)
    problems = {axis: problem_on(blocks, i, cycles=True) for i, axis in enumerate(AXES)}
    return {"names": [(id_, axis) for axis, one in problems.items() if one.effect_of for id_ in lasso_refitted(one)]}
