"""What a finding says agrees with the residual that a picture draws: its variable, period, window, phase and size.

The residual is computed here from the session's arrays: readings minus scale and bias of one least-squares fit in numpy.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.drawn_size import described, drawn_power
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.inference.fitted import AxisFit
from gyrocal.present.report import verdict_text
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from gyrocal.variables.shapes import Steps
from known import ON_X, ON_Z
from make_runs import Array, make_run, make_session

RATE_HZ, SECONDS, NOISE_DPS, WITHIN = 50.0, 24.0, 0.02, 0.2
T_S = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
SEEDS = [0, pytest.param(1, marks=pytest.mark.wide)]
NUMBER = r"([+-]?[\d.]+(?:e[+-]?\d+)?)"


@dataclass
class Recorded:
    """A session with its arrays [runs, n]."""

    rate_dps: Array
    temp_c: Array
    angle_deg: Array
    planted_dps: Array
    reading_dps: Array
    session: Session
    truth: dict[str, float] = field(default_factory=dict)

    @property
    def residual_dps(self) -> Array:
        """Readings minus scale and bias, by least squares on all samples, shape [runs, n]."""
        known = np.column_stack([self.rate_dps.ravel(), np.ones(self.rate_dps.size)])
        known = known if np.ptp(self.rate_dps) else known[:, 1:]
        y = self.reading_dps.ravel()
        return np.asarray(y - known @ np.linalg.lstsq(known, y, rcond=None)[0]).reshape(self.reading_dps.shape)


def recorded(
    rng: np.random.Generator, planted: Callable[[Recorded], Array], rates_dps: tuple[float, ...], *, encoder: bool = False,
    runs: int = 8,
) -> Recorded:  # fmt: skip
    """Power cycles of 24 s at 50 Hz, whose temperature and table angle begin anywhere; ``planted`` [runs, n] is on z."""
    shape = (runs, T_S.size)
    rate_dps = np.broadcast_to(np.resize(rates_dps, runs)[:, None], shape)
    angle_deg = rng.uniform(0, 360, (runs, 1)) + rate_dps * T_S
    temp_c = 30 + 6 * np.sin(2 * np.pi * T_S / 41 + rng.uniform(0, 2 * np.pi, (runs, 1)))
    out = Recorded(rate_dps, temp_c, angle_deg, np.zeros(shape), np.zeros(shape), None)  # type: ignore[arg-type]
    out.planted_dps = np.broadcast_to(planted(out), shape)
    noise = rng.normal(0, NOISE_DPS, (runs, T_S.size, 3))
    gyro = noise + np.stack([0 * rate_dps, 0 * rate_dps, 1.003 * rate_dps + 0.05 + out.planted_dps], axis=-1)
    out.reading_dps = gyro[:, :, 2]
    made = []
    for i in range(runs):
        columns = {"temp_c": temp_c[i] + rng.normal(0, 0.02, T_S.size)} | ({"table_angle_deg": angle_deg[i]} if encoder else {})
        made.append(make_run(T_S, gyro[i], table_rate_dps=float(rate_dps[i, 0]), scenario=f"s{i}", day=1 + i % 3, **columns))
    out.session = make_session(*made)
    return out


def first_on_z(made: Recorded) -> Finding:
    """The strongest finding. There is no other on another axis or against another variable, as there is one cause."""
    found = measure(made.session).where
    assert {(f.axis, f.against) for f in found} == {("z", found[0].against)}
    return found[0]


def number(note: str, pattern: str) -> float:
    found = re.search(pattern, note)
    assert found is not None, note
    return float(found[1])


def window(note: str, unit: str) -> tuple[float, float]:
    """The window that the words name, in its unit."""
    for pattern, low, high in (
        (rf"below {NUMBER} {unit}$", None, 1), (rf"from {NUMBER} to {NUMBER} {unit}$", 1, 2),
        (rf"from {NUMBER} {unit} up$", 1, None),
    ):  # fmt: skip
        found = re.search(pattern, note)
        if found:
            return float(found[low]) if low else -np.inf, float(found[high]) if high else np.inf
    raise AssertionError(note)


def drawn_rms_dps(made: Recorded) -> float:
    """The rms of means over half a second of the residual, without their noise."""
    size = round(RATE_HZ / 2)
    means = made.residual_dps.reshape(len(made.reading_dps), -1, size).mean(axis=2)
    return float(np.sqrt(np.mean((means - means.mean()) ** 2) - NOISE_DPS**2 / size))


def check_window(made: Recorded, finding: Finding, values: Array, unit: str) -> None:
    """The window's mean residual about the mean of all, and the rms of the whole, as they are said."""
    low, high = window(finding.note, unit)
    inside = (values >= low) & (values < high)
    drawn = made.residual_dps[inside].mean() - made.residual_dps.mean()
    assert number(finding.note, rf"mostly {NUMBER} mdps") == pytest.approx(1e3 * drawn, rel=WITHIN)
    assert number(finding.note, rf"^rms {NUMBER} mdps") == pytest.approx(1e3 * drawn_rms_dps(made), rel=WITHIN)
    assert finding.amplitude_dps == pytest.approx(np.sqrt(2) * drawn_rms_dps(made), rel=WITHIN)


SHAPES: dict[str, Callable[[Array], Array]] = {
    "line": lambda u: u, "square": lambda u: u**2, "kink": lambda u: np.maximum(u, 0), "step": lambda u: np.sign(u - 0.2),
    "wave": lambda u: np.sin(np.pi * u), "bump": lambda u: np.exp(-((u / 0.4) ** 2)),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_a_curve_over_temperature(shape: str) -> None:
    rng = np.random.default_rng(sum(map(ord, shape)))
    size = rng.uniform(0.03, 0.3) * rng.choice([-1, 1])
    made = recorded(rng, lambda r: size * SHAPES[shape]((r.temp_c - 30) / 6), (0.0, 60.0, -60.0))
    first = first_on_z(made)
    assert first.against == "temperature"
    check_window(made, first, made.temp_c, "°C")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_curve_over_the_time_of_a_run(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size, tau_s = rng.uniform(0.05, 0.3) * rng.choice([-1, 1]), rng.uniform(3, 12)
    made = recorded(rng, lambda r: size * np.exp(-T_S / tau_s), (70.0, -70.0))
    first = first_on_z(made)
    assert first.against == "time"
    check_window(made, first, np.broadcast_to(T_S, made.temp_c.shape), "s")


@pytest.mark.parametrize("seed", range(6))
def test_a_wave_of_the_table(seed: int) -> None:
    """Its number per turn, its size, and whether the runs agree in its phase; with and without an encoder."""
    rng = np.random.default_rng(seed)
    order, size, encoder, common = int(rng.integers(1, 6)), rng.uniform(0.02, 0.2), bool(seed % 2), seed % 3 != 0
    starts = np.zeros(8) if common else rng.uniform(0, 2 * np.pi, 8)

    def planted(r: Recorded) -> Array:
        angle = np.deg2rad(r.angle_deg if encoder else r.rate_dps * T_S)
        return size * np.cos(order * angle + starts[:, None])

    made = recorded(rng, planted, (78.0,), encoder=encoder)
    first = first_on_z(made)
    turned = np.deg2rad(made.angle_deg if encoder else made.rate_dps * T_S)
    waves = 2 * np.mean(made.residual_dps * np.exp(-1j * order * turned), axis=1)
    of_one_phase = abs(waves.sum()) > 0.9 * np.abs(waves).sum()
    if encoder and not common:  # no wave of the encoder's angle; whatever is said is no wave of a common phase
        assert "of the same phase" not in first.note
        return
    assert first.against == "table_angle"
    assert ("once per turn" if order == 1 else f"{order} per turn") in first.note
    assert ("of the same phase in each run" in first.note) == of_one_phase
    drawn = float(np.sqrt(np.mean(np.abs(waves) ** 2)))
    assert number(first.note, rf"{NUMBER} mdps (?:once|\d)") == pytest.approx(1e3 * drawn, rel=WITHIN)
    assert first.amplitude_dps == pytest.approx(drawn, rel=WITHIN)


@pytest.mark.parametrize("seed", range(2))
def test_a_transient_of_each_run(seed: int) -> None:
    rng = np.random.default_rng(seed)
    alike = seed % 2 == 0
    sizes = rng.uniform(0.2, 0.4) * (np.ones(8) if alike else rng.normal(0, 1, 8))
    made = recorded(rng, lambda r: sizes[:, None] * np.exp(-T_S / 1.0), (70.0, -70.0))
    told = first_on_z(made)
    assert told.against == "time"
    if told.note.startswith("rms"):
        assert alike
        check_window(made, told, np.broadcast_to(T_S, made.temp_c.shape), "s")
        return
    tau_s = number(told.note, rf"about {NUMBER} s")
    known = np.column_stack([np.ones(T_S.size), np.exp(-T_S / tau_s)])
    fitted = np.array([np.linalg.lstsq(known, y, rcond=None)[0][1] for y in made.residual_dps])
    assert number(told.note, rf"^{NUMBER} mdps") == pytest.approx(1e3 * float(np.sqrt(np.mean(fitted**2))), rel=WITHIN)
    assert ("much the same size" in told.note) == (np.std(fitted) < 0.3 * abs(fitted.mean()))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_tone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hz, size = rng.uniform(2, 20), rng.uniform(0.01, 0.1)
    made = recorded(rng, lambda r: size * np.sin(2 * np.pi * hz * T_S + rng.uniform(0, 6.3, (8, 1))), (60.0, -60.0, 30.0))
    first = first_on_z(made)
    assert first.against == "frequency"
    told_hz = number(first.note, rf"at {NUMBER} Hz")
    assert told_hz == pytest.approx(hz, abs=1 / SECONDS)
    near_hz = told_hz + np.linspace(-0.05, 0.05, 41)
    lines = [np.abs(2 * np.mean(made.residual_dps * np.exp(-2j * np.pi * f * T_S), axis=1)) for f in near_hz]
    drawn = float(np.sqrt(max(np.mean(line**2) for line in lines)))
    assert number(first.note, rf"{NUMBER} mdps") == pytest.approx(1e3 * drawn, rel=WITHIN)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_difference_between_rates(seed: int) -> None:
    """A square of the rate, at five rates."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.05, 0.3) * rng.choice([-1, 1])
    made = recorded(rng, lambda r: size * (r.rate_dps / 90) ** 2, (0.0, 40.0, -60.0, 90.0, -90.0), runs=15)
    first = first_on_z(made)
    assert first.against == "rate"
    check_window(made, first, made.rate_dps, "dps")


@pytest.mark.parametrize("effect", ["once per turn", "transient"])
def test_a_large_wave_leaks_into_no_other_test(effect: str) -> None:
    """It was told besides as a line of 1 Hz, as a transient and as steps in time, which no picture shows."""
    rng = np.random.default_rng(5)
    begin = rng.uniform(0, 2 * np.pi, (8, 1))
    sizes = rng.normal(0, 1, (8, 1))
    signal = {
        "once per turn": lambda r: 0.8 * np.cos(np.deg2rad(r.rate_dps * T_S) + begin),
        "transient": lambda r: 0.5 * sizes * np.exp(-T_S / 1.0),
    }[effect]
    made = recorded(rng, signal, (78.0, -78.0))
    assert {f.against for f in measure(made.session).where} == {"table_angle" if effect == "once per turn" else "time"}


@pytest.mark.parametrize("times_rate", [False, True])
def test_a_run_without_the_variable_belongs_to_no_step(times_rate: bool) -> None:
    """A shape over the temperature describes the runs with a thermometer, and nothing of a run without one."""
    rng = np.random.default_rng(0)
    temp_c = np.linspace(20, 40, T_S.size)
    size_dps = np.where(temp_c > 30, 0.2, 0.0)
    shape = Steps(lambda run: run.temp_c, np.array([30.0]), times_rate)

    def read(rate_dps: float, effect_dps: float | Array) -> Array:
        noise = 0.02 * rng.standard_normal((T_S.size, 3))
        noise[:, 2] += rate_dps + effect_dps
        return noise

    def fitted(*, last: bool) -> AxisFit:
        runs = [
            make_run(T_S, read(r, size_dps * (r / 10 if times_rate else 1)), table_rate_dps=r, temp_c=temp_c, scenario=f"s{k}")
            for k, r in enumerate([10.0, -10.0])
        ]
        bare = make_run(T_S, read(10.0, 0.0), table_rate_dps=10.0, scenario="s9")
        return measure(make_session(*runs, *([bare] if last else [])), ON_Z).fit.axes["z"]

    amplitude, _ = described(fitted(last=True), shape)
    assert amplitude == pytest.approx(described(fitted(last=False), shape)[0], rel=0.2)
    of_all, of_two = (drawn_power(f, Finding("z", "temperature", 9.0, 0.0, amplitude, "", shape)) for f in
                      (fitted(last=True), fitted(last=False)))  # fmt: skip
    assert 0.4 * of_two < of_all < 1.2 * of_two


@dataclass
class Moved:
    """Eight runs: the true rate and the planted error of z [runs, n], the noise [runs, 3, n], and what ``make_run`` is told."""

    rate_dps: Array
    planted_dps: Array
    noise_dps: Array
    keys: list[dict[str, Any]]

    def session(self) -> Session:
        t_s, made = T_S[: self.rate_dps.shape[1]], []
        for i, keys in enumerate(self.keys):
            gyro = np.column_stack([*self.noise_dps[i, :2], self.noise_dps[i, 2] + 1.003 * self.rate_dps[i] + 0.05])
            gyro[:, 2] += self.planted_dps[i]
            made.append(make_run(t_s, gyro, **({"scenario": f"s{i}", "day": 1 + i % 3} | keys)))
        return make_session(*made)

    def drawn_dps(self) -> Array:
        """Readings of z minus scale and bias, by least squares on all samples, shape [runs, n]."""
        known = np.column_stack([self.rate_dps.ravel(), np.ones(self.rate_dps.size)])
        y = (self.planted_dps + self.noise_dps[:, 2]).ravel()
        return np.asarray(y - known @ np.linalg.lstsq(known, y, rcond=None)[0]).reshape(self.rate_dps.shape)

    def check(self, against: str, pattern: str, columns: Array) -> re.Match[str]:
        """The strongest finding: its variable, its words, and its rms beside that of the drawn residual's part in columns."""
        first = measure(self.session(), ON_Z).where[0]
        assert first.against == against, first.note
        y = self.drawn_dps().ravel()
        known = np.column_stack([np.ones(y.size), columns.reshape(y.size, -1)])
        part = (known @ np.linalg.lstsq(known, y, rcond=None)[0]).reshape(self.rate_dps.shape)
        assert number(first.note, rf"{NUMBER} mdps") == pytest.approx(1e3 * float(np.std(part)), rel=WITHIN), first.note
        said = re.search(pattern, first.note)
        assert said is not None, first.note
        return said


def noise(rng: np.random.Generator) -> Array:
    """White noise [runs, 3, n], deg/s."""
    return rng.normal(0, NOISE_DPS, (8, 3, T_S.size))


@pytest.mark.parametrize("seed", SEEDS)
def test_friction_is_told_between_a_rising_and_a_falling_rate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * T_S / 6 + rng.uniform(0, 2 * np.pi, (8, 1))
    rate_dps, rises = 60 * np.sin(phase), np.sign(np.cos(phase))
    size = rng.uniform(0.03, 0.2) * rng.choice([-1, 1])
    moved = Moved(rate_dps, size * rises, noise(rng), [{"rate_ref_dps": r} for r in rate_dps])
    moved.check("direction", "between a rate that rises and one that falls$", rises)


@pytest.mark.parametrize("seed", SEEDS)
def test_an_offset_of_one_direction_of_the_table_is_told_by_its_sign(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rates = np.array([30.0, 60.0, 90.0, -30.0, -60.0, -90.0, 30.0, -30.0])
    rate_dps = np.broadcast_to(rates[:, None], (8, T_S.size))
    sense = np.sign(rate_dps)
    size = rng.uniform(0.1, 0.3) * rng.choice([-1, 1])
    moved = Moved(rate_dps, size * sense, noise(rng), [{"table_rate_dps": r} for r in rates])
    said = moved.check("direction", rf"mostly {NUMBER} mdps, the table's (negative|positive) direction", sense)
    drawn = moved.drawn_dps()
    inside = sense < 0 if said[2] == "negative" else sense > 0
    assert float(said[1]) == pytest.approx(1e3 * (drawn[inside].mean() - drawn.mean()), rel=WITHIN)


@pytest.mark.parametrize("seed", SEEDS)
def test_an_offset_of_one_face_is_told_by_the_face(seed: int) -> None:
    rng = np.random.default_rng(seed)
    faces = np.array([1, -1, 1, -1, 1, -1, 1, -1])
    tables = np.array([40.0, 40.0, -40.0, -40.0, 80.0, 80.0, -80.0, -80.0])
    rate_dps = np.broadcast_to((faces * tables)[:, None], (8, T_S.size))
    up = np.broadcast_to(faces[:, None], rate_dps.shape)
    size = rng.uniform(0.05, 0.2) * rng.choice([-1, 1])
    keys = [{"table_rate_dps": r, "face": "up" if f > 0 else "down"} for r, f in zip(tables, faces, strict=True)]
    moved = Moved(rate_dps, size * up, noise(rng), keys)
    said = moved.check("face", rf"mostly {NUMBER} mdps, face (up|down)$", up)
    assert float(said[1]) == pytest.approx(1e3 * size * (1 if said[2] == "up" else -1), rel=WITHIN)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_part_in_proportion_to_the_acceleration_has_its_size(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sway = np.sin(2 * np.pi * T_S / 11 + rng.uniform(0, 2 * np.pi, (8, 1)))
    rate_dps = np.broadcast_to(np.resize([50.0, -50.0], 8)[:, None], sway.shape)
    size = rng.uniform(0.03, 0.2) * rng.choice([-1, 1])
    keys = [
        {"table_rate_dps": rate_dps[i, 0], "ax_g": 0.5 * sway[i] + rng.normal(0, 1e-3, T_S.size), "ay_g": 0.0, "az_g": 1.0}
        for i in range(8)
    ]  # fmt: skip
    Moved(rate_dps, size * sway, noise(rng), keys).check("acceleration", "in proportion to the acceleration$", sway)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_curve_over_the_time_since_power_on_has_its_window_and_size(seed: int) -> None:
    rng = np.random.default_rng(seed)
    on_s = np.linspace(1, 170, 8)
    since_s = on_s[:, None] + T_S
    rate_dps = np.broadcast_to(np.resize([50.0, -50.0], 8)[:, None], since_s.shape)
    size = rng.uniform(0.3, 0.6) * rng.choice([-1, 1])
    keys = [{"table_rate_dps": rate_dps[i, 0], "power_on_s": on_s[i], "scenario": "s0", "day": 1} for i in range(8)]
    moved = Moved(rate_dps, size * np.exp(-since_s / 40), noise(rng), keys)
    first = measure(moved.session(), ON_Z).where[0]
    assert first.against == "power_on_time", first.note
    low, high = window(first.note, "s")
    drawn = moved.drawn_dps()
    inside = (since_s >= low) & (since_s < high)
    assert number(first.note, rf"mostly {NUMBER} mdps") == pytest.approx(1e3 * (drawn[inside].mean() - drawn.mean()), WITHIN)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_tone_of_a_broken_number_per_turn_is_told_on_an_axis_across_the_table_s(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rates, order, size = np.array([60.0, 90.0, 120.0, -75.0] * 2), rng.choice([3.5, 4.25, 6.5]), rng.uniform(0.03, 0.1)
    wave = size * np.sin(order * np.deg2rad(rates[:, None] * T_S) + rng.uniform(0, 2 * np.pi, (8, 1)))
    made = []
    for i, rate in enumerate(rates):
        gyro = rng.normal(0, NOISE_DPS, (T_S.size, 3)) + np.column_stack([wave[i], 0 * T_S, 0 * T_S + 1.003 * rate])
        made.append(make_run(T_S, gyro, table_rate_dps=rate, scenario=f"s{i}", day=1 + i % 3))
    first = measure(make_session(*made), ON_X).where[0]
    assert first.against == "order", first.note
    assert number(first.note, rf"{NUMBER} per turn") == pytest.approx(order, abs=0.02)
    assert number(first.note, rf"{NUMBER} mdps") == pytest.approx(1e3 * size, rel=WITHIN)
    assert first.amplitude_dps == pytest.approx(size, rel=WITHIN)


@pytest.mark.parametrize("seed", SEEDS)
def test_small_rates_with_another_scale_are_told_by_their_level(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * T_S / 12 + rng.uniform(0, 2 * np.pi, (8, 1))
    rate_dps = 80 * np.sin(phase) ** 3
    missing = np.where(np.abs(rate_dps) < 10, -rng.uniform(0.02, 0.05) * rate_dps, 0.0)
    moved = Moved(rate_dps, missing, noise(rng), [{"rate_ref_dps": r} for r in rate_dps])
    first = measure(moved.session(), ON_Z).where[0]
    assert first.against == "level", first.note
    low, high = window(first.note, "dps")
    inside = (np.abs(rate_dps) >= low) & (np.abs(rate_dps) < high)
    drawn = moved.drawn_dps()
    of_rate = float(drawn[inside] @ rate_dps[inside] / (rate_dps[inside] @ rate_dps[inside]))
    whole = float(drawn.ravel() @ rate_dps.ravel() / np.sum(rate_dps**2))
    assert number(first.note, rf"mostly {NUMBER}% of the rate") == pytest.approx(100 * (of_rate - whole), rel=WITHIN)


@pytest.mark.wide
@pytest.mark.parametrize("seed", [31, pytest.param(32, marks=pytest.mark.wide)])
def test_a_ramp_of_the_temperature_in_each_run_is_no_start_up_transient(seed: int) -> None:
    """It was told as a transient of 11 mdps of another size in each run, before or without 139 mdps against the temperature."""
    found = measure(simulate(None, "bench", ["bias_temperature"], seed)[0])
    assert {f.axis for f in found.where} == set("xyz")
    assert {f.against for f in found.where} == {"temperature"}


def test_what_is_larger_than_any_sensor_has_it_is_told_with_its_size_and_not_named() -> None:
    """It was "no effect of the library", although one had its course."""
    rng, t_s, runs = np.random.default_rng(9), np.arange(3000) / 50, []
    for k in range(4):
        gyro = rng.normal(rng.normal(0, 0.01, 3), 0.03, (t_s.size, 3))
        gyro[:, 2] += 1.2 * np.exp(-(t_s + 2.0) / 20)
        runs.append(make_run(t_s, gyro, table_rate_dps=0.0, scenario=f"s{k}", rate_hz=50.0, power_on_s=2.0))
    found = diagnose(make_session(*runs), ON_Z)
    assert found.verdict == "unknown"
    assert not [c for c in found.candidates if c.decision == "add"]
    assert "It has the course of warmup" in verdict_text(found)
    assert "more than 10 times the largest size that is usual" in verdict_text(found)
