"""What a renderer returns and what holds a scene ready to be rendered: the contract shared by all renderers."""

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One rendered picture.

    Attributes
    ----------
    pixels : (h, w, 3) float32, of references float64
        Linear radiance, row 0 at the top.
    seconds : float
        Rendering alone, until the pixels are in host memory.
    setup_seconds : float
        Building and uploading the scene, once for every prepared scene.
    samples : int
        Primary samples in total (0 for closed forms).
    sample_counts : (h, w) int32 or None
        Samples of each pixel where they differ.
    uncertainty : float or None
        Of references: the largest bound over the pixels on |pixel - truth|.
    uncertainty_kind : "bound", "confidence" or None
        Certified, or of 99 % confidence.
    """

    pixels: NDArray[np.floating]
    seconds: float
    setup_seconds: float
    samples: int
    sample_counts: NDArray[np.int32] | None = None
    uncertainty: float | None = None
    uncertainty_kind: Literal["bound", "confidence"] | None = None


Progress = Callable[[float], None]


class Prepared(Protocol):
    """A scene built and uploaded for one technique and size; a context manager that frees what it holds."""

    def render(self, frame: int = 0, seed: int = 0, progress: Progress | None = None) -> Frame:
        """Return frame number `frame`; the same arguments give the same pixels on any number of threads.

        `progress`, where given, is told the share of the picture that is done, from 0 to 1, now and then.
        """
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
