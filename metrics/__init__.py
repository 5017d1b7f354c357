"""How much of each artifact is left in a picture or a sequence."""
