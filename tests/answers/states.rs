//! The states of a filter in a report.

use crate::random::Random;
use greybox::predict::{Plant, Predictor};
use greybox::{
    Experiment, ExperimentOf, Fit, Kalman, Model, Parameter, Problem, Report, Scalar, SecondOrder, Signals, Summary,
    Time, fixed, free, signals,
};

signals! { pub struct Temperatures { air: "K", walls: "K" } }
signals! { pub struct Heater { power: "kW" } }
signals! { pub struct Thermometer { t: "K" } }
signals! { pub struct House { ca: "kWh/K", cw: "kWh/K", inner: "kW/K", outer: "kW/K", sun: "K/h^0.5", noise: "K" } }

/// Air and walls above the temperature outdoors (time in h): the sun on the walls is not measured, nor are the walls.
#[derive(Clone)]
pub struct Heated;

impl Model for Heated {
    type State = Temperatures;
    type Input = Heater;
    type Output = Thermometer;
    type Parameters = House;

    fn derivative<S: Scalar>(&self, _t: S, x: &Temperatures<S>, u: &Heater<S>, p: &House<S>) -> Temperatures<S> {
        let inward = p.inner * (x.walls - x.air);
        Temperatures { air: (u.power + inward) / p.ca, walls: -(inward + p.outer * x.walls) / p.cw }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Temperatures<S>, _u: &Heater<S>, p: &House<S>) -> Temperatures<S> {
        Temperatures { air: p.sun * 0.0, walls: p.sun }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Temperatures<S>, _u: &Heater<S>, p: &House<S>) -> Thermometer<S> {
        Thermometer { t: p.noise }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Temperatures<S>, _u: &Heater<S>, _p: &House<S>) -> Thermometer<S> {
        Thermometer { t: x.air }
    }
}

const TRUTH: House<f64> = House { ca: 2.0, cw: 8.0, inner: 1.5, outer: 0.25, sun: 0.6, noise: 0.2 };
const STEP: f64 = 0.25;

/// A record of the house with the sun at random, by Euler's method in steps of a twentieth of a sample.
pub fn house(samples: usize, seed: u64) -> ExperimentOf<Heated> {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (mut x, mut inputs, mut outputs) = (Temperatures { air: 10.0, walls: 8.0 }, vec![], vec![]);
    for k in 0..samples {
        let u = Heater { power: [4.0, 0.0, 3.0, 1.0][k / 30 % 4] };
        outputs.push(Thermometer { t: x.air + TRUTH.noise * random.normal() });
        inputs.push(u);
        for _ in 0..20 {
            let step = STEP / 20.0;
            let rate = Heated.derivative(0.0, &x, &u, &TRUTH);
            x.air += step * rate.air;
            x.walls += step * rate.walls + TRUTH.sun * step.sqrt() * random.normal();
        }
    }
    let record = Experiment::new(&Heated, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    record.initial(Temperatures { air: fixed(10.0), walls: fixed(8.0) }).named("house")
}

pub fn start() -> House<Parameter> {
    House {
        ca: free(1.5),
        cw: free(6.0),
        inner: free(1.0),
        outer: free(0.4),
        sun: free(1.0).log(),
        noise: free(0.5).log(),
    }
}

/// The problem of a record, its estimate, and the report.
pub fn reported(record: &ExperimentOf<Heated>) -> (Problem<'_>, Summary, Report) {
    let problem = Fit::new(&Heated, record).parameters(start()).predictor(Kalman).problem().unwrap();
    let estimate = problem.run().unwrap();
    let report = Report::new(&problem, &estimate).unwrap();
    (problem, estimate, report)
}

/// The states over time are those of `smoothed` and `filtered`, the band 1.96 deviations, and the standardized residual the residual over what the
/// filter expects of it; text, Markdown and JSON have them in a table.
#[test]
fn a_report_has_the_states_of_a_filter() {
    let record = house(600, 5);
    let (problem, estimate, report) = reported(&record);
    let smoothed = problem.smoothed(&estimate, record.record()).unwrap();
    let filtered = problem.filtered(&estimate, record.record()).unwrap();
    let section = report.sections.iter().find(|section| section.id == "states-1").expect("a section");
    let timeline = section.plots[0].timeline().expect("a timeline");
    let names: Vec<_> = timeline.panels.iter().map(|panel| (panel.name.as_str(), panel.unit.as_str())).collect();
    assert_eq!(names, [("air", "K"), ("walls", "K")]);
    let styles: Vec<&str> = timeline.panels[1].lines.iter().map(|line| line.name.as_str()).collect();
    assert_eq!(styles, ["holds the state with 95 %", "filtered", "smoothed"]);
    let whole = &timeline.stretches[0];
    assert_eq!((whole.samples_per_column, whole.t.len()), (1, 600));
    for i in 0..2 {
        for k in 0..600 {
            let [half, before, all] = [0, 1, 2].map(|line| whole.traces[3 * i + line].low[k].unwrap());
            // The same passes but for the search of the initial state, which is given.
            assert_eq!((before, all), (filtered.means[i][k], smoothed.means[i][k]), "{i} {k}");
            assert!((half - 1.959964 * smoothed.deviations[i][k]).abs() < 1e-6, "{i} {k}: {half}");
        }
    }
    let rms = |of: &[f64]| (of.iter().map(|x| x * x).sum::<f64>() / of.len() as f64).sqrt();
    let table = &section.tables[0];
    assert_eq!(table.columns, ["state", "least", "greatest", "deviation", "filtered", "unit"]);
    let cell = |row: usize, column: usize| match &table.rows[row][column] {
        greybox::report::Cell::Number { value, .. } => *value,
        other => panic!("{other:?}"),
    };
    for i in 0..2 {
        let expected = [rms(&smoothed.deviations[i]), rms(&filtered.deviations[i])];
        assert!((cell(i, 3) / expected[0] - 1.0).abs() < 1e-12 && (cell(i, 4) / expected[1] - 1.0).abs() < 1e-12);
        assert!(expected[0] < expected[1], "later measurements say more: {expected:?}");
        assert_eq!(cell(i, 1), smoothed.means[i].iter().copied().fold(f64::INFINITY, f64::min));
    }
    for text in [report.to_string(), report.to_markdown(), report.to_json().unwrap(), report.to_html()] {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains("States: house") && text.contains("estimated from all measurements"), "{text}");
    }
    let of_record = report.sections.iter().find(|section| section.id == "record-1").unwrap();
    let outputs = of_record.plots[0].timeline().unwrap();
    assert_eq!(outputs.panels[2].name, "standardized residual of t");
    let at = outputs.panels[..2].iter().map(|panel| panel.lines.len()).sum::<usize>();
    let prediction = problem.predict(&estimate, record.record()).unwrap();
    let standardized: Vec<f64> = outputs.stretches[0].traces[at].low.iter().map(|value| value.unwrap()).collect();
    for (k, found) in standardized.iter().enumerate() {
        let expected = prediction.residuals[0][k] / prediction.deviations[0][k];
        assert!((found - expected).abs() < 1e-9, "{k}: {found} {expected}");
    }
    // Of 600 innovations that are white and standard, the mean square is one within four of its deviations, sqrt(2 / 600).
    assert!((rms(&standardized).powi(2) - 1.0).abs() < 4.0 * (2.0f64 / 600.0).sqrt(), "{}", rms(&standardized));
    let histogram = of_record.all_plots().into_iter().find(|plot| plot.name.starts_with("histogram")).unwrap();
    assert_eq!(histogram.curves().unwrap().0[0].name, "standardized residual");
}

/// Of a house that is as warm as outdoors and seldom measured, the smoothed states hardly move against what is known of them; the bands are within
/// their panels all the same.
#[test]
fn a_band_of_a_state_has_room() {
    let outputs =
        (0..40).map(|k| Thermometer { t: if k % 8 == 0 { 1e-3 * f64::from(k).sin() } else { f64::NAN } }).collect();
    let time = Time::Uniform { start: 0.0, step: STEP };
    let record = Experiment::new(&Heated, time, vec![Heater { power: 0.1 }; 40], outputs).unwrap();
    let record = record.initial(Temperatures { air: fixed(0.0), walls: fixed(0.0) });
    let known = House::map(TRUTH, fixed);
    let fit = Fit::new(&Heated, &record).parameters(House { ca: free(2.0), ..known }).predictor(Kalman);
    let problem = fit.problem().unwrap();
    let report = Report::new(&problem, &problem.estimate(&[2.0]).unwrap()).unwrap();
    let section = report.sections.iter().find(|section| section.id == "states-1").unwrap();
    let svg = section.plots[0].to_svg();
    let bands = svg.split("area confidence\" d=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    let mut count = 0;
    for band in bands {
        count += 1;
        for place in band.split(['M', 'L', 'Z']).filter(|place| !place.is_empty()) {
            let y: f64 = place.split(' ').nth(1).unwrap().parse().unwrap();
            // A panel of a state is 160 px high.
            assert!((0.0..=160.0).contains(&y), "{place}");
        }
    }
    assert_eq!(count, 2);
}

/// A simulation whose errors have a known variance.
#[derive(Clone, Debug)]
struct OfKnownVariance;

impl Predictor for OfKnownVariance {
    fn predicts_variance(&self) -> bool {
        true
    }
    fn predict<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        let mut y = vec![S::from(0.0); plant.layout().outputs.len()];
        plant.output(&carry[..plant.layout().states.len()], &mut y);
        (y[output], S::from(4.0))
    }
    fn describe(&self) -> String {
        "simulation of known variance".to_owned()
    }
}

/// A filter of second order has its states, too; a predictor that is no filter says why they are missing; a simulation has none, and says nothing.
#[test]
fn states_that_are_not_known() {
    let record = house(200, 7);
    let fit = |start| Fit::new(&Heated, &record).parameters(start);
    let said = |problem: Problem<'_>| {
        let report = Report::new(&problem, &problem.run().unwrap()).unwrap();
        let section = report.sections.into_iter().find(|section| section.id == "states-1")?;
        Some((section.sentences.join(" "), section.plots.len()))
    };
    let second = said(fit(start()).predictor(SecondOrder).problem().unwrap()).expect("a section");
    assert!(second.0.starts_with("The smoothed state is estimated") && second.1 == 1, "{second:?}");
    let known = House { ca: free(2.0), ..House::map(TRUTH, fixed) };
    let other = said(fit(known).predictor(OfKnownVariance).problem().unwrap()).expect("a section");
    let why = "The states are not shown: states are filtered";
    assert!(other.0.starts_with(why) && other.0.contains("this is simulation of known variance"), "{other:?}");
    assert_eq!(said(fit(start()).problem().unwrap()), None);
}

/// Of several records, each has its states, closed where the record is.
#[test]
fn each_record_has_its_states() {
    let records = [house(200, 8), house(200, 9).named("other")];
    let problem = Fit::new(&Heated, &records).parameters(start()).predictor(Kalman).problem().unwrap();
    let report = Report::new(&problem, &problem.run().unwrap()).unwrap();
    let folded = |id: &str| report.sections.iter().find(|section| section.id == id).map(|section| section.folded);
    for number in [1, 2] {
        let [record, states] = ["record", "states"].map(|what| folded(&format!("{what}-{number}")));
        assert!(record.is_some() && record == states, "{number}: {record:?} {states:?}");
    }
    assert_ne!(folded("states-1"), folded("states-2"));
}

/// Of a long record, columns stand for several samples, and those about the largest residual are kept one by one.
#[test]
fn states_of_a_long_record_are_thinned() {
    let record = house(50_000, 10);
    let found = House {
        ca: free(2.0),
        cw: fixed(8.0),
        inner: fixed(1.5),
        outer: fixed(0.25),
        sun: fixed(0.6),
        noise: fixed(0.2),
    };
    let problem = Fit::new(&Heated, &record).parameters(found).predictor(Kalman).problem().unwrap();
    let estimate = problem.estimate(&[2.0]).unwrap();
    let report = Report::new(&problem, &estimate).unwrap();
    let timeline = |id: &str| {
        let section = report.sections.iter().find(|section| section.id == id).unwrap();
        section.plots[0].timeline().unwrap()
    };
    let (states, outputs) = (timeline("states-1"), timeline("record-1"));
    assert!(states.stretches[0].samples_per_column > 1);
    assert_eq!(
        states.stretches[1..].iter().map(|piece| &piece.t).collect::<Vec<_>>(),
        outputs.stretches[1..].iter().map(|piece| &piece.t).collect::<Vec<_>>()
    );
    let kept: usize = [states, outputs]
        .iter()
        .flat_map(|timeline| &timeline.stretches[0].traces)
        .map(|trace| trace.low.len() + trace.high.len() + trace.mean.len())
        .sum();
    assert!(kept <= 260_000, "{kept}");
}
