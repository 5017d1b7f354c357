"""The rasterizer: moderngl on EGL or OSMesa."""
