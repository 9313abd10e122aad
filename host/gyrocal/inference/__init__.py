"""Statistics: block means, regressors, restricted maximum likelihood, the fit of any list of effects, held-out prediction.

This folder imports ``error_model`` and the folders below it, but not ``simulation``.
"""
