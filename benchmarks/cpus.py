"""What the core costs on emulated CPUs: instructions, flash, RAM and stack of each part, as a Markdown table.

python benchmarks/cpus.py                  prints it
python benchmarks/cpus.py docs/cpus.md     puts it between the marks in that file
"""

import sys
from pathlib import Path

from gyrocal.core import cpus

BEGIN, END = "<!-- table: python benchmarks/cpus.py docs/cpus.md -->\n", "<!-- end of table -->\n"
COLUMNS = ("part", "CPU", "instructions", "largest", "flash, bytes", "RAM, bytes", "stack, bytes")


def table() -> str:
    """The table's lines, one for each part and CPU."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "| --- | --- |" + " ---: |" * (len(COLUMNS) - 2)]
    for part in cpus.parts():
        for cpu in cpus.CPUS:
            c = cpus.cost(cpu, part)
            figures = (c.instructions, c.largest, c.flash_bytes, c.ram_bytes, c.stack_bytes)
            lines.append("| " + " | ".join([part, cpu.name, *(f"{n:,}".replace(",", " ") for n in figures)]) + " |")
    return "\n".join(lines) + "\n"


def put(text: str, begin: str, end: str) -> None:
    """Print a table, or put it between its marks in the file that the command line names."""
    if len(sys.argv) == 1:
        print(text, end="")
        return
    path = Path(sys.argv[1])
    before, _, rest = path.read_text().partition(begin)
    _, _, after = rest.partition(end)
    path.write_text(before + begin + text + end + after)


def main() -> None:
    put(table(), BEGIN, END)


if __name__ == "__main__":
    main()
