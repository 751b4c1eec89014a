"""Enhancement: what makes echoes stand out of noise before they are decomposed.

Of the V–L system (X. Fan and Y.-Q. Wang, V–L decomposition of a novel full-waveform lidar system based on virtual
instrument technique), and what it is compared with.
"""

from openecho.enhance.accumulation import accumulate, snr_db
from openecho.enhance.autoregression import whitening
from openecho.enhance.noise import Noise, noise
from openecho.enhance.smoothing import gaussian, homomorphic, moving_average
from openecho.enhance.vondrak import vondrak
from openecho.enhance.wavelet import denoise

__all__ = [
    "Noise",
    "accumulate",
    "denoise",
    "gaussian",
    "homomorphic",
    "moving_average",
    "noise",
    "snr_db",
    "vondrak",
    "whitening",
]
