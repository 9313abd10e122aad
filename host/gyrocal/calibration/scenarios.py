"""Many calibrations as arrays: their equations for the estimator, and scenarios drawn from the priors of a model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from gyrocal.calibration.estimator import BLOCK_US, Calibration, Posterior, posterior
from gyrocal.errors import InputError
from gyrocal.noise.whitening import Noise, normal_equations
from gyrocal.recording.session import AXES, Array, Run

FACES = ("up", "down")
Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class Protocol:
    """The protocol of a scenario: a turntable at one speed, first face up, then face down."""

    rate_hz: float = 145.0
    table_dps: float = 78.0
    power_on_s: tuple[float, float] = (3.0, 85.0)
    """Time since power-on of each face's first sample. The second face begins after 70 s and a flip."""

    def runs(self, seconds: float, axis: str = "z", temp_c: float = 25.0) -> tuple[Run, Run]:
        """The runs of both faces without readings: the true rate, time, gravity and temperature."""
        n = round(seconds * self.rate_hz)
        made = []
        for index, (face, power_on_s) in enumerate(zip(FACES, self.power_on_s, strict=True)):
            columns = {"t_s": np.round(np.arange(n) / self.rate_hz, 6)}
            columns |= {f"g{a}_dps": np.zeros(n) for a in AXES}
            columns |= {f"a{a}_g": np.full(n, (1.0 if face == "up" else -1.0) if a == axis else 0.0) for a in AXES}
            columns["temp_c"] = np.full(n, temp_c)
            made.append(
                Run(
                    index, f"{index:03d}_{face}.csv", "s000", face, axis, self.table_dps, None, None,  # type: ignore[arg-type]
                    power_on_s, self.rate_hz, frame=pl.DataFrame(columns),
                )
            )  # fmt: skip
        return made[0], made[1]


def regressors(calibration: Calibration, run: Run) -> Array:
    """[effect columns, bias, scale] of each sample, shape [q, n]."""
    axis, within = AXES.index(calibration.axis), calibration.fitted_on.clamped(run)
    return np.array([
        *(c.effect.columns(within, axis, c.values)[:, c.index] for c in calibration.columns),
        np.ones(len(run)), run.rate_dps,
    ])  # fmt: skip


def blocks_of(run: Run) -> tuple[Array, Array]:
    """Number of each block of 0.25 s and its number of samples. Blocks with fewer than half their samples are left out."""
    number, count = np.unique(run.t_us // BLOCK_US, return_counts=True)
    full = 2e6 * count >= run.sample_rate_hz * BLOCK_US
    return number[full].astype(float), count[full].astype(float)


def block_means(values: Array, run: Run) -> Array:
    """Means of samples [..., n] over the run's blocks, shape [..., blocks]."""
    number, count = blocks_of(run)
    first = np.searchsorted(run.t_us // BLOCK_US, number)
    stop = int(first[-1] + count[-1])
    return np.add.reduceat(values[..., :stop], first, axis=-1) / count


def equations(
    calibration: Calibration, run: Run, residual_dps: Array, *, by_sample: bool = False, blocks: bool = False
) -> Array:  # fmt: skip
    """The whitened normal equations of many runs that differ only in their readings, shape [n, q, q].

    ``residual_dps`` [n, samples] is the measured minus the true rate, ``blocks`` [n, blocks] its block means. The equations are
    those of block means as on the device, or of samples with ``by_sample``.
    """
    x, y = regressors(calibration, run), np.asarray(residual_dps, float)
    if by_sample:
        t_s, count = run.t_s - run.t_s[0], np.ones(len(run))
    else:
        number, count = blocks_of(run)
        t_s, x = number * BLOCK_US * 1e-6, block_means(x, run)
        y = y if blocks else block_means(y, run)
    q = len(x)
    parts = []
    for chunk in np.array_split(y, max(1, len(y) // 500)):
        gram = normal_equations(np.concatenate([x, chunk])[None], t_s, count, calibration.noise)[0][0]
        out = np.empty((len(chunk), q + 1, q + 1))
        out[:, :q, :q] = gram[:q, :q]
        out[:, :q, q] = out[:, q, :q] = gram[q:, :q]
        out[:, q, q] = np.diag(gram)[q:]
        parts.append(out)
    return np.concatenate(parts)


def answers(
    calibration: Calibration, up_dps: Array, down_dps: Array, seconds: float, protocol: Protocol, *,
    by_sample: bool = False, blocks: bool = False,
) -> Posterior:  # fmt: skip
    """Scale and bias of many scenarios from the first ``seconds`` of each face.

    ``up_dps`` and ``down_dps`` [n, samples] are measured minus true rates of at least this duration. ``blocks`` holds their
    block means instead.
    """
    runs = protocol.runs(seconds, calibration.axis)
    grams = [
        equations(calibration, run, y if blocks else y[:, : len(run)], by_sample=by_sample, blocks=blocks)
        for run, y in zip(runs, (up_dps, down_dps), strict=True)
    ]
    chunks = np.array_split(np.arange(len(up_dps)), 1 + len(up_dps) // 250)
    parts = [posterior(calibration, [g[rows] for g in grams]) for rows in chunks]
    return Posterior(*(np.concatenate([getattr(p, name) for p in parts]) for name in Posterior.__dataclass_fields__))


class Drawn(NamedTuple):
    """Simulated calibrations: measured minus true rate of both faces [n, m], deg/s, and their true scale and bias [n]."""

    up: Array
    down: Array
    scale: Array
    bias_dps: Array


class Simulation:
    """Scenarios drawn from the priors of a calibration: its effects with their spreads, scale, bias and noise.

    They are block means of 0.25 s, or samples with ``by_sample``.
    """

    def __init__(self, calibration: Calibration, protocol: Protocol, seconds: float, *, by_sample: bool = False) -> None:
        spreads = [c.sd for c in calibration.columns] + [calibration.bias_dps[1], calibration.scale[1]]
        if not np.isfinite(spreads).all():
            raise InputError(
                f"model {calibration.name}: how scale, bias and effects are spread is not known, so nothing can be drawn; "
                "fit it to a campaign of three power cycles or more with `gyrocal add`"
            )
        self.calibration = calibration
        runs = protocol.runs(seconds, calibration.axis)
        columns = [regressors(calibration, run) for run in runs]
        number, count = blocks_of(runs[0])
        self.t_s = runs[0].t_s if by_sample else number * BLOCK_US * 1e-6
        self._white_dps = calibration.noise.white_sd_dps / np.sqrt(1.0 if by_sample else count)
        self._columns = columns if by_sample else [block_means(c, run) for c, run in zip(columns, runs, strict=True)]

    def draw(self, n: int, rng: np.random.Generator) -> Drawn:
        """``n`` calibrations with effects, noise and drift drawn from the calibration's priors."""
        calibration = self.calibration
        own, k, a = calibration.run_columns, len(calibration.run_columns), calibration.alternatives
        bias_dps, scale = rng.normal(*calibration.bias_dps, n), rng.normal(*calibration.scale, n)
        shared = [rng.normal(c.mean, c.sd, n) for c in calibration.shared_columns]
        common = np.column_stack([*shared, bias_dps, scale])
        faces = []
        for columns in self._columns:
            y = common @ columns[k:]
            plain = rng.normal([c.mean for c in own[: k - a]], [c.sd for c in own[: k - a]], (n, k - a))
            y += plain @ columns[: k - a]
            if a:
                chosen = k - a + rng.integers(0, a, n)
                size = rng.normal(np.array([c.mean for c in own])[chosen], np.array([c.sd for c in own])[chosen])
                y += size[:, None] * columns[chosen]
            y += rng.standard_normal(y.shape) * self._white_dps
            y += drift(calibration.noise, float(self.t_s[1] - self.t_s[0]), y.shape, rng)
            faces.append(y)
        return Drawn(faces[0], faces[1], scale, bias_dps)


class Faces:
    """Faces drawn from the effects and the noise of a calibration, without scale and bias, at a positive true rate.

    A face has ``n_columns`` means of ``pool`` samples each at the rate ``protocol.rate_hz``. Drift is constant within a mean.
    Each effect of a face is multiplied by a factor that is drawn evenly on a logarithmic scale from 1/spread to spread.
    """

    def __init__(
        self, calibration: Calibration, protocol: Protocol, n_columns: int, pool: int, spread: float = 1.0
    ) -> None:
        if not np.isfinite([c.sd for c in calibration.columns]).all():
            raise InputError(
                f"model {calibration.name}: how its effects are spread is not known, so nothing can be drawn; "
                "fit it to a campaign of three power cycles or more with `gyrocal add`"
            )
        self.calibration, self.protocol, self._spread = calibration, protocol, spread
        n = n_columns * pool
        # half a sample more than asked for, so that rounding leaves none out
        runs = protocol.runs((n + 0.5) / protocol.rate_hz, calibration.axis)
        effects = [regressors(calibration, run)[:-2, :n].reshape(-1, n_columns, pool).mean(-1) for run in runs]
        self._effects = [(sign * x).astype(np.float32) for sign, x in zip((1.0, -1.0), effects, strict=True)]
        self._white_dps = calibration.noise.white_sd_dps / np.sqrt(pool)
        self._apart_s = pool / protocol.rate_hz

    def draw(self, n: int, rng: np.random.Generator) -> Float32:
        """Measured minus true rate [n, n_columns], float32, dps. The second half are faces down with their sign turned."""
        return np.concatenate([self._face(m, x, rng) for m, x in zip((n - n // 2, n // 2), self._effects, strict=True)])

    def _face(self, n: int, effects: Float32, rng: np.random.Generator) -> Float32:
        columns, a = self.calibration.columns, self.calibration.alternatives
        last = len(self.calibration.run_columns)
        mean, sd = (np.array(x, np.float32) for x in ([c.mean for c in columns], [c.sd for c in columns]))
        plain = np.r_[: last - a, last : len(columns)]
        ids, kind = np.unique([c.effect.id for c in columns], return_inverse=True)
        size = self._spread ** rng.uniform(-1, 1, (n, len(ids))).astype(np.float32)
        normal = rng.standard_normal((n, len(plain)), dtype=np.float32)
        y: Float32 = ((mean[plain] + sd[plain] * normal) * size[:, kind[plain]]) @ effects[plain]
        if a:
            chosen = last - a + rng.integers(0, a, n)
            drawn = mean[chosen] + sd[chosen] * rng.standard_normal(n, dtype=np.float32)
            y += (drawn * size[:, kind[last - 1]])[:, None] * effects[chosen]
        y += np.float32(self._white_dps) * rng.standard_normal(y.shape, dtype=np.float32)
        return y + drift(self.calibration.noise, self._apart_s, y.shape, rng).astype(np.float32)


def drift(noise: Noise, apart_s: float, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Ornstein-Uhlenbeck drift [n, m] at m equally spaced times."""
    from scipy.signal import lfilter

    if noise.ou_sd_dps <= 0:
        return np.zeros(shape)
    phi = float(np.exp(-apart_s / noise.ou_tau_s))
    shocks = rng.standard_normal(shape) * noise.ou_sd_dps * np.sqrt(1 - phi**2)
    shocks[:, 0] /= np.sqrt(1 - phi**2)
    return np.asarray(lfilter([1.0], [1.0, -phi], shocks, axis=1))
