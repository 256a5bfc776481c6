"""The cable in time: a nonlinear elastic lumped-mass line towed along any path, in any wind."""
