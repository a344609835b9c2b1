# SPDX-License-Identifier: BSD-3-Clause
"""Parts of scripts/benchmark.py: sets, methods, tables, plots."""
