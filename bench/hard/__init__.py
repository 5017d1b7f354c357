"""Hard cases: where rasterizers and ray tracers break numerically, each with what must hold and what was found."""
