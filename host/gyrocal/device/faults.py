"""Faults of the simulated device: specifications ``NAME[@T][:LENGTH][*TIMES]``, and random ones from a seed.

T and LENGTH are in seconds; T counts from the first sample of the first run. The simulator lists the names and their meanings.
"""

from __future__ import annotations

import random
import re
import subprocess
from collections.abc import Sequence

from gyrocal.errors import InputError, did_you_mean, there_are

LASTING = ("wrong_id", "stuck_bit", "reset_timeout", "table_off", "reversed_mount", "stuck_mass", "flash_fails")
"""Faults that last from power-on unless specified otherwise; random ones do not include them."""
OF_BOARD = ("unheard", "hang", "supply")
"""Faults of the board that random ones do not include: soak tests with the seeds of earlier versions stay the same."""
OF_FIFO = "bad_tags"
MOST_RANDOM = 6
LATEST_S = 20.0
SHORTEST_S, LONGEST_S = 0.05, 2.0
_NUMBER = r"[0-9]+(?:\.[0-9]+)?"
_SPECIFICATION = re.compile(rf"(?P<name>\w+)(?:@{_NUMBER})?(?::{_NUMBER})?(?:\*[1-9][0-9]{{0,2}})?")


def faults() -> str:
    """The simulator's own list of faults, one a line: name, tab, what happens."""
    from gyrocal.core import library

    done = subprocess.run([library.build_sim(), "--fault", "list"], capture_output=True, text=True, check=False)
    return done.stdout


def fault_names() -> list[str]:
    """Names of all faults, in the simulator's order."""
    return [line.split("\t")[0] for line in faults().splitlines()]


def check_faults(specifications: Sequence[str], fifo: int = 0) -> None:
    """Check specifications before the device starts; ``fifo``: samples taken at once, 0 without the FIFO.

    Raises:
        InputError: the specification is malformed, names no fault, or is a fault of a FIFO that is not in use.
    """
    names = fault_names() if specifications else []
    for text in specifications:
        found = _SPECIFICATION.fullmatch(text)
        if found is None:
            raise InputError(
                f"--fault {text}: write NAME[@T][:LENGTH][*TIMES], T and LENGTH in seconds, for example nack@2:0.5*3"
            )
        if found["name"] not in names:
            listed = there_are(names, "`gyrocal device --fault list`")
            raise InputError(f"--fault {text}: no fault of this name{did_you_mean(text, names)}; {listed}")
        if found["name"] == OF_FIFO and not fifo:
            raise InputError(f"--fault {text}: is a fault of the FIFO; give --fifo too, for example --fifo 12")


def random_faults(text: str, fifo: int = 0) -> list[str]:
    """Specifications of one to six passing faults by ``random:SEED``; the same seed gives the same faults.

    Raises:
        InputError: ``text`` is not ``random:SEED`` with a whole number.
    """
    found = re.fullmatch(r"random:([0-9]{1,18})", text)
    if found is None:
        raise InputError(f"--faults {text}: write random:SEED with a whole number, for example random:7")
    draw = random.Random(int(found[1]))
    names = [name for name in fault_names() if name not in (*LASTING, *OF_BOARD) and (fifo or name != OF_FIFO)]
    return [
        f"{draw.choice(names)}@{draw.uniform(0.0, LATEST_S):.2f}:{draw.uniform(SHORTEST_S, LONGEST_S):.2f}"
        for _ in range(draw.randint(1, MOST_RANDOM))
    ]
