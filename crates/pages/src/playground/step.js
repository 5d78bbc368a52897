// One step of a network, as crates/run/src/export describes it: a sample in the data's units and a state come in, mean and
// variance in the data's units come out, and the state goes on. What is not finite in a sample is missing.
"use strict";
const scrnnStep = (net) => {
  const { channels: names, offset, scale, kind, members } = net;
  const n = names.length, { delay, units, inputs, lags, floor } = kind;
  const past = Math.max(lags, kind.velocity ? 1 : 0);
  const rows = (count, width) => Array.from({ length: count }, () => new Float64Array(width));
  const begin = (internals) => ({
    steps: 0,
    of: members.map((member, m) => ({
      internal: Float64Array.from((internals && internals[m]) || member.internal), past: rows(past + 1, n), means: rows(delay, n),
    })),
  });
  const step = (state, sample) => {
    const means = [], variances = [];
    let context;
    members.forEach((net, m) => {
      const own = state.of[m], u = own.internal, x = new Float64Array(inputs);
      for (let i = 0; i < n; i++) {
        const scaled = sample[i] === null ? NaN : (sample[i] - offset[i]) * scale[i];
        x[i] = Number.isFinite(scaled) ? scaled : state.steps >= delay ? own.means[0][i] : own.past[0][i];
      }
      for (let j = past; j > 0; j--) own.past[j].set(state.steps > 0 ? own.past[j - 1] : x.subarray(0, n));
      own.past[0].set(x.subarray(0, n));
      if (kind.velocity) for (let i = 0; i < n; i++) x[n + i] = (own.past[0][i] - own.past[1][i]) * net.velocity[i];
      // u <- (1 - 1/tau) u + (1/tau) (W x + W c + b),  c = tanh u
      const c = u.map(Math.tanh);
      for (let i = 0; i < units; i++) {
        let drive = net.bias[i];
        for (let j = 0; j < inputs; j++) drive += net.from_input[i * inputs + j] * x[j];
        for (let j = 0; j < units; j++) drive += net.from_context[i * units + j] * c[j];
        u[i] = net.decay[i] * u[i] + drive;
      }
      for (let i = 0; i < units; i++) c[i] = Math.tanh(u[i]);
      const said = (bias, weights, i) => {
        let sum = bias[i];
        for (let j = 0; j < units; j++) sum += weights[i * units + j] * c[j];
        return sum;
      };
      const y = new Float64Array(n), v = new Float64Array(n);
      for (let i = 0; i < n; i++) {
        let mean = said(net.mean_bias, net.mean_from_context, i);
        if (!kind.linear_mean) mean = Math.tanh(mean);
        if (kind.skip) {
          let guess = own.past[0][i];
          for (let lag = 0; lag < lags; lag++)
            for (let j = 0; j < n; j++) guess += net.taps[(lag * n + i) * n + j] * (own.past[lag][j] - own.past[lag + 1][j]);
          mean = guess + net.skip_scale[i] * mean;
        }
        y[i] = mean;
        if (kind.variance) {
          v[i] = Math.exp(said(net.variance_bias, net.variance_from_context, i)) + floor;
          if (kind.skip) v[i] *= net.skip_scale[i] * net.skip_scale[i];
        }
      }
      for (let k = 0; k + 1 < delay; k++) own.means[k].set(own.means[k + 1]);
      own.means[delay - 1].set(y);
      means.push(y);
      variances.push(v);
      if (m === 0) context = c;
    });
    if (state.steps < delay) state.steps++;
    // The moments of the mixture.
    const mean = [], variance = [];
    for (let i = 0; i < n; i++) {
      const middle = means.reduce((sum, y) => sum + y[i], 0) / members.length;
      mean.push(middle / scale[i] + offset[i]);
      const spread = variances.reduce((sum, v, m) => sum + v[i] + (means[m][i] - middle) ** 2, 0);
      variance.push(spread / members.length / (scale[i] * scale[i]));
    }
    return { mean, variance: kind.variance ? variance : null, context };
  };
  return { begin, step, channels: n };
};
