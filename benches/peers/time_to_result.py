#!/usr/bin/env python3
"""Seconds until a network regenerates the twelve Lissajous curves: scrnn's fast preset, the same recipe in JAX, an LSTM in PyTorch.

    python benches/peers/time_to_result.py scrnn|jax|lstm [--seed 11] [--epochs 10000] [--every 500]

All learn the same data: the twelve curves with their noise, 1000 steps. Every so many epochs the network runs on its own for 1000 steps, on
its predictions with the noise that it predicts. A curve is regenerated where half of the mean squared error of the predicted means
is at most (3 sigma)^2 / 2 (thesis 3.2.5), sigma being the deviation of the curve's noise. One thread; seconds are processor time of training alone,
without judging and without compiling. One JSON line for each judgement, and a last one when the epochs are over.

`jax` is float64: Adam with warm-up, cosine, clipping and decoupled decay in batches of six, as assets/experiments/lissajous_fast.toml says, then 500
iterations of L-BFGS by scipy. `lstm` is float32: 60 units, means and logarithms of variances as linear outputs, a learned pair of states for
each curve, Adam in batches of six, warm-up, cosine and clipping as above.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
STEPS, PERIOD, BATCH = 1000, 25, 6
SIGMA = np.tile([0.01, 0.03, 0.05, 0.07], 3)
RATE, WARM_UP, CLIP, DECAY, OWN = 3e-3, 0.02, 1.0, 0.1, 3.0
CURVES = [(1, 2), (-1, 2), (2, 1), (2, -1), (1, 4), (-1, 4), (4, 1), (4, -1), (3, 2), (-3, 2), (2, 3), (2, -3)]


def program():
    path = Path(os.environ.get("SCRNN") or ROOT / "target" / "release" / "scrnn")
    if not path.exists():
        sys.exit(f"{path} is not there: `cargo build --release -p scrnn-cli`, or set SCRNN")
    return path


def scrnn(*arguments):
    subprocess.run([program(), *map(str, arguments), "--quiet"], check=True, stdout=subprocess.DEVNULL)


def arrays(path, field):
    """The sequences of a file, in their order, as [sequence, step, channel]."""
    with np.load(path) as held:
        names = [name for name in held.files if name.startswith(f"{field}_")]
        return np.stack([held[name] for name in sorted(names, key=lambda name: int(name.rsplit("_", 1)[1]))])


def clean():
    """The curves without noise (3.1), at the steps that are predicted: 2 to 1001."""
    angle = 2 * np.pi * (np.arange(2, STEPS + 2) % PERIOD) / PERIOD
    waves = [-0.4 * (np.cos(angle) - 1), 0.8 * np.sin(angle), -0.4 * (np.cos(2 * angle) - 1), 0.8 * np.sin(2 * angle)]
    return np.array([[np.sign(i) * waves[abs(i) - 1] for i in pair] for pair in CURVES]).swapaxes(1, 2)


def regenerated(means):
    """How many curves these means of closed loops [curve, step, channel] are."""
    error = 0.5 * np.mean((means - clean()[:, : means.shape[1]]) ** 2, axis=(1, 2))
    return int(np.sum(error <= (3 * SIGMA) ** 2 / 2))


def rate(epoch, epochs):
    warm = round(WARM_UP * epochs)
    if epoch < warm:
        return RATE * (epoch + 1) / warm
    return RATE * 0.5 * (1 + np.cos(np.pi * min((epoch - warm) / max(epochs - warm, 1), 1)))


def say(**found):
    print(json.dumps(found), flush=True)


def ours(given, folder, _):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    scrnn("train", ROOT / "assets/experiments/lissajous_fast.toml", "--seed", given.seed, "--threads", 1, "--out", folder / "run")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    scrnn("generate", folder / "run", "--steps", STEPS, "--seed", given.seed, "--out", folder / "closed.npz")
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    say(method="scrnn", seed=given.seed, epochs=10_500, seconds=round(seconds, 1), regenerated=regenerated(arrays(folder / "closed.npz", "mean")))


class Stopwatch:
    """Processor time of what is between start and stop."""

    def __init__(self):
        self.seconds, self.begun = 0.0, None

    def start(self):
        self.begun = time.process_time()

    def stop(self):
        self.seconds += time.process_time() - self.begun


def jax_recipe(given, _, samples):
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"
    os.environ["JAX_PLATFORMS"] = "cpu"
    import jax
    import jax.numpy as jnp
    from jax.flatten_util import ravel_pytree
    from scipy.optimize import minimize

    jax.config.update("jax_enable_x64", True)
    count, units, channels, tau = len(samples), 60, samples.shape[2], 2.0
    random = np.random.default_rng(given.seed)
    uniform = lambda fan, *shape: jnp.asarray(random.uniform(-1, 1, shape) / fan)  # noqa: E731
    shared = {
        "input": uniform(channels, units, channels),
        "context": uniform(units, units, units),
        "bias": uniform(1, units),
        "outputs": uniform(units, 2 * channels, units),
        "output_bias": jnp.zeros(2 * channels),
        "mean_state": jnp.zeros(units),
    }
    biases = {"bias", "output_bias", "mean_state"}
    own = jnp.zeros((count, units))
    turned = jnp.asarray(samples.swapaxes(0, 1))

    def outputs(p, contexts):
        u = contexts @ p["outputs"].T + p["output_bias"]
        return jnp.tanh(u[..., :channels]), u[..., channels:]

    def advance(p, u, c, drive):
        u = (1 - 1 / tau) * u + drive + (c @ p["context"].T) / tau
        return u, jnp.tanh(u)

    def ln_likelihood(p, z, x):
        u0 = p["mean_state"] + z
        drives = (x[:-1] @ p["input"].T + p["bias"]) / tau

        def step(state, drive):
            u, c = advance(p, *state, drive)
            return (u, c), c

        contexts = jax.lax.scan(step, (u0, jnp.tanh(u0)), drives, unroll=4)[1]
        mean, u = outputs(p, contexts)
        return -0.5 * jnp.sum(jnp.log(2 * jnp.pi) + u + (x[1:] - mean) ** 2 * jnp.exp(-u))

    def moved(value, slope, first, second, n, step):
        first, second = 0.9 * first + 0.1 * slope, 0.999 * second + 0.001 * slope**2
        ahead = first / (1 - 0.9**n) / (jnp.sqrt(second / (1 - 0.999**n)) + 1e-8)
        return value + step * ahead, first, second

    @jax.jit
    def update(state, batch, n, met, step):
        p, z, moments, own_moments = state
        x = turned[:, batch]
        terms = (x.shape[0] - 1) * x.shape[1] * channels
        by_p, by_z = jax.grad(ln_likelihood, (0, 1))(p, z[batch], x)
        norm = jnp.sqrt(sum(jnp.sum(by_p[k] ** 2) for k in by_p if k != "mean_state")) / terms
        clip = jnp.where(norm > CLIP, CLIP / norm, 1.0)
        new, kept = {}, {}
        for k, value in p.items():
            factor, share = (OWN, 1.0) if k == "mean_state" else (1.0, clip)
            value = value if k in biases else value * (1 - step * DECAY)
            value, *rest = moved(value, by_p[k] * share / terms, *moments[k], n, factor * step)
            new[k], kept[k] = value, tuple(rest)
        slope = (by_z - z[batch]) / (terms * count / BATCH)
        value, *rest = moved(z[batch], slope, own_moments[0][batch], own_moments[1][batch], met, OWN * step)
        z = z.at[batch].set(value)
        own_moments = tuple(m.at[batch].set(r) for m, r in zip(own_moments, rest, strict=True))
        return new, z, kept, own_moments

    @jax.jit
    def closed(p, z, noise):
        u0 = p["mean_state"] + z

        def step(state, e):
            u, c, x = state
            u, c = advance(p, u, c, (x @ p["input"].T + p["bias"]) / tau)
            mean, v = outputs(p, c)
            return (u, c, mean + jnp.exp(0.5 * v) * e), mean

        return jax.lax.scan(step, (u0, jnp.tanh(u0), turned[0]), noise)[1].swapaxes(0, 1)

    noise = jnp.asarray(np.random.default_rng(given.seed + 1).standard_normal((STEPS, count, channels)))
    judged = lambda p, z: regenerated(np.asarray(closed(p, z, noise)))  # noqa: E731
    zeros = lambda value: (jnp.zeros_like(value), jnp.zeros_like(value))  # noqa: E731
    state = (shared, own, {k: zeros(v) for k, v in shared.items()}, zeros(own))
    order, watch, n = np.arange(count), Stopwatch(), 0
    jax.block_until_ready(update(state, jnp.asarray(order[:BATCH]), 1, 1, 0.0))
    for epoch in range(given.epochs):
        watch.start()
        random.shuffle(order)
        for at in range(0, count, BATCH):
            n += 1
            state = update(state, jnp.asarray(order[at : at + BATCH]), n, epoch + 1, rate(epoch, given.epochs))
        jax.block_until_ready(state)
        watch.stop()
        if (epoch + 1) % given.every == 0:
            say(method="jax", seed=given.seed, epochs=epoch + 1, seconds=round(watch.seconds, 1), regenerated=judged(*state[:2]))

    p, z = state[:2]
    flat, back = ravel_pytree((p, z))
    value = jax.jit(jax.value_and_grad(lambda v: -(lambda p, z: ln_likelihood(p, z, turned) - 0.5 * jnp.sum(z**2))(*back(v)) / samples.size))
    jax.block_until_ready(value(flat))
    watch.start()
    found = minimize(lambda v: tuple(map(np.asarray, value(v))), np.asarray(flat), jac=True, method="L-BFGS-B", options={"maxiter": 500})
    watch.stop()
    say(method="jax", seed=given.seed, epochs=given.epochs + found.nit, seconds=round(watch.seconds, 1), regenerated=judged(*back(found.x)), over=True)


def lstm(given, _, samples):
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(given.seed)
    count, units, channels = len(samples), 60, samples.shape[2]
    body, head = torch.nn.LSTM(channels, units, batch_first=True), torch.nn.Linear(units, 2 * channels)
    states = [torch.zeros(1, count, units, requires_grad=True) for _ in range(2)]
    shared = [*body.parameters(), *head.parameters()]
    adam = torch.optim.Adam([{"params": shared}, {"params": states}])
    x = torch.tensor(samples, dtype=torch.float32)
    random = torch.Generator().manual_seed(given.seed + 1)

    @torch.no_grad()
    def judged():
        (h, c), at, means = [state.clone() for state in states], x[:, :1], []
        for _ in range(STEPS):
            out, (h, c) = body(at, (h, c))
            mean, log_variance = head(out).chunk(2, dim=-1)
            means.append(mean)
            at = mean + torch.exp(0.5 * log_variance) * torch.randn(mean.shape, generator=random)
        return regenerated(torch.cat(means, dim=1).double().numpy())

    watch = Stopwatch()
    for epoch in range(given.epochs):
        watch.start()
        now = rate(epoch, given.epochs)
        adam.param_groups[0]["lr"], adam.param_groups[1]["lr"] = now, OWN * now
        for batch in torch.randperm(count).split(BATCH):
            out, _ = body(x[batch, :-1], tuple(state[:, batch].contiguous() for state in states))
            mean, log_variance = head(out).chunk(2, dim=-1)
            loss = 0.5 * (log_variance + (x[batch, 1:] - mean) ** 2 * torch.exp(-log_variance)).mean()
            adam.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(shared, CLIP)
            adam.step()
        watch.stop()
        if (epoch + 1) % given.every == 0:
            over = {"over": True} if epoch + 1 == given.epochs else {}
            say(method="lstm", seed=given.seed, epochs=epoch + 1, seconds=round(watch.seconds, 1), regenerated=judged(), nll=round(loss.item(), 3), **over)


METHODS = {"scrnn": ours, "jax": jax_recipe, "lstm": lstm}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("method", choices=METHODS)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--epochs", type=int, default=10_000)
    parser.add_argument("--every", type=int, default=500)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="time-to-result-") as name:
        folder = Path(name)
        scrnn("data", "lissajous", "--steps", STEPS + 1, "--seed", given.seed, "--out", folder / "data.npz")
        METHODS[given.method](given, folder, arrays(folder / "data.npz", "sequence"))


if __name__ == "__main__":
    main()
