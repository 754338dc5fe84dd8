//! Butterworth filters against their defining equations, and zero-phase filtering against what it promises.

use approx::assert_relative_eq;
use greybox::*;
use std::f64::consts::PI;

/// The next output of a filter of one number per row.
fn step(filter: &Butterworth, state: &mut Vec<f64>, x: f64) -> f64 {
    let mut row = [x];
    filter.filter_rows(&mut row, 1, state);
    row[0]
}

fn impulse_response(filter: &Butterworth, samples: usize) -> Vec<f64> {
    let mut state = vec![];
    (0..samples).map(|k| step(filter, &mut state, if k == 0 { 1.0 } else { 0.0 })).collect()
}

/// The response at a frequency in cycles per sample.
fn response(h: &[f64], f: f64) -> (f64, f64) {
    let turn = 2.0 * PI * f;
    h.iter().enumerate().fold((0.0, 0.0), |(re, im), (k, h)| {
        let angle = turn * k as f64;
        (re + h * angle.cos(), im - h * angle.sin())
    })
}

fn gain(h: &[f64], f: f64) -> f64 {
    let (re, im) = response(h, f);
    re.hypot(im)
}

/// Numerator and denominator as scipy.signal.butter(order, 2 * cut-off) gives them.
#[test]
fn the_transfer_function_is_the_published_one() {
    let low = |order, cutoff| Butterworth::low_pass(order, cutoff, 1.0).unwrap();
    let cases: [(Butterworth, &[f64], &[f64]); 5] = [
        (low(1, 0.125), &[0.2928932188134524; 2], &[1.0, -0.4142135623730951]),
        (low(2, 0.25), &[0.2928932188134524, 0.5857864376269049, 0.2928932188134524], &[1.0, 0.0, 0.17157287525380988]),
        (
            low(3, 0.05),
            &[0.002898194633721443, 0.00869458390116433, 0.00869458390116433, 0.002898194633721443],
            &[1.0, -2.374094743709352, 1.929355669091215, -0.5320753683120917],
        ),
        (
            low(4, 0.1),
            &[
                0.004824343357716232,
                0.019297373430864927,
                0.02894606014629739,
                0.019297373430864927,
                0.004824343357716232,
            ],
            &[1.0, -2.3695130071820376, 2.31398841441588, -1.0546654058785676, 0.18737949236818494],
        ),
        (
            Butterworth::high_pass(3, 0.2, 1.0).unwrap(),
            &[0.25691560124846335, -0.7707468037453901, 0.7707468037453901, -0.25691560124846335],
            &[1.0, -0.5772405248063025, 0.42178704868956163, -0.0562972364918426],
        ),
    ];
    for (filter, b, a) in cases {
        let h = impulse_response(&filter, 100);
        for k in 0..h.len() {
            let past = (1..a.len()).filter(|&i| i <= k).map(|i| a[i] * h[k - i]).sum::<f64>();
            let expected = b.get(k).copied().unwrap_or(0.0) - past;
            assert!((h[k] - expected).abs() < 1e-14, "{}, sample {k}: {} and {expected}", filter.describe(), h[k]);
        }
    }
}

/// `|H|^2 = 1 / (1 + (tan(pi f) / tan(pi f_c))^(2 n))`, for every order; 0.0005 cycles per sample is 0.001 of Nyquist.
#[test]
fn the_gain_is_butterworths_at_every_order_and_cutoff() {
    for order in 1..=20 {
        for cutoff in [0.0005, 0.02, 0.25, 0.45] {
            let low = Butterworth::low_pass(order, cutoff, 1.0).unwrap();
            // The slowest pole has the damping sin(pi / 2n), and decays by this much per sample; 40 of its time constants.
            let decay = (2.0 * PI * cutoff).sin() * (PI / 2.0 / order as f64).sin();
            let h = impulse_response(&low, (40.0 / decay) as usize);
            assert_relative_eq!(gain(&h, cutoff), 0.5f64.sqrt(), epsilon = 1e-10);
            assert_relative_eq!(gain(&h, 0.0), 1.0, epsilon = 1e-12);
            for f in [0.3 * cutoff, 0.9 * cutoff, 1.05 * cutoff] {
                let ratio = (PI * f).tan() / (PI * cutoff).tan();
                assert_relative_eq!(gain(&h, f), 1.0 / (1.0 + ratio.powi(2 * order as i32)).sqrt(), epsilon = 1e-10);
            }
            let high = Butterworth::high_pass(order, cutoff, 1.0).unwrap();
            let h = impulse_response(&high, (40.0 / decay) as usize);
            assert_relative_eq!(gain(&h, cutoff), 0.5f64.sqrt(), epsilon = 1e-10);
            assert_relative_eq!(gain(&h, 0.5), 1.0, epsilon = 1e-12);
            assert!(gain(&h, 0.0) < 1e-12);
        }
    }
}

/// Order 12 at 0.001 of Nyquist: the step response settles at one, with no error that grows.
#[test]
fn a_high_order_at_a_low_cutoff_stays_accurate() {
    let filter = Butterworth::low_pass(12, 0.0005, 1.0).unwrap();
    let mut state = vec![];
    let last = (0..200_000).map(|_| step(&filter, &mut state, 1.0)).last().unwrap();
    assert!((last - 1.0).abs() < 1e-12, "{last}");
    let mut state = filter.settled(3.7);
    assert!((0..10_000).all(|_| step(&filter, &mut state, 3.7) == 3.7));
    let high = Butterworth::high_pass(12, 0.0005, 1.0).unwrap();
    let mut state = high.settled(3.7);
    assert!((0..10_000).all(|_| step(&high, &mut state, 3.7) == 0.0));
}

/// SPEC 5: white noise through 100 Hz, order 4, at 0.126 ms keeps 1/39 of its variance. In continuous time the noise
/// bandwidth is f_c (pi/2n) / sin(pi/2n); the bilinear transform moves it by less than 0.1 % at this cut-off.
#[test]
fn the_power_that_passes() {
    let filter = Butterworth::low_pass(4, 100.0, 0.126e-3).unwrap();
    let power: f64 = impulse_response(&filter, 5_000).iter().map(|h| h * h).sum();
    let bandwidth = 100.0 * (PI / 8.0) / (PI / 8.0).sin();
    assert_relative_eq!(power, 2.0 * bandwidth * 0.126e-3, max_relative = 1e-3);
    assert_eq!((1.0 / power).round(), 39.0);
}

/// Rows in parts of any length give the same bits as number by number, each place in the row by itself.
#[test]
fn rows_equal_single_steps() {
    let width = 7;
    for filter in [Butterworth::low_pass(5, 3.0, 0.01).unwrap(), Butterworth::high_pass(2, 3.0, 0.01).unwrap()] {
        let x = |c: usize, k: usize| ((k * (c + 3)) as f64 * 0.7).sin() + 0.1 * c as f64;
        let (mut single, mut states, mut done) = (vec![vec![]; width], vec![], 0);
        for rows in [1, 16, 17, 50, 3, 0, 2, 128] {
            let mut part: Vec<f64> = (0..rows * width).map(|i| x(i % width, done + i / width)).collect();
            filter.filter_rows(&mut part, width, &mut states);
            for (i, y) in part.into_iter().enumerate() {
                assert_eq!(y, step(&filter, &mut single[i % width], x(i % width, done + i / width)));
            }
            done += rows;
        }
        filter.filter_rows(&mut [], 0, &mut vec![]);
    }
}

/// Subnormal numbers would make a long quiet record 100 times slower.
#[test]
fn a_decaying_state_becomes_zero_and_never_subnormal() {
    for order in [1, 2, 4, 5] {
        let filter = Butterworth::low_pass(order, 0.01, 1.0).unwrap();
        let mut state = vec![];
        step(&filter, &mut state, 1.0);
        let tail: Vec<f64> = (0..200_000).map(|_| step(&filter, &mut state, 0.0)).collect();
        assert!(tail.iter().all(|y| *y == 0.0 || y.is_normal()));
        assert_eq!(tail.last(), Some(&0.0));
        let (mut block, mut state) = (vec![0.0; 200_000], vec![]);
        block[0] = 1.0;
        filter.filter_rows(&mut block, 1, &mut state);
        assert!(block.iter().all(|y| *y == 0.0 || y.is_normal()));
        assert_eq!(block.last(), Some(&0.0));
    }
}

#[test]
fn zero_phase_squares_the_gain_and_does_not_delay() {
    let (n, f) = (4_000, 0.015);
    let filter = Butterworth::low_pass(4, 0.02, 1.0).unwrap();
    let mut values: Vec<f64> = (0..n).map(|k| (2.0 * PI * f * k as f64).sin()).collect();
    filter.zero_phase(&mut values);
    let gain = 1.0 / (1.0 + ((PI * f).tan() / (PI * 0.02).tan()).powi(8));
    for (k, value) in values.iter().enumerate().skip(1_000).take(2_000) {
        assert_relative_eq!(*value, gain * (2.0 * PI * f * k as f64).sin(), epsilon = 1e-9);
    }
}

/// Point reflection continues a straight line: the filter leaves it alone, to the 1e-9 to which it has settled.
#[test]
fn zero_phase_leaves_straight_lines_alone() {
    for order in [1, 2, 3, 7] {
        let filter = Butterworth::low_pass(order, 0.05, 1.0).unwrap();
        let line = |k: usize| 3.0 - 0.01 * k as f64;
        let mut values: Vec<f64> = (0..1_000).map(line).collect();
        filter.zero_phase(&mut values);
        for (k, value) in values.iter().enumerate() {
            assert_relative_eq!(*value, line(k), epsilon = 1e-6);
        }
    }
}

#[test]
fn zero_phase_filters_the_pieces_between_gaps() {
    let filter = Butterworth::low_pass(2, 0.1, 1.0).unwrap();
    let piece = |n: usize| -> Vec<f64> { (0..n).map(|k| (k as f64 * 0.9).sin() + k as f64 * 0.1).collect() };
    let mut alone = [piece(1), piece(2), piece(300)];
    let gap = [f64::NAN];
    let mut together = [&gap, &alone[0][..], &gap, &gap, &alone[1], &gap, &alone[2]].concat();
    filter.zero_phase(&mut together);
    alone.iter_mut().for_each(|piece| filter.zero_phase(piece));
    let expected = [&gap, &alone[0][..], &gap, &gap, &alone[1], &gap, &alone[2]].concat();
    assert_eq!(together.len(), expected.len());
    for (a, b) in together.iter().zip(&expected) {
        assert!(a == b || (a.is_nan() && b.is_nan()));
    }
    // One sample alone is constant.
    assert_eq!(together[1], 0.0);
    filter.zero_phase(&mut []);
}

signals! { pub struct Force { u: "N" } }
signals! { pub struct Place { y: "m", z: "m" } }

struct Arm;
impl Model for Arm {
    type State = Nothing;
    type Input = Force;
    type Output = Place;
    type Parameters = Nothing;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Force<S>, _p: &Nothing) -> Place<S> {
        Place { y: u.u, z: u.u }
    }
}

fn record(time: Time) -> ExperimentOf<Arm> {
    let inputs = (0..400).map(|k| Force { u: (k as f64).sin() }).collect();
    let outputs = (0..400).map(|k| Place { y: (k as f64).sin(), z: if k == 7 { f64::NAN } else { 1.0 } }).collect();
    Experiment::new(&Arm, time, inputs, outputs).unwrap().named("arm").hold(Hold::First)
}

#[test]
fn a_record_is_filtered_on_both_sides() {
    let filter = Butterworth::low_pass(2, 5.0, 0.01).unwrap();
    for time in [
        Time::Uniform { start: 1.0, step: 0.01 },
        Time::Stamps((0..400).map(|k| 0.01 * k as f64 + 4e-5 * (k % 2) as f64).collect()),
    ] {
        let experiment = record(time);
        let filtered = experiment.filtered(&filter).unwrap();
        let mut expected: Vec<f64> = experiment.inputs().map(|u| u.u).collect();
        filter.zero_phase(&mut expected);
        for (k, expected) in expected.iter().enumerate() {
            assert_eq!((filtered.input(k).u, filtered.output(k).y), (*expected, *expected));
            assert!(filtered.output(k).z == 1.0 || k == 7);
        }
        assert!(filtered.output(7).z.is_nan());
        assert_eq!((filtered.name(), filtered.record().input_hold(0), filtered.len()), ("arm", Hold::First, 400));
    }
}

#[test]
fn a_record_with_another_sample_time_or_a_gap_in_time_is_refused() {
    let filter = Butterworth::low_pass(2, 5.0, 0.01).unwrap();
    let why = record(Time::Uniform { start: 0.0, step: 0.02 }).filtered(&filter).unwrap_err().to_string();
    assert!(why.contains("every 0.01 s") && why.contains("`arm`") && why.contains("0.02 s later"), "{why}");
    let gap = (0..400).map(|k| if k > 9 { 0.01 * k as f64 + 1.0 } else { 0.01 * k as f64 }).collect();
    let why = record(Time::Stamps(gap)).filtered(&filter).unwrap_err().to_string();
    assert!(why.contains("number 9"), "{why}");
}

#[test]
fn filters_that_cannot_be_made() {
    let why = |order, cutoff, step| Butterworth::low_pass(order, cutoff, step).unwrap_err().to_string();
    assert!(why(0, 1.0, 0.1).contains("order is 0"));
    assert!(why(21, 1.0, 0.1).contains("order is 21"));
    assert!(why(4, 5.0, 0.1).contains("the cut-off is 5 Hz") && why(4, 5.0, 0.1).contains("sampling rate, 5 Hz"));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(why(4, bad, 0.1).contains("the cut-off is"));
        assert!(why(4, 1.0, bad).contains("sample time"));
    }
    assert!(Butterworth::high_pass(4, 7.0, 0.1).is_err());
}

#[test]
fn a_filter_round_trips_as_its_design() {
    let filter = Butterworth::high_pass(3, 2.0, 0.01).unwrap();
    let text = serde_json::to_string(&filter).unwrap();
    assert_eq!(text, r#"{"pass":"High","order":3,"cutoff":2.0,"sample_time":0.01}"#);
    assert_eq!(serde_json::from_str::<Butterworth>(&text).unwrap(), filter);
    let why = serde_json::from_str::<Butterworth>(&text.replace("3,", "0,")).unwrap_err().to_string();
    assert!(why.contains("order is 0"), "{why}");
    assert_eq!(filter.describe(), "Butterworth high-pass, order 3, 2 Hz");
    assert_eq!((filter.order(), filter.cutoff(), filter.sample_time()), (3, 2.0, 0.01));
}
