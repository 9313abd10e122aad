"""The parts of which the panels are made."""
