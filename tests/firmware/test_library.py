"""The core as a library: its examples run on the simulated board, and CMake builds it."""

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from compiled import Objects
from gyrocal import __version__
from gyrocal.cli import main
from gyrocal.core.firmware_project import create_library
from gyrocal_firmware import CORE, LIBRARY, SIM

from .conftest import HERE, SANITIZE, compile_core, compile_cpp, sentences, turn

Sketch = Callable[..., str]
UP, DOWN = [8950], [-8960]
EXAMPLES = ["Calibrate", "CorrectedStream", "ReadingsOnly"]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library") / "gyrocal_core"
    create_library(folder)
    return folder


@pytest.fixture(scope="module")
def objects(
    library: Path, compiled: Objects, require_tool: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The library's C, the emulated parts and the board without the firmware's port.

    The library's C is that of the core, of which there are objects for the tests of the port. CMake builds it in its own place.
    """
    own, core = ({c.name: c.read_bytes() for c in folder.rglob("*.c")} for folder in (library / "src", CORE))
    headers = library / "src" / "headers.c"
    assert own == core | {headers.name: headers.read_bytes()}
    folder, gcc = tmp_path_factory.mktemp("objects"), require_tool("gcc")
    compile_core(compiled, folder, gcc)
    compiled.into(folder, [gcc, "-std=gnu99", *SANITIZE, f"-I{library / 'src'}"], [headers])
    compile_cpp(compiled, folder, require_tool("g++"), (HERE / "board").glob("*.cpp"))
    return folder


@pytest.fixture
def sketch(
    library: Path, objects: Path, require_tool: Callable[[str], str], tmp_path: Path
) -> Sketch:
    """`sketch(example, script, seconds, *flags)`: what an example writes to its serial port on the simulated board."""

    def run(example: str, script: list[str], seconds: float, *more: str) -> str:
        source = library / "examples" / example / f"{example}.ino"
        flags = [*SANITIZE, *more, "-Wall", "-Wextra", "-Werror", f"-I{library / 'src'}", f"-I{HERE / 'arduino'}", "-pthread"]
        program = tmp_path / example
        linked = sorted(map(str, objects.glob("*.o")))
        command = [require_tool("g++"), "-std=gnu++11", *flags, "-x", "c++", str(source), "-x", "none", *linked, "-lm"]
        subprocess.run([*command, "-o", str(program)], check=True)
        text = "\n".join(sorted(script, key=lambda line: float(line.split()[0]))) + "\n"
        done = subprocess.run(
            [program, str(tmp_path / "flash"), str(seconds)], input=text, capture_output=True, encoding="latin-1", timeout=120
        )
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout

    return run


@pytest.mark.parametrize(("part", "flags"), [("LSM6DSO", []), ("MPU-6050", []), ("MPU-6500", ["-DGYROCAL_CS=5"])])
def test_calibrate(sketch: Sketch, part: str, flags: list[str]) -> None:
    runs = [*turn(0, UP), "1 > start up", "7.5 > stop", *turn(8, DOWN), "8.5 > start down", "15 > stop"]
    text = sketch("Calibrate", [f"0 chip 0 {part}", *runs], 16, *flags)
    assert not sentences(text, "ERR")
    assert sentences(text, "HEL")[0].fields["sensor"] == part
    answer = next(s for s in sentences(text, "CAL") if s.fields["method"] == "baseline" and s.real("seconds") == 6.0)
    assert answer.real("scale") == pytest.approx((UP[0] - DOWN[0]) * 0.00875 / 156 - 1, abs=5 * (answer.real("scale_se") or 0))


@pytest.mark.parametrize("on_s", [3, 10])
def test_calibrate_with_nobody_at_the_usb_connector(sketch: Sketch, on_s: int) -> None:
    """From power-on into the first run of a pair, or the second one."""
    runs = [*turn(0, UP), "1 > start up", "1 > stream raw", "7.5 > stop", *turn(8, DOWN), "8.5 > start down", "15 > stop"]
    text = sketch("Calibrate", ["0 chip 0", "0 listen off", *runs, f"{on_s} listen on", f"{on_s} > status"], 17)
    said = sentences(text)
    numbers = [s.seq for s in said]
    assert numbers == sorted(set(numbers))
    lost = numbers[-1] + 1 - len(numbers)
    assert lost > 100
    (status,) = [s for s in said if s.tag == "ACK" and s.fields["cmd"] == "status"]
    assert status.t_us < 1e6 * on_s + 50_000
    assert int(next(s for s in said if s.tag == "STA").fields["lost"]) == lost
    assert [s.fields["missed"] for s in said if s.tag == "RUN" and s.fields["state"] == "end"][-1] == "0"
    baseline = [s for s in sentences(text, "CAL") if s.fields["method"] == "baseline"]
    assert baseline[-1].real("seconds") == 6.0


def test_corrected_stream(sketch: Sketch) -> None:
    source = (LIBRARY / "examples/CorrectedStream/CorrectedStream.ino").read_text()
    scale, bias_dps = (float(re.search(rf"{name}\[3\] = .* ([-.\d]+)\}}", source)[1]) for name in ("SCALE", "BIAS_DPS"))  # type: ignore[index]
    text = sketch("CorrectedStream", ["0 chip 0", *turn(0, UP)], 3)
    rates = np.array([line.split() for line in text.splitlines() if line.count(" ") == 2 and "#" not in line], float)
    assert len(rates) > 100
    assert rates[:, 2].mean() == pytest.approx((8950 * 0.00875 - bias_dps) / (1 + scale), abs=0.02)


def test_readings_only(sketch: Sketch) -> None:
    text = sketch("ReadingsOnly", ["0 chip 0 ICM-42688-P", *turn(0, UP)], 2)
    assert "ICM-42688-P\n" in text.replace("\r", "")
    rows = np.array([line.split() for line in text.splitlines() if line.count(" ") == 3 and "#" not in line], float)
    assert len(rows) > 100
    np.testing.assert_allclose(rows[1:].mean(axis=0), [0, 0, 8950 * 0.00875, 25], atol=0.03)
    text = sketch("ReadingsOnly", [], 3)
    assert "no sensor: check the wiring" in text
    assert "the sensor is not set up yet" in text


@pytest.mark.wide
def test_cmake_builds_the_target_without_a_warning(
    library: Path, require_tool: Callable[[str], str], tmp_path: Path
) -> None:
    """As a subdirectory of a program that uses it."""
    (tmp_path / "main.c").write_text(
        '#include "gc_parts.h"\n#include <stdio.h>\nint main(void) { puts(gc_parts[0]->name); return 0; }\n'
    )
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(mine C)\n"
        f'add_compile_options(-Wall -Wextra -Werror)\nadd_subdirectory("{library}" core)\n'
        "add_executable(mine main.c)\ntarget_link_libraries(mine gyrocal_core)\n"
    )
    for command in (["-S", str(tmp_path), "-B", str(tmp_path / "build")], ["--build", str(tmp_path / "build")]):
        done = subprocess.run([require_tool("cmake"), *command], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert subprocess.run([tmp_path / "build" / "mine"], capture_output=True, text=True, check=True).stdout == "LSM6DSO\n"


def test_esp_idf_registers_every_source(library: Path, require_tool: Callable[[str], str], tmp_path: Path) -> None:
    """With ESP-IDF's function in place of a stub that says what it was given."""
    (tmp_path / "component.cmake").write_text(
        "set(ESP_PLATFORM 1)\nset(COMPONENT_LIB core)\nfunction(idf_component_register)\nforeach(word ${ARGV})\n"
        f'message(STATUS "given ${{word}}")\nendforeach()\nendfunction()\nfunction(target_compile_options)\nendfunction()\n'
        f'set(CMAKE_CURRENT_LIST_DIR "{library}")\ninclude("{library}/CMakeLists.txt")\n'
    )
    done = subprocess.run([require_tool("cmake"), "-P", str(tmp_path / "component.cmake")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    given = re.findall(r"given (\S+)", done.stdout)
    assert {Path(word).name for word in given if word.endswith(".c")} == {p.name for p in CORE.rglob("*.c")} | {"headers.c"}
    assert given[-2:] == ["INCLUDE_DIRS", "src"]


def test_the_manifests_name_what_is_there(library: Path) -> None:
    manifest = json.loads((library / "library.json").read_text())
    properties = dict(line.split("=", 1) for line in (library / "library.properties").read_text().splitlines())
    version = re.search(r'GC_FIRMWARE_VERSION "([^"]+)"', (CORE / "gc_device.h").read_text())
    assert version is not None
    assert manifest["version"] == properties["version"] == version[1] == __version__
    assert json.loads((CORE / "library.json").read_text())["version"] == __version__
    assert f'version: "{version[1]}"' in (library / "idf_component.yml").read_text()
    assert [e["name"] for e in manifest["examples"]] == EXAMPLES == sorted(p.name for p in (library / "examples").iterdir())
    assert all((library / e["base"] / f).is_file() for e in manifest["examples"] for f in e["files"])
    assert all((library / "src" / header).is_file() for header in [*manifest["headers"], properties["includes"]])


def test_the_keywords_are_names_of_the_headers(library: Path) -> None:
    headers = " ".join(path.read_text() for path in (library / "src").glob("*.h"))
    lines = [line for line in (library / "keywords.txt").read_text().splitlines() if not line.startswith("#")]
    for name, kind in (line.split("\t") for line in lines):
        assert re.search(rf"\b{name}\b", headers), name
        assert kind in ("KEYWORD1", "KEYWORD2", "LITERAL1")


def test_the_command_writes_it_and_leaves_other_folders_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["firmware", str(tmp_path / "mine"), "--library"]) == 0
    assert main(["firmware", str(tmp_path / "mine"), "--library"]) == 0
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").write_text("")
    assert main(["firmware", str(tmp_path / "other"), "--library"]) == 2
    assert "give a new folder" in capsys.readouterr().err


CPP = r"""
#include "gyrocal.hpp"

extern "C" {
#include "emul_spi.h"
}

#include <cstdio>
#include <cstring>

static emul_t emul;

struct Bare {
    uint64_t now = 0;
    bool write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
        now += 70;
        return emul_write(&emul, now, address, reg, data, n) >= 0;
    }
    bool read(uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
        now += 70;
        return emul_read(&emul, now, address, reg, data, n) >= 0;
    }
    uint64_t now_us() { return now; }
    void wait_until_us(uint64_t t_us) { now = t_us > now ? t_us : now; }
    bool send(std::string_view text) { return std::fwrite(text.data(), 1, text.size(), stdout) == text.size(); }
};

struct Whole : Bare {
    char kept[8192] = "";
    bool store(const char *, const void *data, size_t n) { std::memcpy(kept, data, n < sizeof kept ? n : 0); return true; }
    int load(const char *, void *, size_t) { return -1; }
    void led(gc_led_t state) { std::printf("# led %d\n", static_cast<int>(state)); }
    void restart() { std::printf("# restarts\n"); }
};

struct BySpi {
    uint64_t now = 0;
    bool spi(unsigned die, const gc_spi_t &how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
        now += 20;
        emul_spi(&emul, now, die, how.mode, how.most_hz, out, n_out, in, n_in);
        return true;
    }
    uint64_t now_us() { return now; }
    void wait_until_us(uint64_t t_us) { now = t_us > now ? t_us : now; }
    bool send(std::string_view text) { return std::fwrite(text.data(), 1, text.size(), stdout) == text.size(); }
};

template <typename Board> void play(Board &board) {
    static gyrocal::Device<Board> device(board);
    emul_power_on(&emul, 1.0, 0, 250.0);
    board.wait_until_us(200000);
    device.begin();
    device.receive("stream raw\n");
    for (int i = 0; i < 20; i++) {
        device.step();
    }
    device.receive("set table_dps 45\nreboot\n");
}

int main() {
    static Bare bare;
    static Whole whole;
    static BySpi by_spi;
    emul.kind = emul_kind("MPU-6050");
    play(bare);
    emul.kind = emul_kind("LSM6DSV");
    play(whole);
    emul.kind = emul_kind("ICM-20948");
    play(by_spi);
    return static_cast<int>(emul.spi_faults);
}
"""


@pytest.mark.parametrize(("compiler", "standard"), [("g++", "c++17"), ("g++", "c++20"), ("clang++", "c++17")])
def test_the_device_as_a_class(
    library: Path, objects: Path, require_tool: Callable[[str], str], tmp_path: Path, compiler: str, standard: str
) -> None:
    """What a board's class lacks is left out: without `restart` the command is unknown."""
    (tmp_path / "main.cpp").write_text(CPP)
    flags = ["-fsanitize=address,undefined", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
    linked = [str(path) for path in sorted(objects.glob("*.o")) if path.name.startswith(("gc_", "emul", "headers"))]
    linked += [str(objects / f"{path.stem}.o") for path in (library / "src" / "effects").glob("*.c")]
    folders = [f"-I{library / 'src'}", f"-I{SIM}"]
    built = str(tmp_path / "main.o")
    command = [require_tool(compiler), f"-std={standard}", *flags, *folders, "-c", str(tmp_path / "main.cpp"), "-o", built]
    subprocess.run([*command], check=True)
    subprocess.run([require_tool("g++"), *SANITIZE, built, *linked, "-lm", "-o", str(tmp_path / "main")], check=True)
    said = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout
    hello = [s.fields["sensor"] for s in sentences(said, "HEL")]
    assert hello == ["MPU-6050", "LSM6DSV", "ICM-20948"]
    assert len(sentences(said, "RAW")) > 45
    assert [s.fields["name"] for s in sentences(said, "ERR")] == ["unknown_command"] * 2
    assert said.count("# restarts\n") == 1
    assert "# led 0\n" in said


def test_the_platforms_come_with_it(library: Path) -> None:
    for name in ("pico/main.c", "stm32/gyrocal_stm32.c", "esp_idf/main/main.c", "zephyr/src/main.c", "zephyr/prj.conf"):
        text = (library / "platforms" / name).read_text()
        assert "gyrocal" in text.lower()
    module = (library / "zephyr" / "module.yml").read_text()
    for key, path in re.findall(r"(cmake|kconfig|dts_root): (\S+)", module):
        assert (library / path).exists(), key


BARE = r"""
#include "emul.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool board_write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n);
bool board_read(uint8_t address, uint8_t reg, uint8_t *data, size_t n);
uint64_t board_us(void);
bool board_send(const char *text, size_t n);
size_t board_hear(char *text, size_t room);

static emul_t emul;
static uint64_t now;
static const struct { uint64_t at_us; int16_t z; const char *say; } script[] = {
    {1000000, 8950, "set table_dps 78\n"}, {1500000, 8950, "start up\n"}, {8500000, 8950, "stop\n"},
    {9000000, -8960, "start down\n"}, {16000000, -8960, "stop\n"}, {17000000, 0, ""}};
static size_t said;

uint64_t board_us(void) {
    now += 10;
    if (emul.kind == NULL) {
        emul.kind = emul_kind(getenv("PART"));
        emul_power_on(&emul, 1.0, 0, 250.0);
    }
    return now;
}

static bool there(uint8_t address, size_t n, size_t most) {
    now += 70;
    return emul_is_at(&emul, address) && n <= most;
}

bool board_write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    return there(address, n, 16) && emul_write(&emul, now, address, reg, data, n) >= 0;
}

bool board_read(uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    return there(address, n, 24) && emul_read(&emul, now, address, reg, data, n) >= 0;
}

bool board_send(const char *text, size_t n) {
    return fwrite(text, 1, n, stdout) == n;
}

size_t board_hear(char *text, size_t room) {
    static int16_t noise;
    int16_t world[EMUL_WORDS] = {0, 0, 0, 0, 0, 0, 16393};
    (void)room;
    if (now < script[said].at_us) {
        return 0;
    }
    noise = (int16_t)(noise + 1);
    world[3] = script[said].z;
    world[6] = script[said].z < 0 ? -16393 : 16393;
    emul_set_world(&emul, world);
    const char *line = script[said++].say;
    if (line[0] == '\0') {
        exit(0);
    }
    memcpy(text, line, strlen(line));
    return strlen(line);
}
"""


@pytest.mark.parametrize("part", ["MPU-6050", "BMI270", "LSM6DSV"])
def test_the_readme_s_program_runs_on_a_bare_bus(
    library: Path, objects: Path, require_tool: Callable[[str], str], tmp_path: Path, part: str
) -> None:
    """With the five functions that it asks for, and transfers as long as it says, at most."""
    (source,) = re.findall(r"```c\n(.*?)```", (library / "README.md").read_text(), re.DOTALL)
    (tmp_path / "main.c").write_text(source)
    (tmp_path / "board.c").write_text(BARE)
    flags = [*SANITIZE, "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", f"-I{library / 'src'}", f"-I{SIM}"]
    linked = [str(path) for path in sorted(objects.glob("*.o")) if path.name.startswith(("gc_", "emul", "headers"))]
    linked += [str(objects / f"{path.stem}.o") for path in (library / "src" / "effects").glob("*.c")]
    files = [str(tmp_path / "main.c"), str(tmp_path / "board.c"), *linked, "-lm", "-o", str(tmp_path / "main")]
    subprocess.run([require_tool("gcc"), "-std=c99", *flags, *files], check=True)
    said = subprocess.run([tmp_path / "main"], env={"PART": part}, capture_output=True, text=True, check=True).stdout
    if part == "BMI270":
        assert {s.fields["name"] for s in sentences(said, "ERR")} == {"part_file", "not_ready", "no_run"}
        return
    assert sentences(said, "HEL")[0].fields["sensor"] == part
    answer = next(s for s in sentences(said, "CAL") if s.fields["method"] == "baseline" and s.real("seconds") == 6.0)
    assert answer.real("scale") == pytest.approx((8950 + 8960) * 0.00875 / 156 - 1, abs=1e-4)
