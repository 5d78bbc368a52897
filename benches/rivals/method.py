"""What a rival has to offer. Whatever it cannot do it leaves out, and the table shows a gap."""


class Method:
    """`fit` first; then each of the others may be asked for, any number of times.

    `labels` are given where a method has a model for each label: completion and prediction then use the right one, which is
    more than the networks are told. Recognition never sees them.
    """

    seeds = (1, 2, 3)

    def fit(self, task, seed, quick):
        raise NotImplementedError

    def one_step(self, sequences, labels):
        """A list of (mean, variance), each of all steps; the first four rows are not read."""

    def ahead(self, sequences, labels, steps):
        """The same, `steps` ahead: row t is predicted from the samples before t - steps + 1. Earlier rows are not read."""

    def complete(self, observed, length, label, copies, rng):
        """Mean, variance and samples (copies x steps x channels, or None) of samples `len(observed)` to `length`."""

    def beyond(self, observed, length, label, steps):
        """Its mean path in the `steps` after the end, or None where it has no time after it."""

    def recognise(self, sequences):
        """A label for each sequence."""

    def notes(self):
        """Settings that were chosen, for the record."""
        return {}
