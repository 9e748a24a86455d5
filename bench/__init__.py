"""Benchmarks: ratios against peers, alternating in one run. `make bench` runs them; tests check both sides agree."""
