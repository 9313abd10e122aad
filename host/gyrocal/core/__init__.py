"""The C core on this machine: compiled and loaded, held against the host, its cost on other CPUs, a project to flash.

It imports ``calibration`` and what lies below it.
"""
