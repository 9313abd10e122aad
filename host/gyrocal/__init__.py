"""gyrocal: calibrates MEMS gyroscopes and finds the physical effect that the error model is missing.

The Python interface is :mod:`gyrocal.api`.
"""

__version__ = "0.2.0"
