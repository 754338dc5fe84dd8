//! Pages to be looked at, and for the tests in a browser: `GREYBOX_PAGES=folder cargo test --release --test answers gallery
//! -- --ignored` writes them.

use crate::pages::{Lag, Response, record, report};
use crate::random::Random;
use greybox::diagnose::{Compared, profile};
use greybox::{
    Error, Experiment, ExperimentOf, Fit, Kind, Model, Nothing, Report, Scalar, Signals, Time, WarningCode, free,
    signals,
};
use std::path::PathBuf;

signals! { pub struct Currents { id: "A", a_current_with_a_name_of_no_use_to_anyone: "A" } }
signals! { pub struct Voltages { ud: "V", uq: "V" } }
signals! { pub struct Pair { a: "1", b: "A/V", the_resistance_of_the_second_phase: "ohm", d: "A", e: "A/V" } }

/// Two outputs, in one of which `a` and `b` are known as their product only.
#[derive(Clone)]
struct Unclear;

impl Model for Unclear {
    type State = Nothing;
    type Input = Voltages;
    type Output = Currents;
    type Parameters = Pair;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltages<S>, p: &Pair<S>) -> Currents<S> {
        let second = u.uq / p.the_resistance_of_the_second_phase + p.d + p.e * u.ud * u.uq;
        Currents { id: p.a * p.b * u.ud, a_current_with_a_name_of_no_use_to_anyone: second }
    }
}

const START: f64 = 1_760_000_000.0;

/// Time stamps from 1970 that jitter, with gaps, missing samples and outliers.
fn unclear(seed: u64, name: &str) -> ExperimentOf<Unclear> {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let mut times: Vec<f64> = (0..1500).map(|k| START + 0.02 * (k as f64 + 0.2 * random.uniform())).collect();
    times.retain(|t| !(8.0..9.5).contains(&(t - START)) && !(20.0..20.4).contains(&(t - START)));
    let voltages = |t: &f64| Voltages { ud: (2.0 * (t - START)).sin(), uq: ((t - START) * 0.7).cos().signum() };
    let inputs: Vec<Voltages> = times.iter().map(voltages).collect();
    let output = |(k, u): (usize, &Voltages)| {
        let loud = if k % 500 == 77 { 30.0 } else { 1.0 };
        let id = 3.0 * u.ud + 0.05 * loud * random.normal();
        let iq = u.uq / 0.5 + 0.2 + 0.3 * u.ud * u.uq + 0.02 * random.normal();
        let missing = (600..700).contains(&k) || k % 3 == 1 && k > 1000;
        Currents { id: if missing { f64::NAN } else { id }, a_current_with_a_name_of_no_use_to_anyone: iq }
    };
    let outputs = inputs.iter().enumerate().map(output).collect();
    Experiment::new(&Unclear, Time::Stamps(times), inputs, outputs).unwrap().named(name)
}

fn pair() -> Pair<greybox::Parameter> {
    Pair { the_resistance_of_the_second_phase: free(1.0), ..Pair::splat(free(0.7)) }
}

fn of_unclear(records: &[ExperimentOf<Unclear>]) -> Result<Report, Error> {
    let problem = Fit::new(&Unclear, records).parameters(pair()).starts(20).problem()?;
    let estimate = problem.run()?;
    let report = Report::new(&problem, &estimate)?;
    let names = ["d", "e"].into_iter();
    Ok(names.fold(report, |report, name| report.with(profile(&problem, &estimate, name, 0.95).unwrap())))
}

/// Along the curve of a constant product of `a` and `b` all ends of searches are one minimum, and what differs is named.
#[test]
fn ends_along_what_is_not_determined_are_one_minimum() {
    let estimate = Fit::new(&Unclear, &unclear(1, "bench")).parameters(pair()).starts(8).run().unwrap();
    let codes: Vec<WarningCode> = estimate.warnings.iter().map(|warning| warning.code).collect();
    let of_starts = [WarningCode::MinimumFoundOnce, WarningCode::RivalMinimum, WarningCode::DeclaredStartElsewhere];
    assert!(
        codes.contains(&WarningCode::Unidentified) && !codes.iter().any(|code| of_starts.contains(code)),
        "{estimate}"
    );
    let starts = estimate.starts.as_ref().unwrap();
    assert_eq!((starts.agreed, starts.minima.len(), starts.declared), (8, 1, Some(0)), "{starts:?}");
    assert_eq!(starts.minima[0].undetermined, ["a", "b"]);
    let said = "8 of 8 starts ended at the same cost with other values of `a`, `b`, which the data do not determine";
    assert_eq!(starts.to_string(), said);
}

#[test]
#[ignore = "writes pages into the folder GREYBOX_PAGES"]
fn pages_are_written() {
    let folder = PathBuf::from(std::env::var_os("GREYBOX_PAGES").expect("GREYBOX_PAGES names a folder"));
    of_unclear(&[unclear(1, "<b>bench</b> 3, \"cold\"")]).unwrap().save(folder.join("unclear.html")).unwrap();
    let twelve: Vec<_> = (0..12).map(|k| unclear(10 + k, &format!("run {k} of the long series"))).collect();
    of_unclear(&twelve).unwrap().save(folder.join("twelve.html")).unwrap();
    let (_, _, filter) = crate::states::reported(&crate::states::house(1200, 1));
    filter.titled("A house in the sun").save(folder.join("filter.html")).unwrap();
    let even = |samples: usize| (0..samples).map(|k| k as f64 * 0.01).collect();
    let (fitted, other) = (record(even(3000), 0.05, 3), record(even(1000), 0.05, 4).named("another day"));
    let estimate = Fit::new(&Lag, &fitted)
        .parameters(crate::pages::Branch { gain: free(1.0), tau: free(0.1).within(1e-3, 10.0) })
        .run()
        .unwrap();
    let predicted = |compared: Compared, record: &ExperimentOf<Lag>| {
        compared.with("the lag", &estimate.predict(&Lag, record).unwrap()).unwrap()
    };
    let both = vec![
        predicted(Compared::estimation(fitted.record()), &fitted),
        predicted(Compared::validation(other.record()), &other),
    ];
    report(&[fitted]).unwrap().titled("A lag").with(both).save(folder.join("compared.html")).unwrap();
    if cfg!(not(debug_assertions)) {
        let mut outputs: Vec<_> = record(even(10_000_000), 0.01, 5).outputs().collect();
        outputs[7_654_321] = Response { y: 30.0 };
        let long = record(even(10_000_000), 0.01, 5);
        let long = Experiment::new(&Lag, long.times().clone(), long.inputs().collect(), outputs).unwrap();
        let page = report(&[long]).unwrap().to_html();
        assert!(page.len() < 3_000_000, "{} bytes", page.len());
        std::fs::write(folder.join("long.html"), page).unwrap();
    }
}
