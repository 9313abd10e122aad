"""Access to the traces that the worker has written, by memory-mapped files."""

from __future__ import annotations

from typing import Any

import numpy as np

from gyrocal.present.decimate import Pyramid
from gyrocal.web.values.views import ModelView, SessionView


class Traces:
    """The samples of the session and of the latest model, mapped from the worker's files."""

    def __init__(self, session: SessionView) -> None:
        self.session = session
        self.t_s: np.ndarray[Any, Any] = np.load(session.traces / "t_s.npy", mmap_mode="r")
        self.measured = Pyramid(session.traces / "measured")
        self.modelled: Pyramid | None = None
        self.residual: Pyramid | None = None
        self.points: dict[str, np.ndarray[Any, Any]] = {}

    def take(self, model: ModelView) -> None:
        self.modelled, self.residual = Pyramid(model.traces / "modelled"), Pyramid(model.traces / "residual")
        with np.load(model.traces / "points.npz") as packed:
            self.points = dict(packed)
