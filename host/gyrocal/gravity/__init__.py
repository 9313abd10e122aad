"""Calibration without a table: gravity is the reference, and hands turn the sensor from rest to rest.

A session with ``kind = "gravity"`` in ``[reference]`` of session.toml has no true rate. Rests are found, the accelerometer is
calibrated from them, and each movement between two rests must turn gravity's direction by as much as the integrated gyroscope
says. This folder imports ``calibration`` and the folders below it.

Frames and signs: a reading is ``M·true + bias``. The accelerometer's M is lower triangular, so its x axis is an axis of the
common frame, and its y axis lies in that frame's x-y plane. *Up* is the direction that the accelerometer reads at rest.
"""
