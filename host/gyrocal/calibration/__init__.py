"""Scale and bias from the first seconds: baseline, network and estimator, the exact limit, the device's ``calibration.h``.

This folder imports ``inference``, ``simulation`` and the folders below them, but not ``diagnosis``. From the firmware it reads
``gc_flags.h``.
"""
