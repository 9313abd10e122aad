"""How many samples a second `Model.corrector()` corrects, one by one and as a batch: `python benchmarks/corrector.py`."""

import time

import numpy as np

from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model
from gyrocal.error_model.term import Term

SAMPLES, TIMES = 100_000, 5
LINEAR = [
    *(("scale", axis, {"scale": 0.01}) for axis in "xyz"), *(("bias", axis, {"bias_dps": 0.3}) for axis in "xyz"),
    ("misalignment", "x", {"m_y": 0.01, "m_z": -0.02}),
]  # fmt: skip
THERMAL = [*LINEAR, *(("bias_temperature", axis, {"k1_dps_per_c": 0.02, "k2_dps_per_c2": -1e-3}) for axis in "xyz")]
OF_RATE = [*THERMAL, ("scale_temperature", "z", {"k_per_c": 1e-4}), ("scale_nonlinearity", "z", {"k3": 2e-9})]
MODELS = {
    "scale, bias, misalignment": LINEAR, "and bias over temperature of three axes": THERMAL,
    "and two effects that depend on the rate": OF_RATE,
}  # fmt: skip


def main() -> None:
    rng = np.random.default_rng(0)
    readings, temp_c = rng.uniform(-200, 200, (SAMPLES, 3)), rng.uniform(0, 50, SAMPLES)
    samples = list(zip(readings.tolist(), temp_c.tolist(), strict=True))
    print("| model | samples/s, one by one | samples/s, batch |\n| --- | ---: | ---: |")
    for name, terms in MODELS.items():
        corrector = Model(name, tuple(Term.of(effect(i), axis, values) for i, axis, values in terms)).corrector()
        single, batch = [], []
        for _ in range(TIMES):
            start = time.process_time()
            for reading, temp in samples:
                corrector(reading, temp)
            middle = time.process_time()
            corrector.batch(readings, temp_c)
            single.append(middle - start)
            batch.append(time.process_time() - middle)
        rates = " | ".join(f"{SAMPLES / min(took):,.0f}".replace(",", " ") for took in (single, batch))
        print(f"| {name} | {rates} |")


if __name__ == "__main__":
    main()
