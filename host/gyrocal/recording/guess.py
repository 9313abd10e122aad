"""A guess at the columns of a table and their units, from their names and values, which a person confirms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.clock_digits import shows_clock
from gyrocal.recording.column_map import TARGETS, ColumnMap, Scaling
from gyrocal.recording.column_names import (
    GYRO,
    UNIT_WORDS,
    alone,
    bare_name,
    body_rates,
    every_named,
    first_named,
    stated_unit,
    with_unit_of_rate,
)
from gyrocal.recording.copied_rows import written_once
from gyrocal.recording.guess_units import (
    PHONE,
    ROS,
    Known,
    Motion,
    typical_rate_dps,
    unit_of_acceleration,
    unit_of_gyro,
    values_of,
)
from gyrocal.recording.one_sensor import check_one_sensor
from gyrocal.recording.orientation import ALIKE_WITHIN, UNIT_WITHIN
from gyrocal.recording.own_orientation import of_table, yaw_of
from gyrocal.recording.session import AXES, Array
from gyrocal.recording.source import MOST_DAMAGED, Source, moments_ns
from gyrocal.recording.stamps import period_s
from gyrocal.recording.stated import rate_hz as stated_rate_hz

TIME = (
    r"t|time|stamp|timestamp|timestamps|header\.stamp|time_?stamp|date_?time|seconds|secs?|millis|micros|"
    r"ms|us|ns|clock|zeit|all_time|sample_time_fine|timestamp_unix|time_?startup|ts|tow|epoch|elapsed|cts"
)
ACCELERATION = (
    r"acc|accel|accl|accelerometer|acceleration|acc_?(?:smooth|adc|out)|accelerometer_acceleration|accel_[lw][nr]|a|ac|"
    r"g_?f(?:orce)?|lin(?:ear)?_?acc(?:eleration)?|a_rs_s|imu\.acc|all_accel_2|beschleunigung|acel(?:erometro)?|fb"
)
TEMPERATURE = r"t|t_?(?:die|chip|imu|sensor)|die_?t|temp|temperature|temp_?c|imu\.temperature|.*[._ ]temp(?:erature)?"
MAGNETIC = r"mag|(?:^|[/._ ])[uµμn]_?t$"
"""Words of a magnetic field, whose unit ends with a T as temperatures' names do."""
REFERENCE = r"ref|reference|truth|true|encoder|enc|table|turntable|stage|motor|servo"
TRACKER = r"ref|reference|truth|gt|ground_?truth|vicon|optitrack|mocap|qualisys|optical"
"""Words of an orientation that another instrument measured: a sensor's own estimate of it is no reference."""
OWN_FILE = rf"{TRACKER}|orientation|quaternion|quat|rotation|rot|q|q_rs"
"""Words of an orientation in a file of the reference alone."""
RATE = r"rate|speed|velocity|vel|omega|w|angular_?rate|angular_?velocity"
ANGLE = r"angle|position|pos|deg|degs|rad|rads|phi|theta"
LIKE_TIME = r"(?:t|time)_.*|.*(?:_t|time)"
"""Names that no list of words has, as ``t_imu``: their numbers have to be those of a time too."""
EVEN_STEP, MOSTLY = 0.5, 0.9
"""A column with such a name is a time if more than this part of its steps are off the median by less than that part of it."""
TIME_UNITS = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
TICK_S = 5e-4
"""Counts of an Xsens clock that would be shorter steps than this as microseconds are of 0.1 ms."""
RATES_HZ = (5.0, 20_000.0)
"""Sample rates that gyroscopes are read at."""
SLOW_HZ = 0.2
"""Slow logs, as of a thermal chamber, have this rate at least. They are taken for such only where nothing else is left."""
DATES_S = (9.5e8, 4.1e9)
"""The years 2000 to 2100 in seconds since 1970."""
FASTEST_DEGC_S = 2.0
"""No gyroscope's temperature moves faster than this over a whole recording, degC/s."""
LEAST_DEGC = 5.0
"""A temperature that moves by less than this says nothing of the time that passed."""
MANY_ROWS = 1000
"""A temperature that is equal in so many rows is told: its thermometer may not work."""
BACK = 0.1
"""Steps back of a time, as a part of its steps forward."""
OF_A_PHONE = r"Gyroscope\w*\.[xyz]"
"""A column of a phone's file ``Gyroscope.csv`` that was joined with those of other sensors."""
OF_ROS = re.compile(r"(?:^|[./])angular_velocity\.[xyz]$")
"""A field of ROS' sensor_msgs/Imu by its path in the message, as ``rostopic echo -p`` and others write it."""
REPEATED = 0.1
"""Part of the stamps that repeat the one before, from which on a finer clock of the same table is looked for."""
FINER = 0.5
"""A finer clock repeats fewer of its stamps than this part of the other's."""


@dataclass(frozen=True)
class Guess:
    """One column: what it is taken for, as ``--map`` takes it, and why."""

    map: str
    why: str
    option: str = "--map"
    """The option that states it, ``--ref-map`` for a column of the reference's own file."""
    asks: bool = False
    """True if nothing in the file decides between this unit and another, so that a person has to say which it is."""
    file: str = ""
    """Name of the file, where a folder holds several."""

    @property
    def question(self) -> str:
        """What has to be said of a unit that nothing decides."""
        where = f"{self.file}: " if self.file else ""
        return f"{where}the unit of {self.map.partition('=')[2].rpartition(':')[0]} is not known ({self.why})"


def guess(
    source: Source, scaling: Scaling, axes: Sequence[str] = AXES, reference: bool = True, known: Known = Known()
) -> list[Guess]:
    """The mapping of a table's columns, time first; columns with a session's own names and units are taken as they are.

    ``reference``: look for the true rate or angle too. ``known``: what is known of the motion beside the readings.

    InputError where no gyroscope is recognized, or where its unit cannot be told.
    """
    check_one_sensor(source)
    if not known.cuts:  # which count the rows as they are
        source = written_once(source, named_as_time(source.frame.columns))
    exact = [name for name in TARGETS if name in source.frame.columns]
    found = {name: Guess(f"{name}={name}", "its name") for name in exact}
    if "t_s" not in found:
        _add(found, time_column(source, scaling.rate_hz))
    every = {axis: every_named(source, GYRO, axis) for axis in axes}
    named = {axis: next(iter(names), None) for axis, names in every.items()}
    if not any(named.values()):
        named = body_rates(source, axes)
    if not any(named.values()):
        named = {axis: name for axis, name in with_unit_of_rate(source).items() if axis in axes}
    phone = not any(named.values()) and "gyro" in Path(source.label).name.lower()
    if phone:  # Gyroscope.csv of a phone: time, x, y, z
        named = {axis: next((n for n in source.frame.columns if alone(n) == axis), None) for axis in axes}
    phone |= any(re.fullmatch(OF_A_PHONE, str(name)) for name in named.values())
    gyro = {axis: name for axis, name in named.items() if name is not None and f"g{axis}_dps" not in found}
    if "ax_g" not in found:
        for guessed in _acceleration(source, scaling):
            _add(found, guessed)
    si = any(g.map.endswith(":m/s2") for name, g in found.items() if name.startswith("a"))
    if gyro:
        phone_or_ros = PHONE if phone else ROS if all(OF_ROS.search(name) for name in gyro.values()) else ""
        maker = phone_or_ros or ("the accelerometer is in m/s2" if si else "")
        unit = unit_of_gyro(source, gyro, _moves(source, found, scaling), _with_reference(known, source, found), maker, scaling)
        for axis, name in gyro.items():
            others = ", ".join(n for n in (*every[axis], *_left(source, gyro)) if n != name)
            why = f"{unit.why}; not {others}" if others else unit.why
            _add(found, Guess(f"g{axis}_dps={name}{unit.text}", why, asks=not unit.sure))
    if not any(f"g{a}_dps" in found for a in AXES):
        raise InputError(
            f"{source.label}: no gyroscope is recognized among {', '.join(source.frame.columns[:40])}; say which columns to "
            f"take: --map gz_dps=COLUMN:UNIT{source.left_out}"
        )
    if "temp_c" not in found:
        of_time = found["t_s"].map.removeprefix("t_s=").rpartition(":")[0] if "t_s" in found else ""
        _add(found, _temperature(source, of_time))
    if reference and not {"rate_ref_dps", "ref_angle_deg", "ref_x_dps", "ref_qw"} & set(found):
        for guessed in _orientation(source):
            _add(found, guessed)
        if "ref_qw" not in found:
            _add(found, _reference(source, found))
    return sorted(found.values(), key=lambda g: TARGETS.index(g.map.partition("=")[0]))


def _left(source: Source, gyro: Mapping[str, str]) -> list[str]:
    """The columns that a word names as a gyroscope's, of which no axis was recognized, where not all three axes were."""
    if len(gyro) == len(AXES):
        return []
    named = r"(?:.*[/._])?(?:gyro(?:scope)?s?|giro|gyrs?|omega)_?[a-z0-9]{1,2}"
    return [n for n in source.frame.columns if n not in gyro.values() and re.fullmatch(named, bare_name(n)[0])]


def _acceleration(source: Source, scaling: Scaling) -> list[Guess]:
    """The three columns of an accelerometer: of several the first with gravity, which a phone's linear acceleration lacks."""
    each = [every_named(source, ACCELERATION, axis) for axis in AXES]
    units = ((names, unit_of_acceleration(source, names, scaling)) for names in zip(*each, strict=False))
    known = [(names, unit) for names, unit in units if unit is not None]
    if not known:
        return []
    names, unit = next((one for one in known if one[1].sure), known[0])
    return [Guess(f"a{axis}_g={name}{unit.text}", unit.why) for axis, name in zip(AXES, names, strict=True)]


def _with_reference(known: Known, source: Source, found: Mapping[str, Guess]) -> Known:
    """What is known, with the reference that the table holds in a unit of its own, where there is one."""
    stated = _reference(source, found)
    guessed = _orientation(source) or ([stated] if stated is not None and "unit is in its name" in stated.why else [])
    if not guessed or "t_s" not in found:
        return known

    def rate_dps() -> float | None:
        maps = [ColumnMap.parse(g.map, Scaling()) for g in guessed]
        t_s = source.numbers(ColumnMap.parse(found["t_s"].map, Scaling()))
        return typical_rate_dps(t_s, {m.target: source.numbers(m) for m in maps})

    return replace(known, reference_dps=rate_dps)


def _moves(source: Source, found: Mapping[str, Guess], scaling: Scaling) -> Motion | None:
    """The times, with the accelerations that were recognized and the sensor's own orientation; None without times."""
    rate_hz = scaling.rate_hz or stated_rate_hz(source.above)
    if "t_s" in found:
        t_s = source.numbers(ColumnMap.parse(found["t_s"].map, scaling))
    elif rate_hz is not None:
        t_s = np.arange(source.frame.height) / rate_hz
    else:
        return None
    accelerations = [found[name] for name in ("ax_g", "ay_g", "az_g") if name in found]
    acc = [source.numbers(ColumnMap.parse(guessed.map, scaling)) for guessed in accelerations]
    return Motion(t_s, np.column_stack(acc) if len(acc) == len(AXES) else None, of_table(source))


def guess_reference(source: Source, rate_hz: float | None = None) -> list[Guess]:
    """The mapping of a reference's own file: its time, and an orientation, rates about three axes, or one rate or angle.

    With the rate of its samples, Hz, it needs no time. InputError where none of them is recognized.
    """
    found: dict[str, Guess] = {}
    _add(found, time_column(source, rate_hz))
    for guessed in _orientation(source, rf"(?:.*[/._ ])?(?:{OWN_FILE})") or _orientation(source, ""):
        _add(found, guessed)
    rates = [first_named(source, rf"{GYRO}|{REFERENCE}", axis) for axis in AXES]
    if "ref_qw" not in found and None not in rates:
        for axis, name in zip(AXES, rates, strict=True):
            unit = stated_unit(str(name), "gyro")
            why = "the unit is in its name" if unit else "rad/s is possible too"
            _add(found, Guess(f"ref_{axis}_dps={name}:{unit or 'dps'}", f"the true rate: {why}"))
    elif "ref_qw" not in found:
        _add(found, _reference(source, found) or _only_angle_or_rate(source, found) or _yaw(source))
    if ("t_s" not in found and rate_hz is None) or not set(found) - {"t_s"}:
        raise InputError(
            f"{source.label}: no time and reference are recognized among {', '.join(source.frame.columns[:40])}; say which "
            "columns to take: --ref-map t_s=COLUMN:UNIT --ref-map ref_angle_deg=COLUMN:UNIT (or rate_ref_dps, ref_x_dps, "
            "ref_qw and so on)"
        )
    return [replace(g, option="--ref-map") for g in found.values()]


def _only_angle_or_rate(source: Source, found: Mapping[str, Guess]) -> Guess | None:
    """The one angle, or else the one rate, of a reference's own file whose name states its unit; None of several."""
    taken = {g.map.partition("=")[2].rpartition(":")[0] for g in found.values()}
    names = [n for n in source.frame.columns if n not in taken and values_of(source, n).size]
    for words, kind, target in ((ANGLE, "angle", "ref_angle_deg"), (RATE, "gyro", "rate_ref_dps")):
        units = "|".join(UNIT_WORDS[kind].values())
        named = rf"(?:.*[/._ ])?(?:{words})(?:[ _.-]?(?:{units}))?"
        there = [n for n in names if re.fullmatch(named, bare_name(n)[0]) and stated_unit(n, kind)]
        if len(there) == 1:
            what = "angle" if kind == "angle" else "rate"
            return Guess(f"{target}={there[0]}:{stated_unit(there[0], kind)}", f"the true {what}: the unit is in its name")
    return None


def _yaw(source: Source) -> Guess | None:
    """The yaw of a reference's own file, as a robot or a planar map writes it beside its position."""
    found = yaw_of(source)
    if found is None:
        return None
    name, unit = found
    stated = stated_unit(name, "angle")
    why = "the unit is in its name" if stated else "rad by where it goes round" if unit == "rad" else "deg by its size"
    if unit is None:
        why = "within a turn in rad, and within 6 deg in deg"
    return Guess(f"ref_angle_deg={name}:{unit or 'rad'}", f"the true angle: {why}", asks=unit is None)


def _add(found: dict[str, Guess], guessed: Guess | None) -> None:
    if guessed is not None:
        found[guessed.map.partition("=")[0]] = guessed


def named_as_time(names: Sequence[str]) -> list[str]:
    """The columns that are named as a time, then those of one letter with a unit of time."""
    units = "|".join(UNIT_WORDS["t_s"].values())
    named = rf"(?:.*[/._])?(?:{TIME})(?:_?cal|_?since_(?:start|reboot|boot))?(?:_in)?(?:[_.]?(?:{units}))?"
    words = [n for n in names if re.fullmatch(named, bare_name(n)[0])]
    letters = [n for n in names if re.fullmatch(units, bare_name(n)[1]) and len(bare_name(n)[0]) == 1]
    return list(dict.fromkeys((*words, *letters)))


def time_column(source: Source, rate_hz: float | None = None) -> Guess | None:
    """The first column that is named as a time, or has a unit of time; its unit is stated or makes a usual sample rate.

    Where its stamps repeat, as those of a coarse clock, a finer one of the table is taken. ``rate_hz`` is the stated rate.
    """
    taken, least = None, 1.0
    for name in named_as_time(source.frame.columns):
        t_s = source.numbers(ColumnMap("t_s", name))
        t_s = t_s[np.isfinite(t_s)]
        if t_s.size < 2 or not _runs_forward(t_s):
            continue
        repeated = float(np.mean(np.diff(t_s) == 0))
        if taken is not None and repeated > FINER * least:
            continue
        if (guessed := _as_time(source, name, t_s, rate_hz)) is not None:
            taken, least = guessed, repeated
        if least < REPEATED:
            break
    if taken is None and rate_hz is None and len(others := _even_like_time(source)) == 1:
        t_s = source.numbers(ColumnMap("t_s", others[0]))
        taken = _as_time(source, others[0], t_s, rate_hz)
    return taken


def like_time(source: Source) -> list[str]:
    """The columns with a word for the time at either end of their names, whose numbers run forward."""
    names = [n for n in source.frame.columns if re.fullmatch(LIKE_TIME, bare_name(n)[0])]
    return [name for name in names if is_forward(source, name)]


def is_forward(source: Source, name: str) -> bool:
    """True if a column holds numbers alone, and these run forward."""
    t_s = source.numbers(ColumnMap("t_s", name))
    return t_s.size > 1 and bool(np.isfinite(t_s).all()) and _runs_forward(t_s)


def _even_like_time(source: Source) -> list[str]:
    """Those of :func:`like_time` that increase from row to row, by nearly the same step."""
    out = []
    for name in like_time(source):
        steps = np.diff(source.numbers(ColumnMap("t_s", name)))
        middle = float(np.median(steps))
        if steps.min() > 0 and float(np.mean(np.abs(steps - middle) < EVEN_STEP * middle)) > MOSTLY:
            out.append(name)
    return out


def _as_time(source: Source, name: str, t_s: Array, rate_hz: float | None) -> Guess | None:
    """What the unit of a column of time stamps [n] is taken for; None where they are no time."""
    stated = stated_unit(name, "t_s")
    if moments_ns(source.frame[name]) is not None:
        return Guess(f"t_s={name}", "dates or times of day")
    if stated is not None:
        return Guess(f"t_s={name}:{stated}", "the unit is in its name")
    if source.si:
        return Guess(f"t_s={name}:us", "messages of this kind are stamped in us")
    step = period_s(np.maximum.accumulate(t_s[:2000]))
    if bare_name(name)[0] == "sample_time_fine" and step * 1e-4 >= 1 / RATES_HZ[1] and step * 1e-6 < TICK_S:
        return Guess(f"t_s={name}*0.0001", "counts of 0.1 ms, as Xsens writes them")
    counts = bool(np.all(t_s == np.rint(t_s))) and np.median(np.diff(t_s)) == 1
    if rate_hz is not None and counts and not _of_a_unit(rate_hz):
        return Guess(f"t_s={name}*{1 / rate_hz:.9g}", "it counts the samples")
    if step <= 0 or any(shows_clock(t_s + source.start_s(ColumnMap("t_s", name)), size) for _, size in TIME_UNITS):
        return None
    return _unit_of_time(source, name, t_s, step)


def _of_a_unit(rate_hz: float) -> bool:
    """True if samples that come at this rate are a unit of time apart."""
    return any(abs(rate_hz * size - 1) < POLICY.sample_rate_off for _, size in TIME_UNITS)


def _unit_of_time(source: Source, name: str, t_s: Array, step: float) -> Guess | None:
    """The unit of time stamps [n] without a stated one, from their steps, from the date and from the temperature's speed."""
    start = source.start_s(ColumnMap("t_s", name))
    rates_hz = [(unit, size, 1 / (step * size)) for unit, size in TIME_UNITS]
    slow = [(unit, size, hz) for unit, size, hz in rates_hz if SLOW_HZ <= hz <= RATES_HZ[1]]
    usual = [(unit, size, hz) for unit, size, hz in slow if hz >= RATES_HZ[0]]
    for unit, size, hz in slow:
        if DATES_S[0] < start * size < DATES_S[1]:
            uptime_hz = 1e3 * hz if unit == "s" and hz < RATES_HZ[0] else 0.0  # a phone's milliseconds since weeks
            other = f"; ms is possible too, with {uptime_hz:.4g} a second" if RATES_HZ[0] <= uptime_hz <= RATES_HZ[1] else ""
            return Guess(f"t_s={name}:{unit}", f"dates since 1970; its steps make {hz:.4g} samples a second{other}")
    if not usual:
        return None
    (unit, size, hz), (longer, _, slow_hz) = usual[0], slow[0]
    duration_s = float(np.ptp(t_s)) * size
    if np.all(np.diff(t_s) == 1) and np.all(t_s == np.rint(t_s)):
        why = f"it goes on by one: it counts the samples, or {unit} with {hz:.4g} samples a second"
        return Guess(f"t_s={name}:{unit}", why, asks=True)
    if longer == unit:
        return Guess(f"t_s={name}:{unit}", f"its steps make {hz:.4g} samples a second")
    if _too_fast(source, duration_s):
        why = f"in {unit} the temperature would move too fast, over {duration_s:.3g} s"
        return Guess(f"t_s={name}:{longer}", f"its steps make {slow_hz:.3g} samples a second; {why}")
    why = f"{longer} is possible too, with {slow_hz:.3g} a second"
    return Guess(f"t_s={name}:{unit}", f"its steps make {hz:.4g} samples a second; {why}")


def _too_fast(source: Source, duration_s: float) -> bool:
    """True if the temperature moves faster than a sensor's can, over a recording of this length."""
    temperature = _temperature(source)
    if temperature is None:
        return False
    values = values_of(source, temperature.map.partition("=")[2].rpartition(":")[0])
    moved = float(np.ptp([part.mean() for part in np.array_split(values, 16)])) if values.size >= 16 else 0.0
    return moved > LEAST_DEGC and moved > FASTEST_DEGC_S * duration_s


def _runs_forward(t_s: Array) -> bool:
    """True if few steps go back, which other columns do half of the time. A counter may begin again, and a file may end with
    rows of zeros.
    """
    steps = np.diff(t_s)
    return float(np.sum(steps < 0)) < BACK * float(np.sum(steps > 0))


def _is_temperature(name: str, by_unit: bool = True) -> bool:
    """True for a column that is named as a temperature, or whose unit is one of temperatures alone (°C, and not C)."""
    bare, unit = bare_name(name)
    named = rf"(?:.*[/._ ])?(?:{TEMPERATURE})(?:/scalar)?(?:[ _.-]?(?:c|deg_?c|celsius|k|f))?"
    if bare in ("t", "time") or re.search(MAGNETIC, bare):
        return False
    stated = by_unit and len(unit) > 1 and any(re.fullmatch(words, unit) for words in UNIT_WORDS["temp_c"].values())
    return stated or bool(re.fullmatch(named, bare))


def tells_nothing(values: Array) -> bool:
    """True for a temperature [n] that is equal in many rows."""
    return values.size >= MANY_ROWS and bool(np.ptp(values) == 0)


def _temperature(source: Source, of_time: str = "") -> Guess | None:
    """The first column of temperatures, which is not that of the time."""
    columns = [name for name in source.frame.columns if name != of_time and _is_temperature(name)]
    for name in sorted(columns, key=lambda name: not _is_temperature(name, by_unit=False)):
        values = values_of(source, name)
        if not values.size:
            continue
        stated = stated_unit(name, "temp_c")
        middle = float(np.median(values))
        unit = stated or ("K" if 200 < middle < 400 else "degC")
        if unit == "degC" and not -60 < middle < 150:
            continue
        why = "the unit is in its name" if stated else f"about {middle:.4g}"
        if tells_nothing(values):
            why = f"{'the unit is in its name, but ' * bool(stated)}it is {middle:.4g} in every row, which tells nothing"
        return Guess(f"temp_c={name}:{unit}", why)
    return None


def _orientation(source: Source, words: str = rf"(?:.*[/._ ])?(?:{TRACKER})") -> list[Guess]:
    """The four columns of a quaternion that a tracker measured; none if they are not there or of no one length.

    Numbers from 0 stand for w, x, y and z.
    """
    for parts in ("wxyz", "0123"):
        names = []
        for part in parts:
            named = rf"{words}[/._ ]?(?:orientation|quaternion|quat|rotation|rot|q|matrix\.q)?[/._ \[]?{part}\]?"
            names += [name for name in source.frame.columns if re.fullmatch(named, bare_name(name)[0])][:1]
        if len(names) == len(parts):
            break
    else:
        return []
    size = np.sqrt(sum(source.numbers(ColumnMap("ref_qw", name)) ** 2 for name in names))
    size = size[np.isfinite(size) & (size > 0)]
    length = float(np.median(size)) if size.size else 0.0
    if not length or (abs(length - 1) > 0.01 and np.mean(np.abs(size - length) > ALIKE_WITHIN * length) > MOST_DAMAGED):
        return []
    divided = f"{length:.4g}, by which it is divided" if abs(length - 1) > UNIT_WITHIN else "1"
    why = f"the true orientation: its length is {divided}" + (f", and {names[0]} is taken for its w" if parts == "0123" else "")
    return [Guess(f"ref_q{part}={name}", why) for part, name in zip("wxyz", names, strict=True)]


def _reference(source: Source, found: Mapping[str, Guess]) -> Guess | None:
    """A column that is named as the true rate or angle of a table; a rate without a stated unit has that of the gyroscope."""
    taken = {g.map.partition("=")[2] for g in found.values()}
    unit_of_gyro = next((g.map.rpartition(":")[2] for name, g in found.items() if name.startswith("g") and ":" in g.map), "dps")
    for name in source.frame.columns:
        bare, words = bare_name(name)
        if name in taken or not values_of(source, name).size:
            continue
        rate = rf"(?:.*[/._ ])?(?:{REFERENCE})[ _.-]?(?:{RATE})?(?:[ _.-]?(?:dps|rad_?s|rads|mdps|deg_?s))?"
        angle = rf"(?:.*[/._ ])?(?:{REFERENCE})[ _.-]?(?:{ANGLE})(?:[ _.-]?(?:deg|degs|rad|rads|turns?))?"
        stated = stated_unit(name, "gyro")
        of_angle = any(re.fullmatch(known, words) for known in UNIT_WORDS["angle"].values())
        if re.fullmatch(rate, bare) and ((stated and not of_angle) or re.search(rf"(?:{RATE})$", bare)):
            why = "the unit is in its name" if stated else "its name; the unit is taken to be the gyroscope's"
            return Guess(f"rate_ref_dps={name}:{stated or unit_of_gyro}", f"the true rate: {why}")
        stated = stated_unit(name, "angle")
        if re.fullmatch(angle, bare) and stated:
            return Guess(f"ref_angle_deg={name}:{stated}", "the true angle: the unit is in its name")
    return None
