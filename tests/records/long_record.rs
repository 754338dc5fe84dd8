//! Ten million samples in one fit: memory is the record and less than 10 MB. In release only (`cargo test --release`).

use greybox::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

signals! { pub struct Current { i: "A" } }
signals! { pub struct Voltage { u: "V" } }
signals! { pub struct Coil { r: "ohm", l: "H" } }

struct Rl;

impl Model for Rl {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Coil;
    #[inline]
    fn derivative<S: Scalar>(&self, _t: f64, x: &Current<S>, u: &Voltage<S>, p: &Coil<S>) -> Current<S> {
        Current { i: (u.u - p.r * x.i) / p.l }
    }
    #[inline]
    fn output<S: Scalar>(&self, _t: f64, x: &Current<S>, _u: &Voltage<S>, _p: &Coil<S>) -> Current<S> {
        *x
    }
}

/// Counts what is allocated, and the most that ever was.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    let begin = Instant::now();
    let estimate = Fit::new(&Rl, &record).parameters(Coil { r: free(1.0), l: free(0.03) }).run().unwrap();
    let (seconds, more) = (begin.elapsed().as_secs_f64(), PEAK.load(Relaxed) - before);
    println!("{estimate}\n{seconds:.1} s, record {before} bytes, beyond it {more} bytes");
    assert!(estimate.outcome.converged());
    assert!(more < 10_000_000, "{more} bytes beyond the record");
    for (name, value, truth) in [("r", estimate.parameters.r, r), ("l", estimate.parameters.l, l)] {
        let (lower, upper) = estimate.interval(name, 0.999_999).unwrap();
        assert!(lower < truth && truth < upper, "{name} {value}");
    }
}
