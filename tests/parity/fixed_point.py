"""Network `gyrocal` in integers by numpy, from the numbers of a ``weights.h``: what the core computes with GC_NET_FIXED."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]
KINDS = {"gc_convnet_code_t": np.int64, "int16_t": np.int64, "int32_t": np.int64, "float": np.float32}
LAYERS = ("first", "second", "third", "fourth", "last")
LOG_PRECISION = np.float32(9.0)


@dataclass(frozen=True)
class Layer:
    """Codes [out, in], gains [out] (none in the last layer) and starts [out] or [stages, out]."""

    code: Integers
    gain: Integers
    start: Integers

    def sums(self, x: Integers, stage: int = 0) -> Integers:
        """The sums of the layer for inputs [..., in], of which a stage may have fewer than there are codes."""
        start = self.start[stage] if self.start.ndim > 1 else self.start
        return start + x @ self.code[:, : x.shape[-1]].T


class FixedNetwork:
    """The table of a header and its answers. ``layers`` by name; all numbers are integers but the steps."""

    def __init__(self, header: Path) -> None:
        text = re.sub(r"#if !GC_NET_FIXED.*?#else", "", header.read_text(), flags=re.S)
        found = re.findall(r"static const (\w+) gc_gyrocal_(\w+)\[\d+\] = {(.*?)};", text, re.S)
        arrays = {name: np.array(re.findall(r"[-+\d.e]+", body), KINDS[kind]) for kind, name, body in found}
        table = text.partition("gc_gyrocal = {")[2].partition("\n};")[0]
        numbers = dict(re.findall(r"^    \.(\w+) = ([-+\d.e]+)f?,$", table, re.M))
        self.pool, self.stage_columns, self.leak = (int(numbers[name]) for name in ("pool", "stage_columns", "leak"))
        self.unit_dps, self.columns_a_unit = (float(np.float32(numbers[name])) for name in ("unit_dps", "columns_a_unit"))
        self.kernel, self.second_kernel, self.second_pool = (
            int(re.findall(rf"\.{layer} = {{.*?\.{name} = (\d+)", table)[0])
            for layer, name in (("first", "kernel"), ("second", "kernel"), ("second", "pool"))
        )
        self.straight = arrays["straight_code"].reshape(3, -1)
        self.straight_step, self.last_step = arrays["straight_step"], arrays["last_unit"]
        self.layers = {}
        for name in LAYERS:
            start = arrays[f"{name}_start"]
            outputs = len(start) // (3 if name == "third" else 1)
            code = arrays[f"{name}_code"].reshape(outputs, -1)
            gain = arrays.get(f"{name}_gain", np.zeros(0, np.int64))
            self.layers[name] = Layer(code, gain, start.reshape(3, -1) if name == "third" else start)

    def leaky(self, y: Integers) -> Integers:
        return np.where(y < 0, (y * self.leak + 2**14) >> 15, y)

    def outputs(self, name: str, x: Integers, stage: int = 0) -> Integers:
        layer = self.layers[name]
        return self.leaky(layer.sums(x, stage) * layer.gain >> 32)

    def columns(self, counts: Integers, lsb_dps: float, w_dps: float) -> Integers:
        n = counts.shape[1]
        sums = counts.astype(np.int64).reshape(len(counts), -1, self.pool).sum(-1)
        off = sums * n - sums.sum(1, keepdims=True) * self.pool
        gain = np.sign(w_dps) * lsb_dps / (float(self.pool) * float(n) * self.unit_dps)
        return off * int(gain * self.columns_a_unit * 2.0**32) + 2**31 >> 32

    def infer(self, counts: Integers, stage: int, lsb_dps: float, w_dps: float) -> NDArray[np.float32]:
        """Correction and logarithm of its precision, [n, 2], of readings in counts [n, samples] that are in range."""
        columns = self.columns(counts, lsb_dps, w_dps)
        rows = self.outputs("first", _windows(columns, self.kernel, 1))
        summed = sum(rows[:, p : rows.shape[1] - self.second_pool + 1 + p] for p in range(self.second_pool))
        taps = _windows(summed.swapaxes(1, 2), self.second_kernel, self.second_pool)  # [n, channels, times, kernel]
        features = self.outputs("second", taps.transpose(0, 2, 3, 1).reshape(len(counts), taps.shape[2], -1))
        third = self.outputs("third", features.reshape(len(counts), -1), stage)
        last = self.layers["last"].sums(self.outputs("fourth", third)).astype(np.float32) * self.last_step
        line = (columns @ self.straight[stage, : columns.shape[1]]).astype(np.float32) * self.straight_step[stage]
        return np.column_stack([line + last[:, 0], np.clip(last[:, 1], -LOG_PRECISION, LOG_PRECISION)])


def _windows(x: Integers, length: int, step: int) -> Integers:
    return np.lib.stride_tricks.sliding_window_view(x, length, axis=-1)[..., ::step, :]
