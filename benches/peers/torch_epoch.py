"""One epoch in PyTorch: ln L of an S-CTRNN over all sequences and its gradient, float64, autograd through a loop.

Variants: `eager`, and `compiled`, where torch.compile makes one kernel of a step (it needs a C++ compiler).
"""

import math

import task

given = task.arguments(__doc__.splitlines()[0])

import torch  # noqa: E402

VARIANTS = ["eager", "compiled"]


def step(u, drive, weights, decay):
    return decay * u + drive + torch.tanh(u) @ weights


def epoch(variant, parameters, samples, tau):
    advance = torch.compile(step) if variant == "compiled" else step
    decay, rate = 1.0 - 1.0 / tau, 1.0 / tau

    def run():
        for value in parameters.values():
            value.grad = None
        p = parameters
        # Inputs and outputs are one product over all steps each.
        drives = ((samples[:-1] @ p["context_from_input"].T + p["context_bias"]) * rate).unbind()
        weights = (p["context_from_context"] * rate[:, None]).T
        u, states = p["initial_state"], []
        for drive in drives:
            u = advance(u, drive, weights, decay)
            states.append(u)
        contexts = torch.tanh(torch.stack(states))
        mean = torch.tanh(contexts @ p["mean_from_context"].T + p["mean_bias"])
        u_v = contexts @ p["variance_from_context"].T + p["variance_bias"]
        terms = math.log(2 * math.pi) + u_v + (samples[1:] - mean) ** 2 * torch.exp(-u_v)
        ln_likelihood = -0.5 * terms.sum()
        ln_likelihood.backward()
        return ln_likelihood.item(), {name: value.grad for name, value in p.items()}

    return run


def main():
    if given.threads:
        torch.set_num_threads(given.threads)
    arrays, samples, tau = task.load(given.folder)
    parameters = {name: torch.tensor(value, requires_grad=True) for name, value in arrays.items()}
    samples, tau = torch.tensor(samples), torch.tensor(tau)
    task.run(given, VARIANTS, torch.__version__, lambda variant: epoch(variant, parameters, samples, tau))


main()
