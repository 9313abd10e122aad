"""The one place that imports onnxruntime, so that its telemetry is always off.

Newer versions of onnxruntime queue events with the system, the processor, the interpreter's path and a device id in the user's
cache, and send them after a while. They begin when they are imported; a call that ends it after the import comes too late.
"""

from __future__ import annotations

import os
from types import ModuleType

from gyrocal.extras import want


def onnxruntime() -> ModuleType:
    """The module onnxruntime, imported with ``ORT_DISABLE_TELEMETRY=1``: every other value may leave the telemetry on.

    Raises InputError if it is not installed.
    """
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    try:
        import onnxruntime as module
    except ImportError:
        want("the network", "net")
        raise
    return module
