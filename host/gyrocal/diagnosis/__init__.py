"""Diagnosis: where a model fails, which effect explains the failure, or a formula if no effect does.

``residual`` finds where a model fails, ``naming`` which effect explains it, and ``answer`` says it. Each imports those before
it. This folder imports ``inference`` and the folders below it.
"""
