"""A coroutine run to its end in a thread: a browser test before may have left its loop running in the main one."""

import asyncio
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any


def finish(story: Coroutine[Any, Any, None]) -> None:
    """Run ``story``; what it raises is raised here."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, story).result()
