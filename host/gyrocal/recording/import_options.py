"""How a recording of others is read, and what contradicts itself in that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError, did_you_mean
from gyrocal.recording.column_map import Scaling
from gyrocal.recording.cut import Cut, check_meta
from gyrocal.recording.first_rows import Taken
from gyrocal.recording.guess import Guess
from gyrocal.recording.header import Reference
from gyrocal.recording.second_file import SecondFile
from gyrocal.recording.session import Session

FACTS = ("face", "table_rate_dps", "turn_deg", "scenario", "day", "power_on_s")
"""Facts of all runs that :meth:`Options.of` takes by name."""


@dataclass(frozen=True)
class Options:
    """How a recording is read.

    ``maps``: ``target=column[:unit][*factor]``; without any, the columns that bear a session's names, or a guess. ``cuts``: the
    runs to take; without any, a file is one. ``run_meta``: ``PATTERN:key=value,...`` for the runs whose names fit.
    ``defaults``: keys of ``[[run]]`` for all of them. ``axis``: the session's; None is the only one mapped, or z. ``form``: a
    name of ``FORMATS``, whose mappings come before ``maps``. ``resample_hz``: the rate that faster runs are brought to.
    ``gravity``: the sensor was turned by hand between rests, so gravity is the reference and no run has a true rate. ``clock``:
    whether the reference has the clock of the sensor (``same``) or its ``own``. ``joined``: files of other sensors of the same
    recording, whose columns are put onto the times of the gyroscope's; ``FILE:a,b,c`` names all columns of one without a
    header. ``rates``: the table's true rates, deg/s, of a file that
    is cut into its plateaus, each of which has the nearest one.
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
    joined: Sequence[Path | str] = ()
    rates: Sequence[float] = ()
    needs_rate: bool = field(default=True, repr=False)
    """False for a log that is only corrected: no true rate is asked for, and none is looked for among its columns."""

    @staticmethod
    def of(maps: Sequence[str], given: Mapping[str, Any]) -> Options:
        """The options by name: fields of this class and of :class:`Scaling`, and ``FACTS``; ``cuts`` may be NAME:START:END.

        InputError where a name is none of these.
        """
        own, scales = ({f.name for f in fields(kind)} for kind in (Options, Scaling))
        own -= {"needs_rate"}
        known = sorted(own | scales | set(FACTS))
        for name in given:
            if name not in known:
                raise InputError(f"no argument {name!r}{did_you_mean(name, known)}; there are {', '.join(known)}")
        taken = {name: value for name, value in given.items() if name in own and value is not None}
        cuts = [Cut.parse(cut) if isinstance(cut, str) else cut for cut in taken.get("cuts", ())]
        facts = {name: given[name] for name in FACTS if given.get(name) is not None}
        sizes = {name: given[name] for name in scales if given.get(name) is not None}
        defaults = check_meta({**taken.get("defaults", {}), **facts}, "import_recording")
        scaling = Scaling(**{**asdict(taken.get("scaling", Scaling())), **sizes})
        return Options(**{**taken, "maps": maps, "cuts": cuts, "defaults": defaults, "scaling": scaling})

    def check_rates(self) -> None:
        """Raise InputError where ``rates`` stand beside what says otherwise how the file is cut, or which rates it has."""
        others = {
            "--run or --sections": self.cuts, "--rate": "table_rate_dps" in self.defaults,
            "--turn-deg": "turn_deg" in self.defaults, "--gravity": self.gravity,
        }  # fmt: skip
        beside = next((name for name, given in others.items() if given), None)
        if self.rates and beside:
            raise InputError(f"--rates cuts a file into runs at the table's rates; leave out {beside}")

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


@dataclass(frozen=True)
class WithSecond:
    """The options with the columns of the reference's own file, those of them that were guessed, and its first rows."""

    options: Options
    guessed: tuple[Guess, ...] = ()
    first_rows: tuple[Taken, ...] = ()


def with_second(options: Options) -> WithSecond:
    """The options with the columns of the reference's own file, if there is one."""
    if options.second is None:
        return WithSecond(options)
    second, guessed = options.second.guessed(options.scaling.rate_hz)
    return WithSecond(replace(options, second=second), guessed, second.first_rows(options.scaling, guessed))
