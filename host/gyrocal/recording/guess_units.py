"""Units of rates and accelerations that no name states, from what the readings must show of one motion.

A gyroscope in rad/s reads 57 times less than in deg/s. Where a sensor turns, gravity and an orientation that it computed turn
by the angle that the rates add up to, a table turns at the rate or by the angle that was stated, and nothing at rest trembles
by degrees per second. Its range ends at the full scale of a part. Where none of this decides, :attr:`Unit.sure` is False, and
a person has to say which it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.column_map import STANDARD_GRAVITY, ColumnMap, Scaling
from gyrocal.recording.column_names import stated_unit
from gyrocal.recording.cut import Cut
from gyrocal.recording.gravity_turns import LOOKS_S, MEAN_S, directions, looks, off_after
from gyrocal.recording.range_end import in_rad_s
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source
from gyrocal.recording.stated import unit_of_rates
from gyrocal.recording.stretches import Index, Mask

RAD = 180 / np.pi
RADIANS = {"rad/s": 1.0, "dps": 1 / RAD}
"""What a reading of 1 turns in a second, rad."""
PHONE = "phones write rad/s"
ROS = "messages of this kind (sensor_msgs/Imu) define rad/s"
LARGEST_RAD_S = 35.0
"""Full scale of 2000 deg/s, rad/s: larger readings are deg/s."""
COUNTS_ABOVE = 100.0
"""Whole numbers, of which some are larger, are raw counts."""
LARGEST_WORD = 65535.0
"""Largest code of a word of 16 bits: larger whole numbers may as well be of a small unit."""
COUNTS_MDPS, FEWEST_CODES = (4.375, 8.75, 17.5, 35.0, 70.0, 140.0), 4
"""Counts of ST's gyroscopes at their full scales, which their drivers multiply by, and the different readings that show one."""
HALF_OF_LAST = 6e-3
"""A little more than half of the second decimal, to which such readings are written at the least."""
COUNTS_PER_DPS = 131
"""Of the example in an error: an MPU-6050 whose range is 250 deg/s."""
ACCELERATIONS = (("m/s2", STANDARD_GRAVITY), ("mg", 1e3), ("g", 1.0))
"""Units, and the size of gravity in each."""
COUNTS_PER_G = (16384, 8192, 4096, 2048)
LEAST_G = 0.5
"""Readings of a smaller size are accelerations without gravity: no scale is wrong by a factor of two."""
VARIES = 2.0
"""Upper over lower quartile of the sizes of accelerations, from which on gravity is no more than the least of them: 1.1 to 1.6
on feet, drones, robots and in hands, 4.5 to 5.1 at the rim of a wheel, 3.3 to 5.7 of a phone's acceleration without gravity."""
STILL_PIECE, FEWEST_STILL, STILL = 32, 3, 0.05
"""Samples of a piece, such pieces at least, and their scatter as a part of their mean, where gravity alone is shown."""
MOVING = 0.2
"""Readings that are off their median by more than this are of a movement, in either unit of the readings."""
CLEARLY = 4.0
"""Ratio of the squared misfits of two units from which the smaller one is right."""
OF_ONE_SIZE = 3.0
"""Factor within which readings are of the size of a stated rate. Degrees and radians are 57 apart."""
OF_A_PLATEAU = 64
"""Readings whose median shows the rate of a plateau."""
LEAST_TURN_DPS = 2.0
"""A reference that turns less may be noise."""
TREMBLE_RAD_S, FINE_DPS = 0.05, 0.0015
"""Noise of one reading: that of a sensor at rest is smaller than the first in rad/s, and larger than the second in deg/s."""

WHITE = 1.5
"""Spread of still readings over the noise by their second differences: that of a motion, however slow, is larger."""


@dataclass(frozen=True)
class Unit:
    """A unit as ``--map`` writes it, and why. ``sure``: False where another is as possible."""

    text: str
    why: str
    sure: bool = True


@dataclass(frozen=True)
class Motion:
    """Times [n], s, and beside them, NaN where they are missing and None without any: accelerations [n, 3] in any unit, and the
    orientations that the sensor computed, unit quaternions [n, 4].
    """

    t_s: Array
    acc: Array | None
    turned: Array | None = None


@dataclass(frozen=True)
class Known:
    """What is known of a recording's motion beside its readings: the table's rate, deg/s, its angle, deg, or a reference.

    ``cuts`` are the runs that are taken, if a file is cut, each with its own rate or angle, and ``rates_dps`` those of the
    table at which the recording has plateaus, wherever they are. ``reference_dps`` gives the rms rate of a reference, deg/s,
    or None; it is called only if nothing else decides.
    """

    rate_dps: float | None = None
    turn_deg: float | None = None
    reference_dps: Callable[[], float | None] = lambda: None
    cuts: Sequence[Cut] = ()
    rates_dps: Sequence[float] = ()


def unit_of_acceleration(source: Source, names: Sequence[str], scaling: Scaling) -> Unit | None:
    """The unit of three columns; None if they hold no gravity. It is not sure where their size is that of no unit."""
    parts = [values_of(source, name) for name in names]
    length = min(p.size for p in parts)
    sizes = np.sqrt(sum(p[:length] ** 2 for p in parts)) if length else np.zeros(1)
    least, size, most = (float(q) for q in np.quantile(sizes, (0.25, 0.5, 0.75)))
    stated = stated_unit(names[0], "acceleration")
    if stated is not None or source.si:
        one = dict(ACCELERATIONS)[stated or "m/s2"]
        why = "the unit is in its name" if stated else "messages of this kind are in m/s2"
        return Unit(f":{stated or 'm/s2'}", why) if size > LEAST_G * one else None
    whole = all(np.array_equal(p, np.rint(p)) for p in parts)
    if whole and scaling.lsb_g is not None:
        return Unit(":counts", "whole numbers, of which --lsb-g says the size")
    varies = most > VARIES * least
    for unit, one in ACCELERATIONS[:-1] if varies else ACCELERATIONS:  # 1 m/s2 of a motion without gravity looks like 1 g
        if 0.8 < (least if varies else size) / one < 1.25:
            return Unit(f":{unit}", f"its size is {least:.4g} and more" if varies else f"its size is {size:.4g}")
    for counts in COUNTS_PER_G:
        if 0.9 < size / counts < 1.1:
            return Unit(f"/{counts}", f"its size is {size:.6g} counts")
    if (still := _still_size(parts, length)) is not None:
        for unit, one in ACCELERATIONS:
            if 0.8 < still / one < 1.25:
                return Unit(f":{unit}", f"its size is {still:.4g} where it is still")
    if size < LEAST_G:
        return None
    if whole:
        return Unit(f"/{size:.6g}", f"its size, {size:.6g} counts, is taken for 1 g")
    if varies:
        return None
    unit, one = min(ACCELERATIONS, key=lambda unit: abs(np.log(size / unit[1])))
    why = f"its size is {size:.4g}, and gravity is {one:.4g}: the scale of this accelerometer is wrong"
    return Unit(f":{unit}", why, sure=False)


def _still_size(parts: Sequence[Array], length: int) -> float | None:
    """The size of three columns' means where they scatter little about these; None where no more than two pieces are so.

    A part that is shaken shows more than gravity, or less. Accelerations without gravity scatter by more than their mean.
    """
    count = length // STILL_PIECE
    if count < FEWEST_STILL:
        return None
    pieces = np.column_stack([p[: count * STILL_PIECE] for p in parts]).reshape(count, STILL_PIECE, 3)
    size, spread = np.linalg.norm(pieces.mean(axis=1), axis=1), np.sqrt(pieces.var(axis=1).sum(axis=1))
    still = spread < STILL * size
    if still.sum() < FEWEST_STILL:
        return None
    return float(np.median(size[still & (spread <= np.median(spread[still]))]))


def unit_of_gyro(
    source: Source, names: Mapping[str, str], motion: Motion | None, known: Known, maker: str, scaling: Scaling
) -> Unit:
    """The unit of the columns by axis. ``maker`` says why its maker thinks in SI units; empty if nothing says so."""
    stated = stated_unit(next(iter(names.values())), "gyro")
    if stated is not None or source.si:
        return Unit(f":{stated or 'rad/s'}", "the unit is in its name" if stated else "messages of this kind are in rad/s")
    values = np.concatenate([values_of(source, name) for name in names.values()])
    if not values.size:
        return Unit(":dps", "it holds no number")
    largest = float(np.abs(values).max())
    if scaling.lsb_dps is None and (count := _count_mdps(values)):
        return Unit(":mdps", f"whole multiples of {count:g}: one count of an ST gyroscope in mdps")
    if np.all(values == np.rint(values)) and (largest > COUNTS_ABOVE or scaling.lsb_dps is not None):
        check_signed(source, list(names.values()))
        if scaling.lsb_dps is None:
            raise _counts(source, next(iter(names.values())), values)
        return Unit(":counts", "whole numbers, of which --lsb-dps says the size")
    up_to = f"readings up to {largest:.4g}"
    if in_rad_s(values):
        return Unit(":rad/s", f"{up_to}, at which they end: in rad/s that is the full scale of a part")
    if largest > LARGEST_RAD_S:
        return Unit(":dps", f"{up_to} are too large for rad/s")
    rates = np.column_stack([source.numbers(ColumnMap("gz_dps", name)) for name in names.values()])
    if motion is not None and len(names) == 3:
        if motion.acc is not None and (unit := _by_gravity(rates, motion.t_s, motion.acc)):
            return Unit(f":{unit}", f"{up_to}; in {unit} they turn as gravity does in the accelerometer")
        if motion.acc is not None and (turn_dps := _steady_turn_dps(rates, motion.t_s, motion.acc)):
            return Unit(":dps", f"{up_to}; in rad/s it would turn by {turn_dps:.3g} deg each second, and gravity stays")
        if motion.turned is not None and (unit := _by_orientation(rates, motion.t_s, motion.turned)):
            return Unit(f":{unit}", f"{up_to}; in {unit} they turn as the orientation in the same table does")
    if (unit := _by_statement(rates, motion, known)) is not None:
        return Unit(f":{unit}", f"{up_to}; in {unit} they are of the size of the rate that is known")
    if maker == ROS:
        return Unit(":rad/s", f"{up_to}, and {maker}")
    if (unit := _by_noise(rates)) is not None:
        return Unit(f":{unit}", f"{up_to}; the noise of a reading is that of a sensor in {unit}")
    if (unit := unit_of_rates(source.above)) is not None:
        return Unit(f":{unit}", f"{up_to}; a line above the table states {unit}")
    if maker == PHONE:
        return Unit(":rad/s", f"{up_to}, and {maker}; dps is possible too")
    if maker:
        return Unit(":rad/s", f"{up_to}, and {maker}; dps is possible too", False)
    return Unit(":dps", f"{up_to}; rad/s is possible too", False)


def values_of(source: Source, name: str) -> Array:
    """The finite numbers of a column."""
    values = source.numbers(ColumnMap("gz_dps", name))
    return values[np.isfinite(values)]


def _count_mdps(values: Array) -> float:
    """The count in mdps whose whole multiples, and of no larger step, the readings are; 0 if they are of none."""
    multiples = np.rint(values / COUNTS_MDPS[0])
    if np.any(np.abs(values - multiples * COUNTS_MDPS[0]) > HALF_OF_LAST):
        return 0.0
    codes = np.unique(multiples)
    step = COUNTS_MDPS[0] * float(np.gcd.reduce(codes.astype(np.int64))) if codes.size >= FEWEST_CODES else 0.0
    return step if step in COUNTS_MDPS else 0.0


def check_signed(source: Source, names: Sequence[str]) -> None:
    """InputError if columns hold counts of 16 bits without their sign: large and small ones, and none between."""
    for name in names:
        values = values_of(source, name)
        if not values.size or values.min() < 0 or values.max() <= 49152 or not np.array_equal(values, np.rint(values)):
            continue
        if float(np.mean((values > 49152) | (values < 16384))) > 0.99:
            raise InputError(f"{source.label}: {name} holds counts of 16 bits without their sign: {_zeros('COLUMN')}")


def _counts(source: Source, name: str, values: Array) -> InputError:
    """The refusal of raw counts whose size is not known."""
    largest = float(np.abs(values).max())
    if largest > LARGEST_WORD:
        return InputError(
            f"{source.label}: {name} holds whole numbers up to {largest:.6g}, more than a reading of 16 bits; say their unit, "
            f"for example --map gx_dps={name}:mdps, or what one count is, by --lsb-dps"
        )
    zero = _zeros(name) if float(values.min()) >= 0 else _about_the_middle(name)
    return InputError(
        f"{source.label}: {name} holds raw counts up to {largest:.6g}; say what one count is, for example --lsb-dps "
        f"{1 / COUNTS_PER_DPS:.6g} ({COUNTS_PER_DPS} counts per dps); of unsigned ones, {zero}"
    )


def _zeros(name: str) -> str:
    """What unsigned counts may be, in words: two's complement, or counts about the middle of the range."""
    return (
        "either those above 32767 are negative: subtract 65536 from these, then say how many make one dps, as by --map "
        f"gx_dps={name}/{COUNTS_PER_DPS}; or 32768 is zero: {_about_the_middle(name)}"
    )


def _about_the_middle(name: str) -> str:
    return f"map each axis, as by --map 'gx_dps=({name}-32768)/{COUNTS_PER_DPS}'"


def _by_gravity(rates: Array, t_s: Array, acc: Array) -> str | None:
    """The unit in which rates [n, 3] turn gravity as the accelerometer shows it; None where nothing turns it.

    Gravity at the end of a look is compared with gravity at its start, turned by the rates between in either unit, or not at
    all. Looks are those in which the readings are of a movement.
    """
    good = np.isfinite(rates).all(axis=1) & np.isfinite(acc).all(axis=1) & np.isfinite(t_s)
    rates, gravity = rates[good], directions(t_s[good], acc[good])
    if gravity is None:
        return None
    up = gravity.up
    for look_s in LOOKS_S:
        steps = max(1, round(look_s / gravity.step_s))
        starts = looks(_moving(rates), gravity.steady, steps, gravity.edge)
        if not starts.size:
            return None
        turns = {unit: rates * one * gravity.step_s for unit, one in RADIANS.items()}
        misfit = {unit: float(np.mean(off_after(up, turn, starts, steps))) for unit, turn in turns.items()}
        unturned = float(np.mean(np.sum((up[starts + steps] - up[starts]) ** 2, axis=1)))
        if unit := _clearly(misfit, unturned):
            return unit
    return None


def _steady_turn_dps(rates: Array, t_s: Array, acc: Array) -> float:
    """The steady rate of readings [n, 3] in rad/s, deg/s, that is beyond a bias and that gravity contradicts; 0 if none is.

    A sensor that turned so would show gravity on a cone about the axis of the turn, and it shows it in one place. A turn about
    gravity shows no cone, also if a bias tilts the axis somewhat.
    """
    good = np.isfinite(rates).all(axis=1) & np.isfinite(acc).all(axis=1) & np.isfinite(t_s)
    middle = np.median(rates[good], axis=0) if good.any() else np.zeros(3)
    size, gravity = float(np.linalg.norm(middle)), directions(t_s[good], acc[good])
    if gravity is None or not size <= POLICY.largest_bias_dps < size * RAD or size * float(np.ptp(t_s[good])) < np.pi:
        return 0.0
    up = gravity.up[gravity.edge : -gravity.edge]
    mean = np.median(up, axis=0) / max(float(np.linalg.norm(np.median(up, axis=0))), 1e-12)
    off = float(np.median(np.arccos(np.clip(up @ mean, -1.0, 1.0))))
    cone = float(np.arccos(min(1.0, abs(float(mean @ middle)) / size)))
    return size * RAD if max(CLEARLY * off, np.deg2rad(POLICY.same_pose_deg)) < cone else 0.0


def _moving(rates: Array) -> Mask:
    return np.asarray(np.linalg.norm(rates - np.median(rates, axis=0), axis=1) > MOVING)


def _clearly(misfit: Mapping[str, float], unturned: float) -> str | None:
    """The unit of the smallest mean square, if that of the other one, and of no turn at all, is clearly larger."""
    best, other = sorted(misfit, key=lambda unit: misfit[unit])
    return best if min(misfit[other], unturned) > CLEARLY * misfit[best] else None


def _by_orientation(rates: Array, t_s: Array, turned: Array) -> str | None:
    """The unit in which rates [n, 3] turn by the angles between orientations, unit quaternions [n, 4]; None if none does.

    Angles are the same in each frame. Their median square is compared, because an orientation jumps where it is set anew.
    """
    good = np.isfinite(rates).all(axis=1) & np.isfinite(turned).all(axis=1) & np.isfinite(t_s)
    t_s, rates, turned = t_s[good], rates[good], turned[good]
    if t_s.size < 10 or t_s[-1] <= t_s[0]:
        return None
    step_s = float(t_s[-1] - t_s[0]) / (t_s.size - 1)
    for look_s in LOOKS_S:
        steps = max(1, round(look_s / step_s))
        starts = looks(_moving(rates), np.ones(t_s.size, dtype=bool), steps)
        if not starts.size:
            return None
        cosine = np.abs(np.sum(turned[starts] * turned[starts + steps], axis=1))
        angle = 2 * np.arccos(np.minimum(cosine, 1.0))
        by_rates = {unit: _angles(rates * one * step_s, starts, steps) for unit, one in RADIANS.items()}
        misfit = {unit: float(np.median((angle - by) ** 2)) for unit, by in by_rates.items()}
        if unit := _clearly(misfit, float(np.median(angle**2))):
            return unit
    return None


def _angles(turns_rad: Array, starts: Index, steps: int) -> Array:
    """The angle, rad, of the rotation that turns [n, 3] add up to from each start on."""
    from scipy.spatial.transform import Rotation

    total = Rotation.from_rotvec(turns_rad[starts])
    for k in range(1, steps):
        total = total * Rotation.from_rotvec(turns_rad[starts + k])
    return np.asarray(total.magnitude())


def _by_statement(rates: Array, motion: Motion | None, known: Known) -> str | None:
    """The unit in which the rates are of the size of a stated rate or angle, or of those of a reference."""
    pairs = []
    for cut in known.cuts or [Cut("", meta={"table_rate_dps": known.rate_dps, "turn_deg": known.turn_deg})]:
        rows = _rows(cut, motion, len(rates))
        part, rate_dps, turn_deg = rates[rows], cut.meta.get("table_rate_dps"), cut.meta.get("turn_deg")
        if rate_dps and len(part):
            pairs.append((float(np.abs(np.nanmedian(part, axis=0)).max()), abs(rate_dps)))
        if turn_deg and motion is not None and motion.t_s.size == len(rates) and len(part) > 1:
            turned = np.nan_to_num(part - np.nanmedian(part[: max(10, len(part) // 50)], axis=0))
            pairs.append((float(np.abs(np.gradient(motion.t_s[rows]) @ turned).max()), abs(turn_deg)))
    if any(known.rates_dps):
        whole = rates[np.isfinite(rates).all(axis=1)]
        parts = np.array_split(whole, max(1, len(whole) // OF_A_PLATEAU))
        fastest = max((float(np.abs(np.median(part, axis=0)).max()) for part in parts if len(part)), default=0.0)
        pairs.append((fastest, max(map(abs, known.rates_dps))))
    if not pairs and (reference_dps := known.reference_dps()) is not None:
        pairs.append((float(np.sqrt(np.nanmean(np.nansum(rates**2, axis=1)))), reference_dps))
    for read, true in pairs:
        for unit, one in (("dps", 1.0), ("rad/s", RAD)):
            if 1 / OF_ONE_SIZE < read * one / true < OF_ONE_SIZE:
                return unit
    return None


def _rows(cut: Cut, motion: Motion | None, height: int) -> slice:
    """The rows of a table of this height that a run takes; none where it begins or ends at a time and none is known."""
    at = [0, height]
    for k, edge in enumerate((cut.start, cut.end)):
        if edge is not None and not edge.in_seconds:
            at[k] = int(edge.value)
        elif edge is not None:
            at[k] = int(np.searchsorted(motion.t_s, edge.value)) if motion is not None else height * (1 - k)
    return slice(*at)


HALF_TURN_DEG = 180.0


def typical_rate_dps(t_s: Array, columns: Mapping[str, Array]) -> float | None:
    """The rms rate of a reference of any kind, deg/s, by its columns [n]; None where it hardly turns, or there is none."""
    step_s = float(np.nanmax(t_s) - np.nanmin(t_s)) / max(1, t_s.size - 1)
    skip = max(1, round(MEAN_S / step_s)) if step_s > 0 else 1
    found: Array | None = None
    if all(name in columns for name in ("ref_qw", "ref_qx", "ref_qy", "ref_qz")):
        q: Array = np.column_stack([columns[f"ref_q{part}"] for part in "wxyz"])[::skip]
        cosine = np.abs(np.sum(q[1:] * q[:-1], axis=1)) / np.maximum(np.sum(q[1:] ** 2, axis=1), 1e-12)
        found = 2 * np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) / (skip * step_s)
    elif "ref_angle_deg" in columns:
        found = np.diff(columns["ref_angle_deg"][::skip], prepend=np.nan) / (skip * step_s)
        found = found[np.abs(found) * skip * step_s < HALF_TURN_DEG]  # an encoder begins anew after a turn
    elif rates := [columns[n] for n in ("rate_ref_dps", "ref_x_dps", "ref_y_dps", "ref_z_dps") if n in columns]:
        found = np.sqrt(sum(r**2 for r in rates))
    if found is None or not np.isfinite(found).any():
        return None
    rms_dps = float(np.sqrt(np.nanmean(found**2)))
    return rms_dps if rms_dps > LEAST_TURN_DPS else None


def _by_noise(rates: Array) -> str | None:
    """The unit by the noise of a reading where the sensor lies still, or is still at times.

    Noise has one size throughout. A motion that the samples are too slow to show looks white too, and changes.
    """
    rates = rates[np.isfinite(rates).all(axis=1)]
    parts = [part for part in np.array_split(rates, max(1, len(rates) // 64)) if len(part) >= 32]
    if len(parts) < 3:
        return None
    noise = np.array([np.sqrt(np.mean(np.diff(part, 2, axis=0) ** 2) / 6) for part in parts])
    spread = np.array([np.sqrt(np.mean(part.var(axis=0))) for part in parts])
    white = (noise > 0) & (spread < WHITE * noise)
    if white.any() and float(noise[white].min()) < FINE_DPS:
        return "rad/s"
    still = np.ptp(np.array([part.mean(axis=0) for part in parts]), axis=0).max() < np.median(noise)
    still &= noise.max() < WHITE * noise.min()
    return "dps" if still and np.median(spread) > TREMBLE_RAD_S else None
