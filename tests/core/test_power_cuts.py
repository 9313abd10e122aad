"""The power fails in each write to flash of a device's life, before it, in its middle and after it."""

from pathlib import Path

import pytest

from .conftest import HERE, Build, run, sentences

UP, DOWN = "world 0 0 0 8950 0 0 16393\n", "world 0 0 0 -8960 0 0 -16393\n"
REST = "world 0 0 0 -5 0 0 16393\n"
RUN = "run 2.2\n> stop\n"
PAIR = f"{UP}> set table_dps 78\n> start up\n{RUN}{DOWN}> start down\n{RUN}"
LIFE = (
    f"noise 5\npower\n> set full_scale_dps 250\n> auto off\n{PAIR}{REST}> set table_dps 0\n> start up\n{RUN}"
    f"{PAIR}> undo\n> reset\n{PAIR}"
)
SETTINGS = ("rate_hz", "axis", "full_scale_dps", "table_dps", "turn_deg")


@pytest.fixture(scope="module")
def bench(build: Build) -> Path:
    return build(HERE / "bench.c")


def kept(bench: Path, write: int, percent: int) -> tuple[object, ...]:
    """Settings, answers and windows after a power cut in this write; the device then takes and keeps another setting."""
    text = run(bench, f"cut {write} {percent}\n{LIFE}power\n> dump\nrun 2\n> set table_dps 60\npower\n")
    boots = [s for s in sentences(text, "HEL") if s.seq == 0]
    assert len(boots) == 3
    assert boots[-1]["table_dps"] == "60"
    assert "store_failed" not in {s["name"] for s in sentences(text, "ERR")}
    return (*(boots[1][name] for name in SETTINGS), *(tuple(s.items()) for tag in ("OLD", "WIN") for s in sentences(text, tag)))


def test_a_write_is_kept_whole_or_not_at_all(bench: Path) -> None:
    """A write of which half was done leaves what was there before it, or, if the other half was so already, what it writes."""
    writes = run(bench, LIFE).count("# store ")
    assert writes > 12
    before = [kept(bench, write, 0) for write in range(1, writes + 1)]
    after = [*before[1:], kept(bench, writes, 100)]
    half = [kept(bench, write, 50) for write in range(1, writes + 1)]
    assert all(found in (old, new) for found, old, new in zip(half, before, after, strict=True))
    assert sum(found == old for found, old in zip(half, before, strict=True)) > writes / 2
    assert len(set(before)) > writes / 2
