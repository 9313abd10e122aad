"""`pio test`: every line that the core prints on the target must be the line that this computer's `cc` makes."""

import shlex
import shutil
import subprocess
import tempfile
from os import environ
from pathlib import Path

import click
from platformio.public import TestCase, TestRunnerBase, TestStatus

PROJECT = Path(__file__).resolve().parent.parent
CORE = PROJECT / "lib" / "gyrocal_core"
FLAGS = ("-std=c99", "-O1", "-ffp-contract=off")


def reference(include: Path) -> list[str]:
    """What bits.c prints on this computer."""
    command = shlex.split(environ.get("CC", "cc"))
    if shutil.which(command[0]) is None:
        raise RuntimeError(f"no C compiler ({command[0]}) to compute the reference with: install one, or set CC")
    with tempfile.TemporaryDirectory() as folder:
        program = f"{folder}/bits"
        sources = [str(p) for p in (PROJECT / "test" / "test_same_bits" / "bits.c", *CORE.rglob("*.c"))]
        includes = [f"-I{include}", f"-I{CORE}"]
        subprocess.run([*command, *FLAGS, *includes, *sources, "-lm", "-o", program], check=True)
        return subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()


class CustomTestRunner(TestRunnerBase):
    """A test case a section of bits.c: math, inference, baseline, estimator, wire."""

    def setup(self) -> None:
        self.expected = reference(Path(self.project_config.get("platformio", "include_dir")))
        self.sections = list(dict.fromkeys(line.split()[0] for line in self.expected))
        self.lines: list[str] = []

    def on_testing_line_output(self, line: str) -> None:
        """Takes a line of the target; noise of its boot is passed over."""
        words = line.split()
        if words and words[0] in self.sections:
            self.lines.append(line.rstrip("\n"))
            if len(self.lines) == len(self.expected):
                self.finish()

    def finish(self) -> None:
        """Compares section by section."""
        for section in self.sections:
            pairs = zip(self.lines, self.expected, strict=True)
            wrong = [pair for pair in pairs if pair[0] != pair[1] and pair[1].split()[0] == section]
            message = "target {!r}, reference {!r}".format(*wrong[0]) if wrong else None
            case = TestCase(section, TestStatus.FAILED if wrong else TestStatus.PASSED, message)
            click.echo(case.humanize())
            self.test_suite.add_case(case)
        self.test_suite.on_finish()
