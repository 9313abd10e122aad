"""How long the demo takes and how much memory, and that it needs no torch: `python benchmarks/demo.py`."""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = """
import sys
from pathlib import Path
from gyrocal.demo import demo
demo(Path(sys.argv[1]))
sys.exit(1 if {"torch", "onnx"} & set(sys.modules) else 0)
"""


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        for run in ("first", "second"):  # the second finds the core compiled
            start = time.perf_counter()
            code = subprocess.run([sys.executable, "-c", PROGRAM, str(Path(folder, run))], check=False).returncode
            print(f"{run} run: {time.perf_counter() - start:.1f} s")
            if code:
                print("torch or onnx was imported, or the demo failed")
                return code
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"peak memory: {peak_mb:.0f} MB")
    return 0 if peak_mb < 500 else 1


if __name__ == "__main__":
    raise SystemExit(main())
