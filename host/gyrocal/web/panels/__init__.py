"""The panels of the page, one file for each.

``show(tab)`` builds a panel and returns the function to call when the shared state changes.
"""
