"""Benchmarks: figures and tables of the documentation, run times, extreme cases."""
