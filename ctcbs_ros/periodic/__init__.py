"""The periodic motion of a cable in a steady wind, its stability, and where the end mass is."""
