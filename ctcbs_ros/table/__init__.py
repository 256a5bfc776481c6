"""The continuation table: every branch over the flight envelope, computed before the flight."""

from ctcbs_ros.table.provide import table_for
from ctcbs_ros.table.table import Table

__all__ = ["Table", "table_for"]
