# SPDX-License-Identifier: BSD-3-Clause
"""The chain of commands as tasks that Slurm or one machine runs."""
