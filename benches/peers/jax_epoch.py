"""One epoch in JAX: ln L of an S-CTRNN over all sequences and its gradient, float64, jit and lax.scan.

There are several ways to write it; each is a variant, and the fastest counts:

    layout   rows: states are [sequence, unit]; columns: [unit, sequence]
    outputs  inside the scan, or outside: one product over all steps before it (inputs) and after it (outputs)
    weights  by_step: value_and_grad adds up the weights' gradient step by step; at_once: the scan gives the gradient of
             each step's drive, and one product over all steps gives that of the weights
    unroll   steps of the scan that become one
"""

import itertools

import task

given = task.arguments(__doc__.splitlines()[0])

import os  # noqa: E402

if given.threads == 1:
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false " + os.environ.get("XLA_FLAGS", "")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402

jax.config.update("jax_enable_x64", True)

VARIANTS = [
    "-".join(variant)
    for variant in itertools.product(["rows", "columns"], ["inside", "outside"], ["by_step", "at_once"], "1248")
    # At once needs the contexts of all steps, and so the outputs outside.
    if variant[1:3] != ("inside", "at_once")
]


def ln_gaussian(target, u_mean, u_variance):
    error = target - jnp.tanh(u_mean)
    return -0.5 * jnp.sum(jnp.log(2 * jnp.pi) + u_variance + error**2 * jnp.exp(-u_variance))


def inside(parameters, samples, tau, rows, unroll):
    """Everything in the scan."""
    p = parameters
    turned = samples if rows else samples.swapaxes(1, 2)
    product = (lambda w, x: x @ w.T) if rows else (lambda w, x: w @ x)
    column = (lambda b: b) if rows else (lambda b: b[:, None])

    def step(state, pair):
        u, c, ln_likelihood = state
        x, target = pair
        drive = product(p["context_from_input"], x) + product(p["context_from_context"], c)
        u = u + (drive + column(p["context_bias"]) - u) / column(tau)
        c = jnp.tanh(u)
        mean = product(p["mean_from_context"], c) + column(p["mean_bias"])
        variance = product(p["variance_from_context"], c) + column(p["variance_bias"])
        return (u, c, ln_likelihood + ln_gaussian(target, mean, variance)), None

    u0 = p["initial_state"] if rows else p["initial_state"].T
    start = (u0, jnp.tanh(u0), 0.0)
    (_, _, ln_likelihood), _ = jax.lax.scan(step, start, (turned[:-1], turned[1:]), unroll=unroll)
    return ln_likelihood


def outside(parameters, samples, tau, rows, unroll, at_once):
    """Only the recurrence in the scan."""
    p = parameters
    turned = samples if rows else samples.swapaxes(1, 2)
    equation = "oi,tsi->tso" if rows else "oi,tis->tos"
    column = (lambda b: b) if rows else (lambda b: b[:, None])
    decay, rate = 1.0 - 1.0 / column(tau), 1.0 / column(tau)
    drives = (jnp.einsum(equation, p["context_from_input"], turned[:-1]) + column(p["context_bias"])) * rate
    u0 = p["initial_state"] if rows else p["initial_state"].T
    run = recurrence_at_once if at_once else recurrence
    contexts = run(p["context_from_context"], drives, u0, decay, rate, rows, unroll)
    mean = jnp.einsum(equation, p["mean_from_context"], contexts) + column(p["mean_bias"])
    variance = jnp.einsum(equation, p["variance_from_context"], contexts) + column(p["variance_bias"])
    return ln_gaussian(turned[1:], mean, variance)


def recurrence(weights, drives, u0, decay, rate, rows, unroll):
    w = weights * (rate if rate.ndim == 2 else rate[:, None])

    def step(state, drive):
        u, c = state
        u = decay * u + drive + (c @ w.T if rows else w @ c)
        c = jnp.tanh(u)
        return (u, c), c

    return jax.lax.scan(step, (u0, jnp.tanh(u0)), drives, unroll=unroll)[1]


def recurrence_at_once(weights, drives, u0, decay, rate, rows, unroll):
    """The same, with a backward pass by hand."""

    @jax.custom_vjp
    def run(weights, drives, u0):
        return recurrence(weights, drives, u0, decay, rate, rows, unroll)

    def forward(weights, drives, u0):
        contexts = run(weights, drives, u0)
        return contexts, (weights, contexts, u0)

    def backward(kept, gradient):
        weights, contexts, u0 = kept
        w = weights * (rate if rate.ndim == 2 else rate[:, None])
        before = jnp.concatenate([jnp.tanh(u0)[None], contexts[:-1]])

        def step(du, pair):
            c, dc = pair
            # `du` is that of the step after, `total` that of this one.
            total = decay * du + (1.0 - c * c) * (dc + (du @ w if rows else w.T @ du))
            return total, total

        du0, du = jax.lax.scan(step, jnp.zeros_like(u0), (contexts, gradient), reverse=True, unroll=unroll)
        c0 = before[0]
        du0 = decay * du0 + (1.0 - c0 * c0) * (du0 @ w if rows else w.T @ du0)
        equation = "tsi,tsj->ij" if rows else "tis,tjs->ij"
        return jnp.einsum(equation, du * rate, before), du, du0

    run.defvjp(forward, backward)
    return run(weights, drives, u0)


def epoch(variant, samples, tau):
    layout, outputs, weights, unroll = variant.split("-")
    rows, unroll = layout == "rows", int(unroll)
    if outputs == "inside":
        score = lambda parameters: inside(parameters, samples, tau, rows, unroll)  # noqa: E731
    else:
        score = lambda parameters: outside(parameters, samples, tau, rows, unroll, weights == "at_once")  # noqa: E731
    return jax.jit(jax.value_and_grad(score))


def main():
    parameters, samples, tau = task.load(given.folder)
    parameters = {name: jnp.asarray(value) for name, value in parameters.items()}
    samples, tau = jnp.asarray(samples), jnp.asarray(tau)

    def evaluate(variant):
        run = epoch(variant, samples, tau)
        return lambda: jax.block_until_ready(run(parameters))

    task.run(given, VARIANTS, jax.__version__, evaluate)


main()
