"""Sessions with hidden effects, made by a sensor chain of its own.

Nothing here comes from the tool under test. The physics is written again from the documented equations of the effects and
from the LSM6DSO's data sheet, so that an error that the tool's simulator and its fit share cannot hide.

The chain, run by run: true rate of the table -> effects on a time base four times the chip's -> the chip's second-order
low-pass with the white noise -> chip samples by the chip's own clock -> polled at 145 Hz, newest sample -> clipped and
rounded to counts -> a `gyrocal-session/1` folder. `session.make` returns what was planted as a `Truth`, which is never
written to a file.
"""
