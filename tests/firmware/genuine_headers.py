"""The ESP32 port type-checked against Arduino-ESP32's own headers and flags, for each environment of platformio.ini.

    python tests/firmware/genuine_headers.py FRAMEWORK TOOLCHAIN

FRAMEWORK is PlatformIO's framework-arduinoespressif32, TOOLCHAIN an xtensa-esp32-elf of gcc 5.2, of which the C and C++ headers
are taken. This machine's g++ reads them for 32 bits. Prints what it says of each file of the port.
"""

from __future__ import annotations

import re
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2] / "firmware" / "gyrocal_firmware"
CHIP = {"esp32thing_plus": "esp32", "esp32-c3-devkitm-1": "esp32c3", "esp32-s3-devkitc-1": "esp32s3"}
VARIANT = {"esp32": "esp32thing_plus", "esp32c3": "esp32c3", "esp32s3": "esp32s3"}
THREADS = "-D_POSIX_THREADS -D_UNIX98_THREAD_MUTEX_ATTRIBUTES"
"""What a newer toolchain's headers define for the Bluetooth library."""
SPI = "-DGYROCAL_SPI_SCK=18 -DGYROCAL_SPI_MISO=19 -DGYROCAL_SPI_MOSI=23 -DGYROCAL_SPI_CS=5 -DGYROCAL_SPI_CS2=4"
EXTRAS = ("", "-DGYROCAL_SDA2=17 -DGYROCAL_SCL2=16 -DGYROCAL_INT1=27", SPI, f"-DGYROCAL_BLE {THREADS}")


class Environment:
    """What the framework's build script is given: it tells its include folders and definitions."""

    def __init__(self, framework: Path) -> None:
        self.found: dict[str, list[Any]] = {}
        self._framework = framework

    def PioPlatform(self) -> Environment:
        return self

    def BoardConfig(self) -> Environment:
        return self

    def get_package_dir(self, name: str) -> str:
        return str(self._framework)

    def get(self, name: str, default: str = "") -> str:
        return default

    def subst(self, text: str) -> str:
        return text

    def Append(self, **values: list[Any]) -> None:
        for name, each in values.items():
            self.found.setdefault(name, []).extend(each)

    Prepend = Append


def flags(framework: Path, chip: str) -> list[str]:
    """Include folders and definitions of the framework's own build of a chip."""
    env = Environment(framework)
    script = types.ModuleType("SCons.Script")
    script.DefaultEnvironment = lambda: env  # type: ignore[attr-defined]
    sys.modules["SCons"], sys.modules["SCons.Script"] = types.ModuleType("SCons"), script
    source = (framework / "tools" / f"platformio-build-{chip}.py").read_text(encoding="utf-8")
    exec(compile(source, chip, "exec"), {})
    defines = [each if isinstance(each, str) else f"{each[0]}={each[1]}" for each in env.found["CPPDEFINES"]]
    defines = [each.replace('\\"', '"') for each in defines] + (["__XTENSA__"] if chip != "esp32c3" else [])
    variant = framework / "variants" / VARIANT[chip]
    headers = [*env.found["CPPPATH"], framework / "cores" / "esp32", variant, *framework.glob("libraries/*/src")]
    return [f"-D{each}" for each in defines] + [f"-isystem{each}" for each in headers]


def folders(toolchain: Path, cpp: bool) -> list[str]:
    """The C and C++ headers of the toolchain, and those that belong to this machine's compiler itself."""
    std = toolchain / "xtensa-esp32-elf" / "include"
    cxx = std / "c++" / "5.2.0"
    done = subprocess.run(["gcc", "-print-file-name=include"], capture_output=True, text=True, check=True)
    return [f"-isystem{each}" for each in [*((cxx, cxx / "xtensa-esp32-elf") if cpp else ()), done.stdout.strip(), std]]


def complaints(source: Path, options: list[str], toolchain: Path) -> str:
    """What the compiler says of a file of the port."""
    cpp = source.suffix == ".cpp"
    command = ["g++" if cpp else "gcc", "-std=gnu++11" if cpp else "-std=gnu99", "-m32", "-Wall", "-Wextra", "-fsyntax-only"]
    mine = [f"-I{ROOT / folder}" for folder in ("src", "include", "lib/gyrocal_core")]
    command += ["-nostdinc", *mine, *options, *folders(toolchain, cpp), str(source)]
    return subprocess.run(command, capture_output=True, text=True, check=False).stderr


def main() -> int:
    framework, toolchain = Path(sys.argv[1]), Path(sys.argv[2])
    ini = (ROOT / "platformio.ini").read_text(encoding="utf-8")
    said = ""
    for environment, board, own in re.findall(r"\[env:(\w+)\]\nextends = esp32\nboard = (\S+)\nbuild_flags = \S+ (.*)\n", ini):
        for extra in EXTRAS:
            options = [*flags(framework, CHIP[board]), *own.split(), *extra.split()]
            for source in sorted(p for p in (ROOT / "src").iterdir() if p.suffix in (".c", ".cpp")):
                found = complaints(source, options, toolchain)
                said += found
                print(f"{environment} {extra} {source.name}: {found or 'no warning'}")
    return 1 if said else 0


if __name__ == "__main__":
    raise SystemExit(main())
