"""The wire's codec against the vectors that C is held to, binascii, a bitwise CRC and printf's numbers."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from gyrocal.device import wire
from gyrocal.errors import DeviceError

VECTORS = json.loads((Path(__file__).parents[1] / "vectors" / "wire.json").read_text())


def raw(seq: int, n: int, counts: list[int | None], t_us: int = 0, imu: int = 0) -> bytes:
    return wire.encode("RAW", seq, t_us, imu, [n, *counts])


COUNTS = [12, -7, 8931, 4, -31, 16393, -102]


def crc_by_bits(data: bytes) -> int:
    """CRC-16/CCITT-FALSE straight from its definition."""
    register = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            feedback = (register >> 15) ^ (byte >> bit & 1)
            register = (register << 1 & 0xFFFF) ^ (0x1021 if feedback else 0)
    return register


def test_crc_is_the_published_one() -> None:
    assert wire.crc16(b"123456789") == 0x29B1  # the catalogue's check value
    rng = np.random.default_rng(1)
    for length in range(40):
        data = rng.bytes(length)
        assert wire.crc16(data) == crc_by_bits(data)


@pytest.mark.parametrize("vector", VECTORS["good"], ids=lambda v: v["tag"])
def test_shared_vectors_are_read(vector: dict) -> None:
    sentence = wire.decode(vector["sentence"].encode())
    assert (sentence.tag, sentence.seq, sentence.t_us, sentence.imu) == tuple(
        vector[k] for k in ("tag", "seq", "t_us", "imu")
    )
    parts = [p.partition("=") for p in sentence.text.split(",")] if vector["fields"] else []
    assert [[name, value] if equals else ["", name] for name, equals, value in parts] == vector["fields"]
    assert wire.decode(vector["sentence"].encode() + b"\r\n") == sentence


@pytest.mark.parametrize("vector", VECTORS["malformed"], ids=lambda v: v["line"][:24])
def test_shared_vectors_are_refused_in_one_line(vector: dict) -> None:
    with pytest.raises(DeviceError) as error:
        wire.decode(vector["line"].encode())
    assert str(error.value).strip()
    assert "\n" not in str(error.value)
    _, dollar, rest = vector["line"].rpartition("$")
    read = [wire.decode((dollar + rest).encode())] if vector["line"].startswith(" $") else []  # what follows noise is whole
    assert wire.Reader().feed(vector["line"].encode() + b"\n") == read


def test_the_first_sentence_after_a_reset_is_read_behind_the_boots_noise() -> None:
    """The log of an ESP32's ROM comes at another speed, without a newline."""
    noise = bytes(range(0x80, 0x100)) * 3
    hello, state = wire.encode("HEL", 0, 0, 0, {"proto": 1}), wire.encode("STA", 1, 0, 0, {"n": 0})
    for size in (1, 7, 320, 4096):
        for before in (noise, noise[:100], b" ", noise + b"$" + noise, b"$" + noise[:100]):
            stream = before + hello + state
            reader = wire.Reader()
            read = [s for k in range(0, len(stream), size) for s in reader.feed(stream[k : k + size])]
            assert [s.tag for s in read] == ["HEL", "STA"]
            assert (reader.good, reader.lost, reader.overlong) == (2, 0, 0)
            assert (reader.skipped, reader.bad) == ((0, 1) if before.startswith(b"$") else (len(before), 0))


def test_a_sentence_is_read_behind_one_that_lost_its_end() -> None:
    reader = wire.Reader()
    stream = raw(0, 0, COUNTS)[:-9] + raw(1, 1, COUNTS) + b"# a log" + raw(2, 2, COUNTS) + b">gx:1" + raw(3, 3, COUNTS)
    assert [s.seq for s in reader.feed(stream)] == [1, 2, 3]
    assert (reader.bad, reader.skipped, list(reader.logs)) == (1, 0, ["a log"])


def test_numbers_are_written_as_c_writes_them() -> None:
    for vector in VECTORS["numbers"]:
        assert wire.format_field(float.fromhex(vector["hex"])) == vector["text"]
    for text in VECTORS["malformed_numbers"]:
        assert wire.parse_real(text) is None
    assert wire.format_field(float("nan")) == ""
    assert wire.format_field(None) == ""


def test_a_float32_survives_the_wire() -> None:
    bits = np.random.default_rng(2).integers(0, 2**32, 20000, dtype=np.uint32)
    for value in bits.view(np.float32):
        if np.isfinite(value):
            number = wire.parse_real(wire.format_field(float(value)))
            assert number is not None
            assert struct.pack("f", np.float32(number)) == struct.pack("f", value)


def test_every_single_bit_error_is_seen() -> None:
    line = raw(7, 3, COUNTS)[:-1]
    for i in range(8 * len(line)):
        flipped = bytearray(line)
        flipped[i // 8] ^= 1 << (i % 8)
        with pytest.raises(DeviceError):
            wire.decode(bytes(flipped))


def test_gaps_are_counted_and_a_restart_is_none() -> None:
    reader = wire.Reader()
    assert [s.seq for s in reader.feed(b"".join(raw(seq, seq, COUNTS) for seq in (5, 6, 9, 10)))] == [5, 6, 9, 10]
    assert (reader.good, reader.lost, reader.restarts) == (4, 2, 0)
    reader.feed(raw(0, 0, COUNTS) + raw(1, 1, COUNTS))
    assert (reader.lost, reader.restarts) == (2, 1)


def test_sequence_numbers_wrap_and_are_each_sensors_own() -> None:
    reader = wire.Reader()
    top = 2**32
    reader.feed(b"".join(raw(seq % top, 0, COUNTS) for seq in (top - 2, top - 1, top, top + 1)))
    reader.feed(raw(100, 0, COUNTS, imu=1) + raw(102, 0, COUNTS, imu=1) + raw(2, 0, COUNTS))
    assert (reader.lost, reader.restarts) == (1, 0)


def test_damaged_overlong_and_other_lines_are_told_apart() -> None:
    reader = wire.Reader()
    good = raw(1, 1, COUNTS)
    stream = [
        b"ets Jun  8 2016 00:22:57\r\n# a log\r\n>gx:1\n",
        raw(0, 0, COUNTS),
        good.replace(b"8931", b"8932"),
        b"$" + b"x" * 5000 + b"\n",
        raw(2, 2, COUNTS),
    ]
    assert [s.seq for s in reader.feed(b"".join(stream))] == [0, 2]
    assert (reader.good, reader.bad, reader.overlong, reader.lost) == (2, 1, 1, 1)
    assert reader.skipped == len(b"ets Jun  8 2016 00:22:57\r")
    assert list(reader.logs) == ["a log"]


@pytest.mark.parametrize("size", [1, 2, 7, 64, 319, 320, 321, 4096])
def test_how_the_stream_is_cut_does_not_matter(size: int) -> None:
    stream = b"".join(raw(seq, seq, COUNTS) for seq in range(50)) + b"$" + b"y" * 900 + b"\n" + raw(51, 51, COUNTS)
    stream += b"y" * 900 + b"\n" + b"#" + b"y" * 250 + raw(52, 52, COUNTS) + b"y" * 900 + raw(53, 53, COUNTS)
    whole, cut = wire.Reader(), wire.Reader()
    expected = whole.feed(stream)
    pieces = [s for k in range(0, len(stream), size) for s in cut.feed(stream[k : k + size])]
    assert pieces == expected
    assert (
        (cut.good, cut.lost, cut.bad, cut.overlong, cut.skipped)
        == (whole.good, whole.lost, whole.bad, whole.overlong, whole.skipped)
        == (53, 1, 0, 1, 1800)
    )


def test_samples_become_arrays() -> None:
    rng = np.random.default_rng(3)
    counts = rng.integers(-32768, 32768, (200, 7))
    stream = b"".join(raw(i, i - 1, row.tolist(), t_us=6897 * i, imu=i % 2) for i, row in enumerate(counts))
    table = wire.raw_table([*wire.Reader().feed(stream), wire.decode(wire.encode("STA", 0, 0, 0, {"n": 1}))])
    assert np.array_equal(table.counts, counts)
    assert np.array_equal(table.t_us, 6897 * np.arange(200))
    assert np.array_equal(table.number, np.arange(200) - 1)
    assert np.array_equal(table.imu, np.arange(200) % 2)


def test_what_a_sensor_lacks_is_nan() -> None:
    sentences = wire.Reader().feed(raw(0, 0, [1, 2, 3, None, None, None, None]) + raw(1, 1, COUNTS))
    counts = wire.raw_table(sentences).counts
    assert np.array_equal(np.isnan(counts), [[False] * 3 + [True] * 4, [False] * 7])
    assert wire.raw_table([]).counts.shape == (0, 7)


@pytest.mark.parametrize("fields", [[1, 2, 3], ["x", 1, 2, 3, 4, 5, 6, 7], ["", 1, 2, 3, 4, 5, 6, 7], [1] * 9, []])
def test_a_malformed_sample_is_named(fields: list) -> None:
    sentences = wire.Reader().feed(raw(0, 0, COUNTS) + wire.encode("RAW", 77, 0, 0, fields))
    with pytest.raises(DeviceError, match="sentence 77"):
        wire.raw_table(sentences)


def test_what_breaks_the_form_cannot_be_written() -> None:
    for fields in ({"a": "x*y"}, {"a": "x\n"}, {"a": "é"}, dict.fromkeys(map(str, range(25)), 1), {"a": "x" * 400}):
        with pytest.raises(DeviceError):
            wire.encode("STA", 0, 0, 0, fields)


def test_named_fields() -> None:
    sentence = wire.decode(
        wire.encode("CAL", 1, 2, 0, {"method": "baseline", "scale": 0.004, "scale_se": None, "n": 3})
    )
    assert sentence.fields == {"method": "baseline", "scale": "0.004", "scale_se": "", "n": "3"}
    assert [sentence.real(k) for k in ("scale", "scale_se", "method", "none")] == [0.004, None, None, None]
    assert [wire.parse_value(sentence.fields[k]) for k in sentence.fields] == ["baseline", 0.004, None, 3]
