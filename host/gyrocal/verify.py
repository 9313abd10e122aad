"""The C kernel against onnxruntime on the quantised graph."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrocal.core import CoreNetwork
from gyrocal.errors import InputError
from gyrocal.network import Network
from gyrocal.simulate import paper_windows

TOLERANCE = 2e-6  # of an output's range over the windows


def windows(net: Network, seed: int, n: int = 1200) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """``n`` pairs of windows, [n, window] each: of the paper's campaign, and a sixth of them extreme.

    Extreme are saturated at +-250 dps, constant, huge, infinite, denormal and zero readings, and single spikes.
    """
    rng = np.random.default_rng(seed)
    extreme = n // 6
    per_run = max(1, (6 * 145) // net.window)
    data = paper_windows(-(-(n - extreme) // per_run), seed, seconds=per_run * net.window / 145)
    size, shape = np.float32, (extreme, net.window)
    kinds = [
        lambda: np.sign(rng.normal(size=shape)) * 250.0,
        lambda: np.broadcast_to(rng.normal(0.0, 1.0, (extreme, 1)), shape),
        lambda: rng.normal(size=shape) * 10.0 ** rng.uniform(0, 37, (extreme, 1)),
        lambda: np.where(rng.random(shape) < 0.5, np.inf, -np.inf),
        lambda: rng.integers(-5, 6, shape) * 1.4e-45,
        lambda: np.zeros(shape),
        lambda: np.where(rng.random(shape) < 0.01, rng.normal(0, 100.0, shape), rng.normal(0, 0.1, shape)),
    ]
    which = rng.integers(0, len(kinds), (2, extreme))
    pairs = []
    for face, choice in zip(("up", "down"), which, strict=True):
        plain = data[face].reshape(-1, net.window)[: n - extreme]
        drawn = np.stack([kind() for kind in kinds])[choice, np.arange(extreme)]
        pairs.append(np.concatenate([plain, drawn]).astype(size))
    return pairs[0], pairs[1]


def verify(onnx: Path | None = None, header: Path | None = None, seed: int = 0, n: int = 1200) -> dict[str, Any]:
    """Run both on the same windows.

    Args:
        onnx: a quantised graph; the shipped one by default.
        header: the ``weights.h`` made from it; the shipped one by default.

    Returns:
        ``windows``, ``max_abs_diff`` over both outputs (scale, bias in dps), ``max_diff_of_range`` (each difference
        over the range of its output), ``tolerance`` on that, and ``ok``.

    Raises:
        InputError: a file cannot be used, or they are of different networks.
    """
    net = Network.open(onnx) if onnx else Network.shipped()
    core = CoreNetwork(header) if header else CoreNetwork()
    if (net.window, net.rate_hz, net.table_dps) != (core.window, core.rate_hz, core.table_dps):
        raise InputError(
            f"{core.source}: window, rate_hz and table_dps are {core.window}, {core.rate_hz:g}, {core.table_dps:g}; "
            f"those of {net.source} are {net.window}, {net.rate_hz:g}, {net.table_dps:g}: export both together"
        )
    up, down = windows(net, seed, n)
    reference = net.estimate(up, down, net.table_dps, -net.table_dps).astype(np.float64)
    off = np.abs(core.run(up, down, net.table_dps, -net.table_dps) - reference)
    of_range = float(np.max(off / np.ptp(reference, axis=0)))
    return {
        "windows": len(up),
        "max_abs_diff": float(off.max()),
        "max_diff_of_range": of_range,
        "tolerance": TOLERANCE,
        "ok": bool(of_range <= TOLERANCE),
    }
