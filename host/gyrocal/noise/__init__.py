"""Noise: white noise with drift and its whitening, spectra, Allan deviation.

It imports ``recording``.
"""
