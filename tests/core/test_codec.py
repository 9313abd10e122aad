"""Numbers, CRCs and sentences: C against the shared vectors, printf's and Python's own conversions."""

import binascii
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from .conftest import HERE, Build, run

VECTORS = json.loads((HERE.parent / "vectors" / "wire.json").read_text())


@pytest.fixture(scope="module")
def codec(build: Build) -> Path:
    return build(HERE / "codec.c")


def bits(value: float) -> str:
    return struct.pack(">d", value).hex()


def ask(codec: Path, jobs: list[str]) -> list[str]:
    answers = run(codec, "".join(job + "\n" for job in jobs)).split("\n")
    assert len(answers) == len(jobs) + 1
    return answers[:-1]


def test_crc(codec: Path) -> None:
    rng = np.random.default_rng(1)
    texts = ["", "123456789", *("".join(map(chr, rng.integers(32, 256, n))) for n in rng.integers(1, 300, 300))]
    expected = [f"{binascii.crc_hqx(text.encode('latin1'), 0xFFFF):04X}" for text in texts]
    assert expected[1] == "29B1"  # the catalogue's check value of CRC-16/CCITT-FALSE
    assert ask(codec, [f"crc {text}" for text in texts]) == expected
    assert ask(codec, [f"crc {v['text']}" for v in VECTORS["crc"]]) == [v["crc"] for v in VECTORS["crc"]]


def test_good_sentences(codec: Path) -> None:
    lines = [v["sentence"] for v in VECTORS["good"]]
    answers = ask(codec, [f"parse {line}" for line in lines])
    for line, vector, answer in zip(lines, VECTORS["good"], answers, strict=True):
        head, *fields = answer.split("\x1e")
        assert head == f"ok {vector['tag']} {vector['seq']} {vector['t_us']} {vector['imu']}", line
        assert [field.split("\x1f") for field in fields] == vector["fields"], line


def test_malformed_sentences(codec: Path) -> None:
    answers = ask(codec, [f"parse {v['line']}" for v in VECTORS["malformed"]])
    assert answers == [v["error"] for v in VECTORS["malformed"]]


def test_every_single_changed_byte_is_noticed(codec: Path) -> None:
    line = VECTORS["good"][1]["sentence"]
    changed = [line[:i] + chr(ord(line[i]) ^ 1 << bit) + line[i + 1 :] for i in range(len(line)) for bit in range(7)]
    jobs = [f"parse {text}" for text in changed if "\n" not in text and "\r" not in text and "\0" not in text]
    assert all(answer.startswith("wire_") for answer in ask(codec, jobs))


def test_reals_are_printf_9g_and_come_back(codec: Path) -> None:
    rng = np.random.default_rng(2)
    raw = rng.integers(0, 2**63, 20000, dtype=np.uint64).view(np.float64)  # every exponent
    plain = rng.normal(0, 1, 20000) * 10.0 ** rng.integers(-12, 13, 20000)
    ties = rng.integers(0, 10**9, 5000) + 0.5  # half-way: to even
    singles = rng.integers(0, 2**32, 20000, dtype=np.uint32).view(np.float32)
    singles = singles[np.isfinite(singles)]
    vectors = [float.fromhex(v["hex"]) for v in VECTORS["numbers"]]
    values = [float(v) for v in (*singles, *raw, *plain, *ties, *-plain[:1000], *vectors) if np.isfinite(v)]
    texts = ask(codec, [f"real {bits(v)}" for v in values])
    assert texts == [format(v, ".9g") for v in values]
    assert texts[-len(vectors) :] == [v["text"] for v in VECTORS["numbers"]]

    back = [struct.unpack(">d", bytes.fromhex(t))[0] for t in ask(codec, [f"number {t}" for t in texts])]
    for text, value in zip(texts, back, strict=True):
        expected = float(text)
        assert abs(value - expected) <= 1e-14 * abs(expected) + 5e-324, text
        mantissa, _, exponent = text.partition("e")
        digits = len(mantissa.lstrip("-").partition(".")[2])
        if abs(int(exponent or 0) - digits) <= 22:
            assert value == expected, text
    keep = np.abs(singles) < 3.4e38  # beyond, rounding the text to nine digits may pass the largest float32
    np.testing.assert_array_equal(np.array(back[: len(singles)])[keep].astype(np.float32), singles[keep])


def test_values_that_do_not_exist_are_empty(codec: Path) -> None:
    assert ask(codec, [f"real {bits(v)}" for v in (float("nan"), float("inf"), -float("inf"))]) == ["", "", ""]


def test_malformed_numbers(codec: Path) -> None:
    assert set(ask(codec, [f"number {text}" for text in VECTORS["malformed_numbers"]])) == {"bad_number"}


def test_integers(codec: Path) -> None:
    values = [0, 1, -1, 9, 10, -10, 2**63 - 1, -(2**63)]
    assert ask(codec, [f"int {v}" for v in values]) == [str(v) for v in values]


@pytest.mark.parametrize("source", ["fuzz_wire.c", "fuzz_device.c", "fuzz_remote.c"])
def test_fuzz(build: Build, source: str) -> None:
    rounds = {"fuzz_wire.c": "50000", "fuzz_device.c": "150", "fuzz_remote.c": "3000"}[source]
    run(build(HERE.parent / "fuzz" / source), "", rounds)
