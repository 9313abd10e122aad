"""A page for each effect and noise component, made from its file.

Use ``python -m gyrocal.present.effect_pages FOLDER`` or ``make docs``. The figure shows the term that the effect adds to the
reading on the usual protocols, at the size that the simulator plants.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from gyrocal.effects.base import Case, Effect, effects
from gyrocal.noise.axis import COMPONENTS
from gyrocal.noise.component import NoiseComponent
from gyrocal.parameter import Described
from gyrocal.recording.header import Face
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.simulation.simulate import LSB_DPS, RATE_HZ, WHITE_SD_DPS
from gyrocal.units import to_read

SECONDS = 20.0
FACES: tuple[Face, ...] = ("up", "down")
RATES_DPS = (-150.0, -78.0, -30.0, 0.0, 30.0, 78.0, 150.0)
TILT_G = 0.035
"""Component of gravity in the plane of a table that is tilted by 2 degrees."""

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#6f6f6f"
TOP, BOTTOM = 34.0, 190.0
STRIPS = ((60.0, "face up, w = 78 dps"), (200.0, "face down, w = -78 dps"), (340.0, "swinging, w = ±150 dps"))
STRIP_WIDTH = 130
RATE_LEFT, RATE_RIGHT = 545.0, 735.0

SYMBOLS = (
    "w true rate, T temperature, t time in the run, p time since power-on, th angle of the table, "
    "ax ay az acceleration, y the reading; all in dps, °C, s and g."
)
CAPTION = (
    "What the effect adds to the reading at the size that `gyrocal simulate` plants. Left, within three runs of one "
    "power cycle: face up, turned over, and swinging. Right, the mean of a run against the table's rate, face up "
    "(filled) and face down (open). The part warms up by some degrees after power-on, the table is tilted by 2 "
    "degrees. Two effects that look alike in every part of the picture that a session records cannot be distinguished "
    "by it."
)


def pages() -> dict[str, str]:
    """The text of every file of the folder, by name."""
    made = {"README.md": _index()}
    for kind in kinds():
        made[f"{kind.id}.md"] = _page(kind)
        made[f"{kind.id}.svg"] = _picture(kind)
    return made


def kinds() -> list[Described]:
    """Every effect and noise component with a page, by id."""
    everything: list[Described] = [*effects().values(), *COMPONENTS.values()]
    return sorted(everything, key=lambda kind: kind.id)


def _index() -> str:
    rows = [f"| [{k.id}]({k.id}.md) | {k.title} | {_code(k.equation)} |" for k in kinds()]
    return "\n".join([
        "# Effects", "",
        "What makes a gyroscope's reading differ from the true rate, as far as gyrocal knows. Each page is made",
        "from the effect's file in `host/gyrocal/effects/` or `host/gyrocal/noise/`: `make docs` makes them again.", "",
        "| id | effect | adds to the reading |", "| --- | --- | --- |", *rows, "",
        f"Symbols: {SYMBOLS}", "",
        "## How each looks", "",
        CAPTION, "",
        '<div class="gallery" markdown>', "",
        *(line for kind in kinds() for line in (_card(kind), "")),
        "</div>", "",
    ])  # fmt: skip


def _card(kind: Described) -> str:
    """An effect in the gallery: its picture, its name, and what else looks like it."""
    picture = f"[![signature of {kind.id}]({kind.id}.svg)]({kind.id}.md)"
    return f"{picture} **{kind.title}.** What else looks like it: {_linked(kind)}."


def _page(kind: Described) -> str:
    parameters = [
        f"| `{p.name}` | {to_read(p.unit)} | {p.typical[0]:g} to {p.typical[1]:g} "
        f"| {'any' if p.default is None else f'{p.default:g}'} | {p.source} |"
        for p in kind.parameters
    ]
    needs = (kind.missing([], 2) if isinstance(kind, Effect) else None) or "nothing beyond the rates"
    device = "yes: `calibration.h` carries it" if not isinstance(kind, Effect) or kind.on_device else "no"
    return "\n".join([
        f"<!-- made from {_source(kind)} by gyrocal.present.effect_pages -->",
        f"# {kind.title} (`{kind.id}`)", "",
        kind.cause, "",
        f"**Adds to the reading:** {_code(kind.equation)}", "",
        f"![signature of {kind.id}]({kind.id}.svg)", "",
        f"<sub>{CAPTION}</sub>", "",
        "| parameter | unit | typical size | simulator plants | source |",
        "| --- | --- | --- | --- | --- |", *parameters, "",
        f"- **Needs:** {needs}.",
        f"- **What else looks like it:** {_linked(kind)}.",
        f"- **What to measure next:** {kind.measure_next}.",
        f"- **Runs on the device:** {device}.", "",
        *_attempt(kind), "",
        f"Symbols: {SYMBOLS}", "",
    ])  # fmt: skip


def _source(kind: Described) -> str:
    """The file of an effect or a noise component in the repository."""
    return f"host/{type(kind).__module__.replace('.', '/')}.py"


def _attempt(kind: Described) -> list[str]:
    """Commands that show the effect in the simulator, with its first case or the default size."""
    campaign = [demonstration_run(face, np.full(2900, rate), 3.0) for face in FACES for rate in RATES_DPS]
    lacking = kind.missing(campaign, shown_axis(kind, campaign[0])) if isinstance(kind, Effect) else None
    if lacking is not None:
        return [f"The simulator's campaigns cannot show it: that takes {lacking}."]
    case = next(iter(kind.cases), None) if isinstance(kind, Effect) else None
    planted, name = (kind.id, "full") if case is None else (_planted(kind, case), case.campaign)
    then = "compare" if isinstance(kind, NoiseComponent) else "diagnose"
    commands = ["```", f"gyrocal simulate demo --campaign {name} --effect {planted}", f"gyrocal {then} demo", "```"]
    return commands if case is None else [*commands, "", f"A fit recovers {', '.join(map(_code, case.recovers))}."]


def _planted(kind: Described, case: Case) -> str:
    """A case as an argument of the command line."""
    return f"{kind.id}:{','.join(f'{name}={value:g}' for name, value in case.values.items())}"


def _code(equation: str) -> str:
    return f"`{equation}`"


def _linked(kind: Described) -> str:
    """``looks_like`` with the first mention of each other effect linked to its page."""
    text = kind.looks_like
    for other in (k.id for k in kinds()):
        if other != kind.id:
            text = re.sub(rf"(?<![\w/(\[]){other}(?![\w\].-])", f"[{other}]({other}.md)", text, count=1)
    return text


def demonstration_run(face: Face, rate_dps: Array, power_on_s: float) -> Run:
    """A run without noise: the table turns at ``rate_dps`` [n] about z, the part warms up by 6 degC after power-on."""
    n = rate_dps.size
    t_s = np.arange(n) / RATE_HZ
    sign = 1.0 if face == "up" else -1.0
    angle = np.cumsum(np.deg2rad(rate_dps)) / RATE_HZ
    columns = {
        "t_s": t_s,
        "gx_dps": np.zeros(n),
        "gy_dps": np.zeros(n),
        "gz_dps": sign * rate_dps,
        "ax_g": TILT_G * np.cos(angle),
        "ay_g": -sign * TILT_G * np.sin(angle),
        "az_g": np.full(n, sign),
        "temp_c": 22.0 + 6.0 * (1 - np.exp(-(power_on_s + t_s) / 40.0)),
    }
    steady = bool(np.all(rate_dps == rate_dps[0]))
    if not steady:
        columns["rate_ref_dps"] = sign * rate_dps
    table_rate_dps = float(rate_dps[0]) if steady else None
    frame = pl.DataFrame(columns)
    return Run(
        0, "demonstration.csv", "s000", face, "z", table_rate_dps, None, 1, power_on_s, RATE_HZ, frame=frame, lsb_dps=LSB_DPS
    )  # fmt: skip


def shown_axis(kind: Described, run: Run) -> int:
    """The table's axis if the effect acts on it, else the first axis on which it acts."""
    if not isinstance(kind, Effect):
        return run.axis_index
    axes = kind.axes(run)
    return run.axis_index if run.axis_index in axes else axes[0]


def signature_dps(kind: Described, run: Run, rng: np.random.Generator) -> Array:
    """The term that it adds to the reading of :func:`shown_axis`, shape [n], deg/s."""
    values = kind.draw({}, rng)
    axis = shown_axis(kind, run)
    if isinstance(kind, NoiseComponent):
        return kind.with_values(values).sample(len(run), 1 / RATE_HZ, rng)
    assert isinstance(kind, Effect)
    fault = kind.fault_of(values)
    if fault is None:
        return kind.term(run, axis, values)
    clean = run.gyro_dps + rng.normal(0.0, WHITE_SD_DPS, (len(run), 3))
    return np.asarray((fault.distort(run, clean, values, rng) - clean)[:, axis])


def _picture(kind: Described) -> str:
    rng = np.random.default_rng(1)
    n = round(SECONDS * RATE_HZ)
    steady = np.full(n, 78.0)
    swing = 150.0 * np.sin(2 * np.pi * 0.1 * np.arange(n) / RATE_HZ)
    runs = (
        demonstration_run("up", steady, 3.0),
        demonstration_run("down", steady, 35.0),
        demonstration_run("up", swing, 67.0),
    )
    one_cycle = isinstance(kind, NoiseComponent) and kind.one_draw  # the same in all three
    strips = [signature_dps(kind, run, np.random.default_rng(1) if one_cycle else rng) for run in runs]
    points = [
        (face, rate, float(signature_dps(kind, demonstration_run(face, np.full(n, rate), 3.0), rng).mean()))
        for face in FACES
        for rate in RATES_DPS
    ]
    everything = np.concatenate([*strips, [mean for _, _, mean in points], [0.0]])
    low, high = float(everything.min()), float(everything.max())
    margin = 0.06 * max(high - low, 1e-9)
    low, high = low - margin, high + margin
    factor, unit = (1.0, "dps") if max(-low, high) >= 1.0 else (1e3, "mdps")
    middle = (RATE_LEFT + RATE_RIGHT) / 2

    def y(value: float) -> str:
        return f"{BOTTOM - (BOTTOM - TOP) * (value - low) / (high - low):.1f}"

    svg = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 750 232" font-family="sans-serif" font-size="11">',
        '<rect width="750" height="232" fill="white"/>',
        _text(10, 14, f"{kind.id}, {unit} on axis {AXES[shown_axis(kind, runs[0])]}"),
    ]
    for tick in _ticks(low * factor, high * factor):
        at = y(tick / factor)
        line = f"M60 {at}H470M{RATE_LEFT:g} {at}H{RATE_RIGHT:g}"
        svg.append(f'<path d="{line}" stroke="{"#999" if tick == 0 else "#e4e4e4"}"/>')
        svg += [_text(left - 6, float(at) + 4, f"{tick:g}", "end") for left in (60.0, RATE_LEFT)]
    for (left, label), strip in zip(STRIPS, strips, strict=True):
        svg.append(f'<path d="{_trace(strip, left, y)}" fill="none" stroke="{BLUE}" stroke-width="1.2"/>')
        svg += [_text(left, 206, "0"), _text(left + STRIP_WIDTH, 206, f"{SECONDS:g}", "end")]
        svg.append(_text(left + STRIP_WIDTH / 2, 28, label, "middle"))
    for face, rate, mean in points:
        fill, radius = (ORANGE, 3) if face == "up" else ("none", 5)
        place = f'cx="{_rate_x(rate):.1f}" cy="{y(mean)}" r="{radius}"'
        svg.append(f'<circle {place} fill="{fill}" stroke="{ORANGE}" stroke-width="1.3"/>')
    svg += [_text(_rate_x(rate), 206, f"{rate:g}", "middle") for rate in (-150.0, 0.0, 150.0)]
    svg += [
        _text(265, 224, "time in the run, s", "middle"),
        _text(middle, 224, "table's rate, dps", "middle"),
        _text(middle, 28, "mean of a run", "middle"),
    ]
    return "\n".join([*svg, "</svg>", ""])


def _trace(values: Array, left: float, y: Callable[[float], str]) -> str:
    """An SVG path through the smallest and the largest value of each pixel."""
    points = []
    for i, part in enumerate(np.array_split(values, STRIP_WIDTH)):
        points += [f"{left + i:.0f} {at}" for at in dict.fromkeys((y(float(part.min())), y(float(part.max()))))]
    return "M" + "L".join(points)


def _rate_x(rate_dps: float) -> float:
    return (RATE_LEFT + RATE_RIGHT) / 2 + rate_dps * (RATE_RIGHT - RATE_LEFT - 20) / 300.0


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers, two to six of them."""
    step = 10.0 ** np.floor(np.log10((high - low) / 2))
    step *= next(m for m in (1, 2, 5) if (high - low) / (m * step) <= 6 or m == 5)
    return [float(round(k * step, 9)) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _text(x: float, y: float, text: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{GREY}">{text}</text>'


def main(arguments: Sequence[str]) -> int:
    """Write the pages into a folder."""
    if len(arguments) != 1:
        print("usage: python -m gyrocal.present.effect_pages FOLDER", file=sys.stderr)
        return 2
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
