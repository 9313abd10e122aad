"""The C kernels against onnxruntime on the quantised graphs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrocal.calibration.network import STAGES_S, BlockNetwork, Network, open_network
from gyrocal.core.library import CoreBlockNetwork, CoreNetwork
from gyrocal.errors import InputError
from gyrocal.simulation.simulate import paper_windows
from gyrocal_firmware import INCLUDE

TOLERANCE = 2e-6
"""Of an output's range over the windows."""
STEPS = 4
"""Of float32 at an output's largest value, always granted: where it hardly varies, its range says nothing of rounding."""

Pair = tuple[NDArray[np.float32], NDArray[np.float32]]


def windows(net: Network, seed: int, n: int = 1200) -> Pair:
    """``n`` pairs of windows, [n, window] each: of the paper's campaign, and a sixth of them extreme.

    Extreme are saturated at +-250 dps, constant, huge, infinite, denormal and zero readings, and single spikes.
    """
    per_run = max(1, (6 * 145) // net.window)
    data = paper_windows(-(-(n - n // 6) // per_run), seed, seconds=per_run * net.window / 145)
    plain = [data[face].reshape(-1, net.window) for face in ("up", "down")]
    return _with_extremes(plain, seed, n, spiked=0.01, zero=True)


def block_means(net: BlockNetwork, seed: int, n: int) -> Pair:
    """``n`` pairs of block means, [n, 24] each, as :func:`windows`, but none of them all zero."""
    data = paper_windows(n - n // 6, seed)
    return _with_extremes([net.block_means(data[face]) for face in ("up", "down")], seed, n, spiked=0.1)


def _with_extremes(plain: list[NDArray[np.float32]], seed: int, n: int, *, spiked: float, zero: bool = False) -> Pair:
    """``n`` rows of each face: the first of ``plain``, below them extreme ones, their kind chosen by lot.

    ``spiked``: the share of spikes in a row that has them; ``zero``: rows of zeros too.
    """
    rng = np.random.default_rng(seed)
    extreme = n // 6
    shape = extreme, plain[0].shape[1]
    kinds: list[Callable[[], NDArray[Any]]] = [
        lambda: np.sign(rng.normal(size=shape)) * 250.0,
        lambda: np.broadcast_to(rng.normal(0.0, 1.0, (extreme, 1)), shape),
        lambda: rng.normal(size=shape) * 10.0 ** rng.uniform(0, 37, (extreme, 1)),
        lambda: np.where(rng.random(shape) < 0.5, np.inf, -np.inf),
        lambda: rng.integers(-5, 6, shape) * 1.4e-45,
        *([lambda: np.zeros(shape)] if zero else []),
        lambda: np.where(rng.random(shape) < spiked, rng.normal(0, 100.0, shape), rng.normal(0, 0.1, shape)),
    ]
    pair = []
    for face, choice in zip(plain, rng.integers(0, len(kinds), (2, extreme)), strict=True):
        drawn = np.stack([kind() for kind in kinds])[choice, np.arange(extreme)]
        pair.append(np.concatenate([face[: n - extreme], drawn]).astype(np.float32))
    return pair[0], pair[1]


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
    of_range = max(float(np.max(o / held_to(r))) for r, o in zip(reference, off, strict=True))
    return {
        "windows": sum(len(o) for o in off),
        "max_abs_diff": max(float(o.max()) for o in off),
        "max_diff_of_range": of_range,
        "tolerance": TOLERANCE,
        "ok": bool(of_range <= TOLERANCE),
    }


Arrays = list[NDArray[np.float64]]


def held_to(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of each output of ``reference`` [windows, outputs], and as much as makes :data:`STEPS` the tolerance at least."""
    rounding = STEPS * float(np.finfo(np.float32).eps) * np.abs(reference).max(axis=0)
    return np.maximum(np.ptp(reference, axis=0), rounding / TOLERANCE)


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
