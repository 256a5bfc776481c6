"""The `ctcbs` command: one file a subcommand."""
