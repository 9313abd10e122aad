"""Variables on which a residual may depend, one file for each; ``base.py`` defines what a variable is.

``shapes.py`` has the columns that are fitted to a residual, ``terms.py`` the terms of formulas. This folder imports
``recording`` and ``effects``.
"""
