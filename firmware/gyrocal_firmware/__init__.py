"""Where the firmware's C sources are: a Python package only so that a wheel carries them."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent
CORE = ROOT / "lib" / "gyrocal_core"
SIM = ROOT / "sim"
EMUL = ROOT / "emul"
INCLUDE = ROOT / "include"
SRC = ROOT / "src"
LIBRARY = ROOT / "library"
