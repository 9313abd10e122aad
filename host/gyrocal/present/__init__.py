"""Presentation: tables on the terminal, figures, the report's page, the effects' pages.

This folder imports all folders below it. No folder of computation imports it.
"""
