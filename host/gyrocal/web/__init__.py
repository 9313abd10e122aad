"""The workbench: a local page from "does my model fit?" to "this is what was missing". No logic of diagnosis is in it.

It imports ``api`` and what lies below it.
"""
