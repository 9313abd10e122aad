"""The core is portable C99: clean under both compilers, and free of what a microcontroller lacks."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from compiled import Objects
from gyrocal_firmware import CORE, INCLUDE, SIM, SRC

from .conftest import WARNINGS

SOURCES = sorted(CORE.rglob("*.c"))
HEADERS = sorted(CORE.rglob("*.h"))


def strict(compiler: str, fixed: int) -> list[str]:
    """A compiler with all warnings as errors. Position-independent code would keep tables of pointers writable.

    Of both, gcc alone finds warnings as it optimises.
    """
    flags = ["-std=c99", "-O2" if compiler == "gcc" else "-O0", "-fno-pic", "-ffp-contract=off", *WARNINGS]
    return [compiler, *flags, f"-DGC_NET_FIXED={fixed}", f"-I{INCLUDE}", f"-I{CORE}"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("compiler", "fixed"), [("gcc", 0), ("gcc", 1), ("clang", 0), pytest.param("clang", 1, marks=pytest.mark.wide)]
)
def test_compiles_without_a_warning(compiler: str, fixed: int, require_tool: Callable[[str], str], compiled: Objects) -> None:
    """A source that the setting does not change is compiled once for both."""
    try:
        compiled.of_all(strict(require_tool(compiler), fixed), [*SOURCES, *sorted(SIM.glob("*.c"))])
    except subprocess.CalledProcessError as error:
        pytest.fail(error.stderr.decode())


def test_clang_tidy_finds_nothing() -> None:
    """The checks that `.clang-tidy` names. Continuous integration does not install the tool."""
    tool = shutil.which("clang-tidy")
    if tool is None:
        pytest.skip("there is no clang-tidy")
    flags = ["-std=c99", f"-I{CORE}", f"-I{INCLUDE}"]
    done = subprocess.run([tool, "--quiet", *map(str, SOURCES), "--", *flags], cwd=CORE, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_headers_stand_alone_in_c_and_cplusplus(require_tool: Callable[[str], str], tmp_path: Path) -> None:
    for header in HEADERS:
        for name, language in (("one.c", "-std=c99"), ("one.cpp", "-std=c++11")):
            (tmp_path / name).write_text(f'#include "{header.name}"\n#include "{header.name}"\nextern int unused;\n')
            command = [require_tool("gcc"), language, "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{CORE}", name]
            done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
            assert done.returncode == 0, (header.name, done.stderr)


@pytest.mark.slow
def test_core_uses_neither_heap_nor_stdio_nor_writable_globals(
    require_tool: Callable[[str], str], compiled: Objects, tmp_path: Path
) -> None:
    compiled.into(tmp_path, strict(require_tool("gcc"), 0), SOURCES)
    allowed = {"memcpy", "memset", "memcmp", "memmove", "memchr", "strchr", "strlen"}
    allowed |= {"sqrt", "fabs", "floor", "fmin", "fmax"}
    units = sorted(tmp_path.glob("*.o"))
    assert [unit.stem for unit in units] == sorted(source.stem for source in SOURCES) != []
    for unit in units:
        symbols = subprocess.run([require_tool("nm"), unit], capture_output=True, text=True, check=True).stdout
        for line in symbols.splitlines():
            kind, name = line.split()[-2:]
            assert kind not in "BbDdCc", f"{unit.name} keeps {name} in writable memory"
            assert kind != "U" or name.startswith("gc_") or name in allowed, f"{unit.name} needs {name}"


def test_an_effect_is_one_file_that_no_list_names() -> None:
    effects = sorted((CORE / "effects").glob("*.c"))
    assert effects
    for effect in effects:
        assert f"GC_EFFECT({effect.stem}) {{" in effect.read_text()
        others = [p for p in (*SOURCES, *HEADERS) if p != effect and f"effect_{effect.stem}" in p.read_text()]
        assert not others, f"{effect.stem} is named in {others}"


DRIVERS = {"gc_lsm6dso": "lsm6dso", "gc_lsm6dsv": "lsm6dsv", "gc_mpu6050": "mpu6050", "gc_icm42688": "icm42688",
           "gc_icm20948": "icm20948", "gc_bmi270": "bmi270", "gc_bmi088": "bmi088"}  # fmt: skip


def test_the_core_names_no_part_outside_its_driver_and_the_list_of_parts() -> None:
    for path in (*SOURCES, *HEADERS):
        for stem, family in DRIVERS.items():
            named = family in path.read_text().lower()
            assert named == (path.stem == stem or path.name == "gc_parts.c"), path.name


def test_the_port_names_no_part_and_the_simulator_names_them_in_one_place() -> None:
    naming = {
        family: [p.name for folder in (SRC, SIM, INCLUDE) for p in sorted(folder.iterdir()) if family in p.read_text().lower()]
        for family in DRIVERS.values()
    }
    others = ["emul_world.h", "options.h", "rows.h"]
    assert naming.pop("lsm6dso") == ["emul.c", "emul.h", "emul_lsm6dso.c", "emul_lsm6dso.h", *others]
    for family in naming:
        assert naming[family] == ["emul.c", "emul.h", f"emul_{family}.c", f"emul_{family}.h"]
