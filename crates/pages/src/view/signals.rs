//! Curves by channel: what was sensed, and what was expected.

use serde_json::{Value, json};

/// Values of one kind of one channel, with their times.
type Curve = Vec<(i64, f64)>;

/// One channel.
#[derive(Debug, Default)]
struct Channel {
    name: String,
    sensed: Curve,
    mean: Curve,
    variance: Curve,
}

/// All channels, in the order in which they came.
#[derive(Debug, Default)]
pub struct Signals {
    channels: Vec<Channel>,
    left_out: usize,
}

/// Channels that are drawn.
const MOST: usize = 24;

impl Signals {
    pub fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }

    pub fn channels(&self) -> usize {
        self.channels.len()
    }

    pub fn has_predictions(&self) -> bool {
        self.channels.iter().any(|channel| !channel.mean.is_empty())
    }

    pub fn sensed<'a>(&mut self, time: i64, values: impl Iterator<Item = (&'a str, f64)>) {
        self.add(time, values, |channel| &mut channel.sensed);
    }

    pub fn mean<'a>(&mut self, time: i64, values: impl Iterator<Item = (&'a str, f64)>) {
        self.add(time, values, |channel| &mut channel.mean);
    }

    pub fn variance<'a>(&mut self, time: i64, values: impl Iterator<Item = (&'a str, f64)>) {
        self.add(time, values, |channel| &mut channel.variance);
    }

    fn add<'a>(
        &mut self,
        time: i64,
        values: impl Iterator<Item = (&'a str, f64)>,
        curve: fn(&mut Channel) -> &mut Curve,
    ) {
        for (name, value) in values {
            let place = self.channels.iter().position(|channel| channel.name == name).unwrap_or_else(|| {
                self.channels.push(Channel { name: name.to_owned(), ..Channel::default() });
                self.channels.len() - 1
            });
            curve(&mut self.channels[place]).push((time, value));
        }
    }

    /// All times.
    pub fn times(&self) -> impl Iterator<Item = i64> {
        let all = |channel: &Channel| {
            let curves = [&channel.sensed, &channel.mean].into_iter();
            curves
                .flat_map(|curve| curve.first().into_iter().chain(curve.last()))
                .map(|(time, _)| *time)
                .collect::<Vec<_>>()
        };
        self.channels.iter().flat_map(all)
    }

    /// Leaves out channels and samples until all fits into so many numbers. Says what is left out.
    pub fn thin_out(&mut self, numbers: usize) -> Option<String> {
        let mut words = Vec::new();
        if self.channels.len() > MOST {
            self.left_out = self.channels.len() - MOST;
            let names: Vec<&str> = self.channels[MOST..].iter().map(|channel| channel.name.as_str()).collect();
            words.push(format!("Not drawn are the channels {}.", names.join(", ")));
            self.channels.truncate(MOST);
        }
        let count = |channel: &Channel| channel.sensed.len() + channel.mean.len() + channel.variance.len();
        let all: usize = self.channels.iter().map(count).sum();
        let every = all.div_ceil(numbers);
        if every > 1 {
            for channel in &mut self.channels {
                for curve in [&mut channel.sensed, &mut channel.mean, &mut channel.variance] {
                    *curve = curve.iter().step_by(every).copied().collect();
                }
            }
            words.push(format!("One of {every} samples of each curve is in the page."));
        }
        (!words.is_empty()).then(|| words.join(" "))
    }

    pub fn json(&self, seconds: &dyn Fn(i64) -> f64) -> Value {
        let curve = |curve: &Curve| {
            let (times, values): (Vec<f64>, Vec<f64>) =
                curve.iter().map(|&(time, value)| (seconds(time), short(value))).unzip();
            json!([times, values])
        };
        let one = |channel: &Channel| {
            let Channel { name, sensed, mean, variance } = channel;
            json!({ "name": name, "sensed": curve(sensed), "mean": curve(mean), "variance": curve(variance) })
        };
        self.channels.iter().map(one).collect()
    }
}

/// As many digits as a curve can show.
fn short(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}
