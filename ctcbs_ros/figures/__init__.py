"""The thesis's figures, computed and drawn again: what is in them, how they are made and written.

Rows are computed in worker processes (`curves`, `boundaries`), written as CSV (`rows`), read back
and drawn (`draw_curves`, `draw_boundaries`): a picture shows what its CSV holds, nothing else.
`catalogue` says what is in each figure, `produce` makes them.
"""
