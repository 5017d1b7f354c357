"""Sample patterns shared by both renderers, so that they differ in nothing but how they render."""
