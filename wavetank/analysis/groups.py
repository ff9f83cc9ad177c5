"""How waves come in groups: the envelope, and how much it varies."""

import numpy as np
from scipy.signal import hilbert
from xarray import DataArray


def envelope(eta: DataArray) -> DataArray:
    """Return the envelope [m] of a record about its mean: the size of its analytic signal (Hilbert's transform).

    It is that of a periodic signal: within a few periods of its ends that of a record which is not is off.
    """
    values = np.abs(hilbert((eta - eta.mean("time")).values, axis=eta.dims.index("time")))
    return eta.copy(data=values).rename("envelope").assign_attrs(long_name="envelope of the elevation", units="m")


def groupiness(eta: DataArray) -> DataArray:
    """Return the groupiness factor over gauge: the standard deviation of the squared envelope over its mean.

    0 of regular waves, 1 / √2 of two frequencies of one height, 1 of a linear sea of random phases. Source: R. T.
    Hudspeth and J. R. Medina, Proc. 21st Int. Conf. Coastal Eng., 1988.
    """
    squared = envelope(eta) ** 2
    factor: DataArray = squared.std("time") / squared.mean("time")
    return factor.rename("groupiness").assign_attrs(units="1")
