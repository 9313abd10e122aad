"""Careless edits that the tests ought to catch: draws some, runs the tests of each one's folder, and shows those that survive.

    python tests/mutants/mutants.py                                    # `make mutants`: ten of everything below
    python tests/mutants/mutants.py --folders noise core -n 30 --seed 2 --out mutants.jsonl
    python tests/mutants/mutants.py --out mutants.jsonl --again        # after a mend: those that survived there
    python tests/mutants/mutants.py --folders inference -- -m "not slow"
    python tests/mutants/mutants.py --folders core --out core.jsonl --again --tests parity firmware   # by further tests

A folder is one of FOLDERS, or `core`, the C core, and its tests are those of the folder in tests/ with its name (CORE_TESTS),
or of --tests. They run in a copy of the tree, without an edit first: a folder whose tests fail by themselves is refused, and an
edit with which they take far longer is caught, for it hangs. Files of tests that caught most edits of the same source come
first, then those of its name, then the quickest. Of the C core, only the files that call the edited function run, as gcov
counts, and those that run another build of it. An edit of C that warns or leaves the object code as it is, is not drawn. With
--out, what was judged before is not judged again. mutmut and cosmic-ray know no C, run one command for all files, and draw no
sample by a seed.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory
from xml.etree import ElementTree

from mutant_edits import Edit, c_edits, python_edits

ROOT = Path(__file__).resolve().parents[2]
HOST, CORE = Path("host/gyrocal"), Path("firmware/gyrocal_firmware/lib/gyrocal_core")
FOLDERS = ("recording", "noise", "effects", "inference", "plausibility", "evidence", "diagnosis", "calibration", "fleet")
CORE_TESTS = ("core", "parity/test_trust.py")
TIMES_LONGER, AND_S = 3.0, 60.0
"""An edit is caught if its tests take this many times as long as without it, and this much more."""
COMPILE = ("cc", "-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic")
FAILED = re.compile(r"^(?:FAILED|ERROR) ([\w/]+\.py)", re.MULTILINE)


@dataclass(frozen=True)
class Mutant:
    """A file with one edit, named so that the same edit of the same text has the same name."""

    file: str
    folder: str
    edit: Edit

    @property
    def key(self) -> str:
        return hashlib.sha256(f"{self.file}\n{self.text}".encode()).hexdigest()[:16]

    @property
    def text(self) -> str:
        return self.edit.of((ROOT / self.file).read_text(encoding="utf-8"))

    @property
    def line(self) -> tuple[str, int]:
        return self.file, 1 + (ROOT / self.file).read_text(encoding="utf-8").count("\n", 0, self.edit.start)

    @property
    def diff(self) -> str:
        before = (ROOT / self.file).read_text(encoding="utf-8").splitlines(keepends=True)
        return "".join(difflib.unified_diff(before, self.text.splitlines(keepends=True), self.file, self.edit.kind, n=1))

    def compiles(self) -> bool:
        """Whether it is another program, without a warning."""
        if self.file.endswith(".py"):
            try:
                compile(self.text, self.file, "exec")
            except SyntaxError:
                return False
            return True
        made = _objects(self.text)
        return None not in made and made != _objects((ROOT / self.file).read_text(encoding="utf-8"))


@cache
def _objects(text: str) -> list[bytes | None]:
    """The object code of a C text with each of the core's settings, None where it does not compile."""
    made: list[bytes | None] = []
    for fixed in (0, 1):
        with NamedTemporaryFile(suffix=".o") as file:
            command = [*COMPILE, f"-DGC_NET_FIXED={fixed}", f"-I{ROOT / CORE}", "-x", "c", "-", "-c", "-o", file.name]
            done = subprocess.run(command, input=text.encode(), capture_output=True)
            made.append(Path(file.name).read_bytes() if done.returncode == 0 else None)
    return made


@dataclass(frozen=True)
class Judged:
    """A mutant and what the tests said of it: caught, and by which file if one failed, or survived."""

    key: str
    file: str
    folder: str
    kind: str
    result: str
    seconds: float
    tests: list[str]
    diff: str
    by: str = ""


def mutants(folders: list[str]) -> list[Mutant]:
    """Every mutant of the folders."""
    found = []
    for folder in folders:
        source, suffix, edits = (CORE, ".c", c_edits) if folder == "core" else (HOST / folder, ".py", python_edits)
        for path in sorted((ROOT / source).rglob(f"*{suffix}")):
            name = str(path.relative_to(ROOT))
            found += [Mutant(name, folder, edit) for edit in edits(path.read_text(encoding="utf-8"))]
    return found


def draw(every: list[Mutant], n: int, seed: int) -> Iterator[Mutant]:
    """``n`` of them that compile."""
    order = random.Random(seed).sample(every, len(every))
    drawn = 0
    for mutant in order:
        if drawn == n:
            return
        if mutant.compiles():
            drawn += 1
            yield mutant


class Tree:
    """A copy of what git knows of the tree, in which files are edited and tests run."""

    def __init__(self, root: Path) -> None:
        self.root, self.counting, self.counts = root, root / "counting", root / "counts"
        self.counting.mkdir(parents=True)
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for name in filter(None, listed.split("\0")):
            if (ROOT / name).is_file():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, root / name)

    def tested(
        self, tests: list[str], pytest: list[str], limit_s: float | None = None, counted: bool = False
    ) -> tuple[bool, float, str]:
        """Whether the tests of folders or files pass within the limit, the seconds, and the end of their output."""
        paths = os.pathsep.join(str(self.root / name) for name in ("host", "firmware", "model_export", "tests/mutants"))
        # a byte code of the text before the edit would be taken for that of the text after it: same size, same second
        own = {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1", "GYROCAL_OBJECTS": str(self.root / "objects")}
        own["XDG_CACHE_HOME"] = str(self.root / "cache")
        if counted:
            own |= {"GYROCAL_CORE_COVERAGE": str(self.counting), "GYROCAL_COUNTS": str(self.counts)}
            pytest = ["-p", "counted_apart", *pytest]
        report = f"--junitxml={self.root / 'report.xml'}"
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", report, *tests, *pytest]
        start_s = time.monotonic()
        process = subprocess.Popen(
            command, cwd=self.root, env={**os.environ, **own}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            start_new_session=True,
        )  # fmt: skip
        try:
            output = process.communicate(timeout=limit_s)[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            output = process.communicate()[0]
        except KeyboardInterrupt:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        return process.returncode == 0, time.monotonic() - start_s, output[-3000:]

    def seconds(self) -> dict[str, float]:
        """The seconds of each file of tests that ran last, the quickest first."""
        taken: dict[str, float] = {}
        for case in ElementTree.parse(self.root / "report.xml").iter("testcase"):
            parts = case.attrib["classname"].split(".")
            file = "/".join(parts[: 1 + max(i for i, part in enumerate(parts) if part.startswith("test_"))]) + ".py"
            taken[file] = taken.get(file, 0.0) + float(case.attrib["time"])
        return dict(sorted(taken.items(), key=lambda item: item[1]))

    def reached(self) -> dict[str, set[tuple[str, int]]]:
        """The lines of the core's functions that each file of tests called, where it was counted."""
        reached: dict[str, set[tuple[str, int]]] = {}
        for first in self.counts.rglob("gc_error.gcda"):
            for note in self.counting.glob("*.gcno"):
                shutil.copy(note, first.parent)
            command = ["gcov", "--json-format", "--stdout", *map(str, first.parent.glob("*.gcda"))]
            done = subprocess.run(command, cwd=first.parent, capture_output=True, text=True, check=True)
            reached[str(first.relative_to(self.counts)).partition(".py/")[0] + ".py"] = {
                (str(Path(file["file"]).relative_to(self.root)), line)
                for source in map(json.loads, done.stdout.splitlines())
                for file in source["files"]
                if Path(file["file"]).is_relative_to(self.root / CORE)
                for function in file["functions"]
                if function["execution_count"]
                for line in range(function["start_line"], function["end_line"] + 1)
            }
        return reached

    def judge(self, mutant: Mutant, tests: list[str], pytest: list[str], alone_s: float) -> Judged:
        """Run the tests with the mutant in the place of its file."""
        place = self.root / mutant.file
        place.write_text(mutant.text, encoding="utf-8")
        try:
            passed, seconds, output = self.tested(tests, pytest, TIMES_LONGER * alone_s + AND_S)
        finally:
            shutil.copy2(ROOT / mutant.file, place)
        by = FAILED.search(output)
        return Judged(
            mutant.key, mutant.file, mutant.folder, mutant.edit.kind, "survived" if passed else "caught", round(seconds, 1),
            pytest, mutant.diff, by[1] if by else "",
        )  # fmt: skip


def by_promise(
    files: dict[str, float], mutant: Mutant, judged: Iterable[Judged], reached: dict[str, set[tuple[str, int]]]
) -> list[str]:
    """The files of tests that may notice: first what caught most edits of the same source, then what bears its name, then what
    caught most of any, then as given.
    """
    same, any_source = Counter[str](), Counter[str]()
    for row in judged:
        any_source[row.by] += 1
        same[row.by] += row.file == mutant.file
    lines = {mutant.line}
    if not any(lines & called for called in reached.values()):  # in no function, perhaps a table
        lines = {line for called in reached.values() for line in called if line[0] == mutant.file}
    noticing = [file for file in files if file not in reached or lines & reached[file]]
    name = Path(mutant.file).stem.removeprefix("gc_")
    return sorted(noticing, key=lambda file: (-same[file], name not in file, -any_source[file]))


def read(path: Path | None) -> dict[str, Judged]:
    """What was judged before, by the mutant's key."""
    if path is None or not path.is_file():
        return {}
    rows = (Judged(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines())
    return {row.key: row for row in rows}


def chosen(options: argparse.Namespace, before: dict[str, Judged]) -> list[Mutant]:
    """The mutants to judge: those of a draw that are new, or the survivors of before."""
    every = mutants(options.folders)
    if options.again:
        survivors = {key: row for key, row in before.items() if row.result == "survived"}
        files = {row.file for row in survivors.values()}
        return [mutant for mutant in every if mutant.file in files and mutant.key in survivors]
    return [mutant for mutant in draw(every, options.n, options.seed) if mutant.key not in before]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--folders", nargs="+", default=[*FOLDERS, "core"], choices=[*FOLDERS, "core"])
    parser.add_argument("-n", type=int, default=10, help="how many are drawn")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="a file of JSON lines, which is read first and added to")
    parser.add_argument("--again", action="store_true", help="judge the survivors of --out again instead of a draw")
    parser.add_argument("--tests", nargs="+", help="folders in tests/ or files in tests/ instead of the folder's own")
    parser.add_argument("pytest", nargs="*", help="after --: what pytest takes, such as -m 'not slow'")
    options = parser.parse_args()
    before = read(options.out)
    todo = sorted(chosen(options, before), key=lambda mutant: mutant.folder)
    now: list[Judged] = []
    survived = [row for row in before.values() if row.result == "survived" and not options.again]
    with TemporaryDirectory() as folder:
        tree, alone, files = Tree(Path(folder).resolve()), dict[str, float](), dict[str, dict[str, float]]()
        reached: dict[str, set[tuple[str, int]]] = {}
        for mutant in todo:
            if mutant.folder not in alone:
                own = CORE_TESTS if mutant.folder == "core" else (mutant.folder,)
                tests = [f"tests/{name}" for name in options.tests or own]
                counted = mutant.folder == "core" and shutil.which("gcov") is not None
                passed, alone[mutant.folder], output = tree.tested(tests, options.pytest, counted=counted)
                if not passed:
                    sys.exit(f"{output}\n{' '.join(tests)}: fails without an edit: mend that first")
                files[mutant.folder] = tree.seconds()
                reached |= tree.reached()
            order = by_promise(files[mutant.folder], mutant, [*before.values(), *now], reached)
            row = tree.judge(mutant, order, options.pytest, alone[mutant.folder])
            now.append(row)
            if options.out is not None:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
            survived += [row] if row.result == "survived" else []
            print(f"{row.result:9}{row.seconds:7.1f} s  {row.file}: {row.kind} {row.by}", flush=True)
            print(row.diff if row.result == "survived" else "", end="", flush=True)
    print(f"{len(todo)} judged now, {len(before)} before; {len(survived)} survived")


if __name__ == "__main__":
    main()
