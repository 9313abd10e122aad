"""Standard errors, misfit and flags of the core against the host's, on the same counts."""

import ctypes
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.estimator import Answer
from gyrocal.calibration.flags import FLAGS, ordered
from gyrocal.calibration.trust import Evidence, answer_flags
from gyrocal.calibration.uncertainty import last_turn
from gyrocal.core.library import SHARED, build, core_sources
from gyrocal.recording.session import AXES, Run
from gyrocal_firmware import CORE

SHIM = Path(__file__).with_name("trust_shim.c")
LSB_DPS = 0.00875

Trust = Callable[..., tuple[list[float], str]]


@pytest.fixture(scope="module")
def library(require_tool: Callable[[str], str]) -> ctypes.CDLL:
    require_tool("cc")
    return ctypes.CDLL(str(build("trust", [SHIM, *core_sources()], [CORE], SHARED)))


@pytest.fixture(scope="module")
def core(library: ctypes.CDLL) -> Trust:
    """Standard errors of scale and bias, misfit, of the network misfit and standard errors; flags as text."""

    def ask(runs: Sequence[Run], answer: Answer, seconds: float, lsb_dps: float, known_table: bool) -> tuple[list[float], str]:
        t_us = np.concatenate([r.t_us for r in runs])
        counts = np.concatenate([np.rint(r.gyro_dps[:, 2] / lsb_dps) for r in runs]).astype(np.int16)
        numbers = (ctypes.c_double * 6)(answer.scale, answer.scale_se, answer.bias_dps, answer.bias_se_dps)
        text = ctypes.create_string_buffer(library.flags_room())
        error = library.trust(
            t_us.ctypes.data_as(ctypes.c_void_p), counts.ctypes.data_as(ctypes.c_void_p),
            (ctypes.c_uint32 * 2)(*map(len, runs)), (ctypes.c_double * 2)(*(float(r.rate_dps[0]) for r in runs)),
            ctypes.c_double(runs[0].sample_rate_hz), ctypes.c_double(lsb_dps),
            ctypes.c_uint32(round(4 * seconds)), ctypes.c_int(known_table), numbers, text,
        )  # fmt: skip
        assert error == 0
        return list(numbers), text.value.decode()

    return ask


def make_run(y_dps: np.ndarray, t_us: np.ndarray, face: str, rate_hz: float, w_dps: float, lsb_dps: float) -> Run:
    table = {"t_s": t_us * 1e-6, **{f"g{a}_dps": np.rint(y_dps / lsb_dps) * lsb_dps for a in AXES}}
    return Run(
        0, f"{face}.csv", "s", face, "z", w_dps, None, None, None, rate_hz, frame=pl.DataFrame(table), lsb_dps=lsb_dps,  # type: ignore[arg-type]
    )  # fmt: skip


def pair(rng: np.random.Generator, what: str, rate_hz: float, w_dps: float, lsb_dps: float = LSB_DPS) -> list[Run]:
    seconds = 40.0 if what in ("warm-up", "long") else 6.5
    t_us = np.round(np.arange(round(seconds * rate_hz)) / rate_hz * 1e6).astype(np.int64)
    scale, bias_dps = rng.uniform(-0.03, 0.03), rng.uniform(-10, 10)
    runs = []
    for face, w in (("up", w_dps), ("down", -w_dps)):
        t_s = t_us * 1e-6
        y = (1 + scale) * w + bias_dps + rng.normal(0, 0.0448, t_s.size)
        if what == "effects":
            y += w * 0.003 * np.cos(np.deg2rad(w_dps) * t_s + rng.uniform(0, 6)) - w * 0.004 * np.exp(-t_s / 1.7)
        if what == "warm-up":
            y += 0.05 * np.exp(-t_s / 60.0)
        if what == "low-pass":
            y += 0.1 * np.convolve(rng.normal(size=t_s.size), np.ones(4) / 2, "same")
        if what == "spike":
            y[100] = 249.0
        if what == "clipped":
            y[100] = 250.0
        if what == "still":
            y[200:300] = y[200]
        if what == "constant":
            y[:] = w
        if what == "turned":
            y = -y
        if what == "across":  # an axis across the table's, which follows a little by misalignment
            y += (-0.02 - 1 - scale) * w
        kept = np.ones(t_us.size, bool)
        if what == "missed":
            kept[50:95] = False
        runs.append(make_run(y[kept], t_us[kept], face, rate_hz, w_dps, lsb_dps))
    return runs


@pytest.mark.parametrize("known_table", [False, True])
@pytest.mark.parametrize("seconds", [2, 4, 6])
@pytest.mark.parametrize(
    ("what", "rate_hz", "w_dps", "lsb_dps"),
    [
        ("null", 145.0, 78.0, LSB_DPS), ("effects", 145.0, 78.0, LSB_DPS), ("low-pass", 416.0, 30.0, LSB_DPS),
        ("spike", 145.0, 78.0, LSB_DPS), ("clipped", 145.0, 78.0, LSB_DPS), ("still", 145.0, 78.0, LSB_DPS),
        ("constant", 145.0, 78.0, LSB_DPS), ("turned", 145.0, 78.0, LSB_DPS), ("missed", 104.0, 78.0, LSB_DPS),
        ("warm-up", 145.0, 78.0, LSB_DPS), ("warm-up", 145.0, 211.3, 0.1), ("long", 416.0, 33.3, LSB_DPS),
        ("across", 145.0, 78.0, LSB_DPS), ("null", 52.0, 78.0, 0.1), ("null", 12.5, 78.0, LSB_DPS),
    ],
)  # fmt: skip
def test_the_core_says_what_the_host_says(
    core: Trust, what: str, rate_hz: float, w_dps: float, lsb_dps: float, seconds: float, known_table: bool
) -> None:
    rng = np.random.default_rng(7)
    whole = pair(rng, what, rate_hz, w_dps, lsb_dps)
    runs = [r for r in (run.first(seconds) for run in whole) if r is not None]
    means = [float(r.gyro_dps[:, 2].mean()) for r in runs]
    scale = (means[0] - means[1]) / (2 * w_dps) - 1
    answer = Answer(scale, 3e-5, (means[0] + means[1]) / 2, 2e-3, None)
    got, flags = core(whole, answer, seconds, lsb_dps, known_table)
    evidence = Evidence.of(runs, whole, seconds)
    assert evidence is not None
    told = evidence.with_errors(answer)
    if known_table:
        own = [evidence.misfit_of(answer), answer.scale_se, answer.bias_se_dps]
    else:
        claimed = evidence.with_errors_of(answer)
        own = [claimed.misfit, claimed.scale_se, claimed.bias_se_dps]
    assert got == pytest.approx([told.scale_se, told.bias_se_dps, told.misfit, *own], rel=1e-9)
    blocks = sum(np.unique(r.t_us // 250_000).size for r in runs)
    expected = answer_flags(told, blocks)
    if evidence.disagrees(answer):
        expected |= {"disagrees"}
    assert flags == "+".join(ordered(expected))
    assert (evidence.moved > 2.5) == (what == "warm-up")
    assert "misfit" in expected or what != "warm-up"


def test_logarithm_and_decay_are_within_1e_12_everywhere(library: ctypes.CDLL) -> None:
    x = np.concatenate([np.geomspace(5e-324, 1.7e308, 20_001), np.linspace(0.5, 3.0, 5001), np.linspace(1.0, 700.0, 5001)])
    logs, decays = np.empty_like(x), np.empty_like(x)
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (x, logs, decays)]
    library.logs_and_decays(pointers[0], ctypes.c_uint32(x.size), *pointers[1:])
    assert logs == pytest.approx(np.log(x), rel=1e-12, abs=1e-15)
    assert decays == pytest.approx(np.where(x > 700, 0.0, np.exp(-x)), rel=1e-12)


def test_the_host_reads_every_flag_of_the_core() -> None:
    text = (CORE / "gc_flags.h").read_text(encoding="utf-8")
    assert len(FLAGS) == len(re.findall(r"X\(GC_FLAG_", text)) > 0
    assert [f'"{meaning}"' in text for meaning in FLAGS.values()] == [True] * len(FLAGS)


def test_flags_have_one_list(library: ctypes.CDLL) -> None:
    text = ctypes.create_string_buffer(library.flags_room())
    assert library.gc_flags_text(ctypes.c_uint32(0), text) == 0
    assert text.value == b""
    for bit, name in enumerate(FLAGS):
        library.gc_flags_text(ctypes.c_uint32(1 << bit), text)
        assert text.value.decode() == name
    everything = "+".join(FLAGS)
    assert library.gc_flags_text(ctypes.c_uint32(0xFFFFFFFF), text) == len(everything)
    assert text.value.decode() == everything


@pytest.mark.parametrize("w_dps", [20.0, 78.0, 90.0, 288.0, 401.3, 1500.0])
def test_the_last_turn_is_the_same_to_the_sample(library: ctypes.CDLL, w_dps: float) -> None:
    """At the ends of turns too, where one sample decides whether a turn is whole, over, or after the seconds of the answer."""
    rng = np.random.default_rng(3)
    known = 0
    for rate_hz, seconds in ((145.0, 14.9), (100.0, 15.0), (104.0, 29.2), (100.0, 13.0), (26.0, 70.0), (12.5, 19.0)):
        t_us = np.round(np.arange(round(seconds * rate_hz) + 1) / rate_hz * 1e6).astype(np.int64)
        counts = rng.integers(-20, 20, t_us.size).astype(np.int16) + 1000
        for after_us in (2_000_000, 4_000_000, 6_000_000):
            mean = ctypes.c_double()
            samples = library.last_turn(
                t_us.ctypes.data_as(ctypes.c_void_p), counts.ctypes.data_as(ctypes.c_void_p), ctypes.c_uint32(t_us.size),
                ctypes.c_double(rate_hz), ctypes.c_double(-w_dps), ctypes.c_uint64(after_us), ctypes.byref(mean),
            )  # fmt: skip
            turn = last_turn(counts[None].astype(float), t_us, -w_dps, after_us)
            assert samples == (0 if turn is None else turn.samples)
            if turn is not None:
                known += 1
                assert mean.value == pytest.approx(turn.mean_dps[0], rel=1e-12)
    assert known > 0 or w_dps in (20.0, 401.3, 1500.0)
