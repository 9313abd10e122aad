"""The error model: a list of effects with parameters, as a person edits it, and effects written as a formula.

It imports ``recording``, ``noise``, ``effects`` and ``variables``.
"""
