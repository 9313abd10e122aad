"""Charts, pictures and texts, for the page and for the report."""
