"""Names of columns as loggers write them: what they name, about which axis, and the unit that they state."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from gyrocal.recording.run import AXES
from gyrocal.recording.source import Source

GYRO = (
    r"gyro(?:scope)?s?|gyro_?adc|gyrs?|gyr_rad_s|g|gy|w|omega|ang(?:ular)?_?vel(?:ocity)?|ang(?:ular)?_?rate|w_rs_s|imu\.gyro|"
    r"rotation_?rate|all_gyro_2|drehrate|rot|angular_velocity\.xyz"
)
TURNS = {"x": "roll", "y": "pitch", "z": "yaw"}
BODY_RATES = {"x": "p", "y": "q", "z": "r"}
"""Names of flight mechanics, which single letters are only beside :data:`OF_A_BODY` or a unit of a rate."""
OF_A_BODY = {"phi", "theta", "psi", "roll", "pitch", "yaw", "u", "v", "w", "ax", "ay", "az", "alpha", "beta"}
NO_READING = r"(?:.*[/._ -])?(?:b_[wa]_rs_s|bias|biases)(?:[/._ -].*)?"
"""Words of a column that holds an estimated bias of a sensor, and none of its readings."""
UNIT_WORDS = {
    "t_s": {
        "ns": "ns|nsec|nanoseconds", "us": "us|usec|micros|microseconds", "ms": "ms|msec|millis|milliseconds",
        "s": "s|sec|secs|seconds",
    },
    "gyro": {
        "rad/s": r"rads?|rad_?s|rad/s|rad s\^?-1|radps|rad(?:ian)?s?_per_s(?:ec(?:ond)?)?", "mdps": "mdps",
        "dps": r"dps|deg/?s|degs?|deg_?s|°/s|o/s|deg(?:ree)?s?_per_s(?:ec(?:ond)?)?",
    },
    "acceleration": {
        "m/s2": r"m/s2|m/s\^2|m s\^?-2|ms2|mps2|m_?s2|m(?:eter)?s?_per_s(?:ec(?:ond)?)?(?:2|_squared)", "mg": "mg", "g": "gs?",
    },
    "angle": {"rad": "rads?|radians?", "turn": "turns?|revs?", "deg": "deg|degs|degrees?|°"},
    "temp_c": {"degC": "c|degc|°c|celsius", "degF": "f|degf|°f", "K": "k|kelvin"},
}  # fmt: skip
"""Words in a column's name that state its unit."""


def bare_name(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case, and the unit's words: ``Gyro X (rad/s)``, ``w_RS_S_x [rad s^-1]``."""
    name = name.strip().removesuffix("[]")
    match = re.fullmatch(r"(.*?)[ _]*[\[(]([^\])]*[^\])\d][^\])]*)[\])]\s*", name)
    bare, unit = (match[1], match[2]) if match else (name, "")
    return bare.strip(" #").lower(), unit.strip().lower()


def first_named(source: Source, words: str, axis: str) -> str | None:
    """The first column whose name is one of the words with this axis."""
    return next(iter(every_named(source, words, axis)), None)


def every_named(source: Source, words: str, axis: str) -> list[str]:
    """The columns whose names are one of the words with this axis: ``gyr_x``, ``gx``, ``Gyro X (dps)``; else ``yaw_rate``."""
    index = str(AXES.index(axis))
    number = rf"\.{index}|\[{index}\]"
    spelled = "|".join(UNIT_WORDS[kind][unit] for kind, unit in (("gyro", "rad/s"), ("gyro", "dps"), ("acceleration", "m/s2")))
    units = rf"(?:[ _.-]?(?:{spelled}|rad|rad_?s|mdps|deg|m_?s2|mps2|mg|gs?|raw))?"
    kind = r"(?:[ _.-]?(?:cal|calib|calibrated|raw))?"
    named = rf"(?:.*[/._ ])?(?:{words})(?:[ _.-]?(?:calib|raw))?{units}(?:[ _.-]?{axis}|{number}){units}{kind}"
    turn = rf"(?:.*[/._ ])?{TURNS[axis]}[ _.-]?(?:rate|speed|velocity){units}"
    bare = {name: bare_name(name)[0] for name in source.frame.columns}
    found = [name for name, word in bare.items() if re.fullmatch(named, word) and not re.fullmatch(NO_READING, word)]
    found = [name for name in found if "rot" not in bare[name] or not _is_orientation(name, bare)]
    return found or [n for n in source.frame.columns if GYRO in words and re.fullmatch(turn, bare_name(n)[0])]


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
        if re.fullmatch(words, unit) or re.search(rf"(?:^|[ _.-])(?:{words})(?:$|[ _.-](?:[xyz]|\d)$|\[\d\]$)", bare):
            return known
    return None
