"""What ``monitor --json`` prints: one event a line, of one type for each sentence of the wire protocol.

The keys are the fields of the protocol's table (``PROTOCOL.md``). Which of them a board sends is for its firmware to say, so
that of a sentence only ``event``, ``t_us`` and ``imu`` are always there. A field that the board left empty is null.
"""

from __future__ import annotations

from typing import Literal, Required

from typing_extensions import TypedDict

from gyrocal.json_small import Number

Word = str | float | None
"""A name that the board or its user chose; one that reads as a number is a number here."""


class Sent(TypedDict):
    """When, by the device's clock, and by which sensor of the board."""

    t_us: int
    imu: int


class Hello(Sent, total=False):
    """``$HEL``: the firmware, the part and the settings."""

    event: Required[Literal["hello"]]
    proto: int
    fw: str
    sensor: Word
    rate_hz: Number
    odr_hz: Number
    full_scale_dps: Number
    lsb_dps: Number
    lsb_g: Number
    lsb_c: Number
    zero_c: Number
    noise_dps: Number
    accel_g: Number
    low_pass: int
    axis: str
    table_dps: Number
    turn_deg: Number
    cal: Word
    net: Word


class Sample(Sent):
    """``$RAW`` in units; null where the sensor has no such channel, or its units are not known yet."""

    event: Literal["sample"]
    n: int
    gx_dps: Number
    gy_dps: Number
    gz_dps: Number
    ax_g: Number
    ay_g: Number
    az_g: Number
    temp_c: Number


class RunEvent(Sent, total=False):
    """``$RUN``: a run starts or ends."""

    event: Required[Literal["run"]]
    state: Literal["start", "end"]
    face: Literal["up", "down"]
    axis: str
    table_dps: Number
    turn_deg: Number
    n: int
    first: int
    last: int | None
    mean_x_dps: Number
    mean_y_dps: Number
    mean_z_dps: Number
    duration_s: Number
    temp_c: Number
    clipped: int
    missed: int


class DeviceAnswer(TypedDict, total=False):
    """The fields of ``$CAL``: scale and bias by one method, after so many seconds of each run."""

    method: str
    seconds: Number
    axis: str
    scale: Number
    scale_se: Number
    bias_dps: Number
    bias_se_dps: Number
    temp_c: Number
    misfit: Number
    first: int
    last: int
    flags: str | None
    trusted: int


class Result(Sent, DeviceAnswer):
    """``$CAL``."""

    event: Literal["result"]


class State(Sent, total=False):
    """``$STA``: what the device does and waits for, and what it counted since power-on."""

    event: Required[Literal["state"]]
    state: Literal["idle", "recording", "flip", "done"]
    face: str | None
    n: int
    lost: int
    stale: int
    resets: int
    missed: int
    overruns: int
    misfit: Number
    waits: str | None
    rate_dps: Number
    gravity: str | None
    run_first: int
    run_n: int
    slowest_us: int
    heap_bytes: int
    stack_bytes: int


class SelfTest(Sent, total=False):
    """``$TST``: the sensor's own test."""

    event: Required[Literal["selftest"]]
    passed: int
    x_dps: Number
    y_dps: Number
    z_dps: Number
    least_dps: Number
    most_dps: Number
    least_x_dps: Number
    least_y_dps: Number
    least_z_dps: Number
    most_x_dps: Number
    most_y_dps: Number
    most_z_dps: Number
    rest_x_dps: Number
    rest_y_dps: Number
    rest_z_dps: Number
    rest_most_dps: Number


class Taken(Sent, total=False):
    """``$ACK``: a command was taken; a setting is told with its value."""

    event: Required[Literal["ack"]]
    cmd: str
    stream: str
    auto: str
    face: str
    axis: str
    rate_hz: Word
    table_dps: Word
    full_scale_dps: Word
    turn_deg: Word
    fifo: Word
    sensor: Word
    lines: int


class Failure(Sent, total=False):
    """``$ERR``: something failed, and what to do."""

    event: Required[Literal["error"]]
    code: int
    name: str
    advice: str


class End(TypedDict):
    """The last line: why it ended, and how many sentences were good, lost and bad."""

    event: Literal["end"]
    reason: str
    good: int
    lost: int
    bad: int
    skipped: int
    restarts: int


Event = Hello | Sample | RunEvent | Result | State | SelfTest | Taken | Failure | End
"""``monitor``: one event, a line."""
