"""The ray tracer: Embree packets, and the plain embreex engine that checks them."""
