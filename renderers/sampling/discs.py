"""From the unit square to the unit disc: lenses and lobes, in kernels and for single points."""

from aliasbench.renderers.raytrace.scattering import disc_point as disc_point
