"""Whether samples are lost, on paper: bus bits and FIFO of each part, counted, beside the instructions of docs/cpus.md.

For each part and board: the fastest rate at which no sample is lost, sample by sample and with the FIFO, while the device
computes its longest slice of an answer and while the board writes its flash. The rules are those of the core: a sample that is
late by less than half a period still counts, and the FIFO keeps what comes meanwhile.

python benchmarks/timing.py                  prints it
python benchmarks/timing.py docs/cpus.md     puts it between the marks in that file
"""

import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from gyrocal_firmware import CORE, INCLUDE, SIM

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- timing: python benchmarks/timing.py docs/cpus.md -->\n", "<!-- end of timing -->\n"
BEYOND = "\nBeyond the wire, at `device_baseline`, with the gyroscope alone in the FIFO:\n\n"
BUS_HZ = 400_000
CYCLES = 2.0
"""Cycles that an instruction is assumed to take; the parts' data give 1 to 2."""
ERASE_S = 0.4
"""The longest erasure of a sector of flash (W25Q32, data sheet)."""
LATE = 1.5
"""Periods after the sample before at which a sample is missing; the core's GC_GAP_PERIODS."""


@dataclass(frozen=True)
class Board:
    """A board and the CPU of docs/cpus.md whose instructions it executes."""

    name: str
    cpu: str
    clock_hz: float


BOARDS = (
    Board("ESP32-C3, 160 MHz", "rv32imc", 160e6),
    Board("ESP32-P4, 360 MHz", "rv32imafc", 360e6),
    Board("STM32F4, 168 MHz", "cortex-m4f", 168e6),
    Board("nRF52, 64 MHz", "cortex-m4f", 64e6),
)


@dataclass(frozen=True)
class Part:
    """What a sensor takes on its bus, bits, and how many samples its FIFO holds."""

    name: str
    single: int
    batched: int
    depth: int
    check: int
    set_up: int
    gyro_alone: int


def parts() -> list[Part]:
    """Compile the drivers with the emulated parts, and count."""
    sources = [*CORE.rglob("*.c"), *SIM.glob("emul*.c"), ROOT / "benchmarks" / "timing_bus.c"]
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as folder:
        program = Path(folder) / "timing_bus"
        folders = [f"-I{path}" for path in (CORE, INCLUDE, SIM)]
        subprocess.run(["cc", "-std=c99", "-O1", *folders, *map(str, sources), "-lm", "-o", str(program)], check=True)
        lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    return [Part(name, *map(int, numbers)) for name, *numbers in map(str.split, lines)]


def instructions(cpu: str, row_of: str = "device") -> tuple[int, int]:
    """The mean and the largest number for one sample through the whole device."""
    page = (ROOT / "docs" / "cpus.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| {row_of} \| {cpu} \| ([\d ]+) \| ([\d ]+) \|", page, re.MULTILINE)
    assert row is not None, cpu
    return int(row[1].replace(" ", "")), int(row[2].replace(" ", ""))


def fastest_hz(part: Part, board: Board) -> tuple[float, float, float]:
    """The fastest rates: sample by sample, with the FIFO between stores, and with the FIFO while a sector is erased.

    The mean work must fit between two samples. The longest slice, and the check of the settings, may delay a sample by half a
    period, or as long as the FIFO takes to fill up.
    """
    mean, largest = instructions(board.cpu)
    second = CYCLES / board.clock_hz
    slice_s = largest * second + part.check / BUS_HZ
    busy_s = part.single / BUS_HZ + mean * second
    single = min(1 / busy_s, LATE / (slice_s + part.single / BUS_HZ))
    if part.depth == 0:
        return single, 0.0, 0.0
    flow = 1 / (part.batched / BUS_HZ + mean * second)
    return single, min(flow, part.depth / slice_s), min(flow, part.depth / (slice_s + ERASE_S))


def beyond_the_wire_hz(part: Part, board: Board) -> float:
    """The fastest rate of the gyroscope alone in the FIFO, without stream and model."""
    mean, largest = instructions(board.cpu, "device_baseline")
    second = CYCLES / board.clock_hz
    return min(1 / (part.gyro_alone / BUS_HZ + mean * second), part.depth / (largest * second))


def beyond_the_wire(counted: list[Part]) -> str:
    """The lines of the table of rates that the wire does not carry."""
    heads = ["sensor", "bits a sample", *(board.name for board in BOARDS)]
    lines = ["| " + " | ".join(heads) + " |", "| --- |" + " ---: |" * (len(heads) - 1)]
    for part in counted:
        if part.gyro_alone:
            cells = [f"{beyond_the_wire_hz(part, board):.0f}" for board in BOARDS]
            lines.append("| " + " | ".join([part.name, str(part.gyro_alone), *cells]) + " |")
    return "\n".join(lines) + "\n"


def table(counted: list[Part]) -> str:
    """The table's lines, one for each part."""
    heads = ["sensor", "bits a sample", "in a batch", "FIFO, samples", "set-up, ms", *(f"{board.name}" for board in BOARDS)]
    lines = ["| " + " | ".join(heads) + " |", "| --- |" + " ---: |" * (len(heads) - 1)]
    for part in counted:
        cells = [part.name, str(part.single), str(part.batched or "-"), str(part.depth or "-")]
        cells.append(f"{1e3 * part.set_up / BUS_HZ:.0f}")
        for board in BOARDS:
            single, fifo, erasing = fastest_hz(part, board)
            cells.append(f"{single:.0f}" + (f", {fifo:.0f}, {erasing:.0f}" if part.depth else ""))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    counted = parts()
    text = table(counted) + BEYOND + beyond_the_wire(counted)
    if len(sys.argv) == 1:
        print(text, end="")
        return
    path = Path(sys.argv[1])
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    path.write_text(before + BEGIN + text + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
