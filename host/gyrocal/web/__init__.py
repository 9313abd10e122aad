"""The workbench: a local web page for comparison, diagnosis and calibration. It contains no logic of the diagnosis.

This folder imports ``api`` and the folders below it.
"""
