"""A trained network as a policy in the form that LeRobot's loops call: `reset`, `select_action`.

    python lerobot_policy.py                 tries the policy, with a stand-in where lerobot and torch are not installed

The network learned the joints' positions of demonstrations (`scrnn train DATASET`, where DATASET is a LeRobot folder). It follows
``observation.state`` by error regression, and its prediction of the next sample is the action. In LeRobot's own loop:

    policy = NetworkPolicy(scrnn.load("runs/mine"), action_features=dataset.features["action"]["names"])
    policy.reset()
    action = policy.select_action(batch)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import scrnn

try:
    import torch
    from lerobot.policies.pretrained import PreTrainedPolicy  # noqa: F401  (its loop asks for no more than is here)
except ImportError:
    torch = None

STATE = "observation.state"


class NetworkPolicy:
    """Predicts the next positions of the joints from those sensed so far.

    `channels` are the names of the values of ``observation.state``, in their order; by default those that the network learned.
    `action_features` are the names of the values of an action; by default the same.
    """

    name = "scrnn"

    def __init__(
        self,
        net: scrnn.Network,
        channels: Sequence[str] | None = None,
        action_features: Sequence[str] | None = None,
        **follow: Any,
    ) -> None:
        self.net, self.options = net, follow
        self.channels = list(channels or net.channels)
        wanted = list(action_features or net.channels)
        missing = [name for name in wanted if name not in net.channels]
        if missing:
            raise scrnn.Error(f"the network does not predict {', '.join(missing)}\nit predicts {', '.join(net.channels)}")
        self.places = [net.channels.index(name) for name in wanted]
        self.reset()

    def reset(self) -> None:
        """Begins an episode."""
        self.live = self.net.follow(**self.options)

    def eval(self) -> NetworkPolicy:
        """There is no mode of training here: networks are trained by `scrnn`."""
        return self

    def to(self, device: object) -> NetworkPolicy:
        """It computes on the processor, wherever tensors are."""
        return self

    def select_action(self, batch: Mapping[str, Any]) -> Any:
        """The next action, (1, actions), of the type of the batch's state (1, channels) or (channels,)."""
        state = batch[STATE]
        is_tensor = torch is not None and isinstance(state, torch.Tensor)
        values = np.asarray(state.detach().cpu() if is_tensor else state, dtype=np.float64).reshape(-1, len(self.channels))
        if len(values) != 1:
            raise scrnn.Error(f"the batch has {len(values)} states\nthis policy follows one robot: make one for each")
        step = self.live.observe(dict(zip(self.channels, values[0])))
        # Before anything is predicted, the robot stays where it is.
        mean = step.mean if step.mean is not None else values[0]
        action = mean[self.places].reshape(1, -1)
        return torch.as_tensor(action, dtype=state.dtype, device=state.device) if is_tensor else action


def main() -> None:
    """Tries the policy on a small network."""
    if torch is None:
        print("lerobot or torch is not installed: numpy's arrays stand in for tensors")
    t = np.arange(120)
    wave = np.c_[0.5 * np.sin(t / 8), 0.3 * np.cos(t / 16)]
    net = scrnn.SCTRNN(units=10, time_constant=4.0, epochs=300)
    net.fit([wave], channels=["shoulder", "elbow"], progress=False)
    policy = NetworkPolicy(net, window=20)
    errors = []
    for now, following in zip(wave[:-1], wave[1:]):
        state = now[None] if torch is None else torch.as_tensor(now[None], dtype=torch.float32)
        action = policy.select_action({STATE: state})
        errors.append(np.abs(np.asarray(action)[0] - following).max())
    print(f"{len(errors)} actions; in the second half {np.mean(errors[60:]):.3f} rad off at most, on average")


if __name__ == "__main__":
    main()
