"""Network `gyrocal` in integers: the gains and starts by which the C kernel computes it without float arithmetic.

The codes are those of the quantised graph. An output is (start + sum of codes · inputs) · gain / 2^32, rounded down, and LeakyReLU
follows. Each layer's unit is chosen so that no column within the network's range lets an output pass the limit of its layer: the
sums are bounded term by term, from the range of the columns on. Therefore nothing saturates and no data are needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gyrocal.errors import InputError

Float = NDArray[np.float64]
Integers = NDArray[np.int64]

COLUMN_LIMIT = ROW_LIMIT = 2**17
FEATURE_LIMIT, HIDDEN_LIMIT = 2**15, 2**18
"""The largest column, and the largest output of the first convolution, of the second one and of the dense layers. 24 codes times
the sums of two rows, 144 codes times features and 32 codes times hidden outputs are then below 2^30, whatever the codes."""
LARGEST = 2**31 - 1
LEAK_UNIT = 2**15
STRAIGHT_LIMIT = 2**15 - 1


class Layer(NamedTuple):
    """The gains [out] and starts [..., out] of a layer."""

    gain: Integers
    start: Integers


class FixedPoint(NamedTuple):
    """What the integer kernel knows beside the codes."""

    leak: int
    columns_a_unit: np.float32
    straight: Integers
    straight_step: NDArray[np.float32]
    layers: dict[str, Layer]
    last_start: Integers
    last_step: NDArray[np.float32]


class _Bounded(NamedTuple):
    """The smallest and largest value of each input of a layer, and the unit of these integers in the network's unit."""

    low: Float
    high: Float
    unit: float


def fixed_point(constants: Mapping[str, NDArray[Any]], column_range: float, pool: int, leak: float) -> FixedPoint:
    """The numbers of the integer kernel.

    Args:
        constants: the constants of the quantised graph.
        column_range: the largest size of a column, in the network's unit.
        pool: the second convolution's pool.
        leak: LeakyReLU's slope below zero.

    Raises:
        InputError: a bias is so large beside its weights that a sum would not fit.
    """
    leak_code = round(leak * LEAK_UNIT)
    columns_a_unit = np.float32((COLUMN_LIMIT - 1) / column_range)
    first, second, third, fourth, last = (
        constants[f"{name}.code"].astype(np.float64).reshape(len(constants[f"{name}.code"]), -1)
        for name in ("first", "second", "third", "fourth", "last")
    )
    taps, kernel = first.shape[1], constants["second.code"].shape[2]
    layers: dict[str, Layer] = {}

    def through(name: str, code: Float, x: _Bounded, bias: NDArray[Any], limit: int, mean_of: int = 1) -> _Bounded:
        step = constants[f"{name}.step"].astype(np.float64) * x.unit / mean_of
        low, high = (f(code * x.low, code * x.high).sum(1) for f in (np.minimum, np.maximum))
        least, most = float((low * step + bias).min()), float((high * step + bias).max())
        most = max(most, -least * max(leak, (limit - 1) / (LARGEST // leak_code - 1)))  # a number times the leak fits too
        gain = np.rint(step * (limit - 1) / most * 2**32)
        start = np.rint(bias / step + 2**31 / gain)
        if max(gain.max(), float((high + start).max()), -float((low + start).min())) > LARGEST:
            raise InputError(f"the {name} layer of the network does not fit into 32 bits; train it again with more weight decay")
        layers[name] = Layer(gain.astype(np.int64), start.astype(np.int64))
        rows = start if start.ndim > 1 else start[None]
        low, high = (np.floor((sums + rows) * gain / 2**32) for sums in (low, high))
        low, high = (np.where(y < 0, np.floor(leak_code / LEAK_UNIT * y + 0.5), y) for y in (low.min(0), high.max(0)))
        return _Bounded(low, high, most / (limit - 1))

    x = _Bounded(np.full(taps, -float(COLUMN_LIMIT)), np.full(taps, float(COLUMN_LIMIT)), 1 / float(columns_a_unit))
    x = through("first", first, x, constants["first.bias"], ROW_LIMIT)
    x = _Bounded(pool * np.repeat(x.low, kernel), pool * np.repeat(x.high, kernel), x.unit)
    x = through("second", second, x, constants["second.bias"], FEATURE_LIMIT, pool)
    times = third.shape[1] // len(second)
    x = _Bounded(np.tile(x.low, times), np.tile(x.high, times), x.unit)
    x = through("third", third, x._replace(low=np.minimum(x.low, 0), high=np.maximum(x.high, 0)), constants["start"], HIDDEN_LIMIT)
    x = through("fourth", fourth, x, constants["fourth.bias"], HIDDEN_LIMIT)
    last_step = (constants["last.step"].astype(np.float64) * x.unit).astype(np.float32)
    straight = constants["straight"].astype(np.float64)
    straight_unit = np.abs(straight).max(1) / STRAIGHT_LIMIT
    return FixedPoint(
        leak=leak_code,
        columns_a_unit=columns_a_unit,
        straight=np.rint(straight / straight_unit[:, None]).astype(np.int64),
        straight_step=(straight_unit / float(columns_a_unit)).astype(np.float32),
        layers=layers,
        last_start=np.rint(constants["last.bias"] / last_step.astype(np.float64)).astype(np.int64),
        last_step=last_step,
    )
