"""Names of columns as loggers write them: what they name, about which axis, and the unit that they state."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from gyrocal.recording.run import AXES
from gyrocal.recording.source import Source

GYRO = (
    r"gyro(?:scope)?s?|gyro_?adc|gyro_?(?:raw|unfilt|out|rotation|rate)|giro(?:scopio)?s?|gyrs?|gyr_rad_s|g|gy|w|omega|"
    r"ang(?:ular)?_?vel(?:ocity)?|ang(?:ular)?_?(?:rate|speed)|w_rs_s|imu\.gyro|(?:turn|body)_?rates?|pqr|"
    r"rotation_?rate|all_gyro_2|drehrate|rot|angular_velocity\.xyz|wb"
)
SPELLED = r"gyro(?:scope)?|giro|gyr|omega|ang(?:ular)?_?(?:vel|velocity|rate|speed)|acc|accel|accl|accelerometer|acceleration"
"""Words that are clear also behind the axis, as in ``x_gyro``, and behind capitals, as in ``SENSgyro``."""
TURNS = {"x": "roll", "y": "pitch", "z": "yaw"}
OF_ACCELERATION = r"(?!.*(?:gyr|giro|omega|rate|ang)).*(?:^|[/._])acc(?:el|l|elerometer|eleration)?[/._].*"
"""A name that says acceleration and nothing of a gyroscope, as ``acc_imu_g.0``, whose ``g`` is the unit."""
TURN_LETTERS = (("roll", "pitch", "yaw"), ("r", "p", "y"))
"""Words and letters that stand for x, y and z behind a word for rates: ``GyroY`` beside ``GyroR`` and ``GyroP`` is no y."""
BODY_RATES = {"x": "p", "y": "q", "z": "r"}
"""Names of flight mechanics, which single letters are only beside :data:`OF_A_BODY` or a unit of a rate."""
OF_A_BODY = {"phi", "theta", "psi", "roll", "pitch", "yaw", "u", "v", "w", "ax", "ay", "az", "alpha", "beta"}
NO_READING = r"(?:.*[/._])?(?:b_[wa]_rs_s|bias|biases)(?:[/._].*)?"
"""Words of a column that holds an estimated bias of a sensor, and none of its readings."""
MILLI = r"m(?:illi[_-]?)?"
"""A thousandth of a unit, before its words."""
UNIT_WORDS = {
    "t_s": {
        "ns": "ns|nsec|nanoseconds?", "us": "us|µs|usec|micros|microseconds?", "ms": "ms|msec|millis|milliseconds?",
        "s": "s|secs?|seconds?",
    },
    "gyro": {
        "mrad/s": rf"{MILLI}(?:rads?|radians?|rad(?:ian)?s?_?[/.]?s(?:ec|econd)?(?:-?1)?|radps|"
        r"rad(?:ian)?s?_per_s(?:ec(?:ond)?)?)",
        "mdps": rf"{MILLI}(?:dps|[°º]|[°º]/s(?:ec|econd)?|deg(?:ree)?s?|deg(?:ree)?s?_?[/.]?s(?:ec|econd)?(?:-?1)?|"
        r"deg(?:ree)?s?_per_s(?:ec(?:ond)?)?)",
        "rad/s": r"rads?|radians?|rad(?:ian)?s?_?[/.]?s(?:ec|econd)?(?:-?1)?|radps|rad(?:ian)?s?_per_s(?:ec(?:ond)?)?",
        "dps": r"dps|[°ºo]/s(?:ec|econd)?|d/s|deg(?:ree)?s?_?[/.]?s(?:ec|econd)?(?:-?1)?|degs|"
        r"deg(?:ree)?s?_per_s(?:ec(?:ond)?)?",
    },
    "acceleration": {
        "m/s2": r"m/s2|m/s/s|m_?[.]?s-?2|ms2|mps2|m(?:eter)?s?_per_s(?:ec(?:ond)?)?(?:2|_squared)",
        "mg": "mg|milli_?gs?", "g": "gs?|g's|g_force",
    },
    "angle": {
        "mrad": rf"{MILLI}(?:rads?|radians?)", "mdeg": rf"{MILLI}(?:deg|degs|degrees?|°|º)", "rad": "rads?|radians?",
        "turn": "turns?|revs?", "deg": "deg|degs|degrees?|°|º",
    },
    "temp_c": {"degC": "c|degc|°c|℃|celsius", "degF": "f|degf|°f", "K": "k|kelvin"},
}  # fmt: skip
"""Words in a column's name that state its unit, as :func:`bare_name` writes them."""
BRACKETS = r"(.*?)[ _]*[\[(]([^\])]*[^\])\d][^\])]*)[\])]\s*"
CAMEL = (
    (r"(?<![A-Za-z])mG(?![a-z])", "mg"), (r"deg([CFK])\b", r"deg_\1"), (r"(?<=[a-z0-9])(?=[A-Z])", "_"),
    (r"(?<![A-Za-z])([num]s)(?=time)", r"\1_"),
)  # fmt: skip
CAMEL_OF_CAPITALS = r"(?<=[A-Z]{2})(?=[A-Z][a-z])"
OF_A_PART = r"(?:[a-z]{2,4}\d[a-z0-9]{2,}(?:_[a-z])?|imu|mpu|bno|lsm|bmi|icm)"
"""A sensor's part number or family within a column's name, as in ``gyroscope_lsm6ds3_c.x`` or ``giro_bno.0``."""
MOST_OF_A_KIND = 3
"""Columns that are numbered further are of several sensors."""


def bare_name(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case with ``_`` between its words, and the unit's words.

    ``Gyro X (rad/s)`` is ``gyro_x`` and ``rad/s``, ``gyroRotationX`` is ``gyro_rotation_x``, ``w_RS_S_x [rad s^-1]`` is
    ``w_rs_s_x`` and ``rad_s-1``.
    """
    name = re.sub(r"[\[(]([xyzXYZ])[\])]", r"_\1", name.strip().removesuffix("[]"))
    match = re.fullmatch(BRACKETS, name)
    bare, unit = (match[1], match[2]) if match else (name, "")
    bare = re.sub(rf"(?<=[A-Z])(?={SPELLED})", "_", bare)
    for pattern, written in CAMEL:
        bare = re.sub(pattern, written, bare)
    bare = re.sub(r"[ :\-_]+", "_", re.sub(CAMEL_OF_CAPITALS, "_", bare).strip(" #").lower()).strip("_")
    return bare, re.sub(r" +", "_", unit.strip().lower().replace("²", "2").replace("^", "").replace("⁻¹", "-1"))


def first_named(source: Source, words: str, axis: str) -> str | None:
    """The first column whose name is one of the words with this axis."""
    return next(iter(every_named(source, words, axis)), None)


def every_named(source: Source, words: str, axis: str) -> list[str]:
    """The columns whose names are one of the words with this axis: ``gyr_x``, ``gx``, ``Gyro X (dps)``; else ``yaw_rate``.

    The axis may come first (``x_gyro``), or be a number from 0 or 1.
    """
    spelled = "|".join([*UNIT_WORDS["gyro"].values(), UNIT_WORDS["acceleration"]["m/s2"]])
    units = rf"(?:[_.]?(?:{spelled}|deg|mg|gs?|raw))?"
    kind = r"(?:[_.]?(?:cal|calib|calibrated|raw|out|value|axis|cnt|counts?|lsb))?(?:_\d{1,2})?"
    which = rf"(?:_?(?:calib|raw|adc|unfilt|out|smooth))?(?:_sensor)?(?:_\d{{1,3}})?(?:_{OF_A_PART})?"
    stem = rf"(?:.*[/._])?(?:{words}){which}{units}"
    bare = {name: bare_name(name)[0] for name in source.frame.columns}
    number = rf"\.{AXES.index(axis)}|\[{AXES.index(axis)}\]" + _counted(stem, units + kind, bare.values(), axis)
    behind = rf"(?:.*[/._])?{axis}_?(?={SPELLED})(?:{words}){units}{kind}"
    named = rf"{stem}(?:[_./]?{axis}|{number}){units}{kind}|{behind}"
    if GYRO in words and (turned := _turned(words, units + kind, bare.values())):
        named = turned[AXES.index(axis)]
    found = [name for name, word in bare.items() if re.fullmatch(named, word) and not re.fullmatch(NO_READING, word)]
    if GYRO in words:
        found = [name for name in found if not re.match(OF_ACCELERATION, bare[name])]
    found = [name for name in found if "rot" not in bare[name] or not _is_orientation(name, bare)]
    turn = rf"(?:.*[/._])?{TURNS[axis]}_?(?:rate|speed|velocity){units}"
    return found or [name for name, word in bare.items() if GYRO in words and re.fullmatch(turn, word)]


def _turned(words: str, tail: str, names: Collection[str]) -> list[str]:
    """The patterns of rates by roll, pitch and yaw, where a table has all three and no x or z; else none."""

    def pattern(part: str) -> str:
        return rf"(?:.*[/._])?(?=(?:{SPELLED})[_./]?{part})(?:{words})[_./]?{part}{tail}"

    def is_there(part: str) -> bool:
        return any(re.fullmatch(pattern(part), name) for name in names)

    for parts in TURN_LETTERS:
        if all(map(is_there, parts)) and not any(map(is_there, "xz")):
            return [pattern(part) for part in parts]
    return []


def _counted(stem: str, tail: str, names: Collection[str], axis: str) -> str:
    """The number of the axis as an alternative of a pattern, where the columns of a stem are 0, 1, 2 or 1, 2, 3 and no more."""
    there = {n: any(re.fullmatch(rf"{stem}_?{n}{tail}", name) for name in names) for n in range(MOST_OF_A_KIND + 2)}
    for first in (0, 1):
        inside = all(there[first + i] for i in range(MOST_OF_A_KIND))
        if inside and not there[first + MOST_OF_A_KIND] and not (first and there[0]):
            return rf"|_?{first + AXES.index(axis)}"
    return ""


def with_unit_of_rate(source: Source) -> dict[str, str]:
    """The columns by axis that no word names as a gyroscope's but the unit behind their names: ``AsX(°/s)``."""
    found: dict[str, str] = {}
    for axis in AXES:
        for name in source.frame.columns:
            bare, unit = bare_name(name)
            stated = any(re.fullmatch(words, unit) for words in UNIT_WORDS["gyro"].values())
            axial = re.fullmatch(rf"(?:.*_)?(?:[a-z]*_)?{axis}(?:_axis|_value)?|.*[a-z]{axis}", bare)
            if stated and axial and not re.fullmatch(rf"{NO_READING}|.*(?:angle|ref|truth).*", bare):
                found.setdefault(axis, name)
    return found if len(found) == len(AXES) else {}


def alone(name: str) -> str:
    """The axis that is all of a column's name in a file of one sensor: ``x``, ``X_value``, ``x-axis (deg/s)``."""
    return re.sub(r"_(?:axis|value)$", "", bare_name(name)[0])


def _is_orientation(name: str, bare: Mapping[str, str]) -> bool:
    """True for an angle, and for a part of a quaternion, whose real part is among the names ``bare`` of the table."""
    return stated_unit(name, "angle") is not None or re.sub(r"[xyz]$", "w", bare[name]) in bare.values()


def body_rates(source: Source, axes: Sequence[str]) -> dict[str, str | None]:
    """The columns p, q and r by axis, where all three are there and a unit or other columns say what they are."""
    names = {bare_name(name)[0]: name for name in source.frame.columns}
    rates = [names.get(letter) for letter in BODY_RATES.values()]
    known = None not in rates and (OF_A_BODY & set(names) or all(stated_unit(str(name), "gyro") for name in rates))
    return {axis: names[BODY_RATES[axis]] if known else None for axis in axes}


def stated_unit(name: str, kind: str) -> str | None:
    """The unit in a column's name, of a ``kind`` of :data:`UNIT_WORDS`; None if it states none."""
    bare, unit = bare_name(name)
    for known, words in UNIT_WORDS[kind].items():
        if re.fullmatch(words, unit) or re.search(rf"(?:^|[_.])(?:{words})(?:$|[_.](?:[xyz]|\d)$|\[\d\]$)", bare):
            return known
    return None
