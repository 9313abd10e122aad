"""The error model: effects and noise with parameters in a file that a person can edit, and effects written as a formula.

This folder imports ``recording``, ``noise``, ``effects`` and ``variables``.
"""
