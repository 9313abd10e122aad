"""The C kernels, in float32 and in integers, against onnxruntime on the quantised graphs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrocal.calibration.network import STAGES_S, FaceNetwork, Network, open_network
from gyrocal.core.networks import CoreFaceNetwork, CoreNetwork
from gyrocal.errors import GyrocalError, InputError
from gyrocal.simulation.simulate import LSB_DPS, WHITE_SD_DPS, paper_windows
from gyrocal_firmware import INCLUDE

TOLERANCE = 2e-6
"""The largest allowed difference, as a fraction of an output's range over the windows."""
STEPS = 4
"""Steps of float32 at an output's largest value that are always allowed: the range of an output that hardly varies is no
measure of rounding."""

INTEGERS_MAX, INTEGERS_RMS = 0.5, 0.02
"""The largest and the rms difference that the layers in integers (GC_NET_FIXED) may have, in standard errors of the answer.
Over the first ten seeds with 300 windows, half of which are unlike any table's, they are 0.25 and 0.010."""

Float = NDArray[np.float64]
Pair = tuple[NDArray[np.float32], NDArray[np.float32]]


def windows(net: Network, seed: int, n: int = 1200) -> Pair:
    """Draw ``n`` pairs of windows, [n, window] each in dps, from the paper's campaign; a sixth of them are extreme.

    Extreme windows hold saturated (+-250 dps), constant, huge, infinite, denormal or zero readings, or a single spike.
    """
    per_run = max(1, (6 * 145) // net.window)
    data = paper_windows(-(-(n - n // 6) // per_run), seed, seconds=per_run * net.window / 145)
    plain = [data[face].reshape(-1, net.window) for face in ("up", "down")]
    return _with_extremes(plain, seed, n)


def counts(net: FaceNetwork, seed: int, n: int) -> dict[str, NDArray[np.int16]]:
    """Draw ``n`` runs of ``up`` and ``down`` in raw counts, [n, samples of 6 s], half of them of the kinds of :func:`_odd`."""
    data = paper_windows(n - n // 2, seed)
    rng = np.random.default_rng(seed)
    out = {}
    for face, w_dps in (("up", net.table_dps), ("down", -net.table_dps)):
        plain = np.rint((data[face] + w_dps) / LSB_DPS)
        odd = np.rint((w_dps + rng.normal(0.0, 3.0, (n // 2, 1)) + _odd(net, rng, n // 2, plain.shape[1])) / LSB_DPS)
        out[face] = np.concatenate([plain, odd]).clip(-32768, 32767).astype(np.int16)
    return out


def _odd(net: FaceNetwork, rng: np.random.Generator, n: int, samples: int) -> NDArray[np.float64]:
    """Draw deviations [n, samples] that no turntable shows, up to the network's range or beyond it; the kinds are random.

    All of them have a sensor's white noise, except for constant readings.
    """
    t = np.linspace(-1.0, 1.0, samples)
    size = rng.uniform(0, 1, (n, 1)) * net.column_range_dps
    cycles = rng.uniform(0.3, 40.0, (n, 1))
    shape = n, samples
    kinds = [
        size * np.sin(np.pi * cycles * (t + rng.uniform(0, 1, (n, 1)))),
        size * np.sign(t - rng.uniform(-0.9, 0.9, (n, 1))),
        size * t,
        (rng.random(shape) < 0.01) * net.sample_range_dps / 2,
        (rng.random(shape) < 1 / samples) * 249.0,
        np.sign(rng.normal(size=shape)) * 250.0,
    ]
    noisy = np.stack(kinds) + rng.normal(0.0, WHITE_SD_DPS, shape)
    return np.concatenate([noisy, np.zeros((1, *shape))])[rng.integers(0, len(kinds) + 1, n), np.arange(n)]


def _with_extremes(plain: list[NDArray[np.float32]], seed: int, n: int) -> Pair:
    """``n`` rows of each face: first those of ``plain``, then extreme ones of random kinds."""
    rng = np.random.default_rng(seed)
    extreme = n // 6
    shape = extreme, plain[0].shape[1]
    kinds: list[Callable[[], NDArray[Any]]] = [
        lambda: np.sign(rng.normal(size=shape)) * 250.0,
        lambda: np.broadcast_to(rng.normal(0.0, 1.0, (extreme, 1)), shape),
        lambda: rng.normal(size=shape) * 10.0 ** rng.uniform(0, 37, (extreme, 1)),
        lambda: np.where(rng.random(shape) < 0.5, np.inf, -np.inf),
        lambda: rng.integers(-5, 6, shape) * 1.4e-45,
        lambda: np.zeros(shape),
        lambda: np.where(rng.random(shape) < 0.01, rng.normal(0, 100.0, shape), rng.normal(0, 0.1, shape)),
    ]
    pair = []
    for face, choice in zip(plain, rng.integers(0, len(kinds), (2, extreme)), strict=True):
        drawn = np.stack([kind() for kind in kinds])[choice, np.arange(extreme)]
        pair.append(np.concatenate([face[: n - extreme], drawn]).astype(np.float32))
    return pair[0], pair[1]


def verify(onnx: Path | None = None, header: Path | None = None, seed: int = 0, n: int = 1200) -> dict[str, Any]:
    """Run the C core and onnxruntime on the same windows.

    Args:
        onnx: a quantised graph; the shipped ones by default.
        header: the ``weights.h`` made from it; the shipped one by default.

    Returns:
        ``windows``, ``max_abs_diff`` over all outputs (`paper`: scale, bias in dps; `gyrocal`, of
        each face: u less its mean and the logarithm of its precision, in units), ``max_diff_of_range`` (each
        difference over the range of its output), ``tolerance`` on that, and ``ok``. For `gyrocal` also ``integers_max_of_se``
        and ``integers_rms_of_se``: the differences of the layers in integers over the answer's standard error, those of the
        correction and of the standard error itself; None for `paper`.

    Raises:
        InputError: a file cannot be used, or the two files hold different networks.
    """
    path = header or INCLUDE / "weights.h"
    if onnx is not None:
        net = open_network(onnx)
        face_net = net if isinstance(net, FaceNetwork) else None
        found = [_paper(net, path, seed, n) if isinstance(net, Network) else _gyrocal(net, path, seed, n)]
    else:
        face_net = FaceNetwork.shipped() if CoreNetwork(path).convnet else None
        found = [_gyrocal(face_net, path, seed, n)] if face_net else []
        if CoreNetwork(path).window or not found:
            found.append(_paper(Network.shipped(), path, seed, n))
    reference = [x for of_net, _ in found for x in of_net]
    off = [x for _, of_net in found for x in of_net]
    of_range = max(float(np.max(o / held_to(r))) for r, o in zip(reference, off, strict=True))
    of_se = None if face_net is None else integers_of_se(face_net, path, seed, n)
    largest, rms = (None, None) if of_se is None else (float(of_se.max()), float(np.sqrt(np.mean(of_se**2))))
    return {
        "windows": sum(len(o) for o in off),
        "max_abs_diff": max(float(o.max()) for o in off),
        "max_diff_of_range": of_range,
        "tolerance": TOLERANCE,
        "integers_max_of_se": largest,
        "integers_rms_of_se": rms,
        "ok": of_range <= TOLERANCE and (largest is None or rms is None or (largest <= INTEGERS_MAX and rms <= INTEGERS_RMS)),
    }


Arrays = list[Float]


def held_to(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """The range of each output of ``reference`` [windows, outputs], raised so that the tolerance is at least :data:`STEPS`."""
    rounding = STEPS * float(np.finfo(np.float32).eps) * np.abs(reference).max(axis=0)
    return np.maximum(np.ptp(reference, axis=0), rounding / TOLERANCE)


def _paper(net: Network, header: Path, seed: int, n: int) -> tuple[Arrays, Arrays]:
    """The answers of onnxruntime, and the differences of the C core from them."""
    core = CoreNetwork(header)
    _same(net, core, ("window", "rate_hz", "table_dps"))
    up, down = windows(net, seed, n)
    reference = net.estimate(up, down, net.table_dps, -net.table_dps).astype(np.float64)
    return [reference], [np.abs(core.run(up, down, net.table_dps, -net.table_dps) - reference)]


def _gyrocal(net: FaceNetwork, header: Path, seed: int, n: int) -> tuple[Arrays, Arrays]:
    pairs = list(_faces(net, CoreFaceNetwork(header), seed, n))
    return [np.concatenate([want for want, _ in pairs])], [np.concatenate([np.abs(got - want) for want, got in pairs])]


def integers_of_se(net: FaceNetwork, header: Path, seed: int, n: int) -> NDArray[np.float64]:
    """The differences of the layers in integers from onnxruntime, over the standard error of the answer: [faces, 2].

    The first is that of the correction, the second that of the standard error itself.
    """
    return np.concatenate([
        np.abs(got - want) * np.column_stack([np.exp(want[:, 1] / 2), np.full(len(want), 0.5)])
        for want, got in _faces(net, CoreFaceNetwork(header, fixed=True), seed, n)
    ])  # fmt: skip


def _faces(net: FaceNetwork, core: CoreFaceNetwork, seed: int, n: int) -> Iterator[tuple[Float, Float]]:
    """The outputs of onnxruntime and of the core for the faces within the range of the training data, stage by stage."""
    _same(net, core, ("rate_hz", "table_dps", "unit_dps", "column_range_dps", "sample_range_dps"))
    drawn = counts(net, seed, n)
    for stage in range(len(STAGES_S)):
        for face, w_dps in (("up", net.table_dps), ("down", -net.table_dps)):
            x = drawn[face][:, : net.samples(stage)]
            want = net.infer(x * LSB_DPS - w_dps, stage, w_dps)
            got = core.infer(x, stage, LSB_DPS, w_dps).astype(np.float64)
            known = np.isfinite(want[:, 0])
            if not np.array_equal(known, np.isfinite(got[:, 0])):
                raise GyrocalError(f"{core.source}: not the range of {net.source}: export both together")
            yield want[known], got[known]


def _same(net: Network | FaceNetwork, core: CoreNetwork | CoreFaceNetwork, names: tuple[str, ...]) -> None:
    ours, theirs = ([np.float32(getattr(of, name)) for name in names] for of in (core, net))
    if ours != theirs:
        said = [", ".join(f"{value:g}" for value in values) for values in (ours, theirs)]
        raise InputError(
            f"{core.source}: {', '.join(names[:-1])} and {names[-1]} are {said[0]}; "
            f"those of {net.source} are {said[1]}: export both together"
        )
