"""The device, live: its port, its samples, and the coach of a recording."""
