"""What to record next: the runs that answer an open question best, by optimal design on the fitted error model.

It imports ``diagnosis`` and what lies below it.
"""
