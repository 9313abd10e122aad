"""By how many standard errors an effect stands out, and beside which rival by the fewest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import library, planting
from .library import LIMITS, MOST_TYPICAL, UNLIMITED, Shape
from .noise import Columns, Metric, beside
from .oracle import Oracle, Variant, typical_of
from .planting import DIGITAL, Planted
from .recording import AXES, Array, Recording, counts

if TYPE_CHECKING:
    from .drawn import Disturbance


@dataclass(frozen=True)
class Seen:
    """Standard errors of an effect alone, and beside each rival of physical size, on the axis that shows it best."""

    axis: str
    alone: float
    rivals: dict[str, float]

    @property
    def nearest(self) -> float:
        return min(self.rivals.values(), default=self.alone)

    @property
    def rival(self) -> str | None:
        """The nearest rival; None where nothing explains more of the effect than noise alone."""
        name = min(self.rivals, key=self.rivals.__getitem__, default=None)
        return name if name is not None and self.rivals[name] < 0.999 * self.alone else None

    @property
    def cosine(self) -> float:
        """Of the effect and its best imitation, beside scale and bias."""
        return float(np.sqrt(max(0.0, 1 - (self.nearest / self.alone) ** 2))) if self.alone else 1.0

    def cosine_beside(self, rival: str) -> float:
        """Of the effect and its imitation by one rival; 0 for an effect that is none."""
        return float(np.sqrt(max(0.0, 1 - (self.rivals.get(rival, self.alone) / self.alone) ** 2))) if self.alone else 1.0

    def times(self, factor: float) -> Seen:
        return replace(self, alone=self.alone * factor, rivals={k: v * factor for k, v in self.rivals.items()})

    def to_json(self) -> dict[str, Any]:
        equal = [name for name in self.rivals if self.cosine_beside(name) > 0.97]
        return {
            "axis": self.axis, "alone_sigma": self.alone, "nearest_sigma": self.nearest, "nearest": self.rival,
            "cosine": self.cosine, "equivalents": equal,
        }  # fmt: skip


class Judge:
    """Distances in one recording, whose ideal readings before any effect are known."""

    def __init__(self, made: Recording, ideal: list[Array]) -> None:
        self.made, self.ideal = made, ideal
        self.metrics = [Metric(made, axis) for axis in range(len(AXES))]

    def readings(self, planted: list[Planted], disturbance: Disturbance | None) -> list[Array]:
        """What the host reads, [3, n] of each run."""
        found = [reading.copy() for reading in self.ideal]
        for one in planted:
            if one.id not in DIGITAL:
                for total, signal in zip(found, planting.signal(one, self.made), strict=True):
                    total += signal
        if disturbance is not None:
            for total, part in zip(found, disturbance.signal, strict=True):
                total[disturbance.axis] += part
        read = counts(self.made, found)
        for one in planted:
            if one.id in DIGITAL:
                read = planting.damaged(one, self.made, read)
        return read

    def signal(self, one: Planted) -> list[Array]:
        """What an effect adds to the readings, [3, n] of each run."""
        if one.id not in DIGITAL:
            return planting.signal(one, self.made)
        sound = counts(self.made, self.ideal)
        return [d - s for d, s in zip(planting.damaged(one, self.made, sound), sound, strict=True)]

    def seen(self, one: Planted, others: list[Planted]) -> Seen:
        """How an effect stands out beside the other planted ones and each rival."""
        if one.id == "sampling_fault":
            return self._repeats(one)
        signals = self.signal(one)
        best = Seen(one.axes[0], 0.0, {})
        for axis in (AXES.index(name) for name in one.axes):
            beyond = [np.array([self.signal(o)[k][axis] for o in others if AXES[axis] in o.axes]) for k in range(len(signals))]
            base = [np.vstack([b, *m]) if m.size else b for b, m in zip(library.nuisance(self.made, axis), beyond, strict=True)]
            listed = list(library.shapes(self.made, axis, {one.id: one.parameters}))
            left_out = {one.id, *LIMITS.get(one.id, ())}
            alone, rivals = self.distances(axis, [s[axis] for s in signals], base, [s for s in listed if s.id not in left_out])
            if alone > best.alone:
                best = Seen(AXES[axis], alone, rivals)
        return best

    def distances(
        self, axis: int, signal: list[Array], base: Columns, rivals: list[Shape]
    ) -> tuple[float, dict[str, float]]:
        """Norm of a signal on one axis beside the ``base`` columns, and beside each rival as well."""
        gram, places = self._gram(axis, [np.vstack([s, b]) for s, b in zip(signal, base, strict=True)], rivals)
        known = list(range(1, 1 + base[0].shape[0]))
        alone = beside(gram, 0, known)[0]
        found: dict[str, float] = {}
        for shape, index in zip(rivals, places, strict=True):
            left, sizes = beside(gram, 0, known + index)
            if shape.id not in UNLIMITED:
                most = MOST_TYPICAL * np.array([t[1] for t in typical_of(shape.id, shape.columns[0].shape[0])])
                each = np.abs(sizes[len(known) :]).reshape(-1, most.size)
                left = alone if np.any(each > most) else left
            found[shape.id] = min(left, found.get(shape.id, np.inf))
        return alone, found

    def own_share(self, axis: int, signal: list[Array]) -> tuple[float, float, float]:
        """Norm beside scale and bias; the share left beside the best single effect, and beside all of them together."""
        rivals = list(library.shapes(self.made, axis, {}))
        base = library.nuisance(self.made, axis)
        gram, places = self._gram(axis, [np.vstack([s, b]) for s, b in zip(signal, base, strict=True)], rivals)
        known = list(range(1, 1 + base[0].shape[0]))
        alone = beside(gram, 0, known)[0]
        single = min((beside(gram, 0, known + index)[0] for index in places), default=alone)
        every = beside(gram, 0, known + [i for index in places for i in index], rcond=1e-7)[0]
        return alone, single / max(alone, 1e-300), every / max(alone, 1e-300)

    def _gram(self, axis: int, first: Columns, shapes: list[Shape]) -> tuple[Array, list[list[int]]]:
        """The products of the ``first`` columns and all shapes, and the places of each shape's columns."""
        together = [shape for shape in shapes if not shape.own]
        apart = [shape for shape in shapes if shape.own]
        runs = range(len(first))
        shared = [np.vstack([first[k], *(s.columns[k] for s in together)]) for k in runs]
        own = [np.vstack([s.columns[k] for s in apart]) for k in runs] if apart else None
        gram = self.metrics[axis].gram(shared, own)
        places: dict[int, list[int]] = {}
        at = first[0].shape[0]
        for shape in together:
            places[id(shape)] = list(range(at, at + shape.columns[0].shape[0]))
            at += shape.columns[0].shape[0]
        each = own[0].shape[0] if own else 0
        inside = 0
        for shape in apart:
            size = shape.columns[0].shape[0]
            places[id(shape)] = [at + each * k + inside + j for k in runs for j in range(size)]
            inside += size
        return gram, [places[id(shape)] for shape in shapes]

    def _repeats(self, one: Planted) -> Seen:
        """Repeated samples against those that chance makes, by the likelihood ratio of two Poisson counts."""
        sound = counts(self.made, self.ideal)
        chance = max(float(sum(np.all(r[:, 1:] == r[:, :-1], axis=0).sum() for r in sound)), 0.5)
        found = chance + one.parameters["fraction"] * self.made.samples
        return Seen("x", float(np.sqrt(2 * (found * np.log(found / chance) - found + chance))), {})

    def oracle(self, axis: int, planted: list[Planted], disturbance: Disturbance | None, readings: list[Array]) -> Oracle:
        """The best possible answer on an axis. The planted effects' shapes are known."""
        made = self.made
        here = [one for one in planted if AXES[axis] in one.axes]
        listed = list(library.shapes(made, axis, {one.id: one.parameters for one in here}))
        listed = [shape for shape in listed if shape.id not in {one.id for one in here}]
        first: Columns = []
        signals = [self.signal(one) for one in here]
        for k, run in enumerate(made.runs):
            ideal = (1 + made.sensor.scale[axis]) * (run.w[axis] + run.ref_error[axis]) + made.sensor.bias_dps[axis]
            rows = [readings[k][axis] - ideal, *library.nuisance(made, axis)[k]]
            if disturbance is not None and disturbance.axis == axis:
                rows.append(disturbance.signal[k])
            first.append(np.array([*rows, *(s[k][axis] / one.unit for s, one in zip(signals, here, strict=True))]))
        gram, places = self._gram(axis, first, listed)
        at = first[0].shape[0] - len(here)
        variants: dict[str, list[Variant]] = {}
        for k, one in enumerate(here):
            variants[one.id] = [Variant((at + k,), typical_of(one.id, 1))]
        for shape, index in zip(listed, places, strict=True):
            columns = shape.columns[0].shape[0]
            typical = typical_of(shape.id, columns) * (len(index) // columns)
            variants.setdefault(shape.id, []).append(Variant(tuple(index), typical))
        return Oracle(gram, 0, list(range(1, at)), variants, frozenset(one.id for one in here))
