"""Sensitivity of the rate to gravity and acceleration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np

from gyrocal.effects.base import AtSample, Case, Effect, Law, Objection, Parameter, Values, stack
from gyrocal.effects.earth_rate import in_plane_dps, may_be_in_plane
from gyrocal.effects.mistaken import once_per_turn
from gyrocal.effects.optional import CourseWithoutData
from gyrocal.effects.order_tone import mean_wave_per_turn
from gyrocal.effects.quantities import acceleration_by_second, acceleration_g, pose_changes
from gyrocal.recording.once import once_a_run
from gyrocal.recording.session import Array, Run

COMPONENTS = {"gx_dps_per_g": 0, "gy_dps_per_g": 1, "gz_dps_per_g": 2}
LEAST_CHANGE_G = 0.05
LEAST_TILT_G = 0.005
"""Amplitude of a component once per turn, from which on a tilted table shows it. At 0.1 dps/g it makes 0.5 mdps."""


class GSensitivity(Effect, CourseWithoutData):
    id = "g_sensitivity"
    title = "Sensitivity to gravity and acceleration"
    cause = (
        "Acceleration bends the suspension of the vibrating mass, and the electrodes read part of the "
        "displacement as a rate. Turning the part over changes gravity by 2 g, so the bias differs between face up "
        "and face down. On a tilted table the error repeats once per turn."
    )
    equation = "gx_dps_per_g·ax + gy_dps_per_g·ay + gz_dps_per_g·az"
    requires = ("ax_g", "ay_g", "az_g")
    looks_like = (
        "scale, if the table turns one way and only the face changes (0.1 dps/g looks like 0.13 % at "
        "78 dps); misalignment at one rate; table_ripple on a tilted table"
    )
    measure_next = (
        "the same face with the table turning the other way, and both faces at rest, with the accelerometer recorded"
    )
    parameters = tuple(
        Parameter(
            name,
            "dps/g",
            (0.005, 0.1),
            "consumer MEMS gyroscopes (IEEE Std 952: acceleration-sensitive drift)",
            default,
        )
        for name, default in (("gx_dps_per_g", 0.02), ("gy_dps_per_g", 0.02), ("gz_dps_per_g", 0.05))
    )
    linear = tuple(COMPONENTS)
    origin_free = True
    on_device, device_columns = True, COMPONENTS
    law = Law(
        {"gx_dps_per_g": 0.01, "gy_dps_per_g": -0.02, "gz_dps_per_g": 0.05}, "0.01*ax - 0.02*ay + 0.05*az"
    )
    cases = (
        Case({"gx_dps_per_g": 0.0, "gy_dps_per_g": 0.0, "gz_dps_per_g": 0.05}, ("gz_dps_per_g",), "full"),
    )

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if self._moving(runs) else "ax_g, ay_g and az_g columns, and two poses (turn the part over)"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """Every combination of the components that change by more than an accelerometer's noise."""
        names = self._moving(runs) or list(self.linear)
        return [dict.fromkeys(chosen, 0.0) for k in range(1, len(names) + 1) for chosen in combinations(names, k)]

    def unmeasured(self, run: Run, axis: int) -> Array | None:
        """Gravity along the table's axis, of which the face says the sign."""
        return np.full(len(run), run.face_sign) if run.acc_g is None else None

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        acc_g = acceleration_g(run)
        if acc_g is None:
            return np.zeros((len(run), len(self.coding.used(values))))
        return stack(*(acc_g[:, COMPONENTS[name]] for name in self.coding.used(values)))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        x, y, z = (values.get(name, 0.0) for name in COMPONENTS)
        return lambda rate_dps, temp_c, power_on_s, acc_g: x * acc_g[0] + y * acc_g[1] + z * acc_g[2]

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """The Earth's rate once per turn, on an axis in the plane of a table whose angle is known in each run."""
        known = all(r.column("table_angle_deg") is not None for r in runs)
        return [once_per_turn()] if known and in_plane_dps(runs, axis) > 0 else []

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """On an axis in the table's plane, what only turns through gravity may be the Earth's rate, of any phase."""
        turning = {name: tilt_g for name, tilt_g in self._turning_g(runs).items() if name in values}
        posed = self._posed(runs) if turning else []
        waves_dps = [values[name] * tilt_g for name, tilt_g in turning.items() if name not in posed]
        if waves_dps and may_be_in_plane(runs, axis, float(np.linalg.norm(waves_dps))):  # they are a quarter of a turn apart
            yield Objection.REPEATS

    def _moving(self, runs: Sequence[Run]) -> list[str]:
        """Components that change by more than noise."""
        moving = {*self._posed(runs), *self._turning_g(runs)}
        return [name for name in COMPONENTS if name in moving]

    @staticmethod
    def _posed(runs: Sequence[Run]) -> list[str]:
        """Those that change between poses."""
        if not pose_changes(runs):
            return []
        means = [seconds for r in runs if (seconds := acceleration_by_second(r)) is not None]
        moved_g = np.ptp(np.vstack(means), axis=0)
        return [name for name, i in COMPONENTS.items() if moved_g[i] >= LEAST_CHANGE_G]

    @staticmethod
    def _turning_g(runs: Sequence[Run]) -> dict[str, float]:
        """Those that change once per turn of a tilted table, each with the amplitude of its wave, g."""
        of_runs = [wave_g for r in runs for wave_g in _waves_g(r)]
        tilt_g = np.median(of_runs, axis=0) if of_runs else np.zeros(3)
        return {name: float(tilt_g[i]) for name, i in COMPONENTS.items() if tilt_g[i] >= LEAST_TILT_G}


@once_a_run
def _waves_g(run: Run) -> list[Array]:
    """Amplitude of each component's wave once per turn, shape [3], g, in a list.

    None of a run without an accelerometer or of less than a turn.
    """
    acc_g = acceleration_g(run)
    return [] if acc_g is None else [np.abs(wave) for wave in mean_wave_per_turn(run, acc_g)]
