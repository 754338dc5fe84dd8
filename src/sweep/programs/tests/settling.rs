//! Filters whose covariances settle: the same predictions as by the covariance of each sample.

use super::*;

const P: [f64; 5] = [2.0, 3.0, 1.5, 0.4, 0.1];

/// A record of this many samples that misses the measurements of one, if it has it; some intervals are longer if `paused`.
fn whole(samples: usize, missing: usize, paused: bool) -> Record {
    let wave = |a: f64| Column::from((0..samples).map(|k| (a * k as f64).sin()).collect::<Vec<_>>());
    let with_one_missing = |a: f64| {
        let mut values = wave(a).to_vec();
        values.iter_mut().skip(missing).take(1).for_each(|y| *y = f64::NAN);
        Column::from(values)
    };
    let channel = |name: &str, values: Column| Channel { name: name.to_owned(), unit: "1".to_owned(), values };
    let stamp = |k: usize| 0.02 * (k + usize::from(k > 450) * 5) as f64;
    let time = match paused {
        true => Time::Stamps((0..samples).map(stamp).collect()),
        false => Time::Uniform { start: 0.0, step: 0.02 },
    };
    let outputs = vec![channel("phi", with_one_missing(0.05)), channel("w", wave(0.07))];
    Record::new(Layout::of::<Pendulum>().states, time, vec![channel("m", wave(0.11))], outputs).unwrap()
}

/// All samples but the last, after which nothing is reached.
fn piece<'a>(record: &'a Record, prepared: &'a Prepared, seeds: usize) -> Piece<'a> {
    let (carry, slopes) = (vec![0.3, -0.2, 0.0, 0.0, 0.0].into(), vec![0.0; 5 * seeds].into());
    Piece { record, prepared, samples: 0..record.len() - 1, carry, slopes, parameters: &P }
}

/// Against dual numbers, which run the covariance of each sample: values and slopes of errors and variances, and what is reached. After a missing measurement and
/// after a longer interval the covariance is that of each sample again.
#[test]
fn settled_filters_predict_as_those_of_each_sample() {
    let all = [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(1), Seed::Parameter(3), Seed::Parameter(4)];
    for (missing, paused) in [(usize::MAX, false), (460, false), (usize::MAX, true)] {
        let record = whole(1000, missing, paused);
        let [_, evaluated, programs] = sweeps(&Pendulum::Constant, Kalman, exact());
        for seeds in [&all[..], &[]] {
            let prepared = programs.prepare(&record, &P).unwrap();
            let (expected, right) = rows(&*evaluated, &[piece(&record, &prepared, seeds.len())], seeds);
            let (found, reached) = rows(&*programs, &[piece(&record, &prepared, seeds.len())], seeds);
            // Of an output at a sample: whether it was measured, then twice slopes and their number.
            let width = 3 + 2 * seeds.len();
            let largest = |column: usize| {
                expected[0].iter().skip(column).step_by(width).fold(0.0, |most: f64, x| most.max(x.abs()))
            };
            for (at, (a, b)) in expected[0].iter().zip(&found[0]).enumerate() {
                // A covariance is taken for settled within 1e-10, its slopes within 1e-8 of the largest.
                let near = if seeds.is_empty() || at % width % (seeds.len() + 1) == 0 { 1e-9 } else { 1e-7 };
                assert!((a - b).abs() <= near * largest(at % width), "{missing} {paused} {at}: {a} {b}");
            }
            for (a, b) in right[0].carry.iter().zip(&reached[0].carry) {
                assert!((a - b).abs() <= 1e-9 * a.abs().max(1e-3), "{a} {b}");
            }
            assert!(
                right[0].slopes.iter().zip(&reached[0].slopes).all(|(a, b)| (a - b).abs() <= 1e-7 * a.abs().max(1e-2))
            );
        }
        let mut repeated = vec![];
        let prepared = programs.prepare(&record, &P).unwrap();
        programs.run(&[piece(&record, &prepared, 5)], &all, &mut |window| {
            repeated.push(window.is_repeated());
            true
        });
        // The missing measurement and the longer interval are in the eighth window of 64 samples; then the covariance settles again.
        assert!(repeated[6] && repeated[15], "{repeated:?}");
        assert_eq!(repeated[7], missing == usize::MAX && !paused, "{repeated:?}");
    }
}

/// Whether a lane has settled does not depend on the lanes beside it: the same bits in a group as alone.
#[test]
fn settled_lanes_do_not_depend_on_each_other() {
    let seeds = [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(3)];
    // A missing measurement and a longer interval within one window, at other places of it; the last one is too short to settle.
    let records =
        [whole(1_000, usize::MAX, true), whole(1_150, 460, true), whole(1_033, 500, true), whole(130, 99, true)];
    let run = |records: &[&Record]| {
        // Nothing is kept from run to run.
        let [.., programs] = sweeps(&Pendulum::Constant, Kalman, exact());
        let all: Vec<Prepared> = records.iter().map(|record| programs.prepare(record, &P).unwrap()).collect();
        let pieces: Vec<Piece<'_>> = records.iter().zip(&all).map(|(record, kept)| piece(record, kept, 3)).collect();
        rows(&*programs, &pieces, &seeds).0
    };
    let all = records.each_ref();
    assert_eq!(run(&all), all.map(|record| run(&[record])).concat());
}

/// The states of a record by values alone, one trajectory, as by the covariance of each sample. A missing measurement stands in a block of which the first
/// part belongs to the way to the sample before.
#[test]
fn trajectories_of_settled_filters() {
    let record = whole(1_000, 460, false);
    let [_, evaluated, programs] = sweeps(&Pendulum::Constant, Kalman, exact());
    let prepared = programs.prepare(&record, &P).unwrap();
    let at = [1, 100, 450, 461, 500, 999];
    let [right, found] =
        [&*evaluated, &*programs].map(|sweep| sweep.follow(&piece(&record, &prepared, 0), &at).unwrap());
    for (a, b) in right.as_slice().concat().iter().zip(found.concat()) {
        assert!((a - b).abs() <= 1e-9 * a.abs().max(1e-3), "{a} {b}");
    }
}
