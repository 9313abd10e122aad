"""What is missing: where a model fails, which effect would mend it, and a formula where no effect does.

It imports ``inference`` and what lies below it.
"""
