"""A guess at the columns of a table and their units, from their names and values, which a person confirms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.column_map import STANDARD_GRAVITY, TARGETS, ColumnMap, Scaling
from gyrocal.recording.column_names import GYRO, UNIT_WORDS, bare_name, body_rates, every_named, first_named, stated_unit
from gyrocal.recording.session import AXES, Array
from gyrocal.recording.source import Source, moments_ns
from gyrocal.recording.stamps import period_s

TIME = (
    r"t|time|stamp|timestamp|timestamps|header\.stamp|time_?stamp|date_?time|seconds|secs?|millis|micros|clock|zeit|all_time|"
    r"sampletimefine|timestamp_unix"
)
ACCELERATION = (
    r"acc|accel|accelerometer|acceleration|acc_?smooth|accel_[lw][nr]|a|ac|linear_?acceleration|a_rs_s|imu\.acc|all_accel_2|"
    r"beschleunigung"
)
TEMPERATURE = r"t|temp|temperature|temp_?c|imu\.temperature|.*[._ ]temp(?:erature)?"
REFERENCE = r"ref|reference|truth|true|encoder|enc|table|turntable|stage|motor|servo"
TRACKER = r"ref|reference|truth|gt|ground_?truth|vicon|optitrack|mocap|qualisys|optical"
"""Words of an orientation that another instrument measured: a sensor's own estimate of it is no reference."""
OWN_FILE = rf"{TRACKER}|orientation|quaternion|quat|rotation|rot|q|q_rs"
"""Words of an orientation in a file of the reference alone."""
RATE = r"rate|speed|velocity|vel|omega|w|angular_?rate|angular_?velocity"
ANGLE = r"angle|position|pos|deg|degs|rad|rads|phi|theta"
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
BACK = 0.1
"""Steps back of a time, as a part of its steps forward."""
PHONE = "phones write rad/s"
LARGEST_RAD_S = 35.0
"""Full scale of 2000 deg/s, rad/s: larger readings are deg/s."""
COUNTS_ABOVE = 100.0
"""Whole numbers, of which some are larger, are raw counts."""
COUNTS_PER_DPS = 131
"""Of the example in an error: an MPU-6050 whose range is 250 deg/s."""
WHICH_SENSOR = r"(?:.*[/._ -])?(?:sensor|imu|device|node|board|mac|id)(?:[ _.-]?(?:id|type|name|no|number|address))?"
"""Words of a column that says which sensor a row is of."""
MOST_SENSORS = 16
ALTERNATE = 0.25
"""Part of the rows from which another sensor's follow each other in turn, and are no recordings one after the other."""
COUNTS_PER_G = (16384, 8192, 4096, 2048)


@dataclass(frozen=True)
class Guess:
    """One column: what it is taken for, as ``--map`` takes it, and why."""

    map: str
    why: str
    option: str = "--map"
    """The option that states it, ``--ref-map`` for a column of the reference's own file."""


def guess(source: Source, scaling: Scaling, axes: Sequence[str] = AXES, reference: bool = True) -> list[Guess]:
    """The mapping of a table's columns, time first; columns with a session's own names and units are taken as they are.

    ``reference``: look for the true rate or angle too.

    InputError where no gyroscope is recognized, or where its unit cannot be told.
    """
    _check_one_sensor(source)
    exact = [name for name in TARGETS if name in source.frame.columns]
    found = {name: Guess(f"{name}={name}", "its name") for name in exact}
    if "t_s" not in found:
        _add(found, _time(source))
    every = {axis: every_named(source, GYRO, axis) for axis in axes}
    named = {axis: next(iter(names), None) for axis, names in every.items()}
    if not any(named.values()):
        named = body_rates(source, axes)
    phone = not any(named.values()) and "gyro" in Path(source.label).name.lower()
    if phone:  # Gyroscope.csv of a phone: time, x, y, z
        named = {axis: next((n for n in source.frame.columns if n.lower() == axis), None) for axis in axes}
    gyro = {axis: name for axis, name in named.items() if name is not None and f"g{axis}_dps" not in found}
    acceleration = [first_named(source, ACCELERATION, a) for a in AXES]
    acceleration_names = [n for n in acceleration if n is not None] if "ax_g" not in found else []
    si = False
    if len(acceleration_names) == 3:
        unit, why = _unit_of_acceleration(source, acceleration_names)
        si = unit == ":m/s2"
        for axis, name in zip(AXES, acceleration_names, strict=True):
            _add(found, Guess(f"a{axis}_g={name}{unit}", why))
    if gyro:
        unit, why = _unit_of_gyro(source, list(gyro.values()), "the accelerometer is in m/s2" if si else PHONE * phone, scaling)
        for axis, name in gyro.items():
            others = ", ".join(n for n in every[axis] if n != name)
            _add(found, Guess(f"g{axis}_dps={name}{unit}", f"{why}; not {others}" if others else why))
    if not any(f"g{a}_dps" in found for a in AXES):
        raise InputError(
            f"{source.label}: no gyroscope is recognized among {', '.join(source.frame.columns[:40])}; say which columns to "
            "take: --map gz_dps=COLUMN:UNIT"
        )
    if "temp_c" not in found:
        _add(found, _temperature(source))
    if reference and not {"rate_ref_dps", "ref_angle_deg", "ref_x_dps", "ref_qw"} & set(found):
        for guessed in _orientation(source):
            _add(found, guessed)
        if "ref_qw" not in found:
            _add(found, _reference(source, found))
    return sorted(found.values(), key=lambda g: TARGETS.index(g.map.partition("=")[0]))


def guess_reference(source: Source) -> list[Guess]:
    """The mapping of a reference's own file: its time, and an orientation, rates about three axes, or one rate or angle.

    InputError where none of them is recognized.
    """
    found: dict[str, Guess] = {}
    _add(found, _time(source))
    for guessed in _orientation(source, rf"(?:.*[/._ ])?(?:{OWN_FILE})") or _orientation(source, ""):
        _add(found, guessed)
    rates = [first_named(source, rf"{GYRO}|{REFERENCE}", axis) for axis in AXES]
    if "ref_qw" not in found and None not in rates:
        for axis, name in zip(AXES, rates, strict=True):
            unit = stated_unit(str(name), "gyro")
            why = "the unit is in its name" if unit else "rad/s is possible too"
            _add(found, Guess(f"ref_{axis}_dps={name}:{unit or 'dps'}", f"the true rate: {why}"))
    elif "ref_qw" not in found:
        _add(found, _reference(source, found))
    if "t_s" not in found or len(found) < 2:
        raise InputError(
            f"{source.label}: no time and reference are recognized among {', '.join(source.frame.columns[:40])}; say which "
            "columns to take: --ref-map t_s=COLUMN:UNIT --ref-map ref_angle_deg=COLUMN:UNIT (or rate_ref_dps, ref_x_dps, "
            "ref_qw and so on)"
        )
    return [replace(g, option="--ref-map") for g in found.values()]


def _add(found: dict[str, Guess], guessed: Guess | None) -> None:
    if guessed is not None:
        found[guessed.map.partition("=")[0]] = guessed


def _check_one_sensor(source: Source) -> None:
    """Raise InputError if a column says that the rows are of several sensors in turn."""
    for name in source.frame.columns:
        if not re.fullmatch(WHICH_SENSOR, bare_name(name)[0]):
            continue
        column = source.frame[name].drop_nulls()
        kinds = column.unique(maintain_order=True)
        if 2 <= len(kinds) <= MOST_SENSORS and (column != column.shift()).sum() > ALTERNATE * len(column):
            shown = ", ".join(f"{kind:g}" if isinstance(kind, float) else str(kind) for kind in kinds)
            raise InputError(f"{source.label}: {name} says that the rows are of several sensors ({shown}); keep those of one")


def _values(source: Source, name: str) -> Array:
    values = source.numbers(ColumnMap("gz_dps", name))
    return values[np.isfinite(values)]


def _time(source: Source) -> Guess | None:
    """The first column that is named as a time; its unit is stated in its name, or makes a rate that gyroscopes are read at."""
    for name in source.frame.columns:
        bare, _ = bare_name(name)
        units = "|".join(UNIT_WORDS["t_s"].values())
        if not re.fullmatch(rf"(?:.*[/._ ])?(?:{TIME})(?:[ _.-]?cal)?(?:[ _.-]?(?:{units}))?", bare):
            continue
        t_s = source.numbers(ColumnMap("t_s", name))
        t_s = t_s[np.isfinite(t_s)]
        if t_s.size < 2 or not _runs_forward(t_s):
            continue
        stated = stated_unit(name, "t_s")
        if moments_ns(source.frame[name]) is not None:
            return Guess(f"t_s={name}", "dates or times of day")
        if stated is not None:
            return Guess(f"t_s={name}:{stated}", "the unit is in its name")
        step = period_s(np.maximum.accumulate(t_s[:2000]))
        if bare == "sampletimefine" and step * 1e-4 >= 1 / RATES_HZ[1] and step * 1e-6 < TICK_S:
            return Guess(f"t_s={name}*0.0001", "counts of 0.1 ms, as Xsens writes them")
        if step > 0 and (guessed := _unit_of_time(source, name, t_s, step)) is not None:
            return guessed
    return None


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
    values = _values(source, temperature.map.partition("=")[2].rpartition(":")[0])
    moved = float(np.ptp([part.mean() for part in np.array_split(values, 16)])) if values.size >= 16 else 0.0
    return moved > LEAST_DEGC and moved > FASTEST_DEGC_S * duration_s


def _runs_forward(t_s: Array) -> bool:
    """True if few steps go back, which other columns do half of the time. A counter may begin again, and a file may end with
    rows of zeros.
    """
    steps = np.diff(t_s)
    return float(np.sum(steps < 0)) < BACK * float(np.sum(steps > 0))


def _unit_of_acceleration(source: Source, names: Sequence[str]) -> tuple[str, str]:
    stated = stated_unit(names[0], "acceleration")
    if stated is not None or source.si:
        return f":{stated or 'm/s2'}", "the unit is in its name" if stated else "messages of this kind are in m/s2"
    parts = [_values(source, name) for name in names]
    length = min(p.size for p in parts)
    size = float(np.median(np.sqrt(sum(p[:length] ** 2 for p in parts)))) if length else 0.0
    for unit, one in (("m/s2", STANDARD_GRAVITY), ("g", 1.0), ("mg", 1000.0)):
        if 0.8 < size / one < 1.25:
            return f":{unit}", f"its size is {size:.4g}"
    for counts in COUNTS_PER_G:
        if 0.9 < size / counts < 1.1:
            return f"/{counts}", f"its size is {size:.6g} counts"
    return f"/{size:.6g}" if size > 0 else "", f"its size, {size:.6g}, is taken for 1 g"


def _unit_of_gyro(source: Source, names: Sequence[str], si: str, scaling: Scaling) -> tuple[str, str]:
    """The unit as ``--map`` writes it. ``si`` says why its maker thinks in SI units; empty if nothing says so."""
    stated = stated_unit(names[0], "gyro")
    if stated is not None or source.si:
        return f":{stated or 'rad/s'}", "the unit is in its name" if stated else "messages of this kind are in rad/s"
    values = np.concatenate([_values(source, name) for name in names])
    if not values.size:
        return ":dps", "it holds no number"
    largest = float(np.abs(values).max())
    if np.all(values == np.rint(values)) and largest > COUNTS_ABOVE:
        if scaling.lsb_dps is not None:
            return ":counts", "whole numbers"
        turned = float(np.mean((values > 49152) | ((values >= 0) & (values < 16384))))
        if values.min() >= 0 and largest > 49152 and turned > 0.99:
            raise InputError(
                f"{source.label}: {names[0]} holds counts of 16 bits without their sign: those above 32767 are negative. "
                "Subtract 65536 from these, then say how many make one dps, as by --map gx_dps=COLUMN/131"
            )
        raise InputError(
            f"{source.label}: {names[0]} holds raw counts up to {largest:.6g}; say what one count is, for example --lsb-dps "
            f"{1 / COUNTS_PER_DPS:.6g} for {COUNTS_PER_DPS} counts per dps; unsigned ones need each axis mapped, as by "
            f"--map 'gx_dps=({names[0]}-32768)/{COUNTS_PER_DPS}'"
        )
    if largest > LARGEST_RAD_S:
        return ":dps", f"readings up to {largest:.4g} are too large for rad/s"
    if si:
        return ":rad/s", f"readings up to {largest:.4g}, and {si}; dps is possible too"
    return ":dps", f"readings up to {largest:.4g}; rad/s is possible too"


def _temperature(source: Source) -> Guess | None:
    for name in source.frame.columns:
        bare, _ = bare_name(name)
        named = rf"(?:.*[/._ ])?(?:{TEMPERATURE})(?:[ _.-]?(?:c|degc|celsius|k|f))?"
        if bare in ("t", "time") or not re.fullmatch(named, bare):
            continue
        values = _values(source, name)
        if not values.size:
            continue
        stated = stated_unit(name, "temp_c")
        middle = float(np.median(values))
        unit = stated or ("K" if 200 < middle < 400 else "degC")
        if unit == "degC" and not -60 < middle < 150:
            continue
        return Guess(f"temp_c={name}:{unit}", "the unit is in its name" if stated else f"about {middle:.4g}")
    return None


def _orientation(source: Source, words: str = rf"(?:.*[/._ ])?(?:{TRACKER})") -> list[Guess]:
    """The four columns of a unit quaternion that a tracker measured; none if they are not there or not of length 1."""
    names = []
    for part in "wxyz":
        named = rf"{words}[/._ ]?(?:orientation|quaternion|quat|rotation|rot|q)?[/._ ]?{part}"
        names += [name for name in source.frame.columns if re.fullmatch(named, bare_name(name)[0])][:1]
    if len(names) < 4:
        return []
    size = np.sqrt(sum(source.numbers(ColumnMap("ref_qw", name)) ** 2 for name in names))
    size = size[np.isfinite(size) & (size > 0)]
    if not size.size or abs(float(np.median(size)) - 1) > 0.01:
        return []
    why = "the true orientation: its length is 1"
    return [Guess(f"ref_q{part}={name}", why) for part, name in zip("wxyz", names, strict=True)]


def _reference(source: Source, found: Mapping[str, Guess]) -> Guess | None:
    """A column that is named as the true rate or angle of a table; a rate without a stated unit has that of the gyroscope."""
    taken = {g.map.partition("=")[2] for g in found.values()}
    unit_of_gyro = next((g.map.rpartition(":")[2] for name, g in found.items() if name.startswith("g") and ":" in g.map), "dps")
    for name in source.frame.columns:
        bare, _ = bare_name(name)
        if name in taken or not _values(source, name).size:
            continue
        rate = rf"(?:.*[/._ ])?(?:{REFERENCE})[ _.-]?(?:{RATE})?(?:[ _.-]?(?:dps|rad_?s|rads|mdps|deg_?s))?"
        angle = rf"(?:.*[/._ ])?(?:{REFERENCE})[ _.-]?(?:{ANGLE})(?:[ _.-]?(?:deg|degs|rad|rads|turns?))?"
        stated = stated_unit(name, "gyro")
        if re.fullmatch(rate, bare) and (stated or re.search(rf"(?:{RATE})$", bare)):
            why = "the unit is in its name" if stated else "its name; the unit is taken to be the gyroscope's"
            return Guess(f"rate_ref_dps={name}:{stated or unit_of_gyro}", f"the true rate: {why}")
        stated = stated_unit(name, "angle")
        if re.fullmatch(angle, bare) and stated:
            return Guess(f"ref_angle_deg={name}:{stated}", "the true angle: the unit is in its name")
    return None
