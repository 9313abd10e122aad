"""Diagnosis: where a model fails, which effect explains the failure, or a formula if no effect does.

This folder imports ``inference`` and the folders below it.
"""
