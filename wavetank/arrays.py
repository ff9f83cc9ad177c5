"""What states and derivatives are: numpy arrays of the values that this rank owns."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
