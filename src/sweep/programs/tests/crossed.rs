//! Intervals that are crossed exactly, of records that are not evenly spaced.

use super::*;

/// A pendulum that swings around ten times from sample to sample of a clock that jitters: a polynomial in the length would be off by a thousandth, and each
/// transition is computed by itself, as in dual numbers; damped within a sample it is near, whatever the length.
#[test]
fn swings_that_no_polynomial_follows() {
    let turns = 2.0 * core::f64::consts::PI * 10.0 / 0.02;
    let record = record(300, 1.0, false);
    let seeds = [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(1), Seed::Parameter(3), Seed::Parameter(4)];
    for damping in [0.3, 1e4] {
        let p = [turns * turns, damping, 1.5, 0.2, 0.1];
        let [_, evaluated, programs] = sweeps(&Pendulum::Constant, Kalman, exact());
        let prepared = programs.prepare(&record, &p).unwrap();
        let by = |sweep: &dyn Sweep| {
            let (carry, slopes) = (vec![0.3, -0.2, 0.0, 0.0, 0.0].into(), vec![0.0; 5 * seeds.len()].into());
            let piece = Piece { record: &record, prepared: &prepared, samples: 0..300, carry, slopes, parameters: &p };
            rows(sweep, &[piece], &seeds).0.concat()
        };
        let (expected, found) = (by(&*evaluated), by(&*programs));
        // Of an output at a sample: whether it was measured, then twice slopes and their number.
        let largest = |column: usize| {
            expected.iter().skip(column).step_by(13).fold(0.0, |largest: f64, number| largest.max(number.abs()))
        };
        let units = [1.0, p[0], p[1], p[3], p[4], 1.0];
        for (at, (a, b)) in expected.iter().zip(&found).enumerate().filter(|(at, _)| at % 13 > 0) {
            let (column, number) = (at % 13, if at % 13 > 6 { 12 } else { 6 });
            let size = largest(column).max(largest(number) / units[(column - 1) % 6]);
            // Ten doublings of numbers that turn, at each of 300 samples; slopes that cancel have no more digits than what they are slopes of.
            assert!((a - b).abs() <= 1e-10 * size, "{damping}, {at}: {a} {b}");
        }
        assert!(!programs.engine().contains("dual"), "{}", programs.engine());
    }
}

/// Whether the lengths of a record are taken from a polynomial does not depend on the records beside it: the same bits in a group as alone.
#[test]
fn lanes_do_not_depend_on_each_other() {
    let p = [2.0, 0.3, 1.5, 0.2, 0.1];
    let seeds = [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(3)];
    let jittered = record(200, 2.0, false);
    let few = jittered.slice(0..20).unwrap();
    let run = |records: &[&Record]| {
        // Nothing is kept from run to run.
        let [.., programs] = sweeps(&Pendulum::Constant, Kalman, exact());
        let all: Vec<Prepared> = records.iter().map(|record| programs.prepare(record, &p).unwrap()).collect();
        let piece = |(record, prepared)| {
            let (carry, slopes) = (vec![0.3, -0.2, 0.0, 0.0, 0.0].into(), vec![0.0; 5 * seeds.len()].into());
            Piece { record, prepared, samples: 0..Record::len(record), carry, slopes, parameters: &p }
        };
        let pieces: Vec<Piece<'_>> = records.iter().copied().zip(&all).map(piece).collect();
        rows(&*programs, &pieces, &seeds).0
    };
    let together = run(&[&jittered, &few]);
    assert_eq!(together, [run(&[&jittered]), run(&[&few])].concat());
    assert_eq!(together, {
        let mut other = run(&[&few, &jittered]);
        other.reverse();
        other
    });
}
