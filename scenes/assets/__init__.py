"""Model files of the project's own, and the scripts that make them."""
