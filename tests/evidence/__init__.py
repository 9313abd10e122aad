"""The evidence of sets of effects, held against the density that it must equal, and against data drawn from it."""
