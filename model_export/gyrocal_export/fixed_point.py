"""Network `gyrocal` in integers: the gains and starts by which the C kernel computes it without float arithmetic.

The codes are those of the quantised graph. An output is (start + sum of codes · inputs) · gain / 2^32, rounded down, and
LeakyReLU follows. Each layer's unit is chosen so that no column within the network's range lets an output pass the limit of its
layer: the sums are bounded term by term, from the columns on. Therefore nothing saturates, and no data are needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gyrocal.errors import InputError

Float = NDArray[np.float64]
Integers = NDArray[np.int64]

SHORT_LIMIT = 2**15
"""Columns, sums of rows over a pool and features are below it: the kernel keeps them in 16 bits, and some CPUs multiply two
pairs of these at once."""
HIDDEN_LIMIT = 2**19
"""The largest output of a dense layer; 16 bits are too few for these. 32 codes times hidden outputs are below 2^31, whatever
the codes are."""
LARGEST = 2**31 - 1
SMALLEST_GAIN = 2**12
"""A gain is rounded by a part in ten thousand at most."""
LEAK_UNIT = 2**15
STRAIGHT_LIMIT = 2**15 - 1


class Layer(NamedTuple):
    """The gains [out] and starts [..., out] of a layer."""

    gain: Integers
    start: Integers


class FixedPoint(NamedTuple):
    """What the integer kernel knows beside the codes. A step is the size of an integer in the network's unit."""

    leak: int
    columns_a_unit: float
    straight: Integers
    straight_step: Float
    layers: dict[str, Layer]
    last_start: Integers
    last_step: Float


class _Numbers(NamedTuple):
    """The smallest and largest values of the inputs of a layer, zero included, and the size of 1 in the network's unit.

    With zero among them, the bounds of a sum hold for its first terms too, and for a stage that lacks times.
    """

    low: Float
    high: Float
    step: float

    def times(self, n: int, factor: int = 1) -> _Numbers:
        """The inputs of a layer that takes ``n`` times, each the sum of ``factor``."""
        return _Numbers(np.tile(factor * self.low, n), np.tile(factor * self.high, n), self.step)


def fixed_point(constants: Mapping[str, NDArray[Any]], column_range: float, pool: int, leak: float) -> FixedPoint:
    """The numbers of the integer kernel.

    Args:
        constants: the constants of the quantised graph.
        column_range: the largest size of a column, in the network's unit.
        pool: the second convolution's pool.
        leak: LeakyReLU's slope below zero.

    Raises:
        InputError: the network is so large, or a bias so large beside its weights, that a sum would not fit 32 bits.
    """
    layers: dict[str, Layer] = {}

    def through(name: str, code: Float, bias: NDArray[Any], x: _Numbers, limit: int, mean_of: int = 1) -> _Numbers:
        layers[name], y = _layer(name, code, constants[f"{name}.step"] / mean_of, bias, x, limit, round(leak * LEAK_UNIT))
        return y

    columns_a_unit = float(np.float32((SHORT_LIMIT - 1) / column_range))
    first, third, fourth = (constants[f"{name}.code"].astype(float) for name in ("first", "third", "fourth"))
    second = by_time(constants["second.code"]).astype(float)
    taps, times = second.shape[1], third.shape[1] // len(second)
    x = _Numbers(np.array([-SHORT_LIMIT], float), np.array([SHORT_LIMIT], float), 1 / columns_a_unit).times(first.shape[-1])
    x = through("first", first[:, 0], constants["first.bias"], x, SHORT_LIMIT // pool)
    second = second.reshape(len(second), -1)
    x = through("second", second, constants["second.bias"], x.times(taps, pool), SHORT_LIMIT, pool)
    x = through("third", third, constants["start"], x.times(times), HIDDEN_LIMIT)
    x = through("fourth", fourth, constants["fourth.bias"], x, HIDDEN_LIMIT)
    last_step = constants["last.step"].astype(float) * x.step
    last_start = _integers(constants["last.bias"] / last_step)
    _sums("last", constants["last.code"].astype(float), last_start.astype(float), x)
    straight = constants["straight"].astype(float)
    straight_unit = np.abs(straight).max(1) / STRAIGHT_LIMIT
    return FixedPoint(
        leak=round(leak * LEAK_UNIT),
        columns_a_unit=columns_a_unit,
        straight=_integers(straight / straight_unit[:, None]),
        straight_step=straight_unit / columns_a_unit,
        layers=layers,
        last_start=last_start,
        last_step=last_step,
    )


def by_time(code: NDArray[Any]) -> NDArray[Any]:
    """The codes of a convolution, [out, in, kernel], in the order [out, kernel, in]."""
    return code.swapaxes(1, 2)


def _layer(
    name: str, code: Float, step: NDArray[Any], bias: NDArray[Any], x: _Numbers, limit: int, leak: int
) -> tuple[Layer, _Numbers]:
    """The numbers of a layer with codes [out, in], and its outputs after LeakyReLU."""
    step = step.astype(float) * x.step
    low, high = (f(code * x.low, code * x.high).sum(1) for f in (np.minimum, np.maximum))
    least, most = float((low * step + bias).min()), float((high * step + bias).max())
    # after LeakyReLU an output is within the limit, and before it an output times the leak fits 32 bits
    most = max(most, -least * max(leak / LEAK_UNIT, (limit - 1) / (LARGEST // leak - 1)))
    out_step = most / (limit - 1)
    gain = np.rint(step / out_step * 2**32)
    if not SMALLEST_GAIN <= gain.min() <= gain.max() <= LARGEST:
        raise _too_large(name)
    start = np.rint(bias / step + 2**31 / gain)
    y = np.floor(_sums(name, code, start, x) * gain / 2**32)
    y = np.where(y < 0, np.floor(y * leak / LEAK_UNIT + 0.5), y)
    return Layer(_integers(gain), _integers(start)), _Numbers(np.minimum(y[0], 0), np.maximum(y[1], 0), out_step)


def _sums(name: str, code: Float, start: Float, x: _Numbers) -> Float:
    """The smallest and the largest sum of each output, [2, out], at any stage."""
    low, high = (f(code * x.low, code * x.high).sum(1) for f in (np.minimum, np.maximum))
    ends = np.array([(low + start).reshape(-1, len(code)).min(0), (high + start).reshape(-1, len(code)).max(0)])
    if np.abs(ends).max() > LARGEST:
        raise _too_large(name)
    return ends


def _too_large(name: str) -> InputError:
    return InputError(
        f"network gyrocal: the {name} layer does not fit 32 bits; train a smaller network, or with more weight decay"
    )


def _integers(values: Float) -> Integers:
    return np.rint(values).astype(np.int64)
