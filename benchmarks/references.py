"""References about three axes in a frame and by a clock of their own: error over standard error.

    python benchmarks/references.py [SESSIONS]

Each session is a smooth random motion (sums of sines, up to 2 Hz) seen by a sensor with a planted scale, misalignment and bias,
and by a reference that is rotated by 0 to 180 deg, late or early by up to 2 s, by a clock that drifts by some 30 ppm, with
noise. Sample rates, sizes of the motion and noises vary from session to session. The spread of the error over its standard
error should be within 0.85 to 1.2, widened to what the number of sessions can tell.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

Array = NDArray[Any]
BAND = (0.85, 1.2)
SINES = 12


@dataclass(frozen=True)
class Planted:
    """What a session is made with. ``rotation_deg`` is the alignment, ``matrix`` the symmetric scale and misalignment."""

    rotation_deg: Array
    offset_s: float
    drift: float
    matrix: Array
    bias_dps: Array
    motion_dps: float
    noise_dps: float
    ref_noise_dps: float
    rate_hz: float
    seconds: float = 60.0

    @staticmethod
    def draw(rng: np.random.Generator) -> Planted:
        axis = rng.normal(size=3)
        across = rng.normal(0.0, 0.004, 3)
        matrix = np.eye(3) + np.diag(rng.normal(0.0, 0.01, 3))
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            matrix[i, j] = matrix[j, i] = across[k]
        return Planted(
            axis / np.linalg.norm(axis) * rng.uniform(0, 180), rng.uniform(-2, 2), rng.normal(0, 3e-5), matrix,
            rng.normal(0, 1, 3), rng.choice([20.0, 60.0, 150.0]), rng.choice([0.02, 0.05, 0.1]), rng.choice([0.02, 0.05, 0.2]),
            rng.choice([50.0, 100.0, 200.0]),
        )  # fmt: skip


def turned(rotation_deg: Array, rates_dps: Array) -> Array:
    """Rates [n, 3] rotated by a rotation vector (Rodrigues), written out so that it shares nothing with the library."""
    angle = np.deg2rad(np.linalg.norm(rotation_deg))
    k = rotation_deg / max(float(np.linalg.norm(rotation_deg)), 1e-300)
    along = np.outer(rates_dps @ k, k)
    across = np.cross(np.broadcast_to(k, rates_dps.shape), rates_dps)
    return np.asarray(along + (rates_dps - along) * np.cos(angle) + across * np.sin(angle))


def session(planted: Planted, rng: np.random.Generator) -> Any:
    """A session of one run with ``ref_x_dps, ref_y_dps, ref_z_dps`` and ``clock = "own"``."""
    from gyrocal.recording.header import Reference
    from gyrocal.recording.session import Run, Session

    t_s = np.arange(int(planted.seconds * planted.rate_hz)) / planted.rate_hz
    f_hz, phase = rng.uniform(0.1, 2.0, (SINES, 3)), rng.uniform(0, 2 * np.pi, (SINES, 3))
    size = rng.normal(0, planted.motion_dps / np.sqrt(SINES / 2), (SINES, 3))

    def motion(at_s: Array) -> Array:
        waves = (a * np.sin(2 * np.pi * f * at_s[:, None] + p) for a, f, p in zip(size, f_hz, phase, strict=True))
        return np.asarray(sum(waves))

    true = turned(planted.rotation_deg, motion((1 + planted.drift) * t_s - planted.offset_s))
    gyro = true @ planted.matrix.T + planted.bias_dps + rng.normal(0, planted.noise_dps, true.shape)
    ref = motion(t_s) + rng.normal(0, planted.ref_noise_dps, true.shape)
    columns = {f"g{a}_dps": gyro[:, i] for i, a in enumerate("xyz")} | {f"ref_{a}_dps": ref[:, i] for i, a in enumerate("xyz")}
    reference = Reference(clock="own")
    frame = pl.DataFrame({"t_s": t_s, **columns})
    run = Run(
        0, "000_up.csv", "s000", "up", "z", None, None, None, None, planted.rate_hz, frame=frame, reference=reference,
    )  # fmt: skip
    return Session(planted.rate_hz, (run,), reference=reference)


def errors(planted: Planted, rng: np.random.Generator) -> dict[str, float]:
    """Error over standard error of every parameter of one session."""
    from gyrocal.error_model.model import Model
    from gyrocal.inference.fit import fit

    model = Model.builtin("default")
    for axis in "xyz":
        model = model.add("misalignment", axis)
    found = fit(session(planted, rng), model)
    truth = {"offset_s": planted.offset_s, "e": planted.drift} | dict(
        zip(("rx_deg", "ry_deg", "rz_deg"), _nearest(planted.rotation_deg, found), strict=True)
    )
    out = {name: (value - truth[name]) / se for _, name, value, se in found.session.registration_parameters}
    for term in found.model.terms:
        i = "xyz".index(term.axis)
        for name, value in term.values.items():
            if name == "scale":
                out["scale"] = (value - (planted.matrix[i, i] - 1)) / term.se[name]
            elif name.startswith("m_"):
                out["misalignment"] = (value - planted.matrix[i, "xyz".index(name[-1])]) / term.se[name]
    return out


def _nearest(rotation_deg: Array, found: Any) -> Array:
    """Of the two rotation vectors of one rotation, the one nearer to that which was found."""
    other = rotation_deg * (1 - 360 / max(float(np.linalg.norm(rotation_deg)), 1e-300))
    estimate = np.array(found.session.registration_fit.registration.rotation_deg)
    return min((rotation_deg, other), key=lambda r: float(np.linalg.norm(r - estimate)))


def spreads(seeds: range) -> dict[str, Array]:
    """Errors over standard errors by parameter over sessions with these seeds; one scale and misalignment of each session."""
    out: dict[str, list[float]] = defaultdict(list)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        for name, z in errors(Planted.draw(rng), rng).items():
            out[name].append(z)
    return {name: np.array(z) for name, z in out.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", type=int, nargs="?", default=200)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    options = parser.parse_args()
    begun = time.perf_counter()
    print("| parameter | sessions | mean of z | spread of z | largest z | |\n| --- | --- | --- | --- | --- | --- |")
    for name, z in spreads(range(options.first, options.first + options.sessions)).items():
        wide = 2 / np.sqrt(2 * z.size)
        told = "" if BAND[0] - wide <= z.std() <= BAND[1] + wide else "out"
        print(f"| `{name}` | {z.size} | {z.mean():.2f} | {z.std():.2f} | {np.abs(z).max():.2f} | {told} |")
    print(f"{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
