"""One check of a board, and what one of its sensors sent meanwhile."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from gyrocal.device.wire import Sentence, parse_real, raw_table


@dataclass(frozen=True)
class Check:
    """One line of the answer. ``ok`` is None where the check could not be made, ``advice`` empty where nothing is to do."""

    name: str
    ok: bool | None
    found: str
    advice: str = ""
    imu: int = 0

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


@dataclass
class Heard:
    """What one sensor sent while it was listened to."""

    hello: dict[str, str] = field(default_factory=dict)
    before: dict[str, str] = field(default_factory=dict)
    after: dict[str, str] = field(default_factory=dict)
    raw: list[Sentence] = field(default_factory=list)
    arrived_s: list[float] = field(default_factory=list)
    """This machine's time at which each of ``raw`` came."""
    errors: list[str] = field(default_factory=list)

    def real(self, name: str) -> float | None:
        """A number of its hello."""
        return parse_real(self.hello.get(name, ""))

    def counts(self) -> np.ndarray[Any, Any]:
        """The readings: gx, gy, gz, ax, ay, az, temp."""
        return raw_table(self.raw).counts
