"""A recorded flight replayed: through the core, or through the node in its own process."""
