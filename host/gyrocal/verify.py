"""The C kernels against onnxruntime on the quantised graphs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrocal.core import CoreBlockNetwork, CoreNetwork
from gyrocal.errors import InputError
from gyrocal.network import BLOCKS, STAGES_S, BlockNetwork, Network, open_network
from gyrocal.simulate import paper_windows
from gyrocal_firmware import INCLUDE

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


def block_means(net: BlockNetwork, seed: int, n: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """``n`` pairs of block means, [n, 24] each: of the paper's campaign, and a sixth of them extreme, as :func:`windows`."""
    rng = np.random.default_rng(seed)
    extreme = n // 6
    data = paper_windows(n - extreme, seed)
    shape = (extreme, BLOCKS)
    kinds = [
        lambda: np.sign(rng.normal(size=shape)) * 250.0,
        lambda: np.broadcast_to(rng.normal(0.0, 1.0, (extreme, 1)), shape),
        lambda: rng.normal(size=shape) * 10.0 ** rng.uniform(0, 37, (extreme, 1)),
        lambda: np.where(rng.random(shape) < 0.5, np.inf, -np.inf),
        lambda: rng.integers(-5, 6, shape) * 1.4e-45,
        lambda: np.where(rng.random(shape) < 0.1, rng.normal(0, 100.0, shape), rng.normal(0, 0.1, shape)),
    ]
    pairs = []
    for face, choice in zip(("up", "down"), rng.integers(0, len(kinds), (2, extreme)), strict=True):
        drawn = np.stack([kind() for kind in kinds])[choice, np.arange(extreme)]
        pairs.append(np.concatenate([net.block_means(data[face]), drawn]).astype(np.float32))
    return pairs[0], pairs[1]


def verify(onnx: Path | None = None, header: Path | None = None, seed: int = 0, n: int = 1200) -> dict[str, Any]:
    """Run both on the same windows.

    Args:
        onnx: a quantised graph; the shipped ones by default.
        header: the ``weights.h`` made from it; the shipped one by default.

    Returns:
        ``windows``, ``max_abs_diff`` over all outputs (scale, bias in dps, their deviations), ``max_diff_of_range`` (each
        difference over the range of its output), ``tolerance`` on that, and ``ok``.

    Raises:
        InputError: a file cannot be used, or they are of different networks.
    """
    path = header or INCLUDE / "weights.h"
    if onnx is not None:
        net = open_network(onnx)
        found = [_paper(net, path, seed, n) if isinstance(net, Network) else _gyrocal(net, path, seed, n)]
    else:
        found = [_gyrocal(BlockNetwork.shipped(), path, seed, n)] if CoreNetwork(path).blocks else []
        if CoreNetwork(path).window or not found:
            found.append(_paper(Network.shipped(), path, seed, n))
    reference = [x for of_net, _ in found for x in of_net]
    off = [x for _, of_net in found for x in of_net]
    of_range = max(float(np.max(o / np.ptp(r, axis=0))) for r, o in zip(reference, off, strict=True))
    return {
        "windows": sum(len(o) for o in off),
        "max_abs_diff": max(float(o.max()) for o in off),
        "max_diff_of_range": of_range,
        "tolerance": TOLERANCE,
        "ok": bool(of_range <= TOLERANCE),
    }


Arrays = list[NDArray[np.float64]]


def _paper(net: Network, header: Path, seed: int, n: int) -> tuple[Arrays, Arrays]:
    """onnxruntime's answers, and how far the C core's are from them."""
    core = CoreNetwork(header)
    _same(net, core, ("window", "rate_hz", "table_dps"))
    up, down = windows(net, seed, n)
    reference = net.estimate(up, down, net.table_dps, -net.table_dps).astype(np.float64)
    return [reference], [np.abs(core.run(up, down, net.table_dps, -net.table_dps) - reference)]


def _gyrocal(net: BlockNetwork, header: Path, seed: int, n: int) -> tuple[Arrays, Arrays]:
    core = CoreBlockNetwork(header)
    _same(net, core, ("rate_hz", "table_dps"))
    reference, off = [], []
    for stage in range(len(STAGES_S)):
        up, down = block_means(net, seed + stage, n)
        reference.append(net.estimate(up, down, stage, net.table_dps, -net.table_dps).astype(np.float64))
        off.append(np.abs(core.run(up, down, stage, net.table_dps, -net.table_dps) - reference[-1]))
    return reference, off


def _same(net: Network | BlockNetwork, core: CoreNetwork | CoreBlockNetwork, names: tuple[str, ...]) -> None:
    ours, theirs = ([getattr(of, name) for name in names] for of in (core, net))
    if ours != theirs:
        said = [", ".join(f"{value:g}" for value in values) for values in (ours, theirs)]
        raise InputError(
            f"{core.source}: {', '.join(names[:-1])} and {names[-1]} are {said[0]}; "
            f"those of {net.source} are {said[1]}: export both together"
        )
