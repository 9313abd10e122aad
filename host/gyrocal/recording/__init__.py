"""A recording: the session folder, its runs, single readings that stand out, and the import of others' files.

It imports nothing but ``errors`` and ``threads``.
"""
