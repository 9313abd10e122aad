"""Sessions with a known truth: campaigns, the temperature of a part over the days, the simulated sensor.

It imports ``error_model`` and what lies below it.
"""
