"""Coverage-guided fuzzing of the C core with clang's libFuzzer, address and undefined-behaviour sanitizers.

``python tests/fuzz/fuzzing.py --seconds 600`` fuzzes each target for ten minutes, prints a table, and adds inputs that reach
new code to the archives in ``tests/fuzz/corpus``. An input that ends a target is left in the folder that is printed. Names of
targets fuzz only these. ``make fuzz`` is the same.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from gyrocal_firmware import CORE, INCLUDE, SIM

HERE = Path(__file__).resolve().parent
CORPUS = HERE / "corpus"
TARGETS = tuple(sorted(p.stem.removeprefix("fuzz_") for p in HERE.glob("fuzz_*.c")))
FLAGS = ["-std=c99", "-g", "-O1", "-ffp-contract=off", "-DGC_LIBFUZZER", "-fno-sanitize-recover=all"]
LONGEST = 2048
"""Bytes of an input."""
SLOWEST_S = 20
"""Seconds that one input may take: a device that does not end is a finding."""

LARGEST_MB = 64
"""A single allocation beyond it is a finding: the core allocates nothing."""


@dataclass(frozen=True)
class Fuzzed:
    """What one target did: executions, points of the program that were reached, and what it ended with (None: nothing)."""

    target: str
    executions: int
    reached: int
    found: str | None


def compile_core(clang: str, folder: Path) -> None:
    """Compile the core and the emulated sensor, instrumented, into objects in ``folder``."""
    sources = [*sorted(CORE.rglob("*.c")), *sorted(p for p in SIM.glob("*.c") if p.name != "main.c")]
    flags = [*FLAGS, "-fsanitize=fuzzer-no-link,address,undefined", f"-I{CORE}", f"-I{INCLUDE}"]
    subprocess.run([clang, *flags, "-c", *map(str, sources)], cwd=folder, check=True)


def link(clang: str, objects: Path, target: str) -> Path:
    """Link a target with the objects of :func:`compile_core` and return the program."""
    program = objects / target
    includes = [f"-I{folder}" for folder in (INCLUDE, CORE, SIM)]
    linked = [str(p) for p in sorted(objects.glob("*.o"))]
    flags = [*FLAGS, "-fsanitize=fuzzer,address,undefined"]
    command = [clang, *flags, *includes, str(HERE / f"fuzz_{target}.c"), *linked, "-lm", "-o", str(program)]
    subprocess.run(command, check=True)
    return program


def fuzz(program: Path, seconds: int, new: Path, seed: int = 0) -> Fuzzed:
    """Run a target on its corpus and then for ``seconds`` on inputs made from it. New inputs and crashes go to ``new``."""
    limits = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", f"-timeout={SLOWEST_S}", f"-seed={seed}"]
    limits += ["-rss_limit_mb=0", f"-malloc_limit_mb={LARGEST_MB}"]  # the resident size counts that of the parent process
    done = subprocess.run(
        [str(program), *limits, "-print_final_stats=1", f"-artifact_prefix={new}/", str(new), str(_corpus(program))],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace", check=False,
    )  # fmt: skip
    executions = re.search(r"stat::number_of_executed_units:\s+(\d+)", done.stderr)
    reached = re.findall(r"cov: (\d+)", done.stderr)
    found = None if done.returncode == 0 else done.stderr[-4000:]
    return Fuzzed(program.name, int(executions[1]) if executions else 0, int(reached[-1]) if reached else 0, found)


def keep(program: Path, new: Path) -> None:
    """Add to the corpus those inputs of ``new`` that reach code which no input of the corpus reaches."""
    kept = _corpus(program)
    merge = [str(program), "-merge=1", str(kept), str(new)]
    subprocess.run(merge, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    CORPUS.mkdir(exist_ok=True)
    with zipfile.ZipFile(CORPUS / f"{program.name}.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(kept.iterdir()):
            archive.writestr(zipfile.ZipInfo(path.name), path.read_bytes())


def _corpus(program: Path) -> Path:
    """The folder beside the program that holds the inputs of the target's archive."""
    folder = program.with_name(f"{program.name}-corpus")
    if not folder.is_dir():
        folder.mkdir()
        archive = CORPUS / f"{program.name}.zip"
        if archive.is_file():
            zipfile.ZipFile(archive).extractall(folder)
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", default=TARGETS, metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--clang", default="clang")
    chosen = parser.parse_args()
    objects = Path(tempfile.mkdtemp(prefix="gyrocal-fuzz-"))
    compile_core(chosen.clang, objects)
    print("| Target | Executions | Points reached | Found |\n|---|---|---|---|")
    failed = False
    for target in chosen.targets:
        program, new = link(chosen.clang, objects, target), objects / f"{target}-new"
        new.mkdir()
        done = fuzz(program, chosen.seconds, new, chosen.seed)
        failed = failed or done.found is not None
        print(f"| `{target}` | {done.executions} | {done.reached} | {'nothing' if done.found is None else new} |", flush=True)
        if done.found is None:
            keep(program, new)
        else:
            print(done.found, file=sys.stderr)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
