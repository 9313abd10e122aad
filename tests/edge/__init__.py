"""Sessions where names are hard to give: an effect that its nearest rival nearly explains, and small disturbances beside it.

The generator shares no code with the tool under test. It knows the true noise, so that it can say how far the nearest rival is
and what the best possible answer would be. ``drawn`` draws a case by its part, kind and number, and ``recording.write`` makes
its folder.
"""
