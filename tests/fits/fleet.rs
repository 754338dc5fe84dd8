//! Fleets: every answer is that of the single fit.

use crate::common::{Affine, Line, Voltage, levels, simulated};
use greybox::pmsm::{Currents, Drive, Surface, Winding};
use greybox::problem::Role;
use greybox::{
    Butterworth, Error, Estimate, Experiment, ExperimentOf, Fit, Fleet, Hold, Horizon, Huber, Nothing, Time, free,
    simulate,
};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

const TS: f64 = 1e-4;

fn parameters() -> Winding<greybox::Parameter> {
    Winding { rs: free(1.0).within(0.0, 100.0), ls: free(3e-3).log(), ke: free(0.5) }
}

/// Motor number `n`: its record is as long as it says.
fn motor(model: &Surface, n: usize, samples: usize) -> ExperimentOf<Surface> {
    let spread = |k: usize| 1.0 + 0.3 * ((n * 7 + k * 13) as f64).sin();
    let truth = Winding { rs: 0.8 * spread(1), ls: 4e-3 * spread(2), ke: 0.6 * spread(3) };
    let drive = |k: usize| {
        let t = k as f64 * TS;
        Drive {
            ud: 3.0 * (900.0 * t).sin(),
            uq: 20.0 + 6.0 * (500.0 * t + n as f64).cos(),
            w: 40.0 + 10.0 * (60.0 * t).sin(),
        }
    };
    let inputs: Vec<_> = (0..samples).map(drive).collect();
    let time = Time::Uniform { start: 0.0, step: TS };
    let run = simulate(model, &truth, &Currents { id: 0.0, iq: 0.0 }, time, &inputs).unwrap();
    run.with_noise(Currents { id: 0.05, iq: 0.05 }, n as u64).experiment(model).unwrap().named(format!("motor {n}"))
}

/// What two answers to the same question may differ by: rounding, carried through a search that ends where a step is below
/// 1e-8 of the standard errors or so. Known parameters agree to ten digits.
fn same(fleet: &Result<Estimate<Surface>, Error>, single: &Result<Estimate<Surface>, Error>, what: &str) {
    match (fleet, single) {
        (Ok(fleet), Ok(single)) => {
            for (a, b) in fleet.unknowns.iter().zip(&single.unknowns) {
                // Initial states may be next to zero, and what is not known is where the search left it.
                let error = match (b.role, b.knowledge.standard_error()) {
                    (Role::Parameter(_), Some(_)) => 0.0,
                    (_, error) => error.unwrap_or(b.value.abs() * 1e-3),
                };
                assert!(
                    (a.value - b.value).abs() <= 1e-10 * b.value.abs() + 1e-6 * error,
                    "{what}: {} {} {}",
                    a.name,
                    a.value,
                    b.value
                );
                let (wide, right) =
                    (a.knowledge.standard_error().unwrap_or(0.0), b.knowledge.standard_error().unwrap_or(0.0));
                assert!((wide - right).abs() <= 1e-6 * right, "{what}: {} is known to {wide} and {right}", a.name);
            }
            assert!((fleet.cost - single.cost).abs() <= 1e-10 * single.cost, "{what}: {} {}", fleet.cost, single.cost);
            let kind = |estimate: &Estimate<Surface>| std::mem::discriminant(&estimate.outcome);
            assert_eq!(kind(fleet), kind(single), "{what}: {} {}", fleet.outcome, single.outcome);
            let kinds = |estimate: &Estimate<Surface>| -> Vec<_> {
                estimate.warnings.iter().map(|warning| warning.code).collect()
            };
            assert_eq!(kinds(fleet), kinds(single), "{what}: {:?} {:?}", fleet.warnings, single.warnings);
        }
        (Err(fleet), Err(single)) => assert_eq!(fleet.to_string(), single.to_string(), "{what}"),
        (fleet, single) => panic!("{what}: {:?} {:?}", fleet.as_ref().err(), single.as_ref().err()),
    }
}

/// Good records of many lengths, and between them: outputs missing here and there, all of one output missing, two samples,
/// no excitation at all, inputs so large that the simulation overflows, a first-order hold and uneven time.
#[test]
fn each_answer_is_that_of_the_single_fit() {
    let model = Surface::new(4).unwrap();
    let time = Time::Uniform { start: 0.0, step: TS };
    let rows = |input: Drive<f64>, output: Currents<f64>, samples: usize| {
        Experiment::new(&model, time.clone(), vec![input; samples], vec![output; samples]).unwrap()
    };
    let mut records: Vec<_> = (0..40).map(|n| motor(&model, n, [600, 333, 1200, 64, 900][n % 5])).collect();
    let gaps = |k: usize, y: Currents<f64>| if k % 7 == 3 { Currents { id: f64::NAN, iq: y.iq } } else { y };
    let with_gaps: Vec<_> = records[0].outputs().enumerate().map(|(k, y)| gaps(k, y)).collect();
    records[3] = Experiment::new(&model, time.clone(), records[0].inputs().collect(), with_gaps).unwrap();
    records[7] = rows(Drive { ud: 1.0, uq: 1.0, w: 1.0 }, Currents { id: f64::NAN, iq: 1.0 }, 50);
    records[11] = rows(Drive { ud: 1.0, uq: 2.0, w: 3.0 }, Currents { id: 0.1, iq: 0.2 }, 2);
    records[15] = rows(Drive { ud: 0.0, uq: 0.0, w: 0.0 }, Currents { id: 0.0, iq: 0.0 }, 400);
    records[19] = rows(Drive { ud: 1e308, uq: 1e308, w: 1e308 }, Currents { id: 0.0, iq: 0.0 }, 400);
    records[23] = records[1].clone().hold(Hold::First);
    let stamps: Vec<f64> = (0..600).map(|k| TS * (k as f64 + 0.2 * (k as f64).sin())).collect();
    records[27] =
        Experiment::new(&model, Time::Stamps(stamps), records[0].inputs().collect(), records[0].outputs().collect())
            .unwrap();
    for (what, fit) in [
        ("noise given", &(|fit: Fit<'static, Surface>| fit.noise(Currents { id: 0.05, iq: 0.05 })) as &dyn Fn(_) -> _),
        ("noise estimated", &|fit| fit),
        ("robust", &|fit: Fit<'static, Surface>| fit.loss(Huber::default())),
        ("horizon", &|fit: Fit<'static, Surface>| fit.predictor(Horizon::new(3))),
    ] {
        let (model, records): (&'static Surface, &'static [ExperimentOf<Surface>]) =
            (Box::leak(Box::new(model)), records.clone().leak());
        let fleet = fit(Fleet::new(model).parameters(parameters())).fleet().unwrap();
        let answers: Vec<_> = fleet.run(records.iter().cloned()).collect();
        assert_eq!(answers.len(), records.len());
        assert!(answers.iter().filter(|answer| answer.is_ok()).count() >= 35, "{what}");
        for (n, (answer, record)) in answers.iter().zip(records).enumerate() {
            let single = fit(Fit::new(model, record).parameters(parameters())).run();
            same(answer, &single, &format!("{what}, record {n}"));
        }
    }
}

/// No more records are read than a bounded number ahead of the answers, and none before the first answer is asked for.
#[test]
fn answers_come_as_they_are_asked_for() {
    let model = Surface::new(4).unwrap();
    let record = motor(&model, 1, 64);
    let read = std::cell::Cell::new(0usize);
    let endless = std::iter::repeat_with(|| {
        read.set(read.get() + 1);
        record.clone()
    });
    let fleet = Fleet::new(&model).parameters(parameters()).fleet().unwrap();
    let mut answers = fleet.run(endless);
    assert_eq!(read.get(), 0);
    let first = answers.next().unwrap().unwrap();
    let ahead = read.get();
    assert!(ahead > 0);
    for _ in 1..ahead {
        assert_eq!(answers.next().unwrap().unwrap().parameters.rs.to_bits(), first.parameters.rs.to_bits());
    }
    assert_eq!(read.get(), ahead, "answers that are ready are given before more is read");
    let refused =
        Fleet::new(&model).parameters(parameters()).checkpoint("nowhere", 1).fleet().err().unwrap().to_string();
    assert!(refused.contains("checkpoint"), "{refused}");
}

#[test]
fn a_time_limit_of_nothing_stops_every_fit_of_a_fleet() {
    let model = Surface::new(4).unwrap();
    let records = [motor(&model, 1, 400), motor(&model, 2, 400), motor(&model, 3, 400)];
    let fleet = Fleet::new(&model).parameters(parameters()).time_limit(std::time::Duration::ZERO).fleet().unwrap();
    assert_eq!(fleet.run(records).filter(Result::is_err).count(), 3);
}

/// Four groups of 32 records are read ahead for each thread; while an early one takes long, up to sixteen.
#[test]
fn a_fleet_reads_ahead() {
    let inputs: Vec<Voltage> = levels(6, 1, 3).into_iter().map(|u| Voltage { u }).collect();
    let record = simulated(&Line, 1.0, inputs, Nothing, Affine { slope: 1.5, offset: -0.7 });
    let read = AtomicUsize::new(0);
    let records = (0..1000).map(|_| {
        read.fetch_add(1, Relaxed);
        record.clone()
    });
    let parameters = Affine { slope: free(1.0), offset: free(0.5) };
    let fleet = Fleet::new(&Line).parameters(parameters).fleet().unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let first = pool.install(|| fleet.run(records).next().unwrap().unwrap());
    assert!((first.parameters.slope - 1.5).abs() < 1e-6);
    let groups = read.load(Relaxed) / 32;
    assert!((8..=32).contains(&groups), "{groups}");
}

/// Fits behind a filter, and from several starts, are not advanced together: their answers are those of the single fits, too.
#[test]
fn filtered_fits_and_several_starts_of_a_fleet() {
    let model = Surface::new(4).unwrap();
    let records = [motor(&model, 1, 300), motor(&model, 2, 300)];
    let filter = Butterworth::low_pass(2, 1000.0, TS).unwrap();
    let fit = |record, filtered: bool| {
        let fit = Fit::new(&model, record).parameters(parameters());
        if filtered { fit.prefilter(filter) } else { fit.starts(3) }
    };
    for filtered in [true, false] {
        let fleet = fit(&records[0], filtered).fleet().unwrap();
        for (together, record) in fleet.run(records.clone()).zip(&records) {
            let single = fit(record, filtered).run();
            same(&together, &single, if filtered { "filtered" } else { "starts" });
            let (together, single) = (together.unwrap(), single.unwrap());
            assert_eq!((together.starts.is_some(), single.starts.is_some()), (!filtered, !filtered));
            assert_eq!(together.method.prefilter, single.method.prefilter);
        }
    }
}
