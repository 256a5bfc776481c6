"""Design of a towed system: verdict on every point flown, what limits it, and what to change."""
