"""Scale and bias from the first seconds: baseline, network and estimator, the exact limit, the device's ``calibration.h``.

It imports ``inference``, ``simulation`` and what lies below them; of ``diagnosis`` it knows nothing.
"""
