"""Whatever happens to the lines on their way: a file holds one face, its samples in order, and the losses are counted."""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gyrocal.device import simulated as device
from gyrocal.device import wire
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder, Report, Wanted
from gyrocal.device.run_stream import RECENT
from gyrocal.errors import DeviceError
from gyrocal.recording.session import Run, Session

from .conftest import LSB_DPS, two_faces
from .damage import Harm, Lines, opener, spoilt
from .fake import FakeDevice


def record(session: Session, out: Path, harm: Harm, **options: object) -> Report:
    with device.SimulatedDevice(session) as simulated, Link(simulated.port, opener=opener(harm)) as link:
        return Recorder(link, out, wanted=None, **options).record()


def harm_run(state: str, face: str, which: int = 0) -> Harm:
    """Damages one byte in this `$RUN` of the run that comes as number `which` of its face."""
    seen = Counter[bytes]()

    def harm(_: int, line: bytes) -> list[bytes]:
        key = f"state={state},face={face}".encode()
        if line.startswith(b"$RUN") and key in line:
            seen[key] += 1
            if seen[key] == which + 1:
                return [spoilt(line)]
        return [line]

    return harm


def both(*harms: Harm) -> Harm:
    def harm(number: int, line: bytes) -> list[bytes]:
        lines = [line]
        for one in harms:
            lines = [out for part in lines for out in one(number, part)]
        return lines

    return harm


def codes(report: Report) -> list[str]:
    return sorted(w.code for w in report.warnings)


def samples(run: Run) -> set[tuple[int, ...]]:
    """Raw counts."""
    return {tuple(row) for row in np.rint(run.gyro_dps / LSB_DPS).astype(int).tolist()}


def check_session(original: Session, out: Path) -> Session:
    """Each file's samples are those of one run of its face."""
    session = check_faces(out)
    for run in session.runs:
        homes = [o for o in original.runs if o.face == run.face and samples(run) <= samples(o)]
        assert homes, f"{run.file} holds samples that no run {run.face} has"
    return session


def check_faces(out: Path) -> Session:
    """The session can be read, and each file holds one face, its samples in order."""
    session = Session.open(out)
    for run in session.runs:
        assert (run.gyro_dps[:, 2] * run.face_sign > 0).all()
        assert (np.diff(run.t_us) > 0).all()
        assert run.table_rate_dps == 78.0
    return session


@pytest.mark.parametrize(("state", "face"), [("end", "up"), ("start", "down"), ("end", "down"), ("start", "up")])
def test_one_damaged_byte_of_a_run_sentence_mixes_no_faces(state: str, face: str, session: Session, tmp_path: Path) -> None:
    report = record(session, tmp_path / "out", harm_run(state, face))
    assert [(r.face, r.samples, r.lost) for r in report.runs] == [(o.face, len(o), 0) for o in session.runs]
    assert [r.scenario for r in report.runs] == ["s000", "s000", "s001", "s001"]
    assert codes(report) == ["line_damaged", "run_unannounced"]
    (unannounced,) = [w for w in report.warnings if w.code == "run_unannounced"]
    assert unannounced.file == report.runs[0 if face == "up" else 1].file
    assert state in unannounced.text
    recorded = check_session(session, tmp_path / "out")
    for a, b in zip(session.runs, recorded.runs, strict=True):
        assert np.array_equal(a.t_us, b.t_us)
        assert np.abs(a.gyro_dps - b.gyro_dps).max() < 1e-7


def test_a_run_of_which_neither_start_nor_end_is_heard_is_told_by_the_device(session: Session, tmp_path: Path) -> None:
    """The recorder asks for the settings and the state, and the device answers while the run goes on."""
    harm = both(harm_run("start", "down"), harm_run("end", "down"), harm_run("end", "up"))
    report = record(session, tmp_path / "out", harm)
    assert [(r.face, r.samples, r.lost) for r in report.runs] == [(o.face, len(o), 0) for o in session.runs]
    check_session(session, tmp_path / "out")
    assert codes(report).count("run_unannounced") == 2


def unannounced(acc_counts: int) -> Callable[[FakeDevice], None]:
    """A run, and a second one of which nothing is said."""

    def run(fake: FakeDevice) -> None:
        for face in (1, -1):
            for n in range(60):
                fields = [n, 1, -2, face * 8914, 0, 0, face * acc_counts, 256]
                fake.say("RAW", fields, t_us=2_000_000 + (n + (0 if face > 0 else 200)) * 10_000)
            fake.seq += 2  # an end and a start, and at last an end
        fake.unplug()

    return run


class Deaf(FakeDevice):
    """Answers the first commands alone, then begins a run by itself."""

    def _obey(self, text: str) -> None:
        if text == "status":
            self.run_sentence("start", "up")
            self._run(self)
        elif "status" not in self.commands:
            super()._obey(text)


@pytest.mark.parametrize(("acc_counts", "faces"), [(16393, ["up", "down"]), (0, ["up"])])
def test_gravity_tells_the_face_or_the_run_is_left_out(acc_counts: int, faces: list[str], tmp_path: Path) -> None:
    with Deaf(unannounced(acc_counts)) as fake, Link(fake.port) as link:
        recorder = Recorder(link, tmp_path / "out", wanted=None)
        with pytest.raises(DeviceError, match="gone during the run"):
            recorder.record()
    assert [r.face for r in recorder.report.runs] == faces
    session = Session.open(tmp_path / "out")
    assert [r.face for r in session.runs] == faces
    assert all((run.gyro_dps[:, 2] * run.face_sign > 0).all() for run in session.runs)
    text = " ".join(w.text for w in recorder.report.warnings)
    assert ("accelerometer" in text) == (len(faces) == 2)
    assert ("left out" in text) == (len(faces) == 1)
    assert "device_gone" in codes(recorder.report)


@pytest.mark.parametrize("where", ["first", "last", "middle"])
def test_a_stall_that_gave_half_the_samples_says_so(where: str, tmp_path: Path) -> None:
    session = two_faces(seconds=4.0, scenarios=1)
    n = len(session.runs[0])
    kept = {"first": range(n // 2, n), "last": range(n // 2), "middle": [*range(n // 4), *range(3 * n // 4, n)]}[where]

    def harm(_: int, line: bytes) -> list[bytes]:
        stalled = line.startswith(b"$RAW") and int(line.split(b",")[4]) not in kept
        return [] if stalled else [line]

    report = record(session, tmp_path / "out", harm)
    assert [(r.samples, r.lost) for r in report.runs] == [(len(kept), n - len(kept))] * 2
    assert codes(report) == ["samples_lost", "samples_lost"]
    assert f"{n - len(kept)} of {n} samples" in report.warnings[0].text
    check_session(session, tmp_path / "out")


def test_a_wanted_run_counts_what_is_lost_at_its_ends(tmp_path: Path) -> None:
    def run(fake: FakeDevice) -> None:
        for n in [*range(20, 180), *range(260, 400)]:
            fake.sample(n)

    with FakeDevice(run) as fake, Link(fake.port) as link:
        report = Recorder(link, tmp_path / "out", wanted=Wanted("up", 2.0, table_rate_dps=78.0)).record()
    assert [(r.samples, r.lost) for r in report.runs] == [(160, 60)]  # 0 to 19, and 180 to 219 of the two seconds from 20 on


def test_a_wanted_run_that_the_device_ended_in_time_is_whole_though_samples_are_lost(tmp_path: Path) -> None:
    def run(fake: FakeDevice) -> None:
        for n in range(150):
            fake.sample(n)
        fake.say("RUN", {"state": "end", "face": "up", "axis": "z", "table_dps": 78.0, "turn_deg": 0.0, "n": 300})

    with FakeDevice(run) as fake, Link(fake.port) as link:
        report = Recorder(link, tmp_path / "out", wanted=Wanted("up", 3.0, table_rate_dps=78.0)).record()
    assert [(r.samples, r.lost) for r in report.runs] == [(150, 150)]
    assert codes(report) == ["samples_lost"]


def test_repeated_samples_are_dropped_and_counted(tmp_path: Path) -> None:
    def run(fake: FakeDevice) -> None:
        for n in [*range(50), *range(30, 50), 49, *range(50, 100)]:
            fake.sample(n)

    with FakeDevice(run) as fake, Link(fake.port) as link:
        report = Recorder(link, tmp_path / "out", wanted=Wanted("up", 0.9, table_rate_dps=78.0)).record()
    assert [(r.samples, r.lost, r.repeated) for r in report.runs] == [(90, 0, 21)]
    assert len(Session.open(tmp_path / "out").runs[0]) == 90


def test_a_run_of_which_most_samples_are_lost_leaves_a_session_that_can_be_read(tmp_path: Path) -> None:
    session = two_faces(seconds=4.0, scenarios=1)

    def harm(_: int, line: bytes) -> list[bytes]:
        fields = line.split(b",")
        down = line.startswith(b"$RAW") and int(fields[7]) < 0
        return [] if down and int(fields[4]) % 3 else [line]

    report = record(session, tmp_path / "out", harm)
    assert [r.face for r in report.runs] == ["up"]
    assert "left out" in " ".join(w.text for w in report.warnings)
    assert [run.face for run in check_session(session, tmp_path / "out").runs] == ["up"]


def test_a_device_that_starts_anew_unheard_begins_a_new_scenario(session: Session, tmp_path: Path) -> None:
    """The `$HEL` of the power cycle is damaged, and so is the end of the run before it."""

    def harm(_: int, line: bytes) -> list[bytes]:
        return [spoilt(line)] if line.startswith(b"$HEL,0,") else [line]

    report = record(session, tmp_path / "out", both(harm, harm_run("end", "down")))
    assert [(r.scenario, r.face) for r in report.runs] == [("s000", "up"), ("s000", "down"), ("s001", "up"), ("s001", "down")]
    check_session(session, tmp_path / "out")


@dataclass
class Said:
    """A session, and what a device says of it."""

    session: Session
    lines: list[bytes]

    def __repr__(self) -> str:
        return "what was said"


@pytest.fixture(scope="module")
def said(require_tool: Callable[[str], str]) -> Said:
    """Two power cycles with runs of 0.7 s."""
    require_tool("cc")
    session = two_faces(seconds=0.7)
    sentences = device.replay(session)
    return Said(session, [wire.encode(s.tag, s.seq, s.t_us, s.imu, s.fields or s.text.split(","))[:-1] for s in sentences])


def heal(lines: list[bytes], harms: list[tuple[str, float, int]]) -> list[bytes]:
    """Lines after the first hello, some of them spoilt, dropped or repeated, alone or many in a row."""
    out = list(lines)
    hello = next(i for i, line in enumerate(out) if b"cmd=hello" in line) + 2
    for kind, at, length in harms:
        start = hello + int(at * (len(out) - hello))
        length = min(length, RECENT) if kind == "repeat" else length
        part = out[start : start + length]
        out[start : start + length] = {"spoil": [spoilt(x) for x in part], "drop": [], "repeat": part + part}[kind]
    return out


@pytest.mark.parametrize("heard", ["first sample", "state", "end"])
def test_what_is_heard_after_a_long_silence_is_not_taken_for_the_run_before_it(heard: str, said: Said, tmp_path: Path) -> None:
    """Of a run face up its start alone is heard, or a few samples; the next word is one of the run face down."""
    starts = [i for i, line in enumerate(said.lines) if line.startswith(b"$RUN")][::2]
    up, down = starts[:2]
    end = next(i for i, line in enumerate(said.lines) if i > down and line.startswith(b"$RUN"))
    state = state_instead_of(said.lines[down + 60])
    lines = {
        "first sample": [said.lines[up], *said.lines[down + 1 : end]],
        "state": [*said.lines[up + 20 : up + 30], state, *said.lines[down + 61 : end]],
        "end": [*said.lines[up + 20 : up + 30], *said.lines[end:]],
    }[heard]
    with Link("lines", opener=lambda name, baud: Lines([*said.lines[: up - 4], *lines])) as link:
        recorder = Recorder(link, tmp_path / "out", wanted=None)
        with contextlib.suppress(DeviceError):
            recorder.record()
    assert "run_unannounced" in codes(recorder.report)
    if (tmp_path / "out" / "session.toml").exists():
        check_faces(tmp_path / "out")


def state_instead_of(sample: bytes) -> bytes:
    """The answer to `status` that the device would have given in place of this sample."""
    _, seq, t_us, imu, number, *_ = sample.decode().split(",")
    fields = {"state": "recording", "face": "down", "n": int(number)}
    return wire.encode("STA", int(seq), int(t_us), int(imu), fields)[:-1]


def begun_and_ended(heard: list[bytes], sound: set[bytes]) -> int:
    """How often a start of a run is followed by an end of its face.

    An end that is repeated after the device was started anew says the same as that of the run which then goes on.
    """
    said = [line.split(b"state=")[1].split(b",axis")[0] for line in heard if line in sound]
    return sum(a.startswith(b"start") and b == a.replace(b"start", b"end") for a, b in pairwise(said))


HARMS = st.lists(
    st.tuples(
        st.sampled_from(["spoil", "drop", "repeat"]),
        st.floats(0, 0.999),
        st.one_of(st.integers(1, 4), st.integers(1, 150)),
    ),
    max_size=8,
)
RUN_HARMS = st.lists(st.tuples(st.sampled_from(["spoil", "drop", "repeat"]), st.integers(0, 7)), max_size=5)


@settings(max_examples=150, deadline=None)
@given(harms=HARMS, run_harms=RUN_HARMS)
@example(harms=[("spoil", 0.0, 54), ("spoil", 0.125, 58)], run_harms=[("spoil", 0)])
@example(harms=[("drop", 0.5, 92), ("repeat", 0.625, 29)], run_harms=[("spoil", 0)])
def test_any_damage_keeps_faces_apart_and_counts(
    said: Said, harms: list[tuple[str, float, int]], run_harms: list[tuple[str, int]]
) -> None:
    lines = said.lines
    boundaries = [i for i, line in enumerate(lines) if line.startswith(b"$RUN")]
    aimed = [(kind, boundaries[which]) for kind, which in run_harms]
    whole = list(lines)
    for kind, i in aimed:
        whole[i] = {"spoil": spoilt(lines[i]), "drop": b"", "repeat": lines[i] + b"\n" + lines[i]}[kind]
    harmed = heal([part for line in whole for part in line.split(b"\n") if part], harms)
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        with Link("lines", opener=lambda name, baud: Lines(harmed)) as link:
            recorder = Recorder(link, out, wanted=None)
            try:
                recorder.record()
            except DeviceError as error:
                assert "gone" in str(error)  # noqa: PT017
        report = recorder.report
        assert all(r.lost >= 0 and r.samples >= 2 for r in report.runs)
        if (out / "session.toml").exists():
            session = check_faces(out)
            assert [run.file for run in session.runs] == [r.file for r in report.runs]
            assert [len(run) for run in session.runs] == [r.samples for r in report.runs]
        else:
            assert not report.runs
        whole_runs = begun_and_ended(harmed, {lines[i] for i in boundaries})
        unannounced = {w.file for w in report.warnings if w.code == "run_unannounced"}
        known = [r for r in report.runs if r.file not in unannounced]
        for r in known:
            assert r.samples + r.lost == 102 - 4
        assert len(known) <= whole_runs
        json.dumps(report.to_json())


def test_the_planted_session_is_as_the_property_test_takes_it(said: Said) -> None:
    assert {len(run) for run in said.session.runs} == {98}
    assert sum(line.startswith(b"$RUN") for line in said.lines) == 8


def test_samples_lost_behind_an_unheard_restart_are_counted(session: Session, tmp_path: Path) -> None:
    """Sentence numbers begin with 0 at power-on, so the first one heard tells how many were not."""
    boots, dropped = 0, 0

    def harm(_: int, line: bytes) -> list[bytes]:
        nonlocal boots, dropped
        boots += line.startswith(b"$HEL,0,")
        dropped += boots == 2 and line.startswith(b"$RAW")
        return [] if boots == 2 and dropped <= 20 else [line]

    report = record(session, tmp_path / "out", harm)
    assert [r.scenario for r in report.runs] == ["s000", "s000", "s001", "s001"]
    assert [r.samples + r.lost for r in report.runs] == [len(run) for run in session.runs]
    assert [r.lost for r in report.runs] == [0, 0, 20, 0]
