"""Diagnosis: where a model fails, which effect explains the failure, and a formula where no effect does.

This folder imports ``inference`` and the folders below it.
"""
