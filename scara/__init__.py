"""Two-link arms as a load for trajopt."""
