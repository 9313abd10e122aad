"""How a recording of others is read, and what contradicts itself in that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from gyrocal.errors import InputError
from gyrocal.recording.column_map import Scaling
from gyrocal.recording.cut import Cut
from gyrocal.recording.guess import Guess
from gyrocal.recording.header import Reference
from gyrocal.recording.second_file import SecondFile
from gyrocal.recording.session import Session


@dataclass(frozen=True)
class Options:
    """How a recording is read.

    ``maps``: ``target=column[:unit][*factor]``; without any, the columns that bear a session's names, or a guess. ``cuts``: the
    runs to take; without any, a file is one. ``run_meta``: ``PATTERN:key=value,...`` for the runs whose names fit.
    ``defaults``: keys of ``[[run]]`` for all of them. ``axis``: the session's; None is the only one mapped, or z. ``form``: a
    name of ``FORMATS``, whose mappings come before ``maps``. ``resample_hz``: the rate that faster runs are brought to.
    ``gravity``: the sensor was turned by hand between rests, so gravity is the reference and no run has a true rate. ``clock``:
    whether the reference has the clock of the sensor (``same``) or its ``own``.
    """

    maps: Sequence[str] = ()
    cuts: Sequence[Cut] = ()
    run_meta: Sequence[str] = ()
    defaults: Mapping[str, Any] = field(default_factory=dict)
    axis: str | None = None
    scaling: Scaling = field(default_factory=Scaling)
    columns: Sequence[str] | None = None
    skip: int | None = None
    topic: str | None = None
    form: str | None = None
    sensor: str | None = None
    full_scale_dps: float | None = None
    second: SecondFile | None = None
    resample_hz: float | None = None
    gravity: bool = False
    clock: str = "same"

    @property
    def reference(self) -> Reference:
        """The reference as session.toml states it."""
        if self.gravity:
            return Reference(kind="gravity")
        own = "own" in (self.clock, self.second and self.second.clock)
        return Reference.model_validate({"clock": "own"} if own else {})


def with_gravity(options: Options, existing: Session | None) -> Options:
    """The options with the reference of the session that runs are added to. Raises InputError if they contradict it."""
    by_gravity = options.gravity or (existing is not None and existing.reference.kind == "gravity")
    if not by_gravity:
        return options
    if existing is not None and existing.reference.kind != "gravity":
        raise InputError("--gravity: the session's runs have a true rate; import this recording into a session of its own")
    if options.second is not None or {"table_rate_dps", "turn_deg"} & set(options.defaults):
        raise InputError(
            "the reference is gravity, and a true rate is given too; leave out --gravity, or --rate, --turn-deg and --reference"
        )
    return replace(options, gravity=True)


def with_second(options: Options) -> tuple[Options, tuple[Guess, ...]]:
    """The options with the columns of the reference's own file, and those of them that were guessed."""
    if options.second is None:
        return options, ()
    second, guessed = options.second.guessed()
    return replace(options, second=second), guessed
