"""The firmware's C on CPUs that QEMU emulates: it is cross-compiled and run, and its cost is counted.

Programs read this machine's files and print here by semihosting. The firmware's folder ``emul/`` contains the sources for
that, and one file for each part whose cost is counted. Compilers and emulators are Debian packages.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from gyrocal.errors import GyrocalError
from gyrocal_firmware import CORE, EMUL, INCLUDE

HOSTED = ("--specs=picolibc.specs", "--oslib=semihost", "--crt0=hosted", "-D_POSIX_TIMERS", "-D_POSIX_MONOTONIC_CLOCK")
FLAGS = ("-std=c99", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
OPTIMISE = ("-O2",)
SETTINGS = {"inference_gyrocal": "-DGC_NET_FIXED=0", "inference_gyrocal_fixed": "-DGC_NET_FIXED=1"}
"""Settings of the core for the cost of a part; the others have the CPU's defaults."""
BARE = ("-display", "none", "-monitor", "none", "-serial", "none", "-chardev", "stdio,id=console")
TIMEOUT_S = 120


@dataclass(frozen=True)
class Cpu:
    """An emulated CPU. ``like`` names parts that have it; ``flash`` and ``ram`` are addresses on the emulated board."""

    name: str
    like: str
    compiler: tuple[str, ...]
    flash: int
    ram: int
    emulator: tuple[str, ...]
    packages: str

    @property
    def tools(self) -> tuple[str, str]:
        """The names of the compiler and the emulator for this CPU."""
        return self.compiler[0], self.emulator[0]


_RISCV_COMPILER = ("riscv64-unknown-elf-gcc", "-misa-spec=2.2")
_RISCV_EMULATOR = ("qemu-system-riscv32", "-M", "virt", "-bios", "none")
_RISCV_PACKAGES = "gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf qemu-system-misc"
_M4_COMPILER = ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")

CPUS = (
    Cpu("rv32imc", "ESP32-C3", (*_RISCV_COMPILER, "-march=rv32imc", "-mabi=ilp32"), 0x80000000, 0x80200000,
        _RISCV_EMULATOR, _RISCV_PACKAGES),
    Cpu("rv32imafc", "ESP32-P4", (*_RISCV_COMPILER, "-march=rv32imafc", "-mabi=ilp32f"), 0x80000000, 0x80200000,
        _RISCV_EMULATOR, _RISCV_PACKAGES),
    Cpu("cortex-m4f", "STM32F4, nRF52", _M4_COMPILER, 0x0, 0x20000000, ("qemu-system-arm", "-M", "mps2-an386"),
        "gcc-arm-none-eabi picolibc-arm-none-eabi qemu-system-arm"),
)  # fmt: skip


@dataclass(frozen=True)
class Cost:
    """The cost of one part: mean and largest number of instructions in a call; bytes of flash, of static RAM and of stack."""

    part: str
    what: str
    instructions: int
    largest: int
    flash_bytes: int
    ram_bytes: int
    stack_bytes: int


def build(
    cpu: Cpu,
    sources: Sequence[Path],
    output: Path,
    include_dirs: Sequence[Path] = (),
    flags: Sequence[str] = OPTIMISE,
) -> Path:
    """Link C files, one of them with ``int main(int, char **)``, into a program for an emulated CPU, and return its path.

    Raises:
        GyrocalError: the compiler is missing or failed.
    """
    _require(cpu, cpu.tools[0])
    memory = {"flash": cpu.flash, "flash_size": 0x200000, "ram": cpu.ram, "ram_size": 0x400000}
    link = [f"-Wl,--defsym=__{name}={value:#x}" for name, value in memory.items()]
    includes = [f"-I{path}" for path in (*include_dirs, INCLUDE, CORE, EMUL)]
    command = [*cpu.compiler, *HOSTED, *FLAGS, *flags, *includes]
    posix = EMUL / "posix.c"
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as folder:
        objects: list[str] = []
        for source in (posix, *sources):
            objects.append(f"{folder}/{len(objects)}.o")
            entry = [] if source == posix else ["-Dmain=gyrocal_main"]
            _output(cpu, [*command, *entry, "-c", str(source), "-o", objects[-1]])
        _output(cpu, [*command, *link, *objects, "-lm", "-o", str(output)])
    return output


def run(cpu: Cpu, program: Path, arguments: Sequence[str] = (), timeout_s: float = TIMEOUT_S) -> bytes:
    """Run a program built by :func:`build` and return what it prints.

    Arguments must not contain a space or a comma. Relative paths start from the current folder.

    Raises:
        GyrocalError: the emulator is missing, or the program failed.
    """
    _require(cpu, cpu.tools[1])
    words = ",".join(f"arg={word}" for word in (program.name, *arguments))
    command = [*cpu.emulator, *BARE, "-semihosting-config", f"enable=on,target=native,chardev=console,{words}"]
    return _output(cpu, [*command, "-icount", "shift=0", "-kernel", str(program)], timeout_s)


def parts() -> list[str]:
    """The parts of the core whose cost can be counted: the files of ``emul/cost``."""
    return sorted(path.stem for path in (EMUL / "cost").glob("*.c") if path.stem != "nothing")


def cost(
    cpu: Cpu,
    part: str | Path,
    sources: Sequence[Path] | None = None,
    include_dirs: Sequence[Path] = (),
    flags: Sequence[str] = OPTIMISE,
) -> Cost:
    """Measure the cost of a part beyond that of an empty one.

    Args:
        part: one of :func:`parts`, or a C file of that form (see ``emul/cost.h``).
        sources: the C files that it is linked with; the core by default. Flash counts what the part uses of them and of the
            compiler's helper functions.

    Raises:
        GyrocalError: as :func:`build` and :func:`run`.
    """
    file = part if isinstance(part, Path) else EMUL / "cost" / f"{part}.c"
    sources = sorted(CORE.rglob("*.c")) if sources is None else sources
    if file.stem in SETTINGS:
        flags = (*flags, SETTINGS[file.stem])
    measured = _count(cpu, file, sources, include_dirs, flags)
    empty = _count(cpu, EMUL / "cost" / "nothing.c", [], (), flags)
    what = " ".join(file.read_text().partition("*/")[0].removeprefix("/*").split())
    instructions, largest = (max(0, a - b) for a, b in zip(measured.printed[:2], empty.printed[:2], strict=True))
    flash, ram = measured.flash - empty.flash, measured.ram - empty.ram
    return Cost(file.stem, what, instructions, largest, flash, ram, measured.printed[2])


class _Counted(NamedTuple):
    """Bytes of flash and RAM of a whole program, and the numbers that it prints."""

    flash: int
    ram: int
    printed: list[int]


def _count(
    cpu: Cpu, part: Path, sources: Sequence[Path], include_dirs: Sequence[Path], flags: Sequence[str]
) -> _Counted:
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as folder:
        folders = [*include_dirs, EMUL / "cost"]
        program = build(cpu, [EMUL / "cost.c", part, *sources], Path(folder, f"{part.stem}.elf"), folders, flags)
        size = cpu.tools[0].removesuffix("gcc") + "size"
        text, data, bss = _output(cpu, [size, str(program)]).split(b"\n")[1].split()[:3]
        counts = run(cpu, program).split()
    return _Counted(int(text) + int(data), int(data) + int(bss), [int(n) for n in counts])


def _require(cpu: Cpu, tool: str) -> None:
    if shutil.which(tool) is None:
        raise GyrocalError(f"{tool} is not on the PATH; on Debian: apt install {cpu.packages}")


def _output(cpu: Cpu, command: Sequence[str], timeout_s: float = TIMEOUT_S) -> bytes:
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        raise GyrocalError(f"{cpu.name}: {command[0]} did not end within {timeout_s:g} s") from None
    if done.returncode != 0:
        lines = (done.stderr or done.stdout).decode(errors="replace").splitlines() or [f"exit code {done.returncode}"]
        first = next((line for line in lines if "error" in line), lines[-1])
        raise GyrocalError(f"{cpu.name}: {command[0]} failed: {first}")
    return done.stdout
