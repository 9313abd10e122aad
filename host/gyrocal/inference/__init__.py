"""Statistics: block means, regressors, restricted maximum likelihood, the fit of any list of effects, held-out prediction.

It imports ``error_model`` and what lies below it; of ``simulation`` it knows nothing.
"""
