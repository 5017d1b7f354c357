"""Scene definitions: what is true, before anybody renders it."""
