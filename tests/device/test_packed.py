"""Frames of samples: each is read back as the sentences that it stands for, alone, between lines, cut anywhere, and damaged."""

import contextlib
import struct

import numpy as np
import pytest

from frames import frame, stream, stuffed
from gyrocal.device.packed import end_of_whole, unpack, unstuffed
from gyrocal.device.port import Link, PortGone
from gyrocal.device.simulated import SimulatedDevice, simulated_scenario
from gyrocal.device.wire import Reader, Sentence, crc16, encode


def test_frames_between_lines_in_chunks_of_any_length() -> None:
    data, sentences = stream()
    for size in (1, 2, 7, 64, 290, len(data)):
        reader = Reader()
        got = [s for k in range(0, len(data), size) for s in reader.feed(data[k : k + size])]
        assert got == sentences
        assert (reader.good, reader.bad, reader.lost, reader.skipped, reader.overlong) == (len(sentences), 0, 0, 0, 0)
    assert list(reader.logs) == ["begins"]


def test_a_lost_frame_is_its_samples() -> None:
    (first, a), (_, b), (third, c) = frame(0, 0, 8), frame(8, 10_000, 32, 8), frame(40, 20_000, 4, 40)
    reader = Reader()
    assert reader.feed(first + third) == a + c
    assert (reader.lost, reader.bad) == (len(b), 0)


@pytest.mark.parametrize("seed", range(40))
def test_damage_costs_what_it_touches_and_invents_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    data, sentences = stream()
    spoilt = bytearray(data)
    touched = rng.choice(len(data), 3, replace=False)
    for at in touched:
        if seed % 2:
            spoilt[at] ^= int(rng.integers(1, 256))
        else:
            spoilt[at] = int(rng.choice([0, 10, 36]))
    if seed % 3 == 0:
        del spoilt[int(touched[0])]
    last, _ = frame(1000, 10**9, 1)
    reader = Reader()
    size = int(rng.integers(1, 100))
    whole = bytes(spoilt) + last + encode("ACK", 1001, 10**9, 0, {"cmd": "hello"})
    got = [s for k in range(0, len(whole), size) for s in reader.feed(whole[k : k + size])]
    assert set(got[:-2]) <= set(sentences)
    assert got[-1].tag == "ACK"
    assert len(got) == reader.good
    assert reader.good + reader.lost == 1002 - got[0].seq
    assert len(sentences) - len(got[:-2]) <= 3 * 2 * 33  # each touches two neighbours at most


def test_noise_with_zeros_does_not_hold_a_sentence_back() -> None:
    """A board's boot at another speed, after which nothing but a hello may come."""
    reader = Reader()
    noise = b"\x80\xf8\x00\xff\x1c\xe0\x80$\xfe"
    hello = encode("HEL", 0, 5, 0, {"proto": 1})
    assert [s.tag for s in reader.feed(noise + b"\n# gyrocal, reset reason 1\n" + hello)] == ["HEL"]
    assert (reader.bad, list(reader.logs)) == (0, ["gyrocal, reset reason 1"])
    assert reader.skipped > 0


def test_what_is_no_frame() -> None:
    good, _ = frame(3, 4, 5)
    assert len(unpack(good[1:-1])) == 5
    for wrong in (b"", b"\x01", b"\x05ab", good[1:-2], b"\0" + good[1:-1], bytes(300), stuffed(b"\x02" + bytes(40))):
        assert unpack(wrong) == []
    assert unstuffed(b"\x03ab\x01") == b"ab\0"


def test_any_body_with_its_checksum_is_read_or_refused() -> None:
    rng = np.random.default_rng(0)
    read = 0
    for _ in range(3000):
        body = bytearray(rng.integers(0, 256, int(rng.integers(0, 286)), np.uint8).tobytes())
        if body:
            body[0] = 1
        if len(body) > 3 and rng.random() < 0.5:
            body[2] = max(len(body) - 27, 0) // 8
        read += len(unpack(stuffed(bytes(body) + struct.pack("<H", crc16(bytes(body)))))) > 0
    assert read > 50


def test_the_whole_of_what_a_device_has_sent() -> None:
    data, _ = stream()
    part, _ = frame(500, 5, 32)
    assert end_of_whole(data) == len(data)
    for cut in (1, 5, len(part) - 1):
        assert end_of_whole(data + b"$ACK,1") == len(data)
        assert end_of_whole(data + part[:cut]) == len(data)
        assert end_of_whole(data + b"# text\n" + part[:cut]) == len(data) + 7


def test_two_sensors_side_by_side() -> None:
    sessions = [simulated_scenario([], seed) for seed in range(2)]
    reader = Reader()
    with SimulatedDevice(sessions, stream="packed") as device, Link(device.port) as link:
        link.reader = reader
        link.greet()
        samples = []
        with contextlib.suppress(PortGone):
            while True:
                samples += [s.imu for s in link.receive() if s.tag == "RAW"]
    assert samples.count(0) >= sum(len(run.t_us) for run in sessions[0].runs)
    assert samples.count(1) >= sum(len(run.t_us) for run in sessions[1].runs)
    assert (reader.bad, reader.lost, reader.overlong) == (0, 0, 0)


def test_a_rate_beyond_text_is_asked_for_as_frames() -> None:
    with SimulatedDevice(simulated_scenario([], 0), stream="packed") as device, Link(device.port) as link:
        hello = link.greet()
        assert link.stream == "stream raw"
        link.hello = Sentence(*hello[:-1], hello.text.replace("rate_hz=145", "rate_hz=1666"))
        assert link.stream == "stream packed"
        while not any(s.tag == "RAW" for s in link.receive()):  # a device that ends without one raises PortGone
            pass
        assert (link.reader.bad, link.reader.lost) == (0, 0)
