"""The verdict of a comparison, the same for sessions by a known rate and by gravity."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, TypeVar

from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.shown import Shown
from gyrocal.warning import Warning


class _OfAxis(Protocol):
    @property
    def axis(self) -> str | None: ...


OfAxis = TypeVar("OfAxis", bound=_OfAxis)


class Judged(Shown):
    """A comparison of a model with a session: what the residual shows, and what the recording contradicts."""

    where: list[Finding]
    warnings: list[Warning]

    @property
    def own_axis(self) -> str:
        """The session's axis."""
        raise NotImplementedError

    @property
    def implausible(self) -> bool:
        """True if a blocking warning applies to the session's own axis."""
        return any(w.blocks(self.own_axis) for w in self.warnings)

    @property
    def verdict(self) -> str:
        """``implausible``, ``misfit`` or ``adequate``."""
        if self.implausible:
            return "implausible"
        return "misfit" if self.where else "adequate"

    def where_json(self) -> list[dict[str, Any]]:
        """The findings, as the commands print them."""
        return [
            {"axis": f.axis, "against": f.against, "strength": round(f.strength, 3), "note": f.note, "times_rate": f.times_rate}
            for f in self.where
        ]


def on_axis(listed: Iterable[OfAxis], axis: str) -> list[OfAxis]:
    """Those of one axis, and those of all axes."""
    return [each for each in listed if each.axis in (axis, None)]
