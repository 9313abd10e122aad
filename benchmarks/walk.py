"""How a reader who follows ``diagnose`` call by call wanders through the folders of ``host/gyrocal``.

    python benchmarks/walk.py              # a simulated session with a ripple
    python benchmarks/walk.py --show       # and where each change of folder leads

Of the first 400 calls it counts how many are of a function in another folder than the call before, and how many are made by a
folder below the one that is called, by the order of ``tests/test_architecture.py``.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HOST = ROOT / "host" / "gyrocal"
FIRST = 400
AIM, AIM_UP = 40, 5


@dataclass(frozen=True)
class Place:
    """A function of the package: its folder, or its file where that is in none, and its name."""

    folder: str
    name: str

    @staticmethod
    def of(frame: FrameType | None) -> Place | None:
        """The place of a frame; None for what is not of the package, and for comprehensions, which nobody reads apart."""
        code = None if frame is None else frame.f_code
        if code is None or not code.co_filename.startswith(str(HOST)) or code.co_name.startswith("<"):
            return None
        path = Path(code.co_filename).relative_to(HOST)
        return Place(path.parts[0].removesuffix(".py"), f"{path}: {code.co_qualname}")


def calls_of_diagnose(session: Path) -> list[tuple[Place | None, Place]]:
    """The calls that ``diagnose`` makes with the default model: by whom and of what."""
    from gyrocal.diagnosis.answer.diagnose import diagnose
    from gyrocal.error_model.model import Model
    from gyrocal.recording.session import Session

    opened, model, calls = Session.open(session), Model.builtin("default"), list[tuple[Place | None, Place]]()

    def note(frame: FrameType, event: str, _: Any) -> None:
        place = Place.of(frame) if event == "call" and len(calls) < FIRST else None
        if place is not None:
            caller = frame.f_back
            while caller is not None and Place.of(caller) is None:
                caller = caller.f_back
            calls.append((Place.of(caller), place))

    sys.setprofile(note)
    try:
        diagnose(opened, model)
    finally:
        sys.setprofile(None)
    return calls


def main() -> None:
    sys.path.insert(0, str(ROOT))
    from tests.test_architecture import LAYERS

    from gyrocal.simulation.simulate import simulate

    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder) / "session"
        simulate(session, "full", ["table_ripple"], seed=1)
        calls = calls_of_diagnose(session)
    changes = [called for (_, before), (_, called) in pairwise(calls) if called.folder != before.folder]
    level = {folder: i for i, folder in enumerate(LAYERS)}
    upward = [(a, b) for a, b in calls if a is not None and level[b.folder] > level[a.folder]]
    print(f"{len(changes)} changes of folder in {len(calls)} calls (aim: at most {AIM}), {len(upward)} calls upward ({AIM_UP})")
    if "--show" in sys.argv[1:]:
        for place in changes:
            print("   ", place.name)
        for below, above in upward:
            print("upward:", below.name, "->", above.name)


if __name__ == "__main__":
    main()
