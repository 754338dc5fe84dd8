//! The same parameters from parts of the data: from each output, from each record, from each half of the records.
//!
//! At the minimum each part has a triangle of its own, and with it a step to the minimum that it would have by itself. If
//! all parts follow one model, what they gain by steps of their own over the common one is noise: chi squared with as many
//! degrees of freedom as they have steps more (Chow, Econometrica 28 (1960) 591). Errors that are correlated over time, also
//! without what contradicts the common step, count for fewer.

mod left;

use crate::estimate::{Unknown, Warning, WarningCode};
use crate::information::{Block, Information};
use crate::judge::check::{Check, Examined, Level, PREFILTER, Pass};
use crate::judge::directions;
use crate::judge::evidence::Evidence;
use crate::judge::evidence::powers::COMPARED;
use crate::numeral::{number, p_value, percent};
use crate::optimize::{Linearization, Severity};
use crate::problem::{Accumulate, Objective, Role};
use crate::sweep::Window;
use crate::whiteness::chi_squared_tail;
use std::f64::consts::FRAC_1_SQRT_2;

pub(crate) const PARTS: Check = Check {
    name: "parts of the data agree",
    asks: "Where errors are colored or follow from the prediction, or where that is not examined: do outputs, records and halves give one set of parameters (Chow 1960)?",
    codes: &[WarningCode::RecordsContradict, WarningCode::OutputsContradict, WarningCode::HalvesContradict],
    costs: &[Pass::Slopes(1), Pass::Slopes(3)],
    levels: &[
        Level { of: "the probability by chance", value: LEVEL, source: "one good record in ten thousand" },
        Level {
            of: "the distance of two values of a parameter, in standard errors",
            value: APART,
            source: "beside the test above",
        },
        Level { of: "the distance, in parts of the value, that is not usable", value: FAR_APART, source: "a quarter" },
    ],
    examine: |evidence, intervals| {
        Examined::unless(skipped(evidence), || contradictions(evidence, &intervals.unknowns))
            .without(left_out(evidence))
    },
};

/// Level of the test.
pub(crate) const LEVEL: f64 = 1e-4;
/// A parameter is named if its values from two parts of the data differ by more than this many standard errors, where the test above
/// has found a difference. If they differ by more than the second (relative), the estimate is not usable.
const APART: f64 = 3.0;
const FAR_APART: f64 = 0.25;
/// Rows that are absorbed together.
const ROWS: usize = 256;
/// More unknowns than these are not compared: the triangles of all parts are kept.
const MOST: usize = 200;

/// The triangles of one experiment: output by output, each of the first half and of the second.
struct Halves<'h> {
    objective: &'h Objective<'h>,
    experiment: usize,
    of: Vec<[Part; 2]>,
    row: Vec<f64>,
}

/// Rows of a part of an experiment.
struct Part {
    triangle: Information,
    block: Block,
    squares: f64,
    fourths: f64,
    count: u64,
}

impl Part {
    fn new(columns: usize) -> Self {
        Part {
            triangle: Information::new(columns),
            block: Block::new(columns, ROWS),
            squares: 0.0,
            fourths: 0.0,
            count: 0,
        }
    }

    fn append(&mut self, later: &mut Part) {
        self.triangle.absorb(&mut self.block);
        later.triangle.absorb(&mut later.block);
        self.triangle.merge(&later.triangle);
        self.squares += later.squares;
        self.fourths += later.fourths;
        self.count += later.count;
    }
}

impl Accumulate for Halves<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let middle = self.objective.problem.records[self.experiment].len() / 2;
        for k in 0..window.samples[lane] {
            let half = usize::from(window.begin[lane] + k >= middle);
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            for j in (0..window.outputs()).filter(|&j| window.is_measured(k, j, lane) && weight > 0.0) {
                let part = &mut self.of[j][half];
                let values = window.row(k, j).iter().skip(lane).step_by(window.lanes());
                let error = window.error(k, j, lane);
                // As in iteratively reweighted least squares, whose minimum is that of the loss.
                let by_loss = self.objective.loss().map_or(1.0, |loss| loss.weight(error));
                let root = (weight * by_loss).sqrt();
                self.row.iter_mut().zip(values).for_each(|(to, from)| *to = root * from);
                let error = root * error;
                part.squares += error * error;
                part.fourths += error.powi(4);
                part.count += 1;
                part.triangle.gather(&mut part.block, &self.row, error);
                if window.has_variances() {
                    let slope = |column: usize| window.variance_at(k, j, column, lane);
                    self.row.iter_mut().enumerate().for_each(|(c, to)| *to = slope(c));
                    let second = (error * error - 1.0) * FRAC_1_SQRT_2;
                    part.triangle.gather(&mut part.block, &self.row, second);
                }
            }
        }
    }

    fn append(&mut self, mut later: Self) {
        for (part, later) in self.of.iter_mut().flatten().zip(later.of.iter_mut().flatten()) {
            part.append(later);
        }
    }
}

/// Which rows a piece has.
#[derive(Clone, Copy)]
enum Rows {
    Record(usize),
    Output(usize),
    Half(usize),
}

impl Rows {
    fn contain(self, experiment: usize, output: usize, half: usize) -> bool {
        match self {
            Rows::Record(e) => e == experiment,
            Rows::Output(j) => j == output,
            Rows::Half(h) => h == half,
        }
    }
}

/// A part of the data: a triangle per experiment, in units of its own noise.
struct Piece {
    rows: Rows,
    linear: Linearization,
    held: Vec<bool>,
    /// By what a step of its own would lower the sum of squares.
    gain: f64,
    step: Vec<f64>,
    /// How many errors have the information of one.
    dependence: f64,
}

/// Whether parts of the data are compared, which takes slopes: where errors are correlated over time or with the prediction. Always of
/// filters, which estimate what contradicts them as process noise, so that their errors stay white; of static models, whose
/// samples have no order; and with a loss, weights or restarts, where errors are not tested against powers of the prediction.
fn is_suspicious(evidence: &Evidence<'_>) -> bool {
    let least = evidence.residuals.shape.iter().copied().fold(evidence.residuals.parts, f64::min);
    let follow = least * (evidence.point.objective.outputs() as f64) < LEVEL && !evidence.rounding;
    let unseen = evidence.residuals.shape.is_empty() && !evidence.rounding;
    follow
        || unseen
        || evidence.is_colored()
        || evidence.point.is_static()
        || evidence.point.objective.sweep.predicts_variance()
}

/// Why parts are not compared.
fn skipped(evidence: &Evidence<'_>) -> Option<&'static str> {
    let problem = evidence.point.objective.problem;
    match () {
        _ if problem.settings.prefilter.is_some() => Some(PREFILTER),
        _ if problem.unknowns.row.len() > MOST => Some("more than 200 unknowns"),
        _ if evidence.point.degrees <= 0.0 => Some("no degrees of freedom"),
        _ => (!evidence.point.end.outcome.converged()).then_some("no minimum"),
    }
}

/// Which parts are not compared though others are.
fn left_out(evidence: &Evidence<'_>) -> Option<&'static str> {
    let many = evidence.point.objective.experiments() > COMPARED;
    (many && is_suspicious(evidence)).then_some("single records, of which there are more than 12")
}

/// Parameters that differ between outputs, records or halves of the data.
fn contradictions(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let objective = evidence.point.objective;
    if !is_suspicious(evidence) {
        return vec![];
    }
    let diagonal = objective.with(crate::problem::Whitening::Diagonal(objective.whitening.sigma()));
    let make = |e: usize| {
        let columns = objective.problem.unknowns.columns(e).count();
        let halves = |_| [Part::new(columns), Part::new(columns)];
        let of = (0..objective.outputs()).map(halves).collect();
        Halves { objective, experiment: e, of, row: vec![0.0; columns] }
    };
    let Ok(mut all) = diagonal.gather(&evidence.point.end.coordinates, true, make) else { return vec![] };
    all.iter_mut().flat_map(|halves| &mut halves.of).flatten().for_each(|part| part.triangle.absorb(&mut part.block));
    let mut kinds: Vec<(WarningCode, Vec<Rows>)> = vec![];
    if (2..=COMPARED).contains(&all.len()) {
        kinds.push((WarningCode::RecordsContradict, (0..all.len()).map(Rows::Record).collect()));
    }
    if objective.outputs() > 1 {
        kinds.push((WarningCode::OutputsContradict, (0..objective.outputs()).map(Rows::Output).collect()));
    }
    if !evidence.point.is_static() {
        kinds.push((WarningCode::HalvesContradict, (0..2).map(Rows::Half).collect()));
    }
    let of = |(code, rows): (WarningCode, Vec<Rows>)| {
        let mut pieces: Vec<Piece> = rows.into_iter().filter_map(|rows| piece(evidence, &all, rows)).collect();
        compared(evidence, &pieces, unknowns)?;
        // Only now, since it takes another pass. Samples of static models have no order.
        if !evidence.point.is_static() {
            let dependences = left::dependences(&diagonal, &evidence.point.end.coordinates, &pieces)?;
            pieces.iter_mut().zip(dependences).for_each(|(piece, of_errors)| piece.dependence *= of_errors);
        }
        Some(warning(evidence, &pieces, unknowns, code, compared(evidence, &pieces, unknowns)?))
    };
    kinds.into_iter().filter_map(of).collect()
}

/// The triangles of chosen experiments, outputs and halves, those of each output divided by the noise that is left when
/// its own step is taken.
fn piece(evidence: &Evidence<'_>, all: &[Halves<'_>], rows: Rows) -> Option<Piece> {
    let shared = evidence.point.objective.problem.unknowns.shared();
    let held = &evidence.point.undetermined.held;
    let predicted = evidence.point.objective.sweep.predicts_variance();
    let empty = || all.iter().map(|halves| Information::new(halves.row.len())).collect::<Vec<_>>();
    let (mut merged, mut dependence) = (empty(), 1.0f64);
    for j in 0..evidence.point.objective.outputs() {
        let (mut triangles, mut squares, mut fourths, mut count) = (empty(), 0.0, 0.0, 0);
        for (e, halves) in all.iter().enumerate() {
            for (_, part) in halves.of[j].iter().enumerate().filter(|(h, _)| rows.contain(e, j, *h)) {
                triangles[e].merge(&part.triangle);
                squares += part.squares;
                fourths += part.fourths;
                count += part.count;
            }
        }
        if count == 0 {
            continue;
        }
        let linear = Linearization::new(0.0, shared, triangles);
        let own = directions::undetermined(&linear, held).held;
        let step = linear.step(&vec![0.0; own.len()], &own)?;
        let free = own.iter().filter(|held| !**held).count() as f64;
        let left = (squares - 2.0 * linear.predicted_reduction(&step)) / (count as f64 - free);
        // Predicted noise levels are among the unknowns.
        let variance = if predicted { 1.0 } else { left };
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        for (all, (triangle, _)) in merged.iter_mut().zip(linear.columns()) {
            all.merge(&scaled(triangle, variance.sqrt().recip()));
        }
        if predicted || evidence.point.objective.is_weighted() {
            // Squares of errors with heavy tails, or of several sizes, vary more than those of normal ones.
            dependence = dependence.max(0.5 * (count as f64 * fourths / (squares * squares) - 1.0));
        }
    }
    Piece::new(rows, Linearization::new(0.0, shared, merged), held, dependence)
}

/// A difference between pieces that is no chance: its probability, the parameter that differs most, and the two pieces.
struct Difference {
    chance: f64,
    unknown: usize,
    pieces: [usize; 2],
}

/// Whether pieces follow one set of parameters.
fn compared(evidence: &Evidence<'_>, pieces: &[Piece], unknowns: &[Unknown]) -> Option<Difference> {
    let first = pieces.first().filter(|_| pieces.len() > 1)?;
    let dependence = pieces.iter().map(|piece| piece.dependence).fold(1.0, f64::max);
    let shared = evidence.point.objective.problem.unknowns.shared();
    let mut whole: Vec<Information> = first.linear.columns().map(|(triangle, _)| triangle.clone()).collect();
    for piece in &pieces[1..] {
        whole.iter_mut().zip(piece.linear.columns()).for_each(|(all, (one, _))| all.merge(one));
    }
    let whole = Piece::new(first.rows, Linearization::new(0.0, shared, whole), &evidence.point.undetermined.held, 1.0)?;
    let free = |piece: &Piece| piece.held.iter().filter(|held| !**held).count() as f64;
    let degrees = pieces.iter().map(free).sum::<f64>() - free(&whole);
    let gain = pieces.iter().map(|piece| piece.gain).sum::<f64>() - whole.gain;
    let chance = no_chance(gain / dependence, degrees)?;
    let (unknown, a, b, _) = furthest(pieces, unknowns)?;
    Some(Difference { chance, unknown, pieces: [a, b] })
}

fn warning(
    evidence: &Evidence<'_>,
    pieces: &[Piece],
    unknowns: &[Unknown],
    code: WarningCode,
    difference: Difference,
) -> Warning {
    let problem = evidence.point.objective.problem;
    let Difference { chance, unknown: i, pieces: [a, b] } = difference;
    let (unknown, slope) = (&unknowns[i], evidence.point.slopes[i]);
    let value = |piece: &Piece| unknown.value + slope * piece.step[i];
    let error = |piece: &Piece| {
        let unit = piece.linear.covariance(&piece.held).map_or(f64::NAN, |covariance| covariance.standard_error(i));
        (slope * unit).abs() * piece.dependence.sqrt()
    };
    let (one, two) = (&pieces[a], &pieces[b]);
    let part = (value(one) - value(two)).abs() / unknown.value.abs().max(f64::MIN_POSITIVE);
    let name = |piece: &Piece| match piece.rows {
        Rows::Record(e) => format!("`{}` alone", problem.unknowns.labels[e]),
        Rows::Output(j) => format!("`{}` alone", problem.layout().outputs[j].name),
        Rows::Half(h) => format!("the {} half of the data", ["first", "second"][h]),
    };
    let said = |piece: &Piece| format!("{} +- {} by {}", number(value(piece), 4), number(error(piece), 2), name(piece));
    let text = format!(
        "`{}` is {} and {} ({} apart; chi-square {}): check gains, signs and delays of the sensors, whether all data are of \
         one plant, and what the model leaves out",
        unknown.name,
        said(one),
        said(two),
        percent(part, 2),
        p_value(chance)
    );
    let severity = if part > FAR_APART { Severity::NotUsable } else { Severity::UsableWithCare };
    Warning { code, severity, text }
}

/// The parameter that differs most between two pieces, in standard errors: its number, and those of the pieces.
fn furthest(pieces: &[Piece], unknowns: &[Unknown]) -> Option<(usize, usize, usize, f64)> {
    let mut found: Option<(usize, usize, usize, f64)> = None;
    let covariances: Vec<_> = pieces.iter().map(|piece| piece.linear.covariance(&piece.held)).collect();
    for (i, unknown) in unknowns.iter().enumerate().filter(|(_, u)| matches!(u.role, Role::Parameter(_))) {
        for (a, b) in (0..pieces.len()).flat_map(|b| (0..b).map(move |a| (a, b))) {
            let (Some(first), Some(second)) = (&covariances[a], &covariances[b]) else { continue };
            if pieces[a].held[i] || pieces[b].held[i] {
                continue;
            }
            let error = |covariance: &crate::information::Covariance, piece: usize| {
                covariance.standard_error(i) * pieces[piece].dependence.sqrt()
            };
            let apart = (pieces[a].step[i] - pieces[b].step[i]).abs() / error(first, a).hypot(error(second, b));
            if apart > found.map_or(APART, |(_, _, _, most)| most) && unknown.value != 0.0 {
                found = Some((i, a, b, apart));
            }
        }
    }
    found
}

impl Piece {
    fn new(rows: Rows, linear: Linearization, held: &[bool], dependence: f64) -> Option<Self> {
        let held = directions::undetermined(&linear, held).held;
        let step = linear.step(&vec![0.0; held.len()], &held)?;
        let gain = 2.0 * linear.predicted_reduction(&step);
        Some(Piece { rows, linear, held, gain, step, dependence })
    }
}

/// A triangle with all its rows multiplied by a number.
fn scaled(triangle: &Information, factor: f64) -> Information {
    let n = triangle.columns();
    let mut scaled = Information::new(n);
    for i in 0..=n {
        let row: Vec<f64> = (0..n).map(|c| if c < i { 0.0 } else { factor * triangle.at(i, c) }).collect();
        scaled.absorb_row(&row, factor * triangle.at(i, n));
    }
    scaled
}

/// Probability that pieces of one plant gain as much by steps of their own, if it is below the level.
fn no_chance(gain: f64, degrees: f64) -> Option<f64> {
    let chance = chi_squared_tail(gain, degrees);
    (degrees >= 1.0 && chance <= LEVEL).then_some(chance)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same solution and three times the rows, so a ninth of the covariance.
    #[test]
    fn scaled_triangles() {
        let mut triangle = Information::new(2);
        for (row, right) in [([1.0, 2.0], 3.0), ([0.5, -1.0], 1.0), ([2.0, 0.3], -1.0)] {
            triangle.absorb_row(&row, right);
        }
        let scaled = scaled(&triangle, 3.0);
        for (i, c) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            let (found, expected) = (scaled.at(i, c).abs(), 3.0 * triangle.at(i, c).abs());
            assert!((found - expected).abs() < 1e-14, "{i} {c}: {found} {expected}");
        }
        // Signs of whole rows mean nothing, those within a row do.
        let sign = |of: &Information| (of.at(0, 0) * of.at(0, 1), of.at(0, 0) * of.at(0, 2), of.at(1, 1) * of.at(1, 2));
        let ((a, b, c), (d, e, f)) = (sign(&scaled), sign(&triangle));
        assert!((a - 9.0 * d).abs() < 1e-13 && (b - 9.0 * e).abs() < 1e-13 && (c - 9.0 * f).abs() < 1e-13);
    }

    /// The 0.01 % points of chi-squared with 1 and 2 degrees of freedom are 15.137 and `-2 ln 1e-4 = 18.421`.
    #[test]
    fn contradictions_begin_at_their_level() {
        assert!(no_chance(15.14, 1.0).is_some() && no_chance(15.13, 1.0).is_none());
        assert!(no_chance(18.43, 2.0).is_some() && no_chance(18.41, 2.0).is_none() && no_chance(99.0, 0.0).is_none());
    }
}
