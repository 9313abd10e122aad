"""The workbench: a local web page for comparison, diagnosis and calibration. It contains no logic of the diagnosis.

``values`` are what worker and page exchange, ``pictures`` charts and texts for page and report, ``worker`` asks the engine,
``device`` holds the port, ``state`` is what all tabs share, ``page`` is the frame, ``widgets`` are the parts of the ``panels``.
Each imports those before it. This folder imports ``api`` and the folders below it.
"""
