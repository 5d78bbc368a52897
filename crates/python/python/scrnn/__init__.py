"""Recurrent networks that predict two things about the next sample of a sequence: its mean and its variance.

    import scrnn

    net = scrnn.SCTRNN(units=20, time_constant=4.0)
    net.fit(sequences, channels=["shoulder", "elbow"], epochs=2000)   # a list of (steps, channels) arrays
    out = net.generate(sequence=1, steps=300, samples=10)             # out.mean, out.variance, out.sample
    found = net.recognize(new, observed=30, samples=100)              # found.initial_state, found.completed
    live = net.follow(window=30)                                      # live.observe(x) for each sample that arrives

The networks are the S-CTRNN and the S-MTRNN of Shingo Murata's doctoral thesis (Waseda University, 2016). The same data, settings and
seed give the same bits as the program ``scrnn``, which comes with this package.

Every error is a :class:`scrnn.Error`, which is a ``ValueError``.
"""

from scrnn._data import DataWarning, Sequences, read, task
from scrnn._estimators import SCTRNN, SMTRNN, Network, NotTrainedError, load, train
from scrnn._following import Follower, Latency, Step
from scrnn._progress import Progress
from scrnn._results import (
    Calibration,
    Completed,
    Evaluation,
    Generated,
    History,
    Ranked,
    Recognition,
    Verdict,
)
from scrnn._scrnn import (
    DivergedError,
    Error,
    FileError,
    InternalError,
    RefusedError,
    __version__,
)
from scrnn._studies import Reproduced, Simulated, reproduce, simulate, studies
from scrnn._sweeps import Compared, Swept, compare, sweep

__all__ = [
    "SCTRNN",
    "SMTRNN",
    "Calibration",
    "Compared",
    "Completed",
    "DataWarning",
    "DivergedError",
    "Error",
    "Evaluation",
    "FileError",
    "Follower",
    "Generated",
    "History",
    "InternalError",
    "Latency",
    "Network",
    "NotTrainedError",
    "Progress",
    "Ranked",
    "Recognition",
    "RefusedError",
    "Reproduced",
    "Sequences",
    "Simulated",
    "Step",
    "Swept",
    "Verdict",
    "__version__",
    "compare",
    "load",
    "read",
    "reproduce",
    "simulate",
    "studies",
    "sweep",
    "task",
    "train",
]
