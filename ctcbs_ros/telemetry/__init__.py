"""Samples from links, logs and topics, and which of them can be believed."""
