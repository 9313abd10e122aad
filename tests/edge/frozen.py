"""The digest of the frozen part's seed, committed before any case of it was drawn."""

DIGEST = "59da5ed74c866a210fb05c45fdea637e6725ad3c6452d20650c6e11de91d26c7"
"""sha256 of the secret seed, in hexadecimal. Who knows the seed can draw the frozen cases; nobody else can look at them."""
