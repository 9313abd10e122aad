"""The core on emulated CPUs: the bits of this machine, the answers of the simulated device, and what it costs there."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration import header
from gyrocal.core import cpus, library
from gyrocal.device.rows import rows_bytes
from gyrocal.error_model.model import Model, Term
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.simulation import simulate
from gyrocal_firmware import CORE, INCLUDE, ROOT, SIM

pytestmark = pytest.mark.usefixtures("compiled_for_cpus")
BITS = ROOT / "test" / "test_same_bits" / "bits.c"
FACES = Path(__file__).with_name("faces.c")
TABLE = Path(__file__).parents[2] / "docs" / "cpus.md"
CPU = pytest.mark.parametrize(
    "cpu", [pytest.param(cpu, marks=[pytest.mark.wide] * (cpu.name == "rv32imafc"), id=cpu.name) for cpu in cpus.CPUS]
)
"""One without and one with an FPU; ``make wide`` adds the RISC-V with an FPU."""
Require = Callable[[str], str]
DOCUMENTED_GCC = "12.2"
"""The compiler that made the table."""


def require(cpu: cpus.Cpu, require_tool: Require) -> None:
    for tool in ("cc", *cpu.tools):
        require_tool(tool)


def has_no_fpu(cpu: cpus.Cpu) -> bool:
    return cpu.name == "rv32imc"


def setting(fixed: bool) -> str:
    return f"-DGC_NET_FIXED={int(fixed)}"


def first_difference(ours: bytes, theirs: bytes) -> str:
    pairs = zip(ours.splitlines(), theirs.splitlines(), strict=False)
    return next((f"here  {a!r}\nthere {b!r}" for a, b in pairs if a != b), "one has more lines")


def bits_here() -> bytes:
    program = library.build("bits", [BITS, *library.core_sources()], [INCLUDE, CORE])
    return subprocess.run([program], capture_output=True, check=True).stdout


@CPU
def test_computes_the_same_bits(cpu: cpus.Cpu, require_tool: Require, tmp_path: Path) -> None:
    require(cpu, require_tool)
    here = bits_here()
    there = cpus.run(cpu, cpus.build(cpu, [BITS, *library.core_sources()], tmp_path / "bits.elf"))
    lines = here.splitlines()
    assert {line.split()[0] for line in lines} == {b"math", b"inference", b"baseline", b"estimator", b"wire"}
    assert sum(line.startswith(b"estimator 0 ") for line in lines) == 3
    assert there == here, first_difference(here, there)


NETWORKS = [
    pytest.param(
        cpu, fixed, id=f"{'integers' if fixed else 'float'}-{cpu.name}",
        marks=[pytest.mark.wide] * (cpu.name == "rv32imafc" or fixed != has_no_fpu(cpu)),
    )
    for cpu in cpus.CPUS for fixed in (False, True)
]  # fmt: skip
"""As each CPU has it, and with ``make wide`` as the others have it."""


@pytest.mark.parametrize(("cpu", "fixed"), NETWORKS)
def test_a_network_gives_the_same_bits(cpu: cpus.Cpu, fixed: bool, require_tool: Require, tmp_path: Path) -> None:
    """Network `gyrocal` in float32 and in integers, whichever is the CPU's default."""
    require(cpu, require_tool)
    sources = [FACES, *library.core_sources()]
    program = library.build("faces", sources, [INCLUDE, CORE], [setting(fixed)])
    here = subprocess.run([program], capture_output=True, check=True).stdout
    there = cpus.run(cpu, cpus.build(cpu, sources, tmp_path / "faces.elf", flags=(*cpus.OPTIMISE, setting(fixed))))
    answered = [line for line in here.splitlines() if line.startswith(b"0 ")]
    assert len(set(answered)) == 18
    assert there == here, first_difference(here, there)


@CPU
def test_layers_are_integers_where_the_cpu_has_no_fpu(cpu: cpus.Cpu, require_tool: Require, tmp_path: Path) -> None:
    require(cpu, require_tool)
    source = tmp_path / "default.c"
    source.write_text(
        """#include "gc_convnet.h"
#include <stdio.h>
int main(int argc, char **argv) {
    (void)argc, (void)argv;
    printf("%d", GC_NET_FIXED);
    return 0;
}
"""
    )
    assert cpus.run(cpu, cpus.build(cpu, [source], tmp_path / "default.elf")) == (b"1" if has_no_fpu(cpu) else b"0")


@pytest.mark.wide
def test_a_fused_multiply_add_would_be_seen(require_tool: Require, tmp_path: Path) -> None:
    """It changes last bits, which is why the core is compiled without."""
    cpu = next(c for c in cpus.CPUS if c.name == "cortex-m4f")
    require(cpu, require_tool)
    sources = [BITS, *library.core_sources()]
    there = cpus.run(cpu, cpus.build(cpu, sources, tmp_path / "bits.elf", flags=("-O2", "-ffp-contract=fast")))
    assert there != bits_here()


@pytest.fixture(scope="module")
def headers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration with an effect and drift noise, so that all three methods answer."""
    folder = tmp_path_factory.mktemp("headers")
    paper = Model.builtin("paper").terms
    ripple = Term("table_ripple", "z", {"amplitude_1": 0.0016, "amplitude_2": 0.0005})
    noise = AxisNoise(0.0448, Drift(0.002, 30.0))
    header.write(Model("rippling", (*paper, ripple), {"z": noise}), folder / "calibration.h")
    return folder


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Up and down for 7 s each, the table rippling."""
    path = tmp_path_factory.mktemp("rows") / "pair.rows"
    session, _ = simulate.simulate(None, "paper", ["table_ripple"], 3, scenarios=1, seconds=7)
    path.write_bytes(rows_bytes(session))
    return path


@pytest.mark.wide
@CPU
def test_a_whole_calibration_says_the_same_words(
    cpu: cpus.Cpu, require_tool: Require, headers: Path, rows: Path, tmp_path: Path
) -> None:
    """The simulated device, compiled for that CPU: every sentence, raw samples and answers, byte for byte.

    Here it is compiled with the layers of the network as that CPU has them.
    """
    require(cpu, require_tool)
    options = [str(rows), "--speed", "max", "--stream", "raw"]
    device = library.build_sim(headers, [setting(has_no_fpu(cpu))])
    here = subprocess.run([device, *options], capture_output=True, check=True).stdout
    sources = [*library.core_sources(), *sorted(SIM.glob("*.c"))]
    there = cpus.run(cpu, cpus.build(cpu, sources, tmp_path / "sim.elf", [headers]), options)
    answers = [line.split(b",")[4:6] for line in here.splitlines() if line.startswith(b"$CAL")]
    want = [[b"method=" + m, b"seconds=" + s] for s in (b"2", b"4", b"6") for m in (b"baseline", b"model", b"cnn")]
    assert sorted(answers) == sorted(want)
    assert there == here, first_difference(here, there)


def documented() -> dict[tuple[str, str], list[int]]:
    """Part and CPU -> the figures of the table in docs/cpus.md: instructions, largest, flash, RAM, stack."""
    lines = TABLE.read_text().partition("<!-- table")[2].partition("<!-- end")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines.splitlines()[3:]]
    return {(part, cpu): [int(n.replace(" ", "")) for n in figures] for part, cpu, *figures in rows}


def test_the_documented_table_is_complete() -> None:
    assert set(documented()) == {(part, cpu.name) for part in cpus.parts() for cpu in cpus.CPUS}


@pytest.mark.wide
@CPU
@pytest.mark.parametrize("part", ["inference_paper", "inference_gyrocal", "inference_gyrocal_fixed", "device"])
def test_costs_what_the_documentation_says(cpu: cpus.Cpu, part: str, require_tool: Require) -> None:
    """Within a twentieth with the documented compiler, a fifth with another: else make the table again, and say why it grew."""
    require(cpu, require_tool)
    version = subprocess.run([cpu.tools[0], "-dumpfullversion"], capture_output=True, text=True, check=True).stdout
    c = cpus.cost(cpu, part)
    found = [c.instructions, c.largest, c.flash_bytes, c.ram_bytes, c.stack_bytes]
    limit = 0.05 if version.startswith(DOCUMENTED_GCC) else 0.2
    np.testing.assert_allclose(found, documented()[part, cpu.name], rtol=limit)


@CPU
def test_counts_what_is_known(cpu: cpus.Cpu, require_tool: Require, tmp_path: Path) -> None:
    """An empty part costs nothing; a thousand instructions, 5000 bytes and a kilobyte of stack are found."""
    require(cpu, require_tool)
    part = tmp_path / "known.c"
    part.write_text(
        """/* Known. */
#include "cost.h"
#define TEN(x) x x x x x x x x x x
const unsigned cost_times = 100;
static volatile char kept[5000];
void cost_prepare(void) { kept[0] = 1; }
void cost_act(void) {
    volatile char stack[1024];
    stack[0] = 0;
    TEN(TEN(TEN(__asm__ volatile("nop");)))
}
"""
    )
    cost = cpus.cost(cpu, part, [])
    assert 1000 <= cost.instructions <= 1030
    assert 1000 <= cost.largest <= 1100
    assert 2000 <= cost.flash_bytes <= 4100  # a nop has 2 or 4 bytes
    assert 5000 <= cost.ram_bytes <= 5016
    assert 1024 <= cost.stack_bytes <= 1100
    assert cost.what == "Known."
