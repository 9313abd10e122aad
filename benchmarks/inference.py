"""What one answer of network `paper` costs on an emulated Cortex-M4F: our kernel beside C that others generate of its graph.

Peers are used where they are installed (`pip install emx-onnx-cgen`, in an environment of its own, its `bin` on the PATH); what
is not there is named. Instructions of one call, RAM (static and stack, windows included), flash (code, tables and helpers),
compiled with the same options; `max_abs_diff` is a peer's largest difference from onnxruntime on the same windows. Beside them
network `gyrocal` on the counts of 6 s, its layers in float32 and in integers.

    gyrocal benchmark inference
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.calibration.network import Network, image
from gyrocal.core import cpus
from gyrocal.core import library as core
from gyrocal.core.verify import windows
from gyrocal.present.output import stdout, table
from gyrocal_firmware import INCLUDE

CPU = next(cpu for cpu in cpus.CPUS if cpu.name == "cortex-m4f")
DATA = Path(str(files("gyrocal"))) / "data"
GENERATOR = "emx-onnx-cgen"
GRAPHS = {"float": "paper.onnx", "int8 weights": "paper.int8.onnx"}
FIGURES = ("instructions", "ram_bytes", "flash_bytes")

COST = """\
/* Network `paper` as a generator of C writes it. */
#include "cost.h"
#include "peer.h"

const unsigned cost_times = 20;
static float up[1][1][2][290], down[1][1][2][290], y[1][2];

void cost_prepare(void) {
    for (unsigned i = 0; i < 290u; i++) {
        up[0][0][0][i] = 0.2f + 0.01f * (float)(i * 7u % 23u);
        down[0][0][0][i] = -0.4f + 0.01f * (float)(i * 11u % 23u);
        up[0][0][1][i] = 78.0f;
        down[0][0][1][i] = -78.0f;
    }
}

void cost_act(void) { peer(up, down, y); }
"""
DECLARATION = "void peer(const float up[][1][2][290], const float down[][1][2][290], float y[][2]);\n"

def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Measure the costs and return what ``gyrocal benchmark inference --json`` prints. ``sample`` changes nothing."""
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as name:
        folder = Path(name)
        alone = folder / "alone"
        alone.mkdir()
        paper = (INCLUDE / "weights.h").read_text().replace("    .convnet = &gc_gyrocal,\n", "")
        (alone / "weights.h").write_text(paper)
        ours = _figures(cpus.cost(CPU, "inference_paper", include_dirs=[alone]))
        gyrocal = _figures(cpus.cost(CPU, "inference_gyrocal"))
        fixed = _figures(cpus.cost(CPU, "inference_gyrocal_fixed"))
        progress(1, 1 + len(GRAPHS))
        peers = []
        absent = [] if shutil.which(GENERATOR) else [GENERATOR]
        for done, (kind, graph) in enumerate(GRAPHS.items(), start=2):
            if not absent:
                peers.append(_peer(folder / kind.replace(" ", "_"), kind, DATA / graph))
            progress(done, 1 + len(GRAPHS))
    best = {
        name.removesuffix("_bytes"): min(p[name] for p in peers) / ours[name] if peers else None for name in FIGURES
    }  # fmt: skip
    return {
        "ours": ours, "gyrocal": gyrocal, "gyrocal_fixed": fixed, "peers": peers, "best_peer_ratio": best, "absent": absent,
        "cpu": CPU.name,
    }  # fmt: skip


def _figures(cost: cpus.Cost) -> dict[str, int]:
    return {
        "instructions": cost.instructions, "ram_bytes": cost.ram_bytes + cost.stack_bytes, "flash_bytes": cost.flash_bytes,
    }  # fmt: skip


def _peer(folder: Path, kind: str, graph: Path) -> dict[str, Any]:
    """The cost of C code generated from a graph, and its largest difference from onnxruntime."""
    folder.mkdir()
    source = folder / "generated.c"
    command = [GENERATOR, "compile", "--model-name", "peer", "--large-temp-threshold", "0", "--input-dim", "N=1"]
    subprocess.run([*command, str(graph), str(source)], check=True, capture_output=True)
    (folder / "peer.h").write_text(DECLARATION)
    part = folder / "part.c"
    part.write_text(COST)
    cost = cpus.cost(CPU, part, sources=[source], include_dirs=[folder])
    return {"name": f"{GENERATOR}, {kind}", **_figures(cost), "max_abs_diff": _difference(source, graph)}


def _difference(source: Path, graph: Path) -> float:
    net = Network.open(graph)
    up, down = windows(net, 0)
    finite = np.isfinite(up).all(1) & np.isfinite(down).all(1)
    up, down = up[finite], down[finite]
    want = net.estimate(up, down, net.table_dps, -net.table_dps)
    library = ctypes.CDLL(str(core.build("peer", [source], [], core.SHARED)))
    pointer = np.ctypeslib.ndpointer(np.float32, flags="C_CONTIGUOUS")
    library.peer.argtypes = [pointer, pointer, pointer]
    got = np.zeros_like(want)
    for i in range(len(want)):
        images = [np.ascontiguousarray(image(x[i : i + 1], w)) for x, w in ((up, net.table_dps), (down, -net.table_dps))]
        library.peer(images[0], images[1], got[i : i + 1])
    return float(np.abs(got - want).max())


def show(found: dict[str, Any]) -> None:
    """Print the table on the terminal."""
    rows = [
        [name, *(f"{of[figure]:,}".replace(",", " ") for figure in FIGURES), diff]
        for name, of, diff in [
            ("gyrocal's kernel, network paper", found["ours"], ""),
            *((p["name"], p, f"{p['max_abs_diff']:.1e}") for p in found["peers"]),
            ("network gyrocal, 6 s, float32", found["gyrocal"], ""),
            ("network gyrocal, 6 s, integers", found["gyrocal_fixed"], ""),
        ]
    ]
    table(f"one answer on {found['cpu']}", ["code:", "instructions", "RAM bytes", "flash bytes", "off onnxruntime"], rows)
    for name in found["absent"]:
        stdout.print(f"{name} is not installed; pip install it elsewhere and put its bin on the PATH")
