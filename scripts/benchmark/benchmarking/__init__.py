# SPDX-License-Identifier: BSD-3-Clause
"""Parts of scripts/benchmark/benchmark.py: sets, methods, tables, plots."""
