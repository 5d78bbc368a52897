"""A loop of 50 Hz: a network follows what a robot senses and says where its joints are to go next.

    python control_loop.py [RUN]

RUN is a run folder; without it a small network learns a movement first. Replace `Robot` by yours: what it senses has one value for each of
the network's channels, and what it is sent are the predicted means.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import numpy.typing as npt

import scrnn

#: Seconds between two samples.
PERIOD = 0.02
#: Milliseconds of them that the network may take.
DEADLINE = 8.0

Floats = npt.NDArray[np.float64]


class Robot:
    """A stand-in for a robot: two joints that go on with a movement, seen with noise."""

    def __init__(self) -> None:
        self.random = np.random.default_rng(1)
        self.step = 0

    def sense(self) -> Floats:
        """What the encoders say."""
        self.step += 1
        here: Floats = movement(np.array([self.step]))[0]
        return here + self.random.normal(scale=0.01, size=2)

    def send(self, target: Floats) -> None:
        """Where the joints are to go."""


def movement(t: npt.NDArray[np.int_]) -> Floats:
    """Two joints that swing."""
    return np.column_stack([0.5 * np.sin(t / 8), 0.3 * np.cos(t / 16)])


def learned() -> scrnn.Network:
    """A small network that knows the robot's movement."""
    random = np.random.default_rng(2)
    seen = [movement(np.arange(k, 150 + k)) + random.normal(scale=0.01, size=(150, 2)) for k in (0, 40)]
    net = scrnn.SCTRNN(units=12, time_constant=4.0, epochs=600)
    return net.fit(seen, channels=["shoulder", "elbow"], progress=False)


def main(arguments: list[str]) -> None:
    """Runs for three seconds."""
    net = scrnn.load(arguments[0]) if arguments else learned()
    live = net.follow(window=30, ahead=5, deadline=DEADLINE)
    robot = Robot()
    late, due = 0, time.perf_counter()
    for _ in range(150):
        step = live.observe(robot.sense())
        if step.mean is not None:
            robot.send(step.mean)
        due += PERIOD
        left = due - time.perf_counter()
        if left > 0:
            time.sleep(left)
        else:
            late += 1
            due = time.perf_counter()
    latency = live.latency
    assert latency is not None
    print(f"{live.taken} samples at {1 / PERIOD:.0f} Hz: median {latency.median:.3f} ms, 99 % within {latency.p99:.3f} ms")
    print(f"late {late} times; found what it follows: {step.locked}")


if __name__ == "__main__":
    main(sys.argv[1:])
