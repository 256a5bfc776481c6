"""Where the payload's own beacon measures it, held against where it is predicted."""
