"""Whatever bytes, texts and tables come: an answer, or one line that says what is wrong."""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.device import wire
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.recording import column_map, cut, importer
from gyrocal.recording.session import Session

NAMES = st.text(st.characters(min_codepoint=97, max_codepoint=122), min_size=1, max_size=8)
WORDS = st.text(st.characters(min_codepoint=33, max_codepoint=126, exclude_characters=",*$="), max_size=12)
VALUES = st.one_of(WORDS, st.integers(-(2**40), 2**40), st.floats(allow_nan=True), st.none())


@contextlib.contextmanager
def read_or_refused(error: type[GyrocalError], echoed: str = "") -> Iterator[None]:
    """The body ends well, or with this error in one line, what the user wrote himself aside."""
    try:
        yield
    except error as refusal:
        message = str(refusal).replace(echoed, "") if echoed else str(refusal)
        if not message.strip() or "\n" in message:
            raise AssertionError(f"not one line: {refusal!r}") from refusal


@given(st.lists(st.binary(max_size=400), max_size=8))
def test_the_reader_takes_any_bytes(chunks: list[bytes]) -> None:
    reader = wire.Reader()
    sentences = [s for chunk in chunks for s in reader.feed(chunk)]
    assert len(sentences) == reader.good
    with read_or_refused(DeviceError):
        wire.raw_table(sentences)


@given(st.binary(max_size=400) | st.text(max_size=80).map(lambda t: ("$" + t).encode()))
def test_a_sentence_is_read_or_refused_in_one_line(line: bytes) -> None:
    with read_or_refused(DeviceError):
        wire.decode(line)


@given(
    st.from_regex("[A-Z]{3}", fullmatch=True),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**64 - 1),
    st.integers(0, 255),
    st.dictionaries(NAMES, VALUES, max_size=8),
)
def test_what_is_written_is_read(tag: str, seq: int, t_us: int, imu: int, fields: dict) -> None:
    sentence = wire.decode(wire.encode(tag, seq, t_us, imu, fields))
    assert (sentence.tag, sentence.seq, sentence.t_us, sentence.imu) == (tag, seq, t_us, imu)
    assert sentence.fields == {name: wire.format_field(value) for name, value in fields.items()}


@given(st.text(max_size=30) | st.tuples(st.just("gx_dps"), WORDS).map("=".join))
def test_any_map_is_taken_or_refused_in_one_line(text: str) -> None:
    with read_or_refused(InputError, echoed=text):
        mapping = column_map.ColumnMap.parse(text, column_map.Scaling())
        assert mapping.target in column_map.TARGETS
        assert mapping.factor != 0.0


@given(st.text(max_size=30) | st.tuples(NAMES, WORDS, WORDS, WORDS).map(":".join))
def test_any_cut_is_taken_or_refused_in_one_line(text: str) -> None:
    with read_or_refused(InputError, echoed=text):
        found = cut.Cut.parse(text)
        assert "/" not in found.name
        assert not found.name.startswith(".")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["start", "end", "a", "../b"]), inner),
    max_leaves=8,
)


@settings(deadline=None, max_examples=50)
@given(JSON)
def test_any_sections_are_taken_or_refused_in_one_line(content: object) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "sections.json"
        path.write_text(json.dumps(content))
        with read_or_refused(InputError):
            cut.read_sections(path)


CELLS = st.sampled_from(["0", "1", "0.01", "-3.5", "2e3", "nan", "", "x", "1,2", "inf", "é", '"4"', " 7 ", "-"])
ROWS = st.lists(st.lists(CELLS, min_size=3, max_size=5).map(",".join), max_size=6)
FILES = st.one_of(
    st.binary(max_size=200),
    st.tuples(st.sampled_from(["t,x,y,z", "t;x;y;z", "k,1\nt,x,y,z", "", "t,x,y"]), ROWS).map(
        lambda f: "\n".join([f[0], *f[1]]).encode()
    ),
    st.binary(max_size=60).map(lambda b: b"PAR1" + b),
    st.binary(max_size=60).map(lambda b: b"\x1f\x8b" + b),
)


@settings(deadline=None, max_examples=200)
@given(FILES, st.booleans())
def test_any_file_becomes_a_session_or_one_line_and_nothing_else(content: bytes, named: bool) -> None:
    with TemporaryDirectory() as folder:
        source, out = Path(folder) / "source", Path(folder) / "out"
        source.write_bytes(content)
        maps = ["t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z"]
        columns = ["t", "x", "y", "z"] if named else None
        with read_or_refused(InputError):
            importer.import_recording(source, out, maps, columns=columns, defaults={"table_rate_dps": 0.0})
        if out.exists():
            assert len(Session.open(out).runs[0]) >= 2
        assert {p.name for p in Path(folder).iterdir()} <= {"source", "out"}
