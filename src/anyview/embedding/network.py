"""Time-contrastive embedding (Sermanet et al. 2018): no translation, a feature space in which views agree.

It is the model of the `tcn` baseline, whose reward is a distance in this space.
"""

from torch import Tensor, nn
from torch.nn import functional as F

_CHANNELS = (16, 32, 64, 64)
_HIDDEN = 128
_LEAK = 0.2


class Embedding(nn.Module):
    """Four convolutions and two connected layers: (N, 3, H, W) in [-1, 1] -> unit vectors (N, D)."""

    def __init__(self, image_size: int, dimensions: int):
        super().__init__()
        self.image_size, self.dimensions = image_size, dimensions
        layers: list[nn.Module] = []
        before, side = 3, image_size
        for channels in _CHANNELS:
            layers += [nn.Conv2d(before, channels, 5, stride=2, padding=2), nn.LeakyReLU(_LEAK)]
            before, side = channels, -(-side // 2)
        connected = [
            nn.Linear(before * side**2, _HIDDEN),
            nn.LeakyReLU(_LEAK),
            nn.Linear(_HIDDEN, dimensions),
        ]
        self.layers = nn.Sequential(*layers, nn.Flatten(), *connected)

    def forward(self, frames: Tensor) -> Tensor:
        return F.normalize(self.layers(frames).float(), dim=-1)
