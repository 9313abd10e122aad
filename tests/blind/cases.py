"""The blind cases: fixed sessions with fixed seeds, written down before any tool was run on them.

Sizes: "small" stands out by 8 to 14 standard errors for one who knows its shape and the noise (see
`generator.detectability`; the test beside this file holds that), "large" is three times that. Over tens of thousands of
samples this is far below the design's typical sizes (ripple 0.05-0.5 % a turn, warm-up 5-50 mdps, bias 10 mdps/degC):
a tool that finds the small ones finds the typical ones. Four effects are sized otherwise: `bias_jumps` so that each
single step stands out, for its time is to be found as well; `quantization` by the steps of the sensor's coarser ranges;
`saturation` by the runs that it touches (some of the fastest, or all); `sampling_fault` by the share of samples.

turn_on_bias and colored_noise are the noise of these sessions, earth_rate is computed from the latitude: none of the
three is ever missing, so they appear among the nulls.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from .generator.case import AXES, Case, Effect

SECONDS = {"paper": 30.0, "full": 15.0, "swing": 20.0}

# The protocols whose data show the effect apart from scale, bias, turn-on bias and the other effects. clock_error and
# lag need a rate that changes, nonlinearity and saturation a high one; at one rate misalignment passes for gravity.
IDENTIFIED_IN: dict[str, tuple[str, ...]] = {
    "bias_temperature": ("paper", "full", "swing"),
    "scale_temperature": ("paper", "full", "swing"),
    "thermal_lag": ("paper", "full", "swing"),
    "warmup": ("paper", "full", "swing"),
    "drift": ("paper", "full", "swing"),
    "table_ripple": ("paper", "full", "swing"),
    "vibration_tone": ("paper", "full", "swing"),
    "spin_up": ("paper", "full", "swing"),
    "g_sensitivity": ("full", "swing"),
    "misalignment": ("full", "swing"),
    "scale_nonlinearity": ("full",),
    "scale_asymmetry": ("full", "swing"),
    "centripetal": ("full", "swing"),
    "lag": ("swing",),
    "clock_error": ("swing",),
    "bias_jumps": ("paper", "full", "swing"),
    "quantization": ("paper", "full", "swing"),
    "saturation": ("full",),
    "sampling_fault": ("paper", "full", "swing"),
}


@dataclass(frozen=True)
class _Planted:
    """An effect at its small size. `role`: the table's axis ("table"), in its plane ("first", "second"), or "all"."""

    id: str
    role: str
    parameters: Mapping[str, float]
    sized_by: tuple[str, ...]
    large: float = 3.0
    rivals: tuple[str, ...] = ()
    settings: Mapping[str, Any] | None = None

    def on(self, table_axis: str, factor: float = 1.0) -> Effect:
        start = AXES.index(table_axis)
        axes = {
            "table": table_axis,
            "first": AXES[(start + 1) % 3],
            "second": AXES[(start + 2) % 3],
            "all": AXES,
        }[self.role]
        parameters = {
            name.replace("g_table", f"g{table_axis}"): value * (factor if name in self.sized_by else 1.0)
            for name, value in self.parameters.items()
        }
        return Effect(self.id, parameters, axes)


CHAMBER = {"climate": "chamber"}

PAPER = {
    "bias_temperature": _Planted(
        "bias_temperature", "first", {"k1_dps_per_c": 1.5e-3}, ("k1_dps_per_c",), settings=CHAMBER
    ),
    "scale_temperature": _Planted("scale_temperature", "table", {"k_per_c": 2e-5}, ("k_per_c",), settings=CHAMBER),
    "thermal_lag": _Planted("thermal_lag", "second", {"k_dps_s_per_c": 0.017}, ("k_dps_s_per_c",), settings=CHAMBER),
    "warmup": _Planted(
        "warmup", "first", {"A_dps": 0.015, "tau_s": 15.0}, ("A_dps",), rivals=("drift",), settings=CHAMBER
    ),
    "drift": _Planted(
        "drift", "second", {"k_dps_per_s": 1.5e-4}, ("k_dps_per_s",), rivals=("warmup",), settings=CHAMBER
    ),
    "table_ripple": _Planted("table_ripple", "table", {"amplitude_1": 3e-5, "phase_1_deg": 40.0}, ("amplitude_1",)),
    "vibration_tone": _Planted("vibration_tone", "first", {"f_hz": 23.7, "A_dps": 2.4e-3}, ("A_dps",)),
    "spin_up": _Planted("spin_up", "table", {"A": 1.5e-4, "tau_s": 2.0}, ("A",)),
    "bias_jumps": _Planted("bias_jumps", "table", {"n": 6, "size_dps": 0.02}, ("size_dps",)),
    "quantization": _Planted("quantization", "all", {"lsb_dps": 0.0175}, ("lsb_dps",), large=4.0),
    "sampling_fault": _Planted("sampling_fault", "all", {"fraction": 0.005}, ("fraction",), large=4.0),
}

FULL = {
    "bias_temperature": _Planted(
        "bias_temperature",
        "second",
        {"k1_dps_per_c": 1.5e-3, "k2_dps_per_c2": 2e-4},
        ("k1_dps_per_c", "k2_dps_per_c2"),
        settings=CHAMBER,
    ),
    "scale_temperature": replace(PAPER["scale_temperature"], parameters={"k_per_c": 2.5e-5}),
    "thermal_lag": replace(PAPER["thermal_lag"], parameters={"k_dps_s_per_c": 0.02}),
    "warmup": replace(PAPER["warmup"], parameters={"A_dps": 0.012, "tau_s": 6.0}),
    "drift": replace(PAPER["drift"], parameters={"k_dps_per_s": 4e-4}),
    "table_ripple": _Planted(
        "table_ripple",
        "table",
        {"amplitude_1": 2e-5, "phase_1_deg": 200.0, "amplitude_3": 1.5e-5, "phase_3_deg": 75.0},
        ("amplitude_1", "amplitude_3"),
        settings={"table_angle": True},
    ),
    "vibration_tone": replace(PAPER["vibration_tone"], role="table", parameters={"f_hz": 61.3, "A_dps": 2.3e-3}),
    "spin_up": replace(PAPER["spin_up"], parameters={"A": 1.0e-4, "tau_s": 1.0}),
    "g_sensitivity": _Planted("g_sensitivity", "table", {"g_table_dps_per_g": 0.017}, ("g_table_dps_per_g",)),
    "misalignment": _Planted("misalignment", "first", {"m": 1.8e-4}, ("m",)),
    "scale_nonlinearity": _Planted("scale_nonlinearity", "table", {"k3": 2.5e-8}, ("k3",)),
    "scale_asymmetry": _Planted("scale_asymmetry", "table", {"k": 3e-4}, ("k",), rivals=("centripetal",)),
    # an accelerometer would see the arm's acceleration and call it g_sensitivity, rightly: without one w^2 is the name
    "centripetal": _Planted(
        "centripetal",
        "table",
        {"k": 1.8e-6},
        ("k",),
        rivals=("scale_asymmetry",),
        settings={"accelerometer": False},
    ),
    "bias_jumps": replace(PAPER["bias_jumps"], role="first", parameters={"n": 6, "size_dps": 0.03}),
    "quantization": PAPER["quantization"],
    "saturation": _Planted(
        "saturation",
        "table",
        {"full_scale_dps": 125.0},
        (),
        settings={"full_scale_dps": 125.0, "rates_dps": (30.0, 78.0, 125.0), "rate_spread": 0.015},
    ),
    "sampling_fault": PAPER["sampling_fault"],
}

SWING = {
    "lag": _Planted("lag", "table", {"tau_s": 6e-4}, ("tau_s",), rivals=("clock_error",)),
    "clock_error": _Planted("clock_error", "table", {"e": 5e-5}, ("e",), rivals=("lag",)),
}

CONFOUNDED = {
    "g_sensitivity": replace(FULL["g_sensitivity"], rivals=("scale",)),
    "scale_nonlinearity": replace(FULL["scale_nonlinearity"], rivals=("scale",)),
    "scale_asymmetry": replace(FULL["scale_asymmetry"], rivals=("bias",)),
    "centripetal": replace(FULL["centripetal"], rivals=("bias",)),
    "clock_error": replace(SWING["clock_error"], rivals=("scale",), large=10.0),
    "misalignment": replace(FULL["misalignment"], rivals=("g_sensitivity",)),
}

PAIRS = [
    ("paper", "table_ripple", "spin_up"),
    ("paper", "warmup", "table_ripple"),
    ("paper", "bias_temperature", "vibration_tone"),
    ("paper", "scale_temperature", "bias_temperature"),
    ("paper", "thermal_lag", "table_ripple"),
    ("full", "drift", "misalignment"),
    ("full", "g_sensitivity", "table_ripple"),
    ("full", "scale_nonlinearity", "g_sensitivity"),
    ("full", "misalignment", "vibration_tone"),
    ("full", "spin_up", "scale_asymmetry"),
]

# Outside the library. None is a sum of its effects: cycles of random length, an order that is no whole number,
# a frequency that wanders or sweeps, a code that never occurs.
UNKNOWN = [
    ("paper", _Planted("stick_slip", "table", {"amplitude": 6e-4, "period_s": 0.8, "spread": 0.25}, ())),
    ("full", _Planted("stuck_bit", "second", {"bit": 3}, ())),
    ("full", _Planted("gear_ripple", "table", {"order": 3.37, "amplitude": 2e-4}, ())),
    ("paper", _Planted("mount_resonance", "first", {"f_hz": 31.0, "bandwidth_hz": 1.5, "sd_dps": 0.012}, ())),
    ("full", _Planted("fan_sweep", "first", {"f_start_hz": 18.0, "f_end_hz": 26.0, "A_dps": 0.016}, ())),
]


def _nulls() -> list[Case]:
    cases = []
    for i in range(64):
        protocol = ("paper", "full")[i % 2]
        drifts, turns_on = bool(i // 2 % 2), bool(i // 4 % 2)
        cases.append(
            Case(
                name=f"null_{protocol}_{'drift' if drifts else 'white'}{'_turn_on' if turns_on else ''}_{i // 8}",
                kind="null",
                protocol=protocol,
                seed=1000 + i,
                seconds=SECONDS[protocol],
                table_axis="zxy"[i // 8 % 3],
                ou_sd_dps=(1.5e-3, 2e-3, 2.5e-3, 3e-3)[i // 8 % 4] if drifts else 0.0,
                ou_tau_s=(20.0, 30.0, 40.0)[i // 16 % 3],
                turn_on_sd_dps=0.01 if turns_on else 0.0,
                climate=("room", "chamber")[i // 8 % 2],
                accelerometer=i // 8 % 4 != 3,
                table_angle=i // 8 % 4 == 2,
                file_format=("csv", "parquet")[i // 8 % 2],
            )
        )
    drifting = replace(cases[-1], ou_sd_dps=2e-3, turn_on_sd_dps=0.01, climate="room", accelerometer=True)
    for i in range(4):
        cases.append(
            replace(drifting, name=f"null_swing_{i}", protocol="swing", seed=1064 + i, seconds=SECONDS["swing"])
        )
    # so far north that the horizontal part, a wave once a turn on the axes in the table's plane, stays under the noise
    for i, protocol in enumerate(("paper", "full", "paper", "full")):
        cases.append(
            replace(
                drifting,
                name=f"null_earth_{protocol}_{i // 2}",
                protocol=protocol,
                seed=1068 + i,
                seconds=SECONDS[protocol],
                latitude_deg=85.0,
            )
        )
    return cases


def _planted(name: str, kind: str, protocol: str, seed: int, *planted: _Planted, factor: float = 1.0) -> Case:
    table_axis = "zxy"[seed % 3]
    settings: dict[str, Any] = {}
    for one in planted:
        settings |= one.settings or {}
    ids = tuple(one.id for one in planted)
    return Case(
        **{
            "name": name,
            "kind": kind,
            "protocol": protocol,
            "seed": seed,
            "seconds": SECONDS[protocol],
            "effects": tuple(one.on(table_axis, factor) for one in planted),
            "expected": () if kind == "unknown" else ids,
            "rivals": tuple(rival for one in planted for rival in one.rivals if rival not in ids),
            "identified_in": tuple(
                each for each in SECONDS if kind != "unknown" and all(each in IDENTIFIED_IN[one] for one in ids)
            ),
            "table_axis": table_axis,
            "ou_sd_dps": 2e-3,
            "ou_tau_s": 30.0,
            "turn_on_sd_dps": 0.01,
            "file_format": ("csv", "parquet")[seed % 2],
            **settings,
        }
    )


def _effects() -> list[Case]:
    """Every effect at two sizes, two seeds a size: paper and full, or the one protocol that shows it, twice."""
    cases = []
    for id_, shown_in in IDENTIFIED_IN.items():
        tables = [(p, t[id_]) for p, t in (("paper", PAPER), ("full", FULL), ("swing", SWING)) if id_ in t]
        assert all(protocol in shown_in for protocol, _ in tables)
        for repeat in range(2):
            protocol, planted = tables[repeat % len(tables)]
            for size, factor in (("small", 1.0), ("large", planted.large)):
                one = planted
                if id_ == "saturation" and size == "large":
                    one = replace(one, settings={**(one.settings or {}), "rates_dps": (30.0, 78.0, 150.0)})
                name = f"effect_{id_}_{protocol}_{size}_{repeat}"
                cases.append(_planted(name, "effect", protocol, 2000 + len(cases), one, factor=factor))
    return cases


def _pairs() -> list[Case]:
    tables = {"paper": PAPER, "full": FULL}
    return [
        _planted(f"pair_{a}_{b}", "pair", protocol, 3000 + i, tables[protocol][a], tables[protocol][b], factor=2.0)
        for i, (protocol, a, b) in enumerate(PAIRS)
    ]


def _confounded() -> list[Case]:
    return [
        _planted(f"confounded_{id_}_{repeat}", "confounded", "paper", 4000 + 2 * i + repeat, one, factor=one.large)
        for i, (id_, one) in enumerate(CONFOUNDED.items())
        for repeat in range(2)
    ]


def _unknown() -> list[Case]:
    return [
        _planted(f"unknown_{one.id}_{repeat}", "unknown", protocol, 5000 + 2 * i + repeat, one)
        for i, (protocol, one) in enumerate(UNKNOWN)
        for repeat in range(2)
    ]


CASES: list[Case] = [*_nulls(), *_effects(), *_pairs(), *_confounded(), *_unknown()]

# a ninth of them, for a quick look: taken by position, never by outcome
SAMPLE: list[Case] = CASES[::9]
