use greybox::*;
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
    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Coil<S>) -> Current<S> {
        Current { i: (u.u - p.r * x.i) / p.l }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Coil<S>) -> Current<S> {
        *x
    }
}
fn hwm() -> f64 {
    let s = std::fs::read_to_string("/proc/self/status").unwrap();
    s.lines().find(|l| l.starts_with("VmHWM")).unwrap().split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}
fn main() {
    let count: usize = std::env::args().nth(1).unwrap().parse().unwrap();
    let (r, l, h) = (2.0, 0.02, 1e-3);
    let mut bits = 1u64;
    let mut noise = move || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let decay = f64::exp(-h * r / l);
    let experiments: Vec<_> = (0..count).map(|e| {
        let mut i = noise();
        let (mut inputs, mut outputs) = (vec![], vec![]);
        for k in 0..50 {
            let u = if (k + e) % 20 < 10 { 10.0 } else { -4.0 };
            inputs.push(Voltage { u });
            outputs.push(Current { i: i + 0.05 * noise() });
            i = u / r + (i - u / r) * decay;
        }
        Experiment::new(&Rl, Time::Uniform { start: 0.0, step: h }, inputs, outputs).unwrap().initial(Current { i: free(0.0) })
    }).collect();
    println!("records: {:.0} MB", hwm());
    let begin = Instant::now();
    let estimate = Fit::new(&Rl, &experiments).parameters(Coil { r: free(1.0), l: free(0.03) }).run().unwrap();
    println!("{} experiments: {:.1} s, peak {:.0} MB", count, begin.elapsed().as_secs_f64(), hwm());
    println!("{:?} {:?} {:?}", estimate.outcome, estimate.parameters, estimate.interval("r", 0.95));
    println!("{:?}", estimate.warnings.iter().map(|w| &w.text).collect::<Vec<_>>());
}
