"""Network `gyrocal` in integers (GC_NET_FIXED) beside float32: the errors of both on the same readings, as a Markdown table.

The readings are those of `gyrocal benchmark paper` (its seeds, flat priors) and of `gyrocal benchmark population` (its kinds of
tables and sensors). Both networks are run by the C core on raw counts. The last column is the largest difference of a scale or
a bias over its standard error.

python -m benchmarks.fixed_point                    prints it (half a minute)
python -m benchmarks.fixed_point docs/network.md    puts it between the marks in that file
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from benchmarks.cpus import put
from benchmarks.paper import SEEDS
from benchmarks.paper_campaign import FIRST_SEED, MOST, SECONDS, Campaign
from benchmarks.population import KINDS, SEED, SENSORS, W_DPS, Population

from gyrocal.calibration.network import FaceAnswers, merge
from gyrocal.core.networks import CoreFaceNetwork
from gyrocal.recording.session import Array
from gyrocal.simulation.simulate import LSB_DPS

BEGIN, END = "<!-- table: python -m benchmarks.fixed_point docs/network.md -->\n", "<!-- end of table -->\n"
COLUMNS = ("readings", "first", "scale, %", "in integers", "bias, mdps", "in integers", "largest difference")
PERCENT_MDPS = np.array([100.0, 1000.0])


@dataclass(frozen=True)
class Readings:
    """Counts of both faces [N, samples of 6 s], and the true scale and bias (dps) [N, 2] for each number of seconds."""

    name: str
    faces: tuple[Array, Array]
    truth: dict[float, Array]


def readings() -> Iterator[Readings]:
    """The campaign of the paper, then each kind of population."""
    campaigns = [Campaign.draw(FIRST_SEED + seed) for seed in range(SEEDS)]
    up, down = (np.concatenate([getattr(c, face)[:, :MOST] for c in campaigns]) for face in ("up", "down"))
    truth = np.concatenate([c.truth for c in campaigns])
    yield Readings("`paper`", _counts(up, down), dict.fromkeys(SECONDS, truth))
    for i, (name, kind) in enumerate(KINDS.items()):
        drawn = Population.draw(SENSORS, kind, SEED + i)
        told = {s: np.column_stack([drawn.scale, drawn.bias_dps[s]]) for s in SECONDS}
        yield Readings(f"`population`, {name}", _counts(*(face[:, :MOST] for face in drawn.faces)), told)


def _counts(*faces: Array) -> tuple[Array, Array]:
    up, down = (np.rint((y.astype(float) + w) / LSB_DPS) for y, w in zip(faces, W_DPS, strict=True))
    return up, down


def answers(net: CoreFaceNetwork, faces: tuple[Array, Array], stage: int) -> Array:
    """Scale, bias (dps) and their standard errors, [N, 4]; NaN where a face is out of the network's range."""
    n = (stage + 1) * MOST // len(SECONDS)
    found = []
    for counts, w_dps in zip(faces, W_DPS, strict=True):
        u_dps, precision = net.face(counts[:, :n], stage, LSB_DPS, w_dps).T
        found.append(FaceAnswers(w_dps, u_dps, precision, np.isfinite(u_dps)))
    return merge(*found)


def rows() -> Iterator[list[str]]:
    """A row for each kind of readings and number of seconds."""
    nets = [CoreFaceNetwork(fixed=fixed) for fixed in (False, True)]
    for drawn in readings():
        for stage, seconds in enumerate(SECONDS):
            floats, integers = (answers(net, drawn.faces, stage) for net in nets)
            known = np.isfinite(floats[:, 0])
            rms = [np.sqrt(np.mean((y[known, :2] - drawn.truth[seconds][known]) ** 2, axis=0)) for y in (floats, integers)]
            shown, change = rms[0] * PERCENT_MDPS, rms[1] / rms[0] - 1
            apart = np.abs(integers - floats)[known, :2] / floats[known, 2:]
            yield [
                drawn.name, f"{seconds:g} s", f"{shown[0]:.5f}", f"{change[0]:+.3%}", f"{shown[1]:.3f}", f"{change[1]:+.3%}",
                f"{apart.max():.3f} se",
            ]  # fmt: skip


def main() -> None:
    lines = ["| " + " | ".join(COLUMNS) + " |", "| --- | --- |" + " ---: |" * (len(COLUMNS) - 2)]
    lines += ["| " + " | ".join(row) + " |" for row in rows()]
    put("\n".join(lines) + "\n", BEGIN, END)


if __name__ == "__main__":
    main()
