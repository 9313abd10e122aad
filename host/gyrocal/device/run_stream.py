"""Divide the sentences of one sensor into runs, even if some of them are damaged, missing or repeated.

A sentence belongs to the run in progress only if nothing contradicts it. The number and the time of a sample continue those of
the last sample, gravity has not changed sides, and the sentences missing since the last one of this run are too few to contain
the start of another run. Otherwise a new run begins. Its face is unknown until a sentence gives it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, auto

from gyrocal.device.wire import SEQ_RANGE, Sentence, parse_real, raw_table
from gyrocal.errors import DeviceError
from gyrocal.recording.session import AXES

RECENT, RECENT_SAMPLES = 64, 4096
"""A sentence that equals one of so many before it is a repetition. A restarted device may repeat older ones."""
SETTINGS = ("axis", "table_dps", "turn_deg")
REMINDED_US = 4_000_000
"""The device says how many samples a run had until so long after its end."""
GRAVITY_MIN_G = 0.5
"""The least acceleration along the axis that shows the face, as in the core."""


@dataclass(frozen=True)
class Setting:
    """The device's settings of a run: ``table_rate_dps``, signed, about the table; ``turn_deg``, the net angle of the run."""

    face: str
    axis: str
    table_rate_dps: float | None
    turn_deg: float | None

    @staticmethod
    def of(fields: dict[str, str], face: str) -> Setting:
        """Read the fields of a sentence. Raises DeviceError if they are of another version of the protocol."""
        axis = fields.get("axis", "")
        if face not in ("up", "down") or axis not in AXES:
            raise DeviceError(f"the device announces a run with face {face!r} and axis {axis!r}; flash it again")
        turn_deg, rate_dps = _short(fields.get("turn_deg", "")), _short(fields.get("table_dps", ""))
        return Setting(face, axis, rate_dps, turn_deg or None)

    @property
    def has_rate(self) -> bool:
        """True if the true rate or the net angle of a run is known."""
        return self.table_rate_dps is not None or self.turn_deg is not None


def _short(text: str) -> float | None:
    """A setting rounded to the digits of a float32, because some devices store it as one."""
    value = parse_real(text)
    return None if value is None else float(f"{value:.7g}")


class Ending(Enum):
    """How a run ended: by a sentence, by a restart of the device, or unnoticed."""

    SAID = auto()
    RESTART = auto()
    UNHEARD = auto()


@dataclass
class HeardRun:
    """The state of one run, as far as its sentences came.

    ``setting`` is None until a sentence gives the face. ``start`` is its ``$RUN state=start``, or None if that did not come.
    ``from_number`` is the number of the first sample that was sent to this host. ``sent`` counts the samples that the device
    reported; they are all of the run's if ``is_length_known``. ``repeated`` counts samples that came again. ``ending`` is None
    while the run goes on. ``is_over`` is True once a sample outside a run has shown that it no longer does, although its end
    did not come. ``settings`` holds axis, table_dps and turn_deg as the device last said them, or None if they have changed.
    """

    setting: Setting | None = None
    start: Sentence | None = None
    from_number: int = 0
    sent: int = 0
    is_length_known: bool = False
    repeated: int = 0
    face: str = ""
    settings: dict[str, str] | None = None
    ending: Ending | None = None
    is_over: bool = False
    last: Sentence | None = None
    last_number: int = -1

    def may_be_told_by(self, fields: dict[str, str], unheard: int) -> bool:
        """True if a ``$RUN state=end`` or a ``$STA`` can belong to this run, ``unheard`` sentences after the last one of it."""
        count = _count(fields)
        start = self.start.fields if self.start is not None else {}
        first, firsts = start.get("first", ""), fields.get("first", "")
        is_its_own = first == firsts if first and firsts else count is None or not _may_hide_a_start(unheard, count)
        return is_its_own and self.face in ("", fields.get("face")) and (count is None or self.last_number < count)


@dataclass(frozen=True)
class Begun:
    """Event: a run begins, or a run in progress is met."""

    run: HeardRun


@dataclass(frozen=True)
class Told:
    """Event: the setting of a run has become known."""

    run: HeardRun


@dataclass(frozen=True)
class Rows:
    """Event: ``$RAW`` sentences of a run have come, in the order of their numbers and times."""

    run: HeardRun
    sentences: list[Sentence]


@dataclass(frozen=True)
class Ended:
    """Event: a run has ended."""

    run: HeardRun


@dataclass(frozen=True)
class Restarted:
    """Event: the device has restarted."""


Part = Begun | Told | Rows | Ended | Restarted


class Memory:
    """A memory of the latest sentences."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._order: deque[object] = deque()
        self._seen: set[object] = set()

    def holds(self, key: object) -> bool:
        """Return True if the sentence is in the memory, and add it."""
        if key in self._seen:
            return True
        self._seen.add(key)
        self._order.append(key)
        if len(self._order) > self._size:
            self._seen.discard(self._order.popleft())
        return False


class RunStream:
    """Turns the sentences of one sensor, in order, into events of its runs."""

    def __init__(self) -> None:
        self.run: HeardRun | None = None
        self._parts: list[Part] = []
        self._settings: dict[str, str] = {}
        self._settled = False
        self._lsb_g: float | None = None
        self._last: Sentence | None = None
        self._missing = 0
        """Sentences missing since the last sample or boundary."""
        self._unheard = 0
        """Sentences missing since the last one of the run in progress."""
        self._latest, self._samples = Memory(RECENT), Memory(RECENT_SAMPLES)

    def feed(self, sentences: Iterable[Sentence]) -> list[Part]:
        """The events of these sentences, in order.

        Raises:
            DeviceError: a sentence lacks a field or holds a wrong value.
        """
        self._parts = []
        for sentence in sentences:
            if self._is_repeated(sentence):
                continue
            self._note_order(sentence)
            if sentence.tag == "RAW":
                self._sample(sentence)
            elif sentence.tag == "RUN":
                self._boundary(sentence)
            elif sentence.tag == "STA":
                self._state(sentence)
            elif sentence.tag in ("HEL", "ACK"):
                self._learn(sentence)
            self._last = sentence
        return self._parts

    def _is_repeated(self, sentence: Sentence) -> bool:
        repeated = self._latest.holds(sentence)
        if sentence.tag == "RAW":
            repeated = self._samples.holds((sentence.t_us, sentence.text))
            if repeated and self.run is not None:
                self.run.repeated += 1
        return repeated

    def _note_order(self, sentence: Sentence) -> None:
        """Count the sentences missing before this one. A number that decreases shows a restart of the device."""
        if self._last is None:
            return
        step = (sentence.seq - self._last.seq) % SEQ_RANGE
        if step >= SEQ_RANGE // 2 or (sentence.tag == "HEL" and sentence.seq == 0):
            self._end(Ending.RESTART)
            self._parts.append(Restarted())
            self._latest, self._samples = Memory(RECENT), Memory(RECENT_SAMPLES)
            self._settled = False
            self._missing = self._unheard = sentence.seq  # numbers begin with 0 at power-on
        else:
            self._missing += max(step - 1, 0)
            self._unheard += max(step - 1, 0)

    def _sample(self, sentence: Sentence) -> None:
        number = _number(sentence)
        run = self.run
        if number < 0:
            self._note_idle(sentence)
            self._missing = 0
            return
        if run is not None:
            if not self._is_next(run, sentence, number):
                self._leave(run, number)
            elif run.last is not None and (number == run.last_number or sentence.t_us == run.last.t_us):
                run.repeated += 1
                return
        if self.run is None:
            self._begin(HeardRun())
        run = self.run
        assert run is not None
        if run.last is None and run.start is None:
            run.from_number = number - min(number, self._missing)
            if self._missing > number + 2:  # more than an end and a start: settings too, perhaps
                self._settled = False
                run.settings = None
        run.last, run.last_number = sentence, number
        self._missing = self._unheard = 0
        latest = self._parts[-1] if self._parts else None
        if isinstance(latest, Rows) and latest.run is run:
            latest.sentences.append(sentence)
        else:
            self._parts.append(Rows(run, [sentence]))

    def _note_idle(self, sentence: Sentence) -> None:
        """A sample outside a run: the run in progress is over, and only the state can still tell its length."""
        run = self.run
        if run is None:
            return
        run.is_over = True
        if run.last is None or sentence.t_us - run.last.t_us > REMINDED_US:
            self._end(Ending.UNHEARD)

    def _is_next(self, run: HeardRun, sentence: Sentence, number: int) -> bool:
        """True if a sample continues what was heard of the run."""
        if run.is_over or _may_hide_a_start(self._unheard, number):
            return False
        last = run.last
        if last is None:
            return True
        if number < run.last_number or sentence.t_us < last.t_us:
            return False
        return self._missing == 0 or not self._is_turned_over(last, sentence)

    def _leave(self, run: HeardRun, number: int) -> None:
        """End a run that a sample does not continue.

        If the missing sentences cannot hold the start of another run, the samples between the last one and this one are
        missing, and no others: the other missing sentences are errors and answers.
        """
        if not run.is_over and not _may_hide_a_start(self._unheard, number) and number > run.last_number:
            self._missing = min(self._missing, number - run.last_number - 1)
        self._end(Ending.UNHEARD)

    def _is_turned_over(self, last: Sentence, sentence: Sentence) -> bool:
        axis = self._settings.get("axis", "")
        if axis not in AXES or self._lsb_g is None:
            return False
        before, after = (_acceleration(s, AXES.index(axis)) * self._lsb_g for s in (last, sentence))
        return min(abs(before), abs(after)) > GRAVITY_MIN_G and before * after < 0

    def _boundary(self, sentence: Sentence) -> None:
        fields = sentence.fields
        self._learn(sentence)
        face = fields.get("face", "")
        if fields.get("state") == "start":
            self._end(Ending.UNHEARD)
            self._begin(HeardRun(Setting.of(fields, face), sentence, face=face))
            self._missing = self._unheard = 0
        elif fields.get("state") == "end":
            if self.run is not None and (self.run.is_over or not self.run.may_be_told_by(fields, self._unheard)):
                self._end(Ending.UNHEARD)
            sent = _count(fields) or 0
            if self.run is None:  # none of its samples came
                self._begin(HeardRun(from_number=sent - min(sent, self._missing)))
            run = self.run
            assert run is not None
            run.sent, run.face, run.is_length_known = max(run.sent, sent), face, True
            run.setting = run.setting or Setting.of(fields, face)
            self._end(Ending.SAID)
            self._missing = 0

    def _state(self, sentence: Sentence) -> None:
        fields = sentence.fields
        if fields.get("state") != "recording":
            self._end_by_state(fields)
            return
        face = fields.get("face", "")
        if self.run is not None and (self.run.is_over or not self.run.may_be_told_by(fields, self._unheard)):
            self._end(Ending.UNHEARD)
        if self.run is None:
            self._begin(HeardRun(face=face))
        run = self.run
        assert run is not None
        run.face, run.sent = face, max(run.sent, _count(fields) or 0)
        self._unheard = 0
        self._tell()

    def _end_by_state(self, fields: dict[str, str]) -> None:
        """The device records nothing. The state gives the length of its last run, for a reader who missed the end."""
        run = self.run
        told = {"first": fields.get("run_first", ""), "n": fields.get("run_n", "")}
        if run is not None and told["first"] and run.may_be_told_by({**told, "face": run.face}, self._unheard):
            run.sent, run.is_length_known = max(run.sent, _count(told) or 0), _count(told) is not None
        self._end(Ending.UNHEARD)

    def _learn(self, sentence: Sentence) -> None:
        """Update the device's settings from a sentence. After a `set` without its value they are unknown."""
        fields = sentence.fields
        told = {name: fields[name] for name in SETTINGS if name in fields}
        self._settings.update(told)
        if len(told) == len(SETTINGS):
            self._settled = True
        elif fields.get("cmd") == "set" and len(fields) == 1:
            self._settled = False
        self._lsb_g = self._lsb_g if "lsb_g" not in fields else sentence.real("lsb_g")
        if sentence.tag != "RUN" and self.run is not None:
            self.run.settings = dict(self._settings) if self._settled else None
            self._tell()

    def _tell(self) -> None:
        run = self.run
        if run is not None and run.setting is None and run.settings is not None and run.face:
            run.setting = Setting.of(run.settings, run.face)
            self._parts.append(Told(run))

    def _begin(self, run: HeardRun) -> None:
        run.settings = dict(self._settings) if self._settled else None
        self.run = run
        self._parts.append(Begun(run))

    def _end(self, ending: Ending) -> None:
        if self.run is not None:
            self.run.ending = ending
            self._parts.append(Ended(self.run))
            self.run = None


def _may_hide_a_start(unheard: int, number: int) -> bool:
    """True if so many sentences can contain the end of a run, the start of another and ``number`` samples of that one."""
    return unheard >= number + 2


def _number(sentence: Sentence) -> int:
    """The sample's number in its run, or -1 outside a run."""
    try:
        return int(sentence.text.partition(",")[0])
    except ValueError:
        raw_table([sentence])
        raise


def _acceleration(sentence: Sentence, axis: int) -> float:
    """The acceleration in counts; 0 if the device has no accelerometer."""
    cells = sentence.text.split(",")
    return (parse_real(cells[4 + axis]) or 0.0) if len(cells) > 4 + axis else 0.0


def _count(fields: dict[str, str]) -> int | None:
    """The field ``n``: the number of samples of the run."""
    text = fields.get("n", "")
    return int(text) if text.isdecimal() else None
