"""The same problem said otherwise, and the same case run otherwise: what may not contradict."""
