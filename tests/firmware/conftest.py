"""The port on a board in virtual time (the folder board), and what it says there."""

import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from compiled import Objects
from gyrocal.device.wire import Reader, Sentence
from gyrocal_firmware import CORE, INCLUDE, SIM, SRC

HERE = Path(__file__).parent
SANITIZE = ["-g1", "-O0", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
"""Not optimised: compiling is most of what these tests take, and an optimiser may drop what a sanitizer would report."""
FOLDERS = [f"-I{folder}" for folder in (SRC, CORE, INCLUDE, SIM, HERE / "arduino")]
PINS = ["-DGYROCAL_SDA=21", "-DGYROCAL_SCL=22", "-DGYROCAL_SDA2=17", "-DGYROCAL_SCL2=16", "-DGYROCAL_LED=13"]
CHIPS = [f"0 chip {i}" for i in range(4)]
UP = [8950 + 10 * i for i in range(4)]
DOWN = [-8960 - 10 * i for i in range(4)]

WIRED = "-DGYROCAL_INT1=27"
BY_SPI = ["-DGYROCAL_SPI_SCK=18", "-DGYROCAL_SPI_MISO=19", "-DGYROCAL_SPI_MOSI=23", "-DGYROCAL_SPI_CS=5", "-DGYROCAL_SPI_CS2=4"]
"""A sensor by SPI: the simulated board has these chip selects (board/spi.cpp)."""

Play = Callable[..., str]
PlayBoth = Callable[..., tuple[str, str]]


def compile_core(compiled: Objects, folder: Path, gcc: str) -> None:
    """Put the objects of the core and of the emulated parts into a folder."""
    compiled.into(folder, [gcc, "-std=gnu99", *SANITIZE, *FOLDERS], [*CORE.rglob("*.c"), *SIM.glob("emul*.c")])


def compile_cpp(compiled: Objects, folder: Path, gxx: str, sources: Iterable[Path], *more: str) -> None:
    """Put the objects of sources of the port or of the board into a folder."""
    compiled.into(folder, [gxx, "-std=gnu++14", *SANITIZE, *PINS, *more, *FOLDERS], sources)


def compile_board(compiled: Objects, folder: Path, gxx: str, gcc: str, *more: str) -> Path:
    """The port with these pins. The core names no pin, so that its objects are those of every board."""
    compile_core(compiled, folder, gcc)
    compiled.into(folder, [gcc, "-std=gnu99", *SANITIZE, *PINS, *more, *FOLDERS], [SRC / "headers.c"])
    compile_cpp(compiled, folder, gxx, [*SRC.glob("*.cpp"), *(HERE / "board").glob("*.cpp")], *more)
    program = folder / "board"
    objects = sorted(map(str, folder.glob("*.o")))
    subprocess.run([gxx, *SANITIZE, *objects, "-pthread", "-lm", "-o", str(program)], check=True)
    return program


@pytest.fixture(scope="session")
def play(play_both: PlayBoth) -> Play:
    """`play(script, seconds, flash, *flags)`: what the port, built with these flags, writes to its serial port."""
    return lambda *arguments: play_both(*arguments)[0]


@pytest.fixture(scope="session")
def play_both(
    require_tool: Callable[[str], str], compiled: Objects, tmp_path_factory: pytest.TempPathFactory
) -> PlayBoth:
    """As `play`, and what it does in its network (board/network.cpp)."""
    gxx, gcc = require_tool("g++"), require_tool("gcc")
    built: dict[tuple[str, ...], Path] = {}

    def run(script: list[str], seconds: float, flash: Path | None = None, *flags: str) -> tuple[str, str]:
        if flags not in built:
            built[flags] = compile_board(compiled, tmp_path_factory.mktemp("board"), gxx, gcc, *flags)
        flash = flash or tmp_path_factory.mktemp("flash") / "flash"
        text = "\n".join(sorted(script, key=lambda line: float(line.split()[0]))) + "\n"
        done = subprocess.run(
            [built[flags], str(flash), str(seconds)], input=text, capture_output=True, encoding="latin-1", timeout=120
        )
        assert done.returncode == 0, done.stderr[-3000:] + done.stdout[-1000:]
        return done.stdout, done.stderr

    return run


def sentences(text: str, tag: str | None = None, imu: int | None = None) -> list[Sentence]:
    """What was said, every line whole."""
    reader = Reader()
    said = reader.feed(text.encode("latin-1"))
    assert (reader.bad, reader.overlong) == (0, 0)
    return [s for s in said if tag in (None, s.tag) and imu in (None, s.imu)]


def values(text: str, tag: str, name: str) -> list[str]:
    return [s.fields[name] for s in sentences(text, tag)]


def turn(at_s: float, counts: list[int]) -> list[str]:
    """All sensors see the table turn from now on, each with a scale of its own."""
    return [f"{at_s} world {i} 0 0 0 {n} 0 0 {16393 if n > 0 else -16393}" for i, n in enumerate(counts)]


def pair(count: int = 4) -> list[str]:
    return [
        *CHIPS[:count], *turn(0, UP), "1 > start up", "7.5 > stop", *turn(8, DOWN), "8.5 > start down", "15 > stop",
    ]  # fmt: skip
