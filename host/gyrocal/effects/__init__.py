"""Physical effects, one file each; ``base.py`` says what an effect is, ``quantities.py`` derives what several of them need.

It imports ``recording`` and ``noise``.
"""
