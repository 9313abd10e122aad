"""A device at a port: the wire's codec, ports, the simulated device, recording and the monitor.

It imports ``core`` and what lies below it.
"""
