"""The digest of the frozen part's seed, committed before any case of it was drawn."""

DIGEST = "ddb67dfb31fd7caca95f00e75f19aa6a27b4c8d5bff56d5761eec20da61f3fa4"
"""sha256 of the secret seed, in hexadecimal. Who knows the seed can draw the frozen cases; nobody else can look at them."""
