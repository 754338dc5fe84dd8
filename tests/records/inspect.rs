//! What the columns of a record show before any model.

use greybox::{
    Experiment, Kind, Model, Nothing, Scalar, Time,
    record::{Gap, Inspection, Suspicion},
    signals,
};

signals! { pub struct Drive { u: "V" } }
signals! { pub struct Sensor { y: "V" } }
signals! { pub struct Gain { k: "1" } }

struct Amplifier;

impl Model for Amplifier {
    type State = Nothing;
    type Input = Drive;
    type Output = Sensor;
    type Parameters = Gain;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Drive<S>, p: &Gain<S>) -> Sensor<S> {
        Sensor { y: p.k * u.u }
    }
}

/// A signal that never repeats: irrational steps.
fn signal(samples: usize) -> Vec<f64> {
    (0..samples).map(|k| (k as f64 * 0.618_033_988_749_895).sin()).collect()
}

fn inspected(u: &[f64], y: &[f64]) -> Inspection {
    let (inputs, outputs) = (u.iter().map(|&u| Drive { u }).collect(), y.iter().map(|&y| Sensor { y }).collect());
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    Experiment::new(&Amplifier, time, inputs, outputs).unwrap().inspect()
}

/// What is suspicious of an output.
fn suspicions(y: &[f64]) -> Vec<Suspicion> {
    inspected(&signal(y.len()), y).outputs.remove(0).suspicions
}

#[test]
fn a_good_signal_is_not_suspicious() {
    let found = inspected(&signal(500), &signal(500));
    assert!(found.inputs[0].remarks().is_empty() && found.outputs[0].remarks().is_empty(), "{found:?}");
    assert_eq!((found.outputs[0].samples, found.outputs[0].missing, found.outputs[0].levels), (500, 0, None));
    // Nor is that of an encoder of 200 steps, whose extremes last longer than the rest.
    let encoder: Vec<f64> = (0..2000).map(|k| (100.0 * (k as f64 * 0.01).sin()).round()).collect();
    assert!(suspicions(&encoder).is_empty(), "{:?}", suspicions(&encoder));
}

#[test]
fn constants_and_few_levels_are_found() {
    let found = inspected(&[0.7; 50], &[2.5; 50]);
    assert_eq!((found.inputs[0].constant(), found.outputs[0].constant()), (Some(0.7), Some(2.5)));
    assert_eq!(found.inputs[0].remarks(), ["is 0.7 throughout"]);
    let two: Vec<f64> = signal(100).iter().map(|y| if *y > 0.0 { 3.0 } else { -1.0 }).collect();
    let found = inspected(&signal(100), &two).outputs.remove(0);
    assert_eq!((found.levels, found.step, found.range), (Some(2), Some(4.0), Some((-1.0, 3.0))));
}

#[test]
fn sentinels_are_far_and_exact() {
    let mut y = signal(500);
    y[100] = -999.0;
    y[333] = -999.0;
    assert_eq!(suspicions(&y), [Suspicion::Sentinel { value: -999.0, count: 2 }]);
    let mut u = signal(500);
    u[7] = 9999.0;
    let found = inspected(&u, &signal(500)).inputs.remove(0);
    assert_eq!(found.suspicions, [Suspicion::Sentinel { value: 9999.0, count: 1 }]);
    // A value that no program is known to write is one if it occurs twice, not if once.
    let mut y = signal(500);
    y[100] = -777.25;
    assert!(suspicions(&y).is_empty());
    y[333] = -777.25;
    assert_eq!(suspicions(&y), [Suspicion::Sentinel { value: -777.25, count: 2 }]);
    // Outliers are not: no two are alike.
    let mut y = signal(500);
    (y[100], y[333]) = (-998.3, -870.1);
    assert!(suspicions(&y).is_empty());
}

#[test]
fn limits_stops_and_copies_are_found() {
    let clipped: Vec<f64> = signal(500).iter().map(|y| y.min(0.8)).collect();
    let at_limit = clipped.iter().filter(|y| **y == 0.8).count();
    assert_eq!(suspicions(&clipped), [Suspicion::Clipped { value: 0.8, count: at_limit }]);
    let mut frozen = signal(500);
    frozen[200..260].fill(0.1);
    assert_eq!(suspicions(&frozen), [Suspicion::Frozen { value: 0.1, samples: 200..260 }]);
    // Steps are no limits, though the largest of them occurs ten times and the values beside it once each.
    let levels = signal(500);
    let steps: Vec<f64> = (0..500).map(|k| levels[k / 11 * 11] * if k % 11 == 0 { 0.999 } else { 1.0 }).collect();
    assert_eq!(suspicions(&steps), []);
    let held: Vec<f64> = (0..500).map(|k| levels[k / 10 * 10]).collect();
    assert_eq!(suspicions(&held), [Suspicion::Held { samples: 10 }]);
    let mut copied = signal(500);
    copied.copy_within(20..120, 300);
    assert_eq!(suspicions(&copied), [Suspicion::Repeated { samples: 20..120, again: 300 }]);
}

/// Measurements that are missing are counted, and disturb nothing else.
#[test]
fn missing_measurements_are_counted() {
    let mut y = signal(500);
    y.iter_mut().step_by(5).for_each(|y| *y = f64::NAN);
    let found = inspected(&signal(500), &y).outputs.remove(0);
    assert_eq!((found.missing, found.suspicions.len()), (100, 0));
    let nothing = inspected(&signal(50), &[f64::NAN; 50]).outputs.remove(0);
    assert_eq!((nothing.range, nothing.constant(), nothing.missing), (None, None, 50));
}

/// Where time jumps, by the number of the sample after each jump, if step `k` is of this length.
fn gaps(step: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut t = 0.0;
    let times = (0..400).map(|k| {
        t += step(k);
        t
    });
    let times = Time::Stamps(times.collect());
    let (u, y) = (vec![Drive { u: 0.0 }; 400], signal(400).into_iter().map(|y| Sensor { y }).collect());
    Experiment::new(&Amplifier, times, u, y).unwrap().gaps().iter().map(|gap: &Gap| gap.sample).collect()
}

/// Intervals of 0.3 to 1.7 steps are lawful, ten steps among them are not; of an even clock two steps are a gap.
#[test]
fn gaps_are_judged_against_the_spread_of_the_intervals() {
    let fraction = |k: usize| (k as f64 * 0.618_033_988_749_895).fract();
    assert!(gaps(|k| 0.3 + 1.4 * fraction(k)).is_empty());
    // Independent events: exponential intervals.
    assert!(gaps(|k| 1e-3 - (1.0 - fraction(k)).ln()).is_empty());
    assert_eq!(gaps(|k| if k == 200 { 10.0 } else { 0.3 + 1.4 * fraction(k) }), [200]);
    assert_eq!(gaps(|k| if k == 200 { 2.0 } else { 1.0 + 0.02 * fraction(k) }), [200]);
    // Patterns: two steps by turns, every third or sixth one longer; with a gap in the first. One of a hundred is no pattern.
    assert!(gaps(|k| [0.3, 1.7][k % 2]).is_empty() && gaps(|k| [0.6, 1.4][k % 2]).is_empty());
    assert!(gaps(|k| [0.5, 0.5, 2.0][k % 3]).is_empty());
    assert!(gaps(|k| if k % 6 == 5 { 8.0 } else { 1.0 }).is_empty());
    assert_eq!(gaps(|k| if k == 200 { 20.0 } else { [0.3, 1.7][k % 2] }), [200]);
    assert_eq!(gaps(|k| if k % 100 == 50 { 3.0 } else { 1.0 }), [50, 150, 250, 350]);
    // Three of ten rows lost, here and there.
    assert!(gaps(|k| if fraction(k) < 0.3 { 2.0 } else { 1.0 }).len() > 100);
}
