"""What every room uses: arrays, errors, compiled kernels, the user's cache, progress."""
