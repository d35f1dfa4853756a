"""Programs that measure what the methods cost; each writes to benchmarks/results/."""
