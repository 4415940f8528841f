"""The commands of the benchmarks, one a file."""
