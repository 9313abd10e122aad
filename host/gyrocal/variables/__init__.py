"""What a residual is held against, one file each; ``base.py`` says what a variable is."""
