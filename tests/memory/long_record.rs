//! Ten million samples in one fit: memory is the record and less than 10 MB. In release only (`cargo test --release`).

use crate::allocator::most_bytes;
use crate::common::{Coil, Current, Rl, Voltage};
use greybox::*;
use std::time::Instant;

#[test]
#[cfg_attr(debug_assertions, ignore = "slow without optimization")]
fn ten_million_samples() {
    const SAMPLES: usize = 10_000_000;
    const H: f64 = 1e-4;
    let (r, l) = (2.0, 0.02);
    let (mut i, decay) = (0.0, f64::exp(-H * r / l));
    let mut bits = 1u64;
    let mut inputs = Vec::with_capacity(SAMPLES);
    let mut outputs = Vec::with_capacity(SAMPLES);
    for k in 0..SAMPLES {
        let u = if k % 400 < 200 { 10.0 } else { -4.0 };
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let noise = (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
        inputs.push(Voltage { u });
        outputs.push(Current { i: i + 0.01 * noise });
        i = u / r + (i - u / r) * decay;
    }
    let record = Experiment::new(&Rl, Time::Uniform { start: 0.0, step: H }, inputs, outputs).unwrap();
    let begin = Instant::now();
    let fit = || Fit::new(&Rl, &record).parameters(Coil { r: free(1.0), l: free(0.03) }).run().unwrap();
    let (estimate, more) = most_bytes(fit);
    println!("{estimate}\n{:.1} s, {more} bytes beyond the record", begin.elapsed().as_secs_f64());
    assert!(estimate.outcome.converged());
    assert!(more < 10_000_000, "{more} bytes beyond the record");
    for (name, value, truth) in [("r", estimate.parameters.r, r), ("l", estimate.parameters.l, l)] {
        let (lower, upper) = estimate.interval(name, 0.999_999).unwrap();
        assert!(lower < truth && truth < upper, "{name} {value}");
    }
}
