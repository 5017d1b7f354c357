"""What is true: exact images, each with its error bound."""
