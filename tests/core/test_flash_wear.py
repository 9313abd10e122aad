"""What use writes to flash, what a day of it wears, and what remains when the flash fails."""

from __future__ import annotations

from math import ceil
from pathlib import Path

import pytest

from .conftest import HERE, Build, Sentence, run, sentences
from .test_device import DOWN, STILL, UP, errors
from .test_kept import PAIR

PAGE = Path(__file__).parents[2] / "docs" / "reliability.md"
PARTITIONS = HERE.parents[1] / "firmware" / "gyrocal_firmware" / "partitions.csv"
REST = f"{STILL}> start up\nrun 3\n> stop\n"
USES = {
    "a run up and a run down": ("", PAIR),
    "a run at rest": (f"{PAIR}> set table_dps 0\n", REST),
    "`undo`": (PAIR, "> undo\n"),
    "`reset`": (PAIR, "> reset\n"),
    "`set` to another value": ("> set axis z\n", "> set axis x\n"),
    "`set` to the value that is kept": ("> set axis x\n", "> set axis x\n> set table_dps 78\n"),
    "`start` and `stop` without a sample": (PAIR, "> start up\n> stop\n"),
    "a minute of `stream raw`, with `status`, `hello` and `dump`": (
        PAIR,
        "> stream raw\n> status\n> hello\n> dump\nrun 60\n",
    ),
    "power-on": (PAIR, "power\nrun 1\n"),
}
DAY = {"a run up and a run down": 100, "a run at rest": 100, "`undo`": 20, "`reset`": 1, "`set` to another value": 300}
"""Of one sensor."""
ENDLESS = {"a run up and a run down": 86400 // 20}
"""A table that is never still: a pair each 20 s."""

# NVS of ESP-IDF writes records as entries of 32 bytes, 126 a page of 4096 bytes. A record has a header for each piece, two
# pieces where it crosses the end of a page, and an index. One page is kept free.
ENTRY_BYTES, PAGE_ENTRIES, PAGE_BYTES = 32, 126, 4096
HEADERS = 3
ERASURES = 100_000
"""Of a sector, by the data sheets of serial NOR flash."""


@pytest.fixture(scope="module")
def bench(build: Build) -> Path:
    return build(HERE / "bench.c")


def wear(bench: Path, before: str, use: str) -> tuple[int, int]:
    """Records and bytes that the use writes."""
    lines = [line for line in run(bench, f"power\n{before}wear\n{use}wear\n").splitlines() if line.startswith("# wear")]
    _, _, records, size = lines[1].split()
    return int(records), int(size)


def entries(records: int, size: int) -> int:
    return ceil(size / ENTRY_BYTES) + HEADERS * records


def pages() -> int:
    (row,) = (line for line in PARTITIONS.read_text().splitlines() if line.startswith("gyrocal,"))
    return int(row.split(",")[4], 16) // PAGE_BYTES


def years(worn: dict[str, tuple[int, int]], day: dict[str, int], sensors: int) -> float:
    """Until each page but one has been erased as often as it may be. What is kept, both slots of each record, is copied when
    its page is erased: at most the mean fraction of a page."""
    usable = (pages() - 1) * PAGE_ENTRIES
    kept = sensors * 2 * (entries(2, worn["`reset`"][1]) + entries(1, worn["`set` to another value"][1]))
    assert kept < usable
    a_day = sensors * sum(times * entries(*worn[use]) for use, times in day.items()) / (1 - kept / usable)
    return ERASURES * usable / a_day / 365.25


def tables(worn: dict[str, tuple[int, int]]) -> str:
    rows = ["| Use | Records written | Bytes | Entries of NVS |", "|---|---:|---:|---:|"]
    rows += [f"| {use} | {n} | {size} | {entries(n, size)} |" for use, (n, size) in worn.items()]
    rows += ["", "| Day of each sensor | One sensor, years | Four sensors, years |", "|---|---:|---:|"]
    for name, day in (("the day above", DAY), ("a pair each 20 s, day and night", ENDLESS)):
        rows.append(f"| {name} | {years(worn, day, 1):.2g} | {years(worn, day, 4):.2g} |")
    return "\n".join(rows)


def test_the_page_holds_what_use_writes(bench: Path) -> None:
    worn = {use: wear(bench, *scripts) for use, scripts in USES.items()}
    assert tables(worn) in PAGE.read_text(), tables(worn)
    assert years(worn, DAY, 4) > 5


def test_what_is_in_flash_already_is_not_written_again(bench: Path) -> None:
    settings = "> set axis y\n> set table_dps 33\n> auto on\n"
    assert wear(bench, "", settings)[0] == 3
    assert wear(bench, settings, settings * 50) == (0, 0)
    assert wear(bench, f"{settings}power\n", settings * 50) == (0, 0)


def test_a_setting_that_could_not_be_written_is_written_when_it_is_set_again(bench: Path) -> None:
    text = run(bench, "power\n> set axis y\nstore fails\n> set axis x\n> set axis x\nstore on\n> set axis x\npower\n")
    assert errors(text) == ["store_failed"] * 2
    assert sentences(text, "HEL")[-1]["axis"] == "x"


def test_settings_wait_for_the_end_of_a_run_and_are_then_one_write(bench: Path) -> None:
    change = "> auto on\nrun 0.5\n> auto off\nrun 0.5\n> auto on\n"
    assert wear(bench, f"{UP}> start up\nrun 1\n", change) == (0, 0)
    records, _ = wear(bench, f"{UP}> start up\nrun 1\n", f"{change}run 1\n> stop\n")
    assert records == 2  # settings, and the counts of the run


def kept(text: str) -> list[dict[str, str]]:
    return [dict(s) for tag in ("OLD", "WIN") for s in sentences(text, tag)]


@pytest.mark.parametrize("how", ["fails", "torn"])
def test_flash_that_fails_leaves_the_answers_before(bench: Path, how: str) -> None:
    """The corrections in use are those of the new pair until power-off, and those of the old one after it."""
    ask = f"{UP}> stream corrected\nrun 0.5\n> stream off\n> dump\nrun 3\n"
    other = PAIR.replace(UP, UP.replace("8950", "8850")).replace(DOWN, DOWN.replace("-8960", "-8900"))
    assert other != PAIR
    once, twice = (run(bench, f"power\n{pairs}power\n{ask}") for pairs in (PAIR, PAIR + other))
    text = run(bench, f"power\n{PAIR}store {how}\n{other}{ask}power\n{ask}")
    now, after = text.split("$HEL")[-2:]
    assert errors(text) == ["store_failed"] * 2
    assert kept("$HEL" + after) == kept(once) != kept(twice)
    assert mean_rate(sentences("$HEL" + after, "GYR")) == pytest.approx(mean_rate(sentences(once, "GYR")), abs=0.02)
    assert mean_rate(sentences("$HEL" + now, "GYR")) == pytest.approx(mean_rate(sentences(twice, "GYR")), abs=0.02)
    assert abs(mean_rate(sentences(once, "GYR")) - mean_rate(sentences(twice, "GYR"))) > 0.1

    mended = run(bench, f"power\n{PAIR}store {how}\n{other}store on\n{other}power\n{ask}")
    assert len(kept(mended)) > len(kept(once))


def mean_rate(corrected: list[Sentence]) -> float:
    rates = [float(s["3"]) for s in corrected]
    assert len(rates) > 50
    return sum(rates) / len(rates)
