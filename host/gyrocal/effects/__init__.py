"""Physical effects, one file each; ``base.py`` says what an effect is."""
