"""Several axes in one problem: moves that share a time, and arms whose axes are coupled by their dynamics and tip."""
