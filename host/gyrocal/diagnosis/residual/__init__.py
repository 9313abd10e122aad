"""Where a model fails: the residual of a comparison, its rms, floor and excess, and the tests that find a misfit."""
