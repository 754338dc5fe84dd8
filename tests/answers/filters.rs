//! Bands and reports of fits whose predictor says how sure it is of each prediction, and of records with missing outputs.

use crate::pages::{Branch, Lag, Response, record};
use crate::random::Random;
use greybox::diagnose::{Resampling, bands, bootstrap, identifiability};
use greybox::{
    Experiment, ExperimentOf, Fit, Kalman, Kind, Knowledge, Model, Parameter, Report, Scalar, Severity, Time, fixed,
    free, signals,
};

signals! { pub struct Level { x: "V" } }
signals! { pub struct Drive { u: "V" } }
signals! { pub struct Sensor { y: "V" } }
signals! { pub struct Unsteady { decay: "1", drift: "V", noise: "V" } }

/// `x[k+1] = decay x[k] + u[k] + w`, measured with noise.
#[derive(Clone)]
struct Drifting;

impl Model for Drifting {
    type State = Level;
    type Input = Drive;
    type Output = Sensor;
    type Parameters = Unsteady;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Drive<S>, p: &Unsteady<S>) -> Level<S> {
        Level { x: p.decay * x.x + u.u }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Drive<S>, p: &Unsteady<S>) -> Level<S> {
        Level { x: p.drift }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Drive<S>, p: &Unsteady<S>) -> Sensor<S> {
        Sensor { y: p.noise }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Drive<S>, _p: &Unsteady<S>) -> Sensor<S> {
        Sensor { y: x.x }
    }
}

/// A drift that is zero: its variance is a square, whose slopes at zero say nothing. By logarithm it has no end, and all else is known as
/// with the drift at a bound of zero.
#[test]
fn a_drift_that_is_zero_by_logarithm_and_by_bound() {
    let (mut random, mut x, mut inputs, mut outputs, mut held) = (Random(3), 0.0, vec![], vec![], 0);
    for k in 0..1200 {
        let u = if k / 50 % 2 == 0 { 1.0 } else { -1.0 };
        inputs.push(Drive { u });
        outputs.push(Sensor { y: x + 0.2 * random.normal() });
        x = 0.9 * x + u;
    }
    let record = Experiment::new(&Drifting, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    for piece in (0..6).map(|i| record.slice(200 * i..200 * (i + 1)).unwrap()) {
        let fit = |drift: Parameter| {
            let parameters = Unsteady { decay: free(0.8), drift, noise: free(0.5) };
            Fit::new(&Drifting, &piece).parameters(parameters).predictor(Kalman).run().unwrap()
        };
        let (logarithm, bound) = (fit(free(0.3).log()), fit(free(0.3).within(0.0, f64::INFINITY)));
        if matches!(bound.knowledge.drift, Knowledge::Held { .. }) {
            held += 1;
            assert_eq!(logarithm.knowledge.drift, Knowledge::Held { bound: 0.0, end: None }, "{logarithm}");
            let (Knowledge::Known { lower, upper, .. }, Knowledge::Known { lower: low, upper: high, standard_error }) =
                (logarithm.knowledge.decay, bound.knowledge.decay)
            else {
                panic!("{logarithm}{bound}");
            };
            let off = (lower - low).abs().max((upper - high).abs()) / standard_error;
            println!("{off}");
            assert!(off < 1e-3, "{logarithm}{bound}");
        }
    }
    assert!(held >= 2, "{held}");
}

/// Three of four samples are not measured in the second half.
fn is_measured(k: usize) -> bool {
    k < 1000 || k.is_multiple_of(4)
}

fn drifting() -> ExperimentOf<Drifting> {
    let mut random = Random(77);
    let (mut x, mut inputs, mut outputs) = (0.0, vec![], vec![]);
    for k in 0..2000 {
        let u = if k / 50 % 2 == 0 { 1.0 } else { -1.0 };
        let y = x + 0.2 * random.normal();
        inputs.push(Drive { u });
        outputs.push(Sensor { y: if is_measured(k) { y } else { f64::NAN } });
        x = 0.9 * x + u + 0.3 * random.normal();
    }
    Experiment::new(&Drifting, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

fn start() -> Unsteady<Parameter> {
    Unsteady { decay: free(0.8), drift: free(1.0).log(), noise: free(1.0).log() }
}

/// A free initial state may fit the first measurement exactly; then the likelihood has no maximum, and the verdict says so.
#[test]
fn a_likelihood_without_a_maximum_is_not_usable() {
    let record = drifting();
    // From here the search goes to a noise of nothing; from elsewhere it may end in the true maximum.
    let nothing = Unsteady { noise: free(1e-3).log(), ..start() };
    let estimate = Fit::new(&Drifting, &record).parameters(nothing).predictor(Kalman).run().unwrap();
    let given = record.clone().initial(Level { x: fixed(0.0) });
    let usable = Fit::new(&Drifting, &given).parameters(start()).predictor(Kalman).run().unwrap();
    assert_eq!((estimate.severity(), usable.severity()), (Severity::NotUsable, Severity::Usable), "{estimate}");
    assert!(estimate.warnings.iter().any(|w| w.text.contains("the likelihood grows without bound")), "{estimate}");
}

/// The noise in the band of a filter is what a scalar filter by hand predicts, sample by sample, and parameters that are
/// seen in the spread of the errors only are not called without influence.
#[test]
fn the_band_of_a_filter_is_its_own() {
    let record = drifting().initial(Level { x: fixed(0.0) });
    let problem = Fit::new(&Drifting, &record).parameters(start()).predictor(Kalman).problem().unwrap();
    let estimate = problem.run().unwrap();
    let found = bands(&problem, &estimate, 0, 0.95).unwrap();
    let [decay, drift, noise] = [0, 1, 2].map(|i| estimate.parameters[i].value);
    let (mut variance, mut widths) = (0.0, [0.0, 0.0]);
    for k in 0..2000 {
        let (outer, inner) = (found.prediction[0][k], found.confidence[0][k]);
        assert_eq!(outer.is_finite(), is_measured(k));
        if is_measured(k) {
            let expected = variance + noise * noise;
            // Student's quantile for some 1250 degrees of freedom is 1.9619; the sampled variance is exact otherwise.
            let deviation = (outer * outer - inner * inner).sqrt() / 1.9619;
            assert!((deviation / expected.sqrt() - 1.0).abs() < 1e-4, "{k}: {deviation} {}", expected.sqrt());
            widths[k / 1000] = outer;
            variance = variance * noise * noise / expected;
        }
        variance = decay * decay * variance + drift * drift;
    }
    assert!(widths[1] > 1.3 * widths[0], "less is known where less is measured: {widths:?}");
    let said = Report::new(&problem, &estimate).unwrap().to_markdown();
    assert!(!said.contains("moves no output"), "{said}");
}

/// A simulation does not use the noise of the model, and says so of its levels; noise that is asked for beside a filter is left out, which is
/// said, too. Records of resampled prediction errors are not those of a disturbed plant: no bootstrap is made of them.
#[test]
fn noise_that_a_prediction_does_not_use() {
    let record = drifting();
    let start = || Unsteady { decay: free(0.7), drift: free(0.5), noise: free(0.5) };
    let problem = Fit::new(&Drifting, &record).parameters(start()).problem().unwrap();
    let simulated = problem.run().unwrap();
    let advised = identifiability(&problem, &simulated).unwrap().advice;
    for name in ["drift", "noise"] {
        let said = format!("`{name}` stands in the noise of the model alone");
        assert!(simulated.warnings.iter().any(|warning| warning.text.contains(&said)), "{simulated}");
        assert!(advised.iter().any(|advice| advice.contains(&said)), "{advised:?}");
    }
    // Not counted among what no record can tell.
    assert!(!advised.iter().any(|advice| advice.contains("have rank")), "{advised:?}");

    let fit = || Fit::new(&Drifting, &record).parameters(start()).predictor(Kalman);
    let said = |found: &greybox::Summary| {
        found.warnings.iter().any(|warning| warning.text.contains("noise that was asked for"))
    };
    let (plain, asked) = (fit().problem().unwrap(), fit().noise(Sensor { y: 1.0 }).problem().unwrap());
    let (found, beside) = (plain.run().unwrap(), asked.run().unwrap());
    assert_eq!(
        found.unknowns.iter().map(|u| u.value).collect::<Vec<_>>(),
        beside.unknowns.iter().map(|u| u.value).collect::<Vec<_>>()
    );
    assert_eq!([said(&found), said(&beside)], [false, true], "{beside}");

    let error = bootstrap(&plain, &found, Resampling::Residuals, 20, 1).unwrap_err().to_string();
    assert!(
        error.contains("Kalman filter takes in the measurements") && error.contains("diagnose::profile"),
        "{error}"
    );
}

/// What a parameter moves in two equal records is the root of two times what it moves in one, also through the variance.
#[test]
fn records_add_up_in_what_a_parameter_moves() {
    let record = drifting().initial(Level { x: fixed(0.0) });
    let records = [record.clone(), record.named("again")];
    let strengths = |records: &[ExperimentOf<Drifting>]| {
        let problem = Fit::new(&Drifting, records).parameters(start()).predictor(Kalman).problem().unwrap();
        let estimate = problem.estimate(&[0.9, 0.3f64.ln(), 0.2f64.ln()]).unwrap();
        let found = identifiability(&problem, &estimate).unwrap().excitation;
        found.iter().map(|one| one.strength).collect::<Vec<_>>()
    };
    for (two, one) in strengths(&records).into_iter().zip(strengths(&records[..1])) {
        assert!(one > 0.0 && (two / one - 2f64.sqrt()).abs() < 1e-9, "{one} {two}");
    }
}

/// Where an output was not measured, the band of a simulation is as wide as beside it.
#[test]
fn a_band_goes_on_where_nothing_was_measured() {
    let whole = record((0..600).map(|k| k as f64 * 0.01).collect(), 0.05, 6);
    let mut outputs: Vec<Response> = whole.outputs().collect();
    outputs[300] = Response { y: f64::NAN };
    let record = Experiment::new(&Lag, whole.times().clone(), whole.inputs().collect(), outputs).unwrap();
    let branch = Branch { gain: free(1.0), tau: free(0.1).within(1e-3, 10.0) };
    let problem = Fit::new(&Lag, &record).parameters(branch).problem().unwrap();
    let estimate = problem.run().unwrap();
    let widths = &bands(&problem, &estimate, 0, 0.95).unwrap().confidence[0];
    let between = (widths[299] + widths[301]) / 2.0;
    // The width changes by some percent from sample to sample.
    assert!((widths[300] / between - 1.0).abs() < 0.2, "{:?}", &widths[299..302]);
}
