//! The time that a processor spends on one thread. Other programs take none of it, as they do of the time that passes.

use std::time::Instant;

/// A clock of the thread that starts it.
#[derive(Debug, Clone, Copy)]
pub struct ProcessorTime {
    spent: Option<f64>,
    begun: Instant,
}

impl ProcessorTime {
    /// From now on.
    pub fn start() -> Self {
        Self { spent: spent(), begun: Instant::now() }
    }

    /// Seconds spent, or passed where the system does not tell what was spent. To be asked on the same thread.
    pub fn seconds(self) -> f64 {
        let spent = self.spent.zip(spent()).map(|(before, now)| now - before).filter(|seconds| *seconds > 0.0);
        spent.unwrap_or_else(|| self.begun.elapsed().as_secs_f64())
    }
}

/// Of this thread, since it began. Linux alone tells.
fn spent() -> Option<f64> {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    told.split_whitespace().next()?.parse::<u64>().ok().map(|nanoseconds| nanoseconds as f64 / 1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleep_costs_time_but_no_processor() {
        let clock = ProcessorTime::start();
        let begun = Instant::now();
        std::thread::sleep(std::time::Duration::from_millis(60));
        assert!(clock.seconds() > 0.0 && clock.seconds() <= begun.elapsed().as_secs_f64() + 0.01);
        if spent().is_some() {
            let mut x = 0.1_f64;
            while clock.seconds() < 0.02 {
                x = std::hint::black_box(x.sin());
            }
            assert!(clock.seconds() < begun.elapsed().as_secs_f64());
        }
    }
}
