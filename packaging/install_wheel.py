"""Install the wheel of a folder with extras: ``python packaging/install_wheel.py FOLDER EXTRA,EXTRA``."""

import subprocess
import sys
from pathlib import Path

folder, extras = sys.argv[1:3]
(wheel,) = Path(folder).glob("gyrocal-*.whl")
constraints = Path(__file__).resolve().parents[1] / "constraints.txt"
raise SystemExit(subprocess.call([sys.executable, "-m", "pip", "install", "-c", str(constraints), f"{wheel}[{extras}]"]))
