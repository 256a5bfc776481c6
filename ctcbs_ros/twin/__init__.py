"""The cable in time beside the flight, and what it will settle to."""
