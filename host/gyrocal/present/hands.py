"""A recording by hand in the terminal: what is known so far, and what to do next."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gyrocal.device.record_hands import HandsReport
from gyrocal.gravity.aims import Aim, Progress
from gyrocal.policy import POLICY
from gyrocal.units import number_of


class Guide:
    """Shows a recording while it goes on.

    ``say`` prints a line that remains, at each new rest; ``state`` replaces the line of the present state.
    """

    def __init__(self, say: Callable[[str], None], state: Callable[[str], None]) -> None:
        self._say, self._state = say, state
        self._rests = -1

    def show(self, now: Progress) -> None:
        """Show the progress of this moment."""
        self._state(f"{number_of(now.rests, 'rest')}, {'at rest' if now.at_rest else 'moving'}")
        if now.rests == self._rests:
            return
        self._rests = now.rests
        self._say(f"{number_of(now.rests, 'rest')}; {aims_line(now.aims)}")
        if now.aims and all(aim.met for aim in now.aims) and not now.met:
            self._say(f"  the aims are met; {POLICY.aim_rests - now.rests} more rests, and the recording ends")
        if not now.met:
            self._say(f"  next: {now.turn}")


def aims_line(aims: Sequence[Aim]) -> str:
    """The standard errors of all axes beside their aims, in one line."""
    if any(aim.scale_se is None for aim in aims):
        return f"errors are known from {POLICY.fewest_rests} rests on"
    scale = ", ".join(f"{a.axis} {a.scale_se or 0.0:.2%}" for a in aims)
    cross = ", ".join(f"{a.axis} {a.misalignment_se or 0.0:.4f}" for a in aims)
    return f"scale +- {scale} (aim {aims[0].scale_aim:.2%}); misalignment +- {cross} (aim {aims[0].misalignment_aim:g})"


def print_aims(report: HandsReport) -> None:
    """Print the rests, the standard errors, and whether the aims are met."""
    missing = [aim.axis for aim in report.aims if not aim.met]
    print(f"{number_of(report.rests, 'rest')}; {aims_line(report.aims)}" if report.aims else number_of(0, "rest"))
    if missing or report.rests < POLICY.aim_rests:
        why = f"axes {', '.join(missing)}" if missing else f"fewer than {POLICY.aim_rests} rests"
        print(f"The aims are not met ({why}); leave the sensor on, and run the same command again to add to the recording")
    else:
        print(f"The aims are met; next: gyrocal calibrate {report.session}")
