"""Floor 3: many motions at once, by steps generated for a system and made for vector lanes side by side."""
