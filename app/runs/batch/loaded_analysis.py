"""Loads what an analysis needs, or compiles it, when it is imported: once in a process, before its first run.

On Linux the process that forks workers imports it before them, so that it is loaded once for all.
"""

from app.child import loading

__all__ = ["tasks"]

with loading():
    from analysis.identify import warm_up
    from app.runs.batch import tasks

    warm_up()
