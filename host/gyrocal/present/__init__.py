"""What people see: the terminal's tables, pictures, the report's page, the effects' pages.

It imports whatever lies below it; no layer of computation imports it.
"""
