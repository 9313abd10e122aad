"""One file for each command: ``gyrocal VERB`` is ``run`` in ``commands/VERB.py`` (``import`` is ``import_.py``)."""
