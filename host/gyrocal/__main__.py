"""The process ``gyrocal`` and ``python -m gyrocal``: Ctrl-C ends it with one line from its first moment on.

Nothing is imported above that takes time, because an interrupt during an import would be a traceback.
"""

import os
import signal
from typing import Any

STOPPED = b"gyrocal: stopped\n"
INTERRUPTED = 130


def _stop(*_: Any) -> None:
    os.write(2, STOPPED)
    os._exit(INTERRUPTED)


def main() -> int:
    """Run the command line of this process and return its exit code.

    Linear algebra has one thread (:mod:`gyrocal.threads`), unless the user says otherwise. It is told as it is loaded.
    """
    signal.signal(signal.SIGINT, _stop)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from gyrocal.cli import main as run

    return run(started=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))


if __name__ == "__main__":
    raise SystemExit(main())
