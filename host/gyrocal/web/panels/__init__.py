"""A page's panels, a file each: ``show(tab)`` builds one and returns what to call when shared state changes."""
