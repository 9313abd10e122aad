"""Physical effects, one file for each. ``base.py`` defines what an effect is, ``quantities.py`` derives shared quantities.

This folder imports ``recording`` and ``noise``.
"""
