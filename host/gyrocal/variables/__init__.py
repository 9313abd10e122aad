"""What a residual is held against, one file each; ``base.py`` says what a variable is.

``shapes.py`` has the columns that are fitted to a residual, ``terms.py`` the terms of formulas. It imports ``recording`` and
``effects``.
"""
