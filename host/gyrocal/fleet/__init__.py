"""Many boards' sessions as one population: each session is one task, and the population is computed from small summaries.

This folder imports ``plausibility`` and the folders below it. Only ``engine.py`` imports ``distributed``, which comes with the
extra ``gyrocal[fleet]``.
"""
