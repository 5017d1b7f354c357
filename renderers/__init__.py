"""The ray tracer, the rasterizer and the exact references, behind one contract (`catalog.prepare`)."""

from aliasbench.renderers.kernel_cache import use_kernel_cache

use_kernel_cache()
