"""The C core on this machine: compiling, loading, comparison with the host, cost on other CPUs, a project to flash.

It imports ``calibration`` and what lies below it.
"""
