"""What an installation weighs and how long its import takes, as a Markdown table. Needs the package index.

python benchmarks/weight.py                     this checkout: without an extra, and with some
python benchmarks/weight.py --source FOLDER     another checkout, without an extra
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXTRAS = ("", "[net]", "[page,net]")
TIMES = 9
EVERY_NAME = "import gyrocal.api as api; [getattr(api, name) for name in api.__all__]"
IMPORTS = ("import numpy, scipy", "import gyrocal.api", "from gyrocal.api import Model, Session", EVERY_NAME)

COMMANDS = (("version",), ("--help",), ("compare", "--help"), ("effects",))


def environment(folder: Path, source: Path, extra: str) -> Path:
    """The interpreter of a new environment into which the checkout was installed."""
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    pip = [str(folder / "bin" / "pip"), "install", "--quiet", "-c", str(source / "constraints.txt")]
    subprocess.run([*pip, f"{source}{extra}"], check=True, stderr=subprocess.DEVNULL)
    return folder / "bin" / "python"


def megabytes(python: Path) -> tuple[int, int]:
    """Megabytes of ``site-packages`` without pip and setuptools, and how many packages lie there."""
    (packages,) = python.parent.parent.glob("lib/python*/site-packages")
    theirs = [p for p in packages.iterdir() if not p.name.startswith(("pip", "setuptools", "pkg_resources", "_distutils_hack"))]
    size = sum(file.stat().st_size for p in theirs for file in (p.rglob("*") if p.is_dir() else [p]) if file.is_file())
    return round(size / 1e6), sum(p.name.endswith(".dist-info") for p in theirs)


def seconds(python: Path, statement: str) -> float:
    """Processor time of a statement in a new interpreter, the best of several."""
    code = f"import time; before = time.process_time(); {statement}; print(time.process_time() - before)"
    return min(float(subprocess.check_output([python, "-c", code], text=True, cwd="/")) for _ in range(TIMES))


def started(python: Path, words: tuple[str, ...]) -> float:
    """Processor time of a command of gyrocal from its start to its end, the best of several."""
    times = []
    for _ in range(TIMES):
        process = subprocess.Popen([python.parent / "gyrocal", *words], stdout=subprocess.DEVNULL, cwd="/")
        _, status, used = os.wait4(process.pid, 0)
        if status:
            sys.exit(f"gyrocal {' '.join(words)} failed")
        times.append(used.ru_utime + used.ru_stime)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", type=Path)
    source: Path | None = parser.parse_args().source
    with tempfile.TemporaryDirectory() as scratch:
        print("| installed | MB | packages |\n| --- | ---: | ---: |")
        for number, extra in enumerate(EXTRAS if source is None else ("",)):
            python = environment(Path(scratch, str(number)), source or ROOT, extra)
            size, count = megabytes(python)
            print(f"| `gyrocal{extra}` | {size} | {count} |", flush=True)
        bare = Path(scratch, "0", "bin", "python")
        print("\n| statement | processor time, s | of numpy and scipy |\n| --- | ---: | ---: |")
        took = {statement: seconds(bare, statement) for statement in IMPORTS}
        for statement, second in took.items():
            print(f"| `{statement}` | {second:.2f} | {second / took[IMPORTS[0]]:.1f} |")
        print("\n| command | processor time, s |\n| --- | ---: |")
        for words in COMMANDS if source is None else ():
            print(f"| `gyrocal {' '.join(words)}` | {started(bare, words):.2f} |", flush=True)


if __name__ == "__main__":
    main()
