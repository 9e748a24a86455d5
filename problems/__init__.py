"""Ready-made problems, a file each; ``trajopt.load("clemen_rupp_jerk_l2")`` reads one by its name."""

from trajopt.problem_file import ready_made

__all__ = ["ready_made"]
