//! What the machine can do at best, measured in the run that judges by it.

use std::hint::black_box;
use std::time::{Duration, Instant};

use pulp::{Simd, WithSimd};
use scrnn::engine::InstructionSet;

/// Runs `work` compiled for an instruction set.
pub fn on<W: WithSimd>(set: InstructionSet, work: W) -> W::Output {
    match set {
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 if let Some(simd) = pulp::x86::V4::try_new() => Simd::vectorize(simd, work),
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 if let Some(simd) = pulp::x86::V3::try_new() => Simd::vectorize(simd, work),
        #[cfg(target_arch = "aarch64")]
        InstructionSet::Neon if let Some(simd) = pulp::aarch64::Neon::try_new() => Simd::vectorize(simd, work),
        _ => Simd::vectorize(pulp::Scalar512b, work),
    }
}

/// Seconds that one call takes, over as many calls as fill `least`.
pub fn seconds_per_call(least: Duration, mut call: impl FnMut(u32)) -> f64 {
    let mut calls = 1;
    loop {
        let start = Instant::now();
        call(calls);
        let elapsed = start.elapsed();
        if elapsed >= least {
            return elapsed.as_secs_f64() / f64::from(calls);
        }
        let wanted = least.as_secs_f64() / elapsed.as_secs_f64().max(1e-9);
        calls = (f64::from(calls) * (1.1 * wanted).clamp(2.0, 1000.0)).ceil() as u32;
    }
}

/// The median of a list that is not empty.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Operations a second, in units of 1e9, when each of `threads` threads does nothing but fused multiply-adds of
/// independent registers; one multiply-add counts as two operations.
pub fn peak_gflops(set: InstructionSet, threads: usize) -> f64 {
    let burst = || {
        let mut operations = 0.0;
        let seconds = seconds_per_call(Duration::from_millis(4), |rounds| operations = on(set, MultiplyAdds(rounds)));
        operations / seconds / 1e9
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(burst)).collect();
        burst() + others.into_iter().map(|other| other.join().expect("a burst does not panic")).sum::<f64>()
    })
}

/// Rounds of 1000 multiply-adds of each accumulator; gives the operations of one round.
struct MultiplyAdds(u32);

impl WithSimd for MultiplyAdds {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        // Latency times units is at most 16 on any processor with 32 registers, 10 on one with 16.
        if S::REGISTER_COUNT >= 32 { chains::<S, 24>(simd, self.0) } else { chains::<S, 12>(simd, self.0) }
    }
}

#[inline(always)]
fn chains<S: Simd, const N: usize>(simd: S, rounds: u32) -> f64 {
    const LENGTH: u32 = 1000;
    let (factor, term) = (simd.splat_f64s(black_box(0.999_9)), simd.splat_f64s(black_box(1e-4)));
    // Every chain starts from another value, or the compiler would compute one of them only.
    let mut sums = [simd.splat_f64s(0.0); N];
    for (n, sum) in sums.iter_mut().enumerate() {
        *sum = simd.splat_f64s(black_box(1.0 + n as f64));
    }
    for _ in 0..rounds * LENGTH {
        for sum in &mut sums {
            *sum = simd.mul_add_f64s(*sum, factor, term);
        }
    }
    black_box(sums.iter().fold(0.0, |total, sum| total + simd.reduce_sum_f64s(*sum)));
    f64::from(LENGTH) * (2 * N * S::F64_LANES) as f64
}
