//! Whether a sensor has a gain, an offset or a delay that the model does not have.
//!
//! The unknowns take a part of such a fault, which biases them and leaves little in the errors. Gain, offset and delay of each output are
//! therefore tested one by one as one more unknown beside all others, by the slopes at the estimate (score test: Rao, Proc. Cambridge
//! Philosophical Society 44 (1948) 50). The most significant one is tested again ([`confirm`]) for errors of changing variance and
//! autocorrelated ones.

mod confirm;
mod cut_off;
mod offsets;

use crate::estimate::student::two_sided;
use crate::estimate::{Unknown, Warning, WarningCode};
use crate::judge::check::{Check, Examined, Level, Pass};
use crate::judge::directions;
use crate::judge::evidence::sensors::{KINDS, Kind};
use crate::judge::evidence::{Evidence, ROUND_OFF};
use crate::judge::leverage::prior_row;
use crate::numeral::{number, p_value, percent, unit_after};
use crate::optimize::{Linearization, Severity};
use crate::problem::{Objective, Role, Whitening};
pub(crate) use offsets::growth_by_offsets;

pub(crate) const SENSORS: Check = Check {
    name: "sensors have the model's gain, offset and delay",
    asks: "Does a gain, an offset or a delay of an output, as one more unknown, explain the errors (score test, Rao 1948; confirmed by White 1980 and for autocorrelated errors), or may a quantized output have been truncated?",
    codes: &[WarningCode::SensorContradicts, WarningCode::CoarseOutput],
    costs: &[Pass::Rows, Pass::Slopes(1)],
    levels: &[
        Level {
            of: "the probability by chance, over all regressors",
            value: LEVEL,
            source: "one good record in ten thousand",
        },
        Level { of: "the part of a parameter that is a note", value: NOTHING, source: "no digit of it changes" },
        Level { of: "the part of a parameter that is not usable", value: FAR, source: "a quarter" },
    ],
    examine: |evidence, intervals| Examined::unless(skipped(evidence), || sensors(evidence, &intervals.unknowns)),
};

/// Level of the test, divided by the number of regressors.
const LEVEL: f64 = 1e-4;
/// The estimate is not usable where the fault moves a parameter by more than `FAR` of itself; below `NOTHING` it is a note.
const FAR: f64 = 0.25;
const NOTHING: f64 = 1e-4;
/// Part of a regressor's norm that must be orthogonal to the slopes of the unknowns: below it, curvature and rounding decide.
const LEFT: f64 = 1e-4;
/// Norm of the prediction, or of its changes, in standard deviations of the noise, below which its gain or delay has a standard error of more
/// than one by itself: a current that a controller holds at zero.
const ACTS: f64 = 1.0;
/// Regressors whose sum of squares is within this many variances of the least (a chance of 0.002) explain the errors as well: of the gains of
/// two sensors, often only the ratio is determined. At most so many are said.
const AS_WELL: f64 = 10.0;
const SAID: usize = 3;

/// A regressor that was estimated beside the unknowns.
struct Released {
    number: usize,
    /// The steps of the unknowns and of the regressor.
    step: Vec<f64>,
    value: f64,
    standard_error: f64,
    /// The sum of squares that is left, and its probability by chance.
    left: f64,
    chance: f64,
}

/// The slopes at the estimate, with the regressors of each output behind the shared unknowns.
struct Extended<'j> {
    evidence: &'j Evidence<'j>,
    objective: Objective<'j>,
    linear: Linearization,
}

/// Why sensors are not tested.
fn skipped(evidence: &Evidence<'_>) -> Option<&'static str> {
    let degrees = (evidence.point.degrees <= 1.0).then_some("no degrees of freedom");
    evidence.without_sensors().or(degrees).or(evidence.rounding.then_some(ROUND_OFF))
}

/// What is wrong with outputs, or may be.
fn sensors(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let Some(extended) = Extended::new(evidence) else { return vec![] };
    match extended.contradicts(unknowns) {
        Some(warning) => vec![warning],
        None => extended.cut_off(unknowns),
    }
}

impl<'j> Extended<'j> {
    /// `None` with a pre-filter, predictions that restart, many unknowns, or without a minimum.
    fn new(evidence: &'j Evidence<'j>) -> Option<Self> {
        // Rows of single outputs.
        let sigma = Whitening::Diagonal(evidence.point.objective.whitening.sigma());
        let objective = evidence.point.objective.with(sigma);
        let outputs = objective.outputs();
        let mut triangles = evidence.rows().sensors.clone()?;
        let unknowns = &objective.problem.unknowns;
        for (i, slope, error) in unknowns.priors(&evidence.point.end.coordinates) {
            let e = unknowns.row[i].experiment.unwrap_or(0);
            triangles[e].absorb_row(&prior_row(&objective, e, i, slope), error);
        }
        let linear = Linearization::new(0.0, unknowns.shared() + outputs * KINDS, triangles);
        Some(Extended { evidence, linear, objective })
    }

    /// What most certainly is wrong with an output.
    fn contradicts(&self, unknowns: &[Unknown]) -> Option<Warning> {
        let numbers = (0..self.objective.outputs() * KINDS).filter(|number| self.is_examined(*number));
        let mut found: Vec<Released> = numbers.clone().filter_map(|number| self.release(number)).collect();
        found.sort_by(|a, b| a.left.total_cmp(&b.left));
        let first = found.first()?;
        let (tests, least) = (numbers.count() as f64, first.left);
        if first.chance * tests >= LEVEL {
            return None;
        }
        let (standard_error, chance) = self.confirm(first)?;
        let wider = standard_error / first.standard_error;
        let as_well = AS_WELL * wider * wider * least / self.degrees();
        found.retain(|one| one.left <= least + as_well);
        found.truncate(SAID);
        found.iter_mut().for_each(|one| one.standard_error *= wider);
        (chance * tests < LEVEL).then(|| self.warning(&found, chance * tests, unknowns))
    }

    /// The place of a regressor.
    fn place(&self, number: usize) -> usize {
        self.objective.problem.unknowns.shared() + number
    }

    /// The place of an unknown.
    fn place_of(&self, unknown: usize) -> usize {
        let shared = self.objective.problem.unknowns.shared();
        if unknown < shared { unknown } else { unknown + self.objective.outputs() * KINDS }
    }

    /// Whether an output has noise to tell it by, its samples an order where it is asked for a delay, and its prediction anything that a gain
    /// or a delay changes.
    fn is_examined(&self, number: usize) -> bool {
        let (j, kind) = (number / KINDS, Kind::ALL[number % KINDS]);
        let acts = kind == Kind::Offset || self.linear.column_norms()[self.place(number)] > ACTS;
        acts && !(self.evidence.rounded[j] || kind == Kind::Delay && self.evidence.point.is_static())
    }

    /// Which unknowns and regressors are held, one of the latter released.
    fn held(&self, released: Option<usize>) -> Vec<bool> {
        let mut held = vec![true; self.linear.unknowns()];
        for (unknown, of_unknown) in self.evidence.point.undetermined.held.iter().enumerate() {
            held[self.place_of(unknown)] = *of_unknown;
        }
        if let Some(number) = released {
            held[self.place(number)] = false;
        }
        held
    }

    /// The regressor beside the unknowns; `None` where these replace it.
    fn release(&self, number: usize) -> Option<Released> {
        let (place, held) = (self.place(number), self.held(Some(number)));
        let held = directions::undetermined(&self.linear, &held).held;
        let norm = self.linear.column_norms()[place];
        let unit = self.linear.covariance(&held).filter(|_| !held[place])?.standard_error(place);
        // One over what is left of it beside the unknowns.
        if unit * norm * LEFT >= 1.0 || !unit.is_finite() {
            return None;
        }
        let step = self.linear.step(&vec![0.0; held.len()], &held)?;
        let left = self.linear.sum_of_squares() - 2.0 * self.linear.predicted_reduction(&step);
        let degrees = self.degrees();
        let (value, standard_error) = (step[place], unit * (left / degrees).sqrt());
        let chance = two_sided(value / standard_error, degrees);
        Some(Released { number, step, value, standard_error, left, chance })
    }

    /// Degrees of freedom with a regressor.
    fn degrees(&self) -> f64 {
        self.evidence.point.degrees - 1.0
    }

    fn warning(&self, found: &[Released], chance: f64, unknowns: &[Unknown]) -> Warning {
        let (said, severities): (Vec<String>, Vec<Severity>) = found.iter().map(|one| self.said(one, unknowns)).unzip();
        let severity = severities.into_iter().max().unwrap_or(Severity::Usable);
        let text = format!(
            "{} ({}): check unit, gain, zero and filter of the sensor, and what the model leaves out; no interval allows for it",
            said.join(", or "),
            p_value(chance)
        );
        Warning { code: WarningCode::SensorContradicts, severity, text }
    }

    /// What is wrong with a sensor and how far that moves a parameter, and how severe that is.
    fn said(&self, found: &Released, unknowns: &[Unknown]) -> (String, Severity) {
        let output = &self.objective.problem.layout().outputs[found.number / KINDS];
        let furthest = self.furthest(&found.step, unknowns);
        let (value, error) = (found.value, number(found.standard_error, 2));
        let is = match Kind::ALL[found.number % KINDS] {
            Kind::Gain => format!("is {} +- {error} times what the model predicts", number(1.0 + value, 4)),
            Kind::Offset => {
                format!(
                    "lies {} +- {error}{} beside what the model predicts",
                    number(value, 3),
                    unit_after(&output.unit)
                )
            }
            Kind::Delay => {
                let order = if value > 0.0 { "after" } else { "before" };
                format!("comes {} +- {error} samples {order} what the model predicts", number(value.abs(), 3))
            }
        };
        let moved = furthest.map_or(String::new(), |(name, part, errors)| {
            format!(
                " with `{name}` {} ({} standard errors) away from this estimate",
                percent(part, 2),
                number(errors, 2)
            )
        });
        let severity = match furthest {
            Some((_, part, _)) if part > FAR => Severity::NotUsable,
            Some((_, part, _)) if part <= NOTHING => Severity::Usable,
            _ => Severity::UsableWithCare,
        };
        (format!("`{}` {is}{moved}", output.name), severity)
    }

    /// The parameter that a step moves by most standard errors, by which part of itself, and by how many.
    fn furthest<'u>(&self, step: &[f64], unknowns: &'u [Unknown]) -> Option<(&'u str, f64, f64)> {
        let moves = |i: usize| {
            let unknown = &unknowns[i];
            let error = unknown.knowledge.standard_error().filter(|_| matches!(unknown.role, Role::Parameter(_)))?;
            let by = self.evidence.point.slopes[i] * step[self.place_of(i)];
            (unknown.value != 0.0).then_some((&*unknown.name, (by / unknown.value).abs(), (by / error).abs()))
        };
        (0..unknowns.len()).filter_map(moves).max_by(|a, b| a.2.total_cmp(&b.2))
    }
}
