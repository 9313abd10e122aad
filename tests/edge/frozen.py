"""The seed of the frozen part: the git tree of the code that the cases judge.

Nobody knows the tree before the code is written, and each change of the code draws other cases. No method can be fitted to
them, and no secret has to be kept. Whoever checks out the code, or sets ``GYROCAL_EDGE_TREE``, draws the same cases again.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

JUDGED = "host/gyrocal"
TREE = "GYROCAL_EDGE_TREE"
"""The environment variable that holds the id of another tree, whose cases are drawn again."""


def tree(root: Path = Path(__file__).parents[2]) -> str:
    """The id of the judged code's tree. Raises ValueError where it is not committed as it is, or not in a git checkout."""
    told = os.environ.get(TREE, "").strip()
    if told:
        return told

    def git(*arguments: str) -> str:
        found = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False)
        if found.returncode:
            raise ValueError(f"the frozen part needs the git checkout of the code that it judges, or its tree in {TREE}")
        return found.stdout.strip()

    if git("status", "--porcelain", "--", JUDGED):
        raise ValueError(f"{JUDGED} has changes that are not committed: commit them before the frozen part is drawn")
    return git("rev-parse", f"HEAD:{JUDGED}")
