"""Delay of the reading."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from gyrocal.effects.base import Effect, Law, Objection, Parameter, Values
from gyrocal.effects.sampling_fault import SamplingFault
from gyrocal.effects.timing import TimingEffect
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Run
from gyrocal.recording.timing import Motion, Timing


class Lag(TimingEffect):
    id = "lag"
    title = "Lag of the reading"
    cause = (
        "The chip's low-pass filter, the wait until the chip is polled and the transport each delay the reading by "
        "milliseconds, and the reference's clock may have an offset. The reading lags behind a changing rate; a "
        "constant rate does not show the delay. tau_s is the group delay at low frequencies. If the rate changes slowly "
        "compared with it, a delay and a first-order low-pass are equivalent. If it changes fast, only the low-pass also "
        "makes the motion smaller."
    )
    equation = "w(t - tau_s) - w(t), or w behind a first-order low-pass of time constant tau_s"
    uncorrected = "undoing a low-pass would amplify the noise; shift the times by tau_s instead"
    looks_like = "clock_error within a short run (it grows with time, a lag does not)"
    measure_next = "swing the table, or start and stop it, for a minute, and record its encoder as rate_ref_dps"
    parameters = (
        Parameter(
            "tau_s",
            "s",
            (0.0005, 0.02),
            "LSM6DSO datasheet: low-pass of 33-136 Hz is 1-5 ms, and polling at 145 Hz up to 7 ms",
            0.005,
            sized=False,
        ),
        Parameter(
            "order",
            "poles",
            (0.0, 1.0),
            "0 = pure delay, 1 = first-order low-pass; the fit takes the likelier one",
            0.0,
            (0.0, 1.0),
            sized=False,
        ),
    )
    linear, chosen = ("tau_s",), ("order",)
    law = Law({"tau_s": 0.004}, None, degree=1)

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """A late reference makes the reading lead, and so does friction, unless that is the main cause.

        Repeated readings make a delay on average, whether or not they are among the ``known`` effects.
        """
        tau_s = values.get("tau_s", 0.0)
        if tau_s < 0:
            yield Objection.MINOR
        found = SamplingFault().detect(runs, axis)
        late = 0.0 if found is None else SamplingFault.late_samples(found.values)
        if abs(tau_s) < POLICY.late_repeats * late / runs[0].sample_rate_hz:
            yield Objection.REPEATS

    def shapes(self, values: Mapping[str, float]) -> list[Values]:
        return [{**values, "order": order} for order in (0.0, 1.0)]

    def set(self, timing: Timing, values: Mapping[str, float]) -> Timing:
        tau_s = values.get("tau_s", 0.0)
        filtered = values.get("order", 0.0) == 1 and tau_s > 0
        return replace(timing, delay_s=0.0 if filtered else tau_s, filter_s=tau_s if filtered else 0.0)

    def derivative(self, motion: Motion, t_s: Array, timing: Timing) -> Array:
        return motion.by_filter(t_s, timing) if timing.filter_s > 0 else motion.by_delay(t_s, timing)
